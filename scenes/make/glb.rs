//! Binary glTF from shapes. Same calls, same bytes, on every machine.

use super::shape::Shape;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::{Map, Value, json};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Positions are multiples of this (m): exact in `f32`, and free of the last bit of a platform's `sin`.
const GRID: f64 = 1.0 / 65536.0;

/// A material of a [`Document`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Paint(usize);

/// A mesh of a [`Document`].
#[derive(Clone, Copy)]
pub(crate) struct MeshId(usize);

/// Shapes with their materials: what becomes one mesh.
#[derive(Clone, Default)]
pub(crate) struct Model(BTreeMap<Paint, Shape>);

impl Model {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    /// Adds `shape` in `paint`.
    pub(crate) fn add(&mut self, paint: Paint, shape: Shape) -> &mut Self {
        self.0.entry(paint).or_default().append(shape);
        self
    }

    /// Adds all of `other`, moved by `transform`.
    pub(crate) fn merge(&mut self, other: &Self, transform: DAffine3) -> &mut Self {
        for (&paint, shape) in &other.0 {
            self.add(paint, shape.clone().transform(transform));
        }
        self
    }
}

/// A glTF file in the making.
pub(crate) struct Document {
    name: &'static str,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    lights: Vec<Value>,
    cameras: Vec<Value>,
    accessors: Vec<Value>,
    skins: Vec<Value>,
    animations: Vec<Value>,
    vectors: Vec<u8>,
    indices: Vec<u8>,
    /// Joints and weights, four bytes each.
    influences: Vec<u8>,
    /// Keys and matrices.
    floats: Vec<u8>,
}

/// A node of a [`Document`].
#[derive(Clone, Copy)]
pub(crate) struct NodeId(usize);

/// What a channel moves.
pub(crate) enum Moved {
    Translation(NodeId),
    /// By unit quaternions.
    Rotation(NodeId),
    /// Of the only morph target.
    Weight(NodeId),
    /// What a JSON pointer names, of so many numbers.
    Pointer(String, usize),
}

/// Which two joints move a point, and the share of the second.
pub(crate) type Weights<'a> = &'a dyn Fn(DVec3) -> ([u8; 2], f64);

/// Linear Rec. 709 of an sRGB colour `0xRRGGBB`, to three digits.
fn linear(hex: u32) -> [f64; 3] {
    [16, 8, 0].map(|shift| {
        let encoded = f64::from((hex >> shift) & 255) / 255.0;
        let value = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
        (value * 1000.0).round() / 1000.0
    })
}

/// Digits enough for a transform in metres and radians.
fn rounded<const N: usize>(values: [f64; N]) -> Vec<f64> {
    values.iter().map(|v| (v * 1e6).round() / 1e6 + 0.0).collect()
}

/// The same of keys, as they are stored.
fn rounded_all(values: &[f64]) -> impl Iterator<Item = f32> + '_ {
    values.iter().map(|v| ((v * 1e6).round() / 1e6 + 0.0) as f32)
}

impl Document {
    pub(crate) fn new(name: &'static str) -> Self {
        Self {
            name,
            materials: Vec::new(),
            meshes: Vec::new(),
            nodes: Vec::new(),
            lights: Vec::new(),
            cameras: Vec::new(),
            accessors: Vec::new(),
            skins: Vec::new(),
            animations: Vec::new(),
            vectors: Vec::new(),
            indices: Vec::new(),
            influences: Vec::new(),
            floats: Vec::new(),
        }
    }

    fn paint(
        &mut self,
        name: &str,
        color: [f64; 3],
        metallic: f64,
        roughness: f64,
        extensions: Value,
    ) -> Paint {
        if let Some(index) = self.materials.iter().position(|m| m["name"] == name) {
            return Paint(index);
        }
        let [r, g, b] = color;
        let mut material = json!({
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorFactor": [r, g, b, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness
            },
            "doubleSided": true,
        });
        if !extensions.is_null() {
            material["extensions"] = extensions;
        }
        self.materials.push(material);
        Paint(self.materials.len() - 1)
    }

    /// Lambertian, by linear albedo.
    pub(crate) fn lambert(&mut self, name: &str, albedo: [f64; 3]) -> Paint {
        self.paint(name, albedo, 0.0, 1.0, json!({ "KHR_materials_specular": { "specularFactor": 0.0 } }))
    }

    /// Lambertian, by the albedo's sRGB colour. A name stands for one material; its first use defines it.
    pub(crate) fn matte(&mut self, name: &str, hex: u32) -> Paint {
        self.lambert(name, linear(hex))
    }

    /// One of several Lambertian shades of a `kind` of thing.
    pub(crate) fn tone(&mut self, kind: &str, hex: u32) -> Paint {
        self.matte(&format!("{kind} {hex:06x}"), hex)
    }

    /// A diffuse body of sRGB colour `hex` under a smooth clear coat of refractive index 1.5.
    pub(crate) fn lacquer(&mut self, name: &str, hex: u32) -> Paint {
        self.paint(name, linear(hex), 0.0, 0.05, Value::Null)
    }

    /// A mirror of reflectance `hex`.
    pub(crate) fn mirror(&mut self, name: &str, hex: u32) -> Paint {
        self.paint(name, linear(hex), 1.0, 0.02, Value::Null)
    }

    /// A thin pane of clear glass.
    pub(crate) fn pane(&mut self, name: &str) -> Paint {
        let extensions = json!({ "KHR_materials_transmission": { "transmissionFactor": 1.0 } });
        self.paint(name, [1.0; 3], 0.0, 0.0, extensions)
    }

    /// Solid glass about `thickness` metres thick; white light takes on the colour `hex` in 0.1 m.
    pub(crate) fn glass(&mut self, name: &str, thickness: f64, hex: u32) -> Paint {
        let extensions = json!({
            "KHR_materials_transmission": { "transmissionFactor": 1.0 },
            "KHR_materials_volume": {
                "thicknessFactor": thickness, "attenuationDistance": 0.1, "attenuationColor": linear(hex)
            },
        });
        self.paint(name, [1.0; 3], 0.0, 0.0, extensions)
    }

    fn accessor(&mut self, view: usize, offset: usize, component: u32, kind: &str, count: usize) -> usize {
        self.accessors.push(json!({
            "bufferView": view, "byteOffset": offset, "componentType": component, "type": kind, "count": count
        }));
        self.accessors.len() - 1
    }

    fn vectors(&mut self, values: &[[f32; 3]]) -> usize {
        let offset = self.vectors.len();
        self.vectors.extend(values.iter().flatten().flat_map(|v| v.to_le_bytes()));
        self.accessor(0, offset, 5126, "VEC3", values.len())
    }

    /// Normals are left out where every triangle is flat: what glTF means by their absence.
    fn primitive(&mut self, paint: Paint, shape: &Shape, weights: Option<Weights<'_>>) -> Value {
        let flat = shape.is_flat();
        let mut seen = BTreeMap::new();
        let (mut positions, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        for corners in shape.triangles() {
            let on_grid = corners.map(|(position, _)| (position / GRID).round());
            let area = (on_grid[1] - on_grid[0]).cross(on_grid[2] - on_grid[0]).length();
            if area < 1.0 {
                continue;
            }
            triangles.push([0, 1, 2].map(|k| {
                let position = on_grid[k];
                let normal = if flat { DVec3::ZERO } else { (corners[k].1 * 16384.0).round() };
                let key = [position, normal].map(|v| v.as_i64vec3().to_array());
                *seen.entry(key).or_insert_with(|| {
                    positions.push((position * GRID).as_vec3().to_array());
                    normals.push(normal.normalize_or_zero().as_vec3().to_array());
                    u16::try_from(positions.len() - 1).expect("a mesh of few vertices")
                })
            }));
        }
        let min = positions.iter().fold([f32::INFINITY; 3], |m, p| [0, 1, 2].map(|i| m[i].min(p[i])));
        let max = positions.iter().fold([f32::NEG_INFINITY; 3], |m, p| [0, 1, 2].map(|i| m[i].max(p[i])));
        let position = self.vectors(&positions);
        self.accessors[position]["min"] = json!(min.map(f64::from));
        self.accessors[position]["max"] = json!(max.map(f64::from));
        let mut attributes = Map::new();
        attributes.insert("POSITION".into(), json!(position));
        if !flat {
            attributes.insert("NORMAL".into(), json!(self.vectors(&normals)));
        }
        if let Some(weights) = weights {
            let offset = self.influences.len();
            let (mut joints, mut shares) = (Vec::new(), Vec::new());
            for position in &positions {
                let ([a, b], share) = weights(DVec3::from(position.map(f64::from)));
                let share = (share * 255.0).round() as u8;
                joints.extend([a, b, 0, 0]);
                shares.extend([255 - share, share, 0, 0]);
            }
            self.influences.extend(joints.into_iter().chain(shares));
            let count = positions.len();
            let joints = self.accessor(2, offset, 5121, "VEC4", count);
            let shares = self.accessor(2, offset + 4 * count, 5121, "VEC4", count);
            self.accessors[shares]["normalized"] = json!(true);
            attributes.insert("JOINTS_0".into(), json!(joints));
            attributes.insert("WEIGHTS_0".into(), json!(shares));
        }
        let offset = self.indices.len();
        self.indices.extend(triangles.iter().flatten().flat_map(|i: &u16| i.to_le_bytes()));
        let indices = self.accessor(1, offset, 5123, "SCALAR", 3 * triangles.len());
        json!({ "attributes": attributes, "indices": indices, "material": paint.0 })
    }

    /// A mesh to be placed any number of times.
    pub(crate) fn mesh(&mut self, name: &str, model: &Model) -> MeshId {
        let primitives: Vec<_> =
            model.0.iter().map(|(&paint, shape)| self.primitive(paint, shape, None)).collect();
        self.meshes.push(json!({ "name": name, "primitives": primitives }));
        MeshId(self.meshes.len() - 1)
    }

    /// A mesh of one morph target, which brings the corners of its only paint to where `to` has them.
    pub(crate) fn morphing(&mut self, name: &str, model: &Model, to: impl Fn(DVec3) -> DVec3) -> MeshId {
        let mesh = self.mesh(name, model);
        for index in 0..model.0.len() {
            let primitive = &self.meshes[mesh.0]["primitives"][index];
            let accessor = primitive["attributes"]["POSITION"].as_u64().expect("an accessor") as usize;
            let [offset, count] = ["byteOffset", "count"]
                .map(|key| self.accessors[accessor][key].as_u64().expect("a number") as usize);
            let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            let moved = self.vectors[offset..offset + 12 * count].chunks_exact(12).map(|bytes| {
                let position = DVec3::from([0, 4, 8].map(|i| f64::from(number(&bytes[i..]))));
                (((to(position) - position) / GRID).round() * GRID).as_vec3().to_array()
            });
            let moved: Vec<_> = moved.collect();
            let target = self.vectors(&moved);
            let bounds = |pick: fn(f32, f32) -> f32| {
                moved.iter().copied().reduce(|a, b| [0, 1, 2].map(|i| pick(a[i], b[i]))).unwrap_or_default()
            };
            self.accessors[target]["min"] = json!(bounds(f32::min).map(f64::from));
            self.accessors[target]["max"] = json!(bounds(f32::max).map(f64::from));
            self.meshes[mesh.0]["primitives"][index]["targets"] = json!([{ "POSITION": target }]);
        }
        self.meshes[mesh.0]["weights"] = json!([0.0]);
        mesh
    }

    /// A skinned mesh and its joints: name, parent among them and place at rest, where the mesh is modelled. The first joint is
    /// the root, and the node that all hang from; returned are the joints' nodes.
    pub(crate) fn skinned(
        &mut self,
        name: &str,
        parts: &[(Paint, Shape, Weights<'_>)],
        joints: &[(&str, Option<usize>, [f64; 3])],
    ) -> Vec<NodeId> {
        let primitives: Vec<_> = parts
            .iter()
            .map(|(paint, shape, weights)| self.primitive(*paint, shape, Some(*weights)))
            .collect();
        self.meshes.push(json!({ "name": name, "primitives": primitives }));
        let first = self.nodes.len();
        let offset = self.floats.len();
        for (index, &(joint, parent, at)) in joints.iter().enumerate() {
            let from = parent.map_or([0.0; 3], |parent| joints[parent].2);
            let translation = rounded([0, 1, 2].map(|i| at[i] - from[i]));
            let children: Vec<_> = (0..joints.len())
                .filter(|&child| joints[child].1 == Some(index))
                .map(|child| first + child)
                .collect();
            let mut node = json!({ "name": format!("{name} {joint}"), "translation": translation });
            if !children.is_empty() {
                node["children"] = json!(children);
            }
            self.nodes.push(node);
            let mut bind = [0.0; 16];
            (bind[0], bind[5], bind[10], bind[15]) = (1.0, 1.0, 1.0, 1.0);
            (bind[12], bind[13], bind[14]) = (-at[0], -at[1], -at[2]);
            self.floats.extend(bind.iter().flat_map(|&value| (value as f32).to_le_bytes()));
        }
        let matrices = self.accessor(3, offset, 5126, "MAT4", joints.len());
        let nodes: Vec<_> = (first..first + joints.len()).collect();
        self.skins.push(json!({ "joints": nodes, "inverseBindMatrices": matrices, "skeleton": first }));
        let (mesh, skin) = (self.meshes.len() - 1, self.skins.len() - 1);
        self.nodes.push(json!({ "name": name, "mesh": mesh, "skin": skin }));
        nodes.into_iter().map(NodeId).collect()
    }

    /// The node added last.
    pub(crate) fn last(&self) -> NodeId {
        NodeId(self.nodes.len() - 1)
    }

    /// Hangs the nodes added last from `parent`, as many as are named; their places are in it.
    pub(crate) fn hang(&mut self, parent: NodeId, count: usize) {
        let nodes = self.nodes.len() - count..self.nodes.len();
        let children: Vec<_> = nodes.collect();
        self.nodes[parent.0]["children"] = json!(children);
    }

    /// A channel of animation `clip`, straight between keys of times (s) and values.
    pub(crate) fn animate(&mut self, clip: &str, moved: Moved, keys: &[(f64, Vec<f64>)]) {
        let mut accessor = |values: Vec<f64>, kind: &str, count: usize| {
            let offset = self.floats.len();
            self.floats.extend(rounded_all(&values).flat_map(|value| value.to_le_bytes()));
            self.accessors.push(json!({
                "bufferView": 3, "byteOffset": offset, "componentType": 5126, "type": kind, "count": count
            }));
            self.accessors.len() - 1
        };
        let (target, kind) = match moved {
            Moved::Translation(node) => (json!({ "node": node.0, "path": "translation" }), "VEC3"),
            Moved::Rotation(node) => (json!({ "node": node.0, "path": "rotation" }), "VEC4"),
            Moved::Weight(node) => (json!({ "node": node.0, "path": "weights" }), "SCALAR"),
            Moved::Pointer(pointer, width) => {
                let extension = json!({ "KHR_animation_pointer": { "pointer": pointer } });
                let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
                (json!({ "path": "pointer", "extensions": extension }), kind)
            }
        };
        let times: Vec<_> = keys.iter().map(|(time, _)| *time).collect();
        let (first, last) = (times[0], times[times.len() - 1]);
        let input = accessor(times, "SCALAR", keys.len());
        let output = accessor(keys.iter().flat_map(|(_, values)| values.clone()).collect(), kind, keys.len());
        self.accessors[input]["min"] = json!([rounded([first])[0]]);
        self.accessors[input]["max"] = json!([rounded([last])[0]]);
        let index = self.animations.iter().position(|animation| animation["name"] == clip);
        let index = index.unwrap_or_else(|| {
            self.animations.push(json!({ "name": clip, "channels": [], "samplers": [] }));
            self.animations.len() - 1
        });
        let animation = &mut self.animations[index];
        let list = |value: &mut Value, item: Value| {
            let items = value.as_array_mut().expect("a list");
            items.push(item);
            items.len() - 1
        };
        let sampler = list(&mut animation["samplers"], json!({ "input": input, "output": output }));
        list(&mut animation["channels"], json!({ "sampler": sampler, "target": target }));
    }

    /// Places a mesh: turned by `degrees` about Y, then moved.
    pub(crate) fn place(&mut self, name: &str, mesh: MeshId, position: [f64; 3], degrees: f64) {
        let mut node = json!({ "name": name, "mesh": mesh.0 });
        if position != [0.0; 3] {
            node["translation"] = json!(rounded(position));
        }
        if degrees != 0.0 {
            node["rotation"] = json!(rounded(DQuat::from_rotation_y(degrees.to_radians()).to_array()));
        }
        self.nodes.push(node);
    }

    /// A mesh used once, where it was modelled.
    pub(crate) fn add(&mut self, name: &str, model: &Model) {
        let mesh = self.mesh(name, model);
        self.place(name, mesh, [0.0; 3], 0.0);
    }

    /// A point light of `intensity` W/sr in the brightest channel.
    pub(crate) fn light(&mut self, name: &str, position: [f64; 3], color: [f64; 3], intensity: f64) {
        self.nodes.push(json!({
            "name": name, "translation": position,
            "extensions": { "KHR_lights_punctual": { "light": self.lights.len() } },
        }));
        self.lights.push(json!({ "name": name, "type": "point", "color": color, "intensity": intensity }));
    }

    /// A camera at `eye` that looks at `target`; `degrees` is the vertical angle.
    pub(crate) fn camera(&mut self, name: &str, eye: [f64; 3], target: [f64; 3], degrees: f64, aspect: f64) {
        let back = (DVec3::from(eye) - DVec3::from(target)).normalize();
        let right = DVec3::Y.cross(back).normalize();
        let rotation = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back));
        self.nodes.push(json!({
            "name": name, "camera": self.cameras.len(), "translation": eye, "rotation": rounded(rotation.to_array()),
        }));
        let yfov = rounded([degrees.to_radians()])[0];
        self.cameras.push(json!({
            "name": name, "type": "perspective",
            "perspective": { "aspectRatio": rounded([aspect])[0], "yfov": yfov, "znear": 0.01 },
        }));
    }

    /// The file.
    pub(crate) fn into_glb(self) -> Vec<u8> {
        let uses = |name: &str| self.materials.iter().any(|m| !m["extensions"][name].is_null());
        let mut used: Vec<_> =
            ["KHR_materials_specular", "KHR_materials_transmission", "KHR_materials_volume"].to_vec();
        used.retain(|name| uses(name));
        used.push("KHR_lights_punctual");
        let pointers = self.animations.iter().flat_map(|animation| animation["channels"].as_array());
        if pointers.flatten().any(|channel| channel["target"]["path"] == "pointer") {
            used.push("KHR_animation_pointer");
        }
        let mut bin = self.vectors;
        let split = bin.len();
        bin.extend(&self.indices);
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut views = vec![
            json!({ "buffer": 0, "byteOffset": 0, "byteLength": split, "byteStride": 12, "target": 34962 }),
            json!({ "buffer": 0, "byteOffset": split, "byteLength": self.indices.len(), "target": 34963 }),
        ];
        if !self.floats.is_empty() {
            // Views are numbered: where nothing is skinned the third is of a joint that nobody has.
            let influences = if self.influences.is_empty() { vec![0; 4] } else { self.influences };
            views.push(json!({
                "buffer": 0, "byteOffset": bin.len(), "byteLength": influences.len(), "byteStride": 4, "target": 34962
            }));
            bin.extend(influences);
            views.push(json!({ "buffer": 0, "byteOffset": bin.len(), "byteLength": self.floats.len() }));
            bin.extend(self.floats);
        }
        // A child is in no scene's list.
        let children: Vec<_> =
            self.nodes.iter().filter_map(|node| node["children"].as_array()).flatten().collect();
        let roots: Vec<_> = (0..self.nodes.len()).filter(|&node| !children.contains(&&json!(node))).collect();
        let mut root = json!({
            "asset": {
                "version": "2.0", "generator": "parhelion scenes/make",
                "copyright": "The Parhelion authors, MIT OR Apache-2.0",
            },
            "extensionsUsed": used,
            "extensions": { "KHR_lights_punctual": { "lights": self.lights } },
            "scene": 0,
            "scenes": [{ "name": self.name, "nodes": roots }],
            "nodes": self.nodes,
            "cameras": self.cameras,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": views,
            "buffers": [{ "byteLength": bin.len() }],
        });
        for (list, items) in [("skins", self.skins), ("animations", self.animations)] {
            if !items.is_empty() {
                root[list] = json!(items);
            }
        }
        let glb = gltf::binary::Glb {
            header: gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 },
            json: Cow::Owned(root.to_string().into_bytes()),
            bin: Some(Cow::Owned(bin)),
        };
        glb.to_vec().expect("writing to memory")
    }
}
