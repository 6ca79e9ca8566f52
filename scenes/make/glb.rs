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
    vectors: Vec<u8>,
    indices: Vec<u8>,
}

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
            vectors: Vec::new(),
            indices: Vec::new(),
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
    fn primitive(&mut self, paint: Paint, shape: &Shape) -> Value {
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
        let offset = self.indices.len();
        self.indices.extend(triangles.iter().flatten().flat_map(|i: &u16| i.to_le_bytes()));
        let indices = self.accessor(1, offset, 5123, "SCALAR", 3 * triangles.len());
        json!({ "attributes": attributes, "indices": indices, "material": paint.0 })
    }

    /// A mesh to be placed any number of times.
    pub(crate) fn mesh(&mut self, name: &str, model: &Model) -> MeshId {
        let primitives: Vec<_> = model.0.iter().map(|(&paint, shape)| self.primitive(paint, shape)).collect();
        self.meshes.push(json!({ "name": name, "primitives": primitives }));
        MeshId(self.meshes.len() - 1)
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
        let mut bin = self.vectors;
        let split = bin.len();
        bin.extend(&self.indices);
        bin.resize(bin.len().next_multiple_of(4), 0);
        let root = json!({
            "asset": {
                "version": "2.0", "generator": "parhelion scenes/make",
                "copyright": "The Parhelion authors, MIT OR Apache-2.0",
            },
            "extensionsUsed": used,
            "extensions": { "KHR_lights_punctual": { "lights": self.lights } },
            "scene": 0,
            "scenes": [{ "name": self.name, "nodes": (0..self.nodes.len()).collect::<Vec<_>>() }],
            "nodes": self.nodes,
            "cameras": self.cameras,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": [
                { "buffer": 0, "byteOffset": 0, "byteLength": split, "byteStride": 12, "target": 34962 },
                { "buffer": 0, "byteOffset": split, "byteLength": self.indices.len(), "target": 34963 },
            ],
            "buffers": [{ "byteLength": bin.len() }],
        });
        let glb = gltf::binary::Glb {
            header: gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 },
            json: Cow::Owned(root.to_string().into_bytes()),
            bin: Some(Cow::Owned(bin)),
        };
        glb.to_vec().expect("writing to memory")
    }
}
