//! glTF 2.0 import: `.gltf` with buffers and images beside it or in `data:` URIs, and `.glb`.
//!
//! The JSON is typed and its indices are checked by the `gltf` crate; accessors are read by a checked reader of
//! our own. All of the file is checked but textures that the chosen scene does not show. Skins are shown undeformed, morph targets with their default weights.

mod accessor;
mod container;
mod context;
mod geometry;
mod material;

use super::file::{self, Files};
use super::import::{self, Mended};
use super::origin::{self, Around};
use super::{Camera, Instance, Light, LightKind, LoadOptions, Material, Scene, SceneError, View};
use ::gltf::json;
use ::gltf::json::deserialize::from_slice;
use ::gltf::json::extensions::scene::khr_lights_punctual;
use ::gltf::json::validation::{Checked, Error, Validate};
use context::Context;
use glam::{Affine3A, DAffine3, DMat3, DMat4, DQuat, DVec3, Vec2, Vec3};
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

/// Extensions a file may require.
pub const SUPPORTED_EXTENSIONS: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Loads a `.gltf` or `.glb` file.
///
/// # Errors
/// [`SceneError`] names the file, the element and the defect.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let bytes = file::read_file(path).map_err(|problem| SceneError::new(path, "file", problem))?;
    read(path, &bytes, options)
}

/// Loads a file that is in memory already; `name` stands for it in messages.
pub(crate) fn load_bytes(bytes: &[u8], name: &str, options: &LoadOptions) -> Result<Scene, SceneError> {
    read(Path::new(name), bytes, options)
}

fn read(path: &Path, bytes: &[u8], options: &LoadOptions) -> Result<Scene, SceneError> {
    let binary =
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb")) || bytes.starts_with(b"glTF");
    let (json, chunk) = if binary { container::split(path, bytes)? } else { (bytes, None) };
    let (root, nodes) = parse(path, json)?;
    let (files, mended) = (&Files::of(path, options)?, &Mended::new(options));
    let buffers = buffers(path, files, &root, binary, chunk)?;
    let quantized = root.extensions_used.iter().any(|name| name == "KHR_mesh_quantization");
    let context =
        Context { file: path, files, mended, root: &root, nodes: &nodes, buffers: &buffers, quantized };
    context.check_structure()?;
    context.scene(options)
}

/// Types the JSON and checks all indices in it. Nodes come as they are, too.
fn parse(path: &Path, text: &[u8]) -> Result<(json::Root, json::Value), SceneError> {
    let mut value: json::Value =
        from_slice(text).map_err(|error| SceneError::new(path, "JSON", error.to_string()))?;
    drop_extras(&mut value);
    let root: json::Root = json::Root::deserialize(&value)
        .map_err(|error| SceneError::new(path, untyped_element(&value), error.to_string()))?;
    check_header(path, &root)?;
    // The crate's validation indexes accessors by these without a check.
    for (i, mesh) in root.meshes.iter().enumerate() {
        for (j, primitive) in mesh.primitives.iter().enumerate() {
            for (name, accessor) in &primitive.attributes {
                if accessor.value() >= root.accessors.len() {
                    let element = format!("meshes[{i}].primitives[{j}].attributes.{}", name.to_string());
                    let problem = format!("accessors[{accessor}] is not there: index out of range");
                    return Err(SceneError::new(path, element, problem));
                }
            }
        }
    }
    let mut first = None;
    root.validate(&root, json::Path::new, &mut |at, error| {
        let at = at().0;
        // Extensions are checked above; these may be absent.
        let optional = at.ends_with("attributes[\"POSITION\"]")
            || at.starts_with("accessors[") && at.ends_with("].bufferView")
            || at.starts_with("textures[") && at.ends_with("].source");
        let legal = error == Error::Unsupported || error == Error::Missing && optional;
        if !legal && first.is_none() {
            let problem = match error {
                Error::IndexOutOfBounds => "index out of range",
                Error::Missing => "required, but missing",
                Error::Oversize => "larger than this machine can address",
                Error::Invalid | Error::Unsupported => "invalid value",
            };
            first = Some(SceneError::new(path, at, problem));
        }
    });
    let nodes = value.get_mut("nodes").map_or(json::Value::Null, json::Value::take);
    first.map_or(Ok((root, nodes)), Err)
}

/// `extras` concern nobody here, and those of lights can't be typed by the crate.
fn drop_extras(value: &mut json::Value) {
    match value {
        json::Value::Object(members) => {
            members.remove("extras");
            members.values_mut().for_each(drop_extras);
        }
        json::Value::Array(items) => items.iter_mut().for_each(drop_extras),
        _ => {}
    }
}

/// Which element of well-formed JSON can't be typed.
fn untyped_element(root: &json::Value) -> String {
    fn find<T: for<'de> Deserialize<'de>>(root: &json::Value, list: &str) -> Option<String> {
        let value = root.get(list)?;
        let Some(items) = value.as_array() else { return Some(list.to_owned()) };
        let i = items.iter().position(|item| T::deserialize(item).is_err())?;
        Some(format!("{list}[{i}]"))
    }
    find::<json::Accessor>(root, "accessors")
        .or_else(|| find::<json::Animation>(root, "animations"))
        .or_else(|| find::<json::buffer::View>(root, "bufferViews"))
        .or_else(|| find::<json::Buffer>(root, "buffers"))
        .or_else(|| find::<json::Camera>(root, "cameras"))
        .or_else(|| find::<json::Image>(root, "images"))
        .or_else(|| find::<json::Material>(root, "materials"))
        .or_else(|| find::<json::Mesh>(root, "meshes"))
        .or_else(|| find::<json::Node>(root, "nodes"))
        .or_else(|| find::<json::texture::Sampler>(root, "samplers"))
        .or_else(|| find::<json::Scene>(root, "scenes"))
        .or_else(|| find::<json::Skin>(root, "skins"))
        .or_else(|| find::<json::Texture>(root, "textures"))
        .unwrap_or_else(|| "JSON".to_owned())
}

fn check_header(path: &Path, root: &json::Root) -> Result<(), SceneError> {
    let minimum = root.asset.min_version.as_deref();
    if !root.asset.version.starts_with("2.") || minimum.is_some_and(|version| version != "2.0") {
        let wanted = minimum.unwrap_or(&root.asset.version);
        return Err(SceneError::new(path, "asset.version", format!("glTF {wanted}, expected 2.0")));
    }
    let unknown: Vec<&str> = root
        .extensions_required
        .iter()
        .map(String::as_str)
        .filter(|name| !SUPPORTED_EXTENSIONS.contains(name))
        .collect();
    if unknown.is_empty() {
        return Ok(());
    }
    Err(SceneError::new(path, "extensionsRequired", format!("not supported: {}", unknown.join(", "))))
}

fn buffers<'a>(
    path: &Path,
    files: &Files,
    root: &json::Root,
    binary: bool,
    chunk: Option<&'a [u8]>,
) -> Result<Vec<Option<Cow<'a, [u8]>>>, SceneError> {
    let read = |i: usize, buffer: &json::Buffer| {
        let data = match &buffer.uri {
            Some(uri) => Some(Cow::Owned(container::fetch(files, uri)?)),
            None if i == 0 && binary => {
                Some(Cow::Borrowed(chunk.ok_or("has no uri, and there is no binary chunk")?))
            }
            None => None,
        };
        let length = buffer.byte_length.0;
        match &data {
            Some(data) if (data.len() as u64) < length => {
                Err(format!("truncated: {} of {length} bytes", data.len()))
            }
            _ => Ok(data),
        }
    };
    let all = root.buffers.iter().enumerate();
    all.map(|(i, buffer)| read(i, buffer).map_err(|p| SceneError::new(path, format!("buffers[{i}]"), p)))
        .collect()
}

/// What is read of nodes.
struct Read {
    scene: Scene,
    /// Of its instances.
    transforms: Vec<DAffine3>,
    /// How far from the origin nodes are that lead to them (m).
    detour: f64,
    tally: geometry::Tally,
    skinned: usize,
    /// Lights with a range.
    ranged: usize,
}

impl Context<'_> {
    /// Everything that is checked whether the scene shows it or not.
    fn check_structure(&self) -> Result<(), SceneError> {
        for (i, view) in self.root.buffer_views.iter().enumerate() {
            let length = self.root.buffers[view.buffer.value()].byte_length.0;
            let end = view.byte_offset.map_or(0, |o| o.0).checked_add(view.byte_length.0);
            if end.is_none_or(|end| end > length) {
                let problem = format!("ends behind the {length} bytes of buffers[{}]", view.buffer);
                return Err(self.error(format!("bufferViews[{i}]"), problem));
            }
        }
        // Without a URI a buffer is there for an extension; what reads it all the same fails then.
        if self.buffers.iter().all(Option::is_some) {
            (0..self.root.accessors.len()).try_for_each(|i| self.elements(i).map(drop))?;
            let mut shown = vec![false; self.root.meshes.len()];
            for mesh in self.root.nodes.iter().filter_map(|node| node.mesh) {
                shown[mesh.value()] = true;
            }
            let unseen = (0..shown.len()).filter(|&mesh| !shown[mesh]);
            unseen
                .map(|mesh| self.mesh(mesh, None, DVec3::ZERO, &mut geometry::Tally::default()))
                .try_for_each(|m| m.map(drop))?;
        }
        (0..self.root.cameras.len()).try_for_each(|i| self.view(i).map(drop))?;
        self.check_nodes()
    }

    /// Nodes form trees: no node has two parents or is its own ancestor.
    fn check_nodes(&self) -> Result<(), SceneError> {
        let nodes = &self.root.nodes;
        let mut parents = vec![None; nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            for child in node.children.iter().flatten() {
                if let Some(other) = parents[child.value()].replace(i) {
                    let problem = format!("is a child of nodes[{other}] and again of nodes[{i}]");
                    return Err(self.error(format!("nodes[{child}]"), problem));
                }
            }
        }
        // With one parent at most, a walk upwards either reaches a root or comes back to where it began.
        let mut walked = vec![usize::MAX; nodes.len()];
        for i in 0..nodes.len() {
            let mut at = Some(i);
            while let Some(node) = at.filter(|&node| walked[node] == usize::MAX) {
                walked[node] = i;
                at = parents[node];
            }
            if let Some(node) = at.filter(|&node| walked[node] == i) {
                return Err(
                    self.error(format!("nodes[{node}]"), "is its own ancestor: the hierarchy is cyclic")
                );
            }
        }
        let mut listed = vec![usize::MAX; nodes.len()];
        for (i, scene) in self.root.scenes.iter().enumerate() {
            for node in &scene.nodes {
                if parents[node.value()].is_some() || std::mem::replace(&mut listed[node.value()], i) == i {
                    let problem = format!("nodes[{node}] is not a root node, or is listed twice");
                    return Err(self.error(format!("scenes[{i}]"), problem));
                }
            }
        }
        Ok(())
    }

    /// Root nodes of the scene that is asked for, and which element that is.
    fn roots(&self, options: &LoadOptions) -> Result<(Vec<usize>, String), SceneError> {
        let scenes = &self.root.scenes;
        let default = self.root.scene.map_or(0, |scene| scene.value());
        let chosen = match &options.scene {
            Some(wanted) => {
                let named = scenes.iter().position(|scene| scene.name.as_ref() == Some(wanted));
                let index = wanted.parse().ok().filter(|&i: &usize| i < scenes.len());
                let Some(chosen) = named.or(index) else {
                    let names: Vec<String> = scenes
                        .iter()
                        .enumerate()
                        .map(|(i, scene)| {
                            scene.name.as_ref().map_or(i.to_string(), |name| format!("{i} ({name})"))
                        })
                        .collect();
                    return Err(
                        self.error("scenes", format!("no scene `{wanted}`; there are: {}", names.join(", ")))
                    );
                };
                chosen
            }
            None => default,
        };
        if let Some(scene) = scenes.get(chosen) {
            return Ok((scene.nodes.iter().map(|node| node.value()).collect(), format!("scenes[{chosen}]")));
        }
        let mut is_root = vec![true; self.root.nodes.len()];
        for child in self.root.nodes.iter().filter_map(|node| node.children.as_ref()).flatten() {
            is_root[child.value()] = false;
        }
        Ok(((0..is_root.len()).filter(|&i| is_root[i]).collect(), "nodes".to_owned()))
    }

    fn scene(&self, options: &LoadOptions) -> Result<Scene, SceneError> {
        let (roots, element) = self.roots(options)?;
        let mut read = self.placed_parts(&roots, None)?;
        if let Some(around) = Around::of(&read.scene, &read.transforms, read.detour) {
            read = self.placed_parts(&roots, Some(&around))?;
        }
        let Read { mut scene, tally, skinned, ranged, .. } = read;
        self.materials(&mut scene)?;
        self.note(&mut scene, &tally, skinned, ranged);
        scene.notes.extend(self.mended.notes());
        import::finish(scene, self.file, &element)
    }

    /// Meshes, instances, lights and cameras; in double precision about other points where there are some.
    fn placed_parts(&self, roots: &[usize], around: Option<&Around>) -> Result<Read, SceneError> {
        let mut scene = Scene {
            name: self.file.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            origin: around.map_or(DVec3::ZERO, |around| around.origin),
            ..Scene::default()
        };
        let lights = self.lights()?;
        let mut tally = geometry::Tally::default();
        let mut meshes: HashMap<(usize, Option<Vec<u32>>), u32> = HashMap::new();
        let mut transforms = Vec::new();
        let (mut skinned, mut ranged) = (0, 0);
        let sources: &[khr_lights_punctual::Light] = self.root.as_ref();
        let mut detour = 0.0_f64;
        let mut stack: Vec<(usize, DAffine3, f64)> =
            roots.iter().rev().map(|&i| (i, DAffine3::IDENTITY, 0.0)).collect();
        while let Some((i, parent, way)) = stack.pop() {
            let node = &self.root.nodes[i];
            let world = parent * self.local_transform(i, around.is_some())?;
            let way = way.max(world.translation.length());
            stack.extend(node.children.iter().flatten().rev().map(|child| (child.value(), world, way)));
            if let Some(mesh) = node.mesh.map(|mesh| mesh.value()) {
                skinned += usize::from(node.skin.is_some());
                let weights = node.weights.as_deref().filter(|w| !w.is_empty());
                let key = (mesh, weights.map(|w| w.iter().map(|w| w.to_bits()).collect()));
                let mesh = match meshes.get(&key) {
                    Some(&mesh) => mesh,
                    None => {
                        let slot = scene.meshes.len();
                        let offset = around.map_or(DVec3::ZERO, |around| around.meshes[slot]);
                        scene.meshes.push(self.mesh(mesh, weights, offset, &mut tally)?);
                        meshes.insert(key, slot as u32);
                        slot as u32
                    }
                };
                let name = node.name.clone().unwrap_or_else(|| scene.meshes[mesh as usize].name.clone());
                let placement = around.map_or(world, |around| around.placement(mesh as usize, &world));
                scene.instances.push(Instance { name, mesh, transform: self.world_f32(i, placement)? });
                transforms.push(placement);
                detour = detour.max(way);
            }
            let world = DAffine3 { translation: world.translation - scene.origin, ..world };
            if let Some(camera) = node.camera {
                scene.cameras.push(self.camera(i, camera.value(), world)?);
            }
            let light = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
            if let Some((light, source)) =
                light.map(|l| (&lights[l.light.value()], &sources[l.light.value()]))
            {
                ranged += usize::from(light.kind != LightKind::Directional && source.range.is_some());
                scene.lights.push(self.placed(i, light, world)?);
            }
        }
        Ok(Read { scene, transforms, detour, tally, skinned, ranged })
    }

    /// All materials in file order, with textures where a triangle uses them.
    fn materials(&self, scene: &mut Scene) -> Result<(), SceneError> {
        let count = self.root.materials.len();
        scene.materials = (0..count).map(|i| self.material(i)).collect::<Result<_, _>>()?;
        let mut used = vec![false; count + 1];
        for &material in scene.meshes.iter().flat_map(|mesh| &mesh.materials) {
            used[material as usize] = true;
        }
        if used[count] {
            scene.materials.push(Material { name: "default".into(), ..Material::default() });
        }
        let mut textures = material::Textures::new(self.root);
        for (i, material) in scene.materials[..count].iter_mut().enumerate() {
            if used[i] {
                self.texture(i, material, &mut textures)?;
            }
        }
        scene.images = textures.images;
        if textures.far_sets > 0 {
            scene
                .notes
                .push(format!("{} textures use coordinate sets above 1 and are left out", textures.far_sets));
        }
        let mut without = 0;
        for mesh in &mut scene.meshes {
            mesh.generate_tangents(&scene.materials);
            let mut wanted = [false; 2];
            let mut seen = u32::MAX;
            for &material in &mesh.materials {
                if std::mem::replace(&mut seen, material) != material {
                    for (_, texture) in scene.materials[material as usize].textures() {
                        wanted[texture.uv_set as usize] = true;
                    }
                }
            }
            for (wanted, uv) in wanted.into_iter().zip([&mut mesh.uv0, &mut mesh.uv1]) {
                if wanted && uv.is_empty() {
                    uv.resize(mesh.positions.len(), Vec2::ZERO);
                    without += 1;
                }
            }
        }
        if without > 0 {
            scene
                .notes
                .push(format!("{without} textured meshes lack texture coordinates and show one texel"));
        }
        Ok(())
    }

    fn note(&self, scene: &mut Scene, tally: &geometry::Tally, skinned: usize, ranged: usize) {
        let mut note = |holds: bool, text: String| {
            if holds {
                scene.notes.push(text);
            }
        };
        note(
            tally.points_and_lines > 0,
            format!("{} primitives of points or lines are left out", tally.points_and_lines),
        );
        note(
            tally.without_positions > 0,
            format!("{} primitives without positions are left out", tally.without_positions),
        );
        note(
            tally.incomplete > 0,
            format!("{} vertices behind the last whole triangle are left out", tally.incomplete),
        );
        note(
            ranged > 0,
            format!(
                "the range of {ranged} lights, a hint, is left out: their light falls off by the inverse square for ever"
            ),
        );
        note(skinned > 0, format!("{skinned} skinned meshes are shown undeformed"));
        note(
            tally.morphed > 0,
            format!("{} morphed meshes are shown with their default weights", tally.morphed),
        );
        note(
            !self.root.animations.is_empty(),
            format!("{} animations are left out", self.root.animations.len()),
        );
        let unknown: Vec<&str> = self
            .root
            .extensions_used
            .iter()
            .map(String::as_str)
            .filter(|name| !SUPPORTED_EXTENSIONS.contains(name))
            .collect();
        note(!unknown.is_empty(), format!("extensions left out: {}", unknown.join(", ")));
    }

    /// Transform of a node in its parent; 64 bits keep deep chains exact enough. Its numbers are those of the file, to 32
    /// bits or, if `exact`, to 64.
    fn local_transform(&self, index: usize, exact: bool) -> Result<DAffine3, SceneError> {
        let node = &self.root.nodes[index];
        let fail = |problem: &str| Err(self.error(format!("nodes[{index}]"), problem));
        if let Some(matrix) = node.matrix {
            if node.translation.is_some() || node.rotation.is_some() || node.scale.is_some() {
                return fail("has both a matrix and translation, rotation or scale");
            }
            if !matrix.iter().all(|e| e.is_finite()) {
                return fail("its matrix is not finite");
            }
            if [matrix[3], matrix[7], matrix[11], matrix[15]] != [0.0, 0.0, 0.0, 1.0] {
                return fail("the last row of its matrix is not 0 0 0 1");
            }
            let matrix = self.node_numbers(index, "matrix", exact, matrix);
            return Ok(DAffine3::from_mat4(DMat4::from_cols_array(&matrix)));
        }
        let translation = node.translation.unwrap_or_default();
        let translation = DVec3::from(self.node_numbers(index, "translation", exact, translation));
        let rotation = node.rotation.unwrap_or_default().0;
        let rotation = DQuat::from_array(self.node_numbers(index, "rotation", exact, rotation));
        let scale = DVec3::from(self.node_numbers(index, "scale", exact, node.scale.unwrap_or([1.0; 3])));
        if !(translation.is_finite() && rotation.is_finite() && scale.is_finite()) {
            return fail("its translation, rotation or scale is not finite");
        }
        if (rotation.length() - 1.0).abs() > 1e-2 {
            return fail("its rotation is not a unit quaternion");
        }
        Ok(DAffine3::from_scale_rotation_translation(scale, rotation.normalize(), translation))
    }

    /// Numbers of a node under `key`, which are `read` to 32 bits.
    fn node_numbers<const N: usize>(&self, index: usize, key: &str, exact: bool, read: [f32; N]) -> [f64; N] {
        let written = &self.nodes[index][key];
        std::array::from_fn(|i| written[i].as_f64().filter(|_| exact).unwrap_or_else(|| f64::from(read[i])))
    }

    fn world_f32(&self, node: usize, world: DAffine3) -> Result<Affine3A, SceneError> {
        let transform = origin::rounded(&world);
        if transform.is_finite() {
            return Ok(transform);
        }
        Err(self.error(format!("nodes[{node}]"), "its transform in the world is too large"))
    }

    fn view(&self, index: usize) -> Result<View, SceneError> {
        let source = &self.root.cameras[index];
        let element = || format!("cameras[{index}]");
        let view = match (source.type_, &source.perspective, &source.orthographic) {
            (Checked::Valid(json::camera::Type::Perspective), Some(p), _) => {
                View::Perspective { yfov: p.yfov }
            }
            (Checked::Valid(json::camera::Type::Orthographic), _, Some(o)) => {
                View::Orthographic { ymag: o.ymag }
            }
            _ => return Err(self.error(element(), "what its type names is missing")),
        };
        view.check().map_err(|problem| self.error(element(), problem))?;
        Ok(view)
    }

    /// A camera where node `node` is; scales do not reach it.
    fn camera(&self, node: usize, index: usize, world: DAffine3) -> Result<Camera, SceneError> {
        let camera_name = self.root.cameras[index].name.clone();
        let backward = world.matrix3.z_axis.normalize_or_zero();
        let right = world.matrix3.x_axis.reject_from(backward).normalize_or_zero();
        if backward == DVec3::ZERO || right == DVec3::ZERO || !world.is_finite() {
            return Err(self
                .error(format!("nodes[{node}]"), "its camera has no direction: the transform is singular"));
        }
        let rigid = DAffine3::from_mat3_translation(
            DMat3::from_cols(right, backward.cross(right), backward),
            world.translation,
        );
        let name = self.root.nodes[node].name.clone().or(camera_name.clone());
        let camera = Camera {
            name: name.unwrap_or_else(|| format!("camera {index}")),
            camera_name,
            transform: self.world_f32(node, rigid)?,
            view: self.view(index)?,
        };
        camera.check().map_err(|problem| self.error(format!("nodes[{node}]"), problem))?;
        Ok(camera)
    }

    /// The file's lights, at the origin, along −Z.
    fn lights(&self) -> Result<Vec<Light>, SceneError> {
        let sources: &[khr_lights_punctual::Light] = self.root.as_ref();
        let read = |(i, source): (usize, &khr_lights_punctual::Light)| {
            let kind = match (source.type_, &source.spot) {
                (Checked::Valid(khr_lights_punctual::Type::Directional), _) => LightKind::Directional,
                (Checked::Valid(khr_lights_punctual::Type::Spot), Some(spot)) => {
                    LightKind::Spot { inner: spot.inner_cone_angle, outer: spot.outer_cone_angle }
                }
                _ => LightKind::Point,
            };
            let light = Light {
                name: source.name.clone().unwrap_or_else(|| format!("light {i}")),
                kind,
                position: Vec3::ZERO,
                direction: Vec3::NEG_Z,
                intensity: Vec3::from(source.color) * source.intensity,
            };
            let negative = source.intensity < 0.0 || source.color.iter().any(|&c| c < 0.0);
            let checked =
                if negative { Err("its intensity or colour is negative".into()) } else { light.check() };
            checked.map_err(|problem| {
                self.error(format!("extensions.KHR_lights_punctual.lights[{i}]"), problem)
            })?;
            Ok(light)
        };
        sources.iter().enumerate().map(read).collect()
    }

    fn placed(&self, node: usize, light: &Light, world: DAffine3) -> Result<Light, SceneError> {
        let direction = (world.matrix3 * DVec3::NEG_Z).normalize_or_zero();
        if direction == DVec3::ZERO && light.kind != LightKind::Point {
            return Err(
                self.error(format!("nodes[{node}]"), "its light has no direction: the transform is singular")
            );
        }
        let position = self.world_f32(node, DAffine3::from_translation(world.translation))?.translation;
        let placed = Light {
            name: self.root.nodes[node].name.clone().unwrap_or_else(|| light.name.clone()),
            position: position.into(),
            direction: if direction == DVec3::ZERO { Vec3::NEG_Z } else { direction.as_vec3() },
            ..light.clone()
        };
        placed.check().map_err(|problem| self.error(format!("nodes[{node}]"), problem))?;
        Ok(placed)
    }
}
