//! glTF 2.0 import: `.gltf` with buffers and images beside it or in `data:` URIs, and `.glb`.
//!
//! The JSON is cut to what is read of it, typed and its indices checked by the `gltf` crate; accessors are read by a checked
//! reader of our own. What is harmless is mended and noted, and so is what is broken where the chosen scene does not need it.
//! Skins are shown at rest, morph targets with their default weights, unless the scene keeps what moves it.

mod accessor;
mod animation;
mod container;
mod context;
mod geometry;
mod material;
mod skin;
mod tidy;

use super::clip::{NodeProperty, Target};
use super::file::{self, Files};
use super::import;
use super::mend::Mended;
use super::motion::rig::{Local, Node};
use super::motion::{self, Placed, Rig, Rigged, Shaped, Source, Within};
use super::origin::{self, Around};
use super::{
    Camera, Fault, Instance, Light, LightKind, LoadOptions, MAX_TRIANGLES, Material, Scene, SceneError, View,
};
use crate::memory::Budget;
use crate::read::narrow;
use ::gltf::json;
use ::gltf::json::accessor::{ComponentType, Type};
use ::gltf::json::extensions::scene::khr_lights_punctual;
use ::gltf::json::validation::{Checked, Error, Validate};
use context::{Buffer, Context};
use geometry::Pose;
use glam::{Affine3A, DAffine3, DMat4, DQuat, DVec3, Vec2, Vec3};
use serde::Deserialize;
use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::collections::{HashMap, HashSet};
use std::f32::consts::FRAC_PI_2;
use std::path::Path;
use std::sync::Arc;

/// Extensions a file may require.
pub const SUPPORTED_EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Extensions a file may require although they are left out: they concern motion, sound, choices that a viewer has, coarser
/// levels of detail, and data of applications, and the picture without them is right.
const INVISIBLE_EXTENSIONS: &[&str] = &[
    "AGI_articulations",
    "AGI_stk_metadata",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    POINTER,
    "KHR_audio",
    "KHR_audio_emitter",
    "KHR_implicit_shapes",
    "KHR_interactivity",
    "KHR_materials_variants",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_physics_rigid_bodies",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_lod",
    "MSFT_packing_normalRoughnessMetallic",
    "MSFT_packing_occlusionRoughnessMetallic",
];

/// What makes a channel move more than a node's place and weights.
const POINTER: &str = "KHR_animation_pointer";

/// Loads a `.gltf` or `.glb` file.
///
/// # Errors
/// [`SceneError`] names the file, the element and the defect.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let bytes = file::read_file(path, &mut Budget::of_process()).map_err(|fault| fault.of(path, "file"))?;
    read(path, &bytes, options)
}

/// Loads a file that is in memory already; `name` stands for it in messages.
pub(crate) fn load_bytes(bytes: &[u8], name: &str, options: &LoadOptions) -> Result<Scene, SceneError> {
    read(Path::new(name), bytes, options)
}

fn read(path: &Path, bytes: &[u8], options: &LoadOptions) -> Result<Scene, SceneError> {
    let (files, mended) = (&Files::of(path, options)?, &Mended::new(options));
    let budget = &RefCell::new(Budget::of_process());
    let binary =
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb")) || bytes.starts_with(b"glTF");
    let (text, chunk) = if binary {
        let chunks = container::split(path, bytes, mended)?;
        (chunks.json, chunks.binary)
    } else {
        narrow(bytes).map_err(|problem| SceneError::new(path, "file", problem))?;
        (bytes, None)
    };
    let short = |shortage| SceneError::short(path, "JSON", shortage);
    budget.borrow_mut().take(parsed_size(text)).map_err(short)?;
    let (mut value, animations) = tidy::parse(path, text, mended, options.motion)?;
    let root = &typed(path, &value)?;
    let nodes = match value.get_mut("nodes").map(json::Value::take) {
        Some(json::Value::Array(nodes)) => nodes,
        _ => Vec::new(),
    };
    drop(value);
    let buffers = &buffers(path, files, root, binary.then_some(chunk), mended, budget)?;
    let parents = &parents(path, root)?;
    let quantized = root.extensions_used.iter().any(|name| name == "KHR_mesh_quantization");
    let read = &vec![Cell::new(false); root.accessors.len()];
    let nodes = &nodes;
    let file = path;
    let (clips, unplayed) = Default::default();
    let mut context = Context {
        file,
        files,
        mended,
        root,
        nodes,
        parents,
        buffers,
        read,
        quantized,
        clips,
        unplayed,
        budget,
    };
    if options.motion {
        context.clips = Arc::new(context.clips(&animations)?);
    }
    context.scene(options, animations.len())
}

/// Bytes that an object of JSON takes once it is typed and of the scene: a material's, the largest.
const OBJECT: u64 = 2048;

/// Bytes that JSON takes once it is parsed and typed, or a little more.
fn parsed_size(text: &[u8]) -> u64 {
    let values = text.iter().filter(|byte| b",:[{".contains(byte)).count();
    let objects = text.iter().filter(|&&byte| byte == b'{').count();
    2 * text.len() as u64 + values as u64 * 3 * size_of::<json::Value>() as u64 + objects as u64 * OBJECT
}

/// Types the JSON and checks all indices in it.
fn typed(path: &Path, value: &json::Value) -> Result<json::Root, SceneError> {
    // Files of other versions can't be typed.
    if let Some(version) = value.pointer("/asset/version").and_then(json::Value::as_str) {
        check_version(path, version, value.pointer("/asset/minVersion").and_then(json::Value::as_str))?;
    }
    let root: json::Root = json::Root::deserialize(value).map_err(|error| {
        SceneError::new(path, untyped_element(value), file::shortened(&error.to_string()))
    })?;
    check_extensions(path, &root)?;
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
            || at.ends_with("attributes[\"POSITION\"].min")
            || at.ends_with("attributes[\"POSITION\"].max")
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
            // The crate has names of its own for a few.
            let at = at.replace("khrLightsPunctual", "KHR_lights_punctual");
            first = Some(SceneError::new(path, at, problem));
        }
    });
    first.map_or(Ok(root), Err)
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

fn check_version(path: &Path, version: &str, minimum: Option<&str>) -> Result<(), SceneError> {
    if version.starts_with("2.") && minimum.is_none_or(|version| version == "2.0") {
        return Ok(());
    }
    let wanted = file::shortened(minimum.unwrap_or(version));
    Err(SceneError::new(path, "asset.version", format!("glTF {wanted}, expected 2.0")))
}

fn check_extensions(path: &Path, root: &json::Root) -> Result<(), SceneError> {
    let unknown: Vec<&str> = root
        .extensions_required
        .iter()
        .map(String::as_str)
        .filter(|name| !SUPPORTED_EXTENSIONS.contains(name) && !INVISIBLE_EXTENSIONS.contains(name))
        .collect();
    if unknown.is_empty() {
        return Ok(());
    }
    Err(SceneError::new(path, "extensionsRequired", format!("not supported: {}", unknown.join(", "))))
}

/// Data of all buffers; the first of a .glb file may be its `chunk`.
fn buffers<'a>(
    path: &Path,
    files: &Files,
    root: &json::Root,
    chunk: Option<Option<&'a [u8]>>,
    mended: &Mended,
    budget: &RefCell<Budget>,
) -> Result<Vec<Buffer<'a>>, SceneError> {
    let read = |(i, buffer): (usize, &json::Buffer)| match (&buffer.uri, chunk) {
        (Some(uri), _) => match container::fetch(files, uri, budget) {
            Ok(fetched) => {
                if let Some(name) = fetched.differs {
                    let problem = format!("`{}` is not there, but `{name}` is", file::shortened(uri));
                    let defect = SceneError::new(path, format!("buffers[{i}]"), problem);
                    mended.mend(path, defect, container::OTHER_CASE)?;
                }
                Ok(Buffer::Data(Cow::Owned(fetched.bytes)))
            }
            Err(Fault::Broken(problem)) => Ok(Buffer::Lost(problem)),
            Err(short) => Err(short.of(path, format!("buffers[{i}]"))),
        },
        (None, Some(Some(chunk))) if i == 0 => Ok(Buffer::Data(Cow::Borrowed(chunk))),
        (None, Some(None)) if i == 0 => Ok(Buffer::Lost("has no uri, and there is no binary chunk".into())),
        _ => Ok(Buffer::Nowhere),
    };
    root.buffers.iter().enumerate().map(read).collect()
}

/// The parent of each node. They form trees: no node has two parents or is its own ancestor.
fn parents(path: &Path, root: &json::Root) -> Result<Vec<Option<usize>>, SceneError> {
    let fail = |element: String, problem: String| Err(SceneError::new(path, element, problem));
    let nodes = &root.nodes;
    let mut parents = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in node.children.iter().flatten() {
            if let Some(other) = parents[child.value()].replace(i) {
                let problem = format!("is a child of nodes[{other}] and again of nodes[{i}]");
                return fail(format!("nodes[{child}]"), problem);
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
            return fail(format!("nodes[{node}]"), "is its own ancestor: the hierarchy is cyclic".into());
        }
    }
    let mut listed = vec![usize::MAX; nodes.len()];
    for (i, scene) in root.scenes.iter().enumerate() {
        for node in &scene.nodes {
            if parents[node.value()].is_some() || std::mem::replace(&mut listed[node.value()], i) == i {
                let problem = format!("nodes[{node}] is not a root node, or is listed twice");
                return fail(format!("scenes[{i}]"), problem);
            }
        }
    }
    Ok(parents)
}

/// What is read of nodes.
struct Read {
    scene: Scene,
    /// Of its instances.
    transforms: Vec<DAffine3>,
    /// How far from the origin nodes are that lead to them (m).
    detour: f64,
    /// What moves it, if anything does.
    rig: Rig,
    tally: geometry::Tally,
    /// Lights with a range.
    ranged: usize,
}

impl Context<'_> {
    /// What is broken, but not needed by the scene; `all` of it, not only what is looked at in passing.
    fn unneeded_defects(&self, all: bool) -> Vec<SceneError> {
        let mut defects = Vec::new();
        for (i, (buffer, data)) in self.root.buffers.iter().zip(self.buffers).enumerate() {
            let problem = match data {
                Buffer::Data(data) if (data.len() as u64) < buffer.byte_length.0 => {
                    accessor::too_short(data, buffer.byte_length.0)
                }
                Buffer::Lost(problem) => problem.clone(),
                _ => continue,
            };
            defects.push(self.error(format!("buffers[{i}]"), problem));
        }
        // Views of such buffers would be told again.
        let whole = defects.is_empty();
        let mut check = |checked: Result<(), SceneError>| defects.extend(checked.err());
        // Without a URI a buffer is there for an extension; what reads it all the same fails then.
        if whole && !self.buffers.iter().any(|buffer| matches!(buffer, Buffer::Nowhere)) {
            (0..self.root.buffer_views.len()).for_each(|view| check(self.check_view(view)));
            let unread = (0..self.read.len()).filter(|&accessor| !self.read[accessor].get());
            unread.for_each(|accessor| check(self.elements(accessor).map(drop)));
            let mut shown = vec![!all; self.root.meshes.len()];
            for mesh in self.root.nodes.iter().filter_map(|node| node.mesh) {
                shown[mesh.value()] = true;
            }
            for mesh in (0..shown.len()).filter(|&mesh| !shown[mesh]) {
                let budget = *self.budget.borrow();
                check(self.mesh(mesh, &Pose::default(), &mut geometry::Tally::default()).map(drop));
                self.budget.replace(budget);
            }
        }
        defects
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

    fn scene(&self, options: &LoadOptions, animations: usize) -> Result<Scene, SceneError> {
        let (roots, element) = self.roots(options)?;
        let budget = *self.budget.borrow();
        self.foresee(&roots)?;
        self.budget.replace(budget);
        let mut read = self.placed_parts(&roots, None)?;
        if let Some(around) = Around::of(&read.scene, &read.transforms, read.detour) {
            drop(read);
            self.budget.replace(budget);
            read = self.placed_parts(&roots, Some(&around))?;
        }
        let Read { mut scene, rig, tally, ranged, .. } = read;
        self.materials(&mut scene)?;
        let empty = scene.meshes.iter().all(|mesh| mesh.triangles.is_empty());
        for defect in self.unneeded_defects(empty || options.strict) {
            // Where there is nothing to see, it may be why.
            if empty {
                return Err(defect);
            }
            self.mended.mend(self.file, defect, tidy::UNNEEDED)?;
        }
        self.note(&mut scene, &tally, animations, ranged, options.motion);
        scene.notes.extend(self.mended.notes());
        if self.clips.is_empty() || empty {
            return import::finish(scene, self.file, &element);
        }
        let rig = Rig { glow: self.glow(&scene), ..rig };
        let motion = Rigged::new(self.file.to_owned(), element, Arc::clone(&self.clips), scene, rig);
        let mut scene = motion.at_rest()?;
        scene.motion = Some(Arc::new(motion));
        Ok(scene)
    }

    /// Emissive factor and strength of each material.
    fn glow(&self, scene: &Scene) -> Vec<(Vec3, f32)> {
        let factors = self.root.materials.iter().map(material::glow);
        factors.chain([(Vec3::ZERO, 1.0)]).take(scene.materials.len()).collect()
    }

    /// Adds nodes, light sources and views, as they are at rest.
    fn complete(&self, rig: &mut Rig, around: Option<&Around>) -> Result<(), SceneError> {
        for (i, node) in self.root.nodes.iter().enumerate() {
            let mesh = node.mesh.map(|mesh| mesh.value());
            let own = mesh.and_then(|mesh| self.root.meshes[mesh].weights.as_deref());
            let weights = node.weights.as_deref().filter(|w| !w.is_empty()).or(own).unwrap_or_default();
            rig.nodes.push(Node {
                parent: self.parents[i].map(|parent| parent as u32),
                // The scene is without those that are broken.
                local: self.local(i, around.is_some()).unwrap_or(Local::Matrix(DAffine3::IDENTITY)),
                weights: weights.iter().map(|&weight| f64::from(weight)).collect(),
                visible: !self.is_hidden(i),
            });
        }
        let sources: &[khr_lights_punctual::Light] = self.root.as_ref();
        for (light, source) in self.lights()?.iter().zip(sources) {
            let (color, intensity) = (Vec3::from(source.color), source.intensity);
            rig.sources.push(Source { kind: light.kind, color, intensity });
        }
        rig.views = (0..self.root.cameras.len()).map(|i| self.view(i)).collect::<Result<_, _>>()?;
        rig.around = around.cloned();
        Ok(())
    }

    /// Takes the memory that all meshes shown need at the least, before the first is read.
    fn foresee(&self, roots: &[usize]) -> Result<(), SceneError> {
        let mut meshes = HashSet::new();
        let mut tally = geometry::Tally::default();
        let mut stack: Vec<usize> = roots.to_vec();
        while let Some(i) = stack.pop() {
            if self.is_never_shown(i) {
                continue;
            }
            let node = &self.root.nodes[i];
            stack.extend(node.children.iter().flatten().map(|child| child.value()));
            let Some(mesh) = node.mesh.map(|mesh| mesh.value()) else { continue };
            // Each skin, and each pose, has vertices of its own.
            let weights = node.weights.iter().flatten().map(|w| w.to_bits()).collect::<Vec<_>>();
            if meshes.insert((mesh, weights, node.skin.map(|_| i))) {
                self.foresee_mesh(mesh, node.skin.is_some(), &mut tally)?;
            }
        }
        Ok(())
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
        let mut worlds = self.worlds(around.is_some());
        let mut transforms = Vec::new();
        let moving = !self.clips.is_empty();
        let mut rig = Rig::default();
        let (mut ranged, mut triangles) = (0, 0_usize);
        let sources: &[khr_lights_punctual::Light] = self.root.as_ref();
        let mut detour = 0.0_f64;
        let animated = self.animated_nodes();
        let mut stack: Vec<(usize, DAffine3, f64, bool)> =
            roots.iter().rev().map(|&i| (i, DAffine3::IDENTITY, 0.0, false)).collect();
        while let Some((i, parent, way, carried)) = stack.pop() {
            let node = &self.root.nodes[i];
            if self.is_never_shown(i) {
                continue;
            }
            let world = parent * self.local_transform(i, around.is_some())?;
            let way = way.max(world.translation.length());
            let carried = carried || animated.contains(&(i as u32));
            let children = node.children.iter().flatten().rev();
            stack.extend(children.map(|child| (child.value(), world, way, carried)));
            if let Some(source) = node.mesh.map(|mesh| mesh.value()) {
                let weights = node.weights.as_deref().filter(|w| !w.is_empty());
                let skin = match node.skin {
                    Some(skin) => self.skin(skin.value(), world, &mut worlds)?,
                    None => None,
                };
                let slot = scene.meshes.len();
                let origin = || around.map_or(DVec3::ZERO, |around| around.meshes[slot]);
                let morphs = self.moves(Target::Node(i as u32, NodeProperty::Weights));
                let pose = |skin| Pose { weights, origin: origin(), skin, every_target: morphs };
                let reshaped = moving && (morphs || skin.is_some());
                let mesh = match &skin {
                    skin if reshaped => {
                        let pose = pose(skin.as_ref());
                        let mut shape = self.shape(source, &pose, &mut tally)?;
                        scene.meshes.push(self.posed(source, shape.clone(), &pose)?.into());
                        // The posed mesh has these.
                        (shape.base.uv0, shape.base.uv1, shape.base.colors) = Default::default();
                        let skin = skin.as_ref().map(|skin| Arc::clone(&skin.source));
                        let shape = Arc::new(shape);
                        rig.shapes.push(Shaped { mesh: slot as u32, node: i as u32, skin, shape });
                        slot
                    }
                    Some(skin) => {
                        scene.meshes.push(self.mesh(source, &pose(Some(skin)), &mut tally)?.into());
                        slot
                    }
                    None => {
                        let key = (source, weights.map(|w| w.iter().map(|w| w.to_bits()).collect()));
                        match meshes.get(&key) {
                            Some(&mesh) => mesh as usize,
                            None => {
                                scene.meshes.push(self.mesh(source, &pose(None), &mut tally)?.into());
                                meshes.insert(key, slot as u32);
                                slot
                            }
                        }
                    }
                };
                let name = node.name.clone().unwrap_or_else(|| scene.meshes[mesh].name.clone());
                let within = match &skin {
                    Some(_) => vec![Within::World],
                    None => self.places(i)?,
                };
                let whole = scene.meshes[mesh].triangles.len().saturating_mul(within.len());
                triangles = triangles.saturating_add(whole);
                if triangles > MAX_TRIANGLES {
                    let problem = format!("more than {MAX_TRIANGLES} triangles up to here");
                    return Err(self.error(format!("nodes[{i}]"), problem));
                }
                let bytes = size_of::<(Instance, DAffine3)>() + name.len();
                let taken = self.take::<u8>(within.len().saturating_mul(bytes));
                taken.map_err(|shortage| self.fault(format!("nodes[{i}]"), shortage))?;
                for within in within {
                    let place = within.at(world);
                    let placement = around.map_or(place, |around| around.placement(mesh, &place));
                    let transform = self.world_f32(i, placement)?;
                    // Whether what changes shape is built anew with all the rest is settled later.
                    let moves = carried && !reshaped;
                    scene.instances.push(Instance {
                        name: name.clone(),
                        mesh: mesh as u32,
                        transform,
                        moves,
                    });
                    transforms.push(placement);
                    if moving {
                        rig.instances.push(Placed { node: i as u32, within });
                    }
                }
                detour = detour.max(skin.map_or(way, |skin| skin.reach()));
            }
            let world = DAffine3 { translation: world.translation - scene.origin, ..world };
            if let Some(camera) = node.camera {
                scene.cameras.push(self.camera(i, camera.value(), world)?);
                rig.cameras.push((i as u32, camera.value() as u32));
            }
            let light = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
            if let Some(index) = light.map(|light| light.light.value()) {
                let (light, source) = (&lights[index], &sources[index]);
                rig.lights.push((i as u32, index as u32));
                ranged += usize::from(light.kind != LightKind::Directional && source.range.is_some());
                scene.lights.push(self.placed(i, light, world)?);
            }
        }
        if moving {
            self.complete(&mut rig, around)?;
        }
        Ok(Read { scene, transforms, detour, rig, tally, ranged })
    }

    /// What an extension says of a node that the crate does not type.
    fn node_extension(&self, node: usize, name: &str) -> Option<&json::Value> {
        self.root.nodes[node].extensions.as_ref()?.others.get(name)
    }

    /// Whether `KHR_node_visibility` hides a node and all below it.
    fn is_hidden(&self, node: usize) -> bool {
        let extension = self.node_extension(node, "KHR_node_visibility");
        extension.is_some_and(|extension| extension["visible"] == json::Value::Bool(false))
    }

    /// Whether it is hidden and stays so.
    fn is_never_shown(&self, node: usize) -> bool {
        self.is_hidden(node) && !self.moves(Target::Node(node as u32, NodeProperty::Visible))
    }

    /// Where a node's mesh is in the node: there, or as often as `EXT_mesh_gpu_instancing` has it.
    fn places(&self, node: usize) -> Result<Vec<Within>, SceneError> {
        let name = "EXT_mesh_gpu_instancing";
        let Some(extension) = self.node_extension(node, name) else { return Ok(vec![Within::Node]) };
        let element = format!("nodes[{node}].extensions.{name}");
        let attribute = |name: &str, shape: Type| {
            let Some(index) = extension.pointer(&format!("/attributes/{name}")) else { return Ok(None) };
            let index = index.as_u64().filter(|&index| index < self.root.accessors.len() as u64);
            let index = index.ok_or_else(|| {
                self.error(
                    format!("{element}.attributes.{name}"),
                    "its accessor is not there: index out of range",
                )
            })?;
            let elements = self.elements(index as usize)?;
            let floats = elements.component == ComponentType::F32;
            let small = elements.normalized
                && shape == Type::Vec4
                && matches!(elements.component, ComponentType::I8 | ComponentType::I16);
            if elements.shape == shape && (floats || small) {
                return Ok(Some(elements));
            }
            Err(self.error(&element, format!("accessors[{index}] can't be {name}")))
        };
        let translations = attribute("TRANSLATION", Type::Vec3)?;
        let rotations = attribute("ROTATION", Type::Vec4)?;
        let scales = attribute("SCALE", Type::Vec3)?;
        let mut counts = [&translations, &rotations, &scales].into_iter().flatten().map(|e| e.count);
        // Other attributes are an application's.
        let Some(count) = counts.next() else { return Ok(vec![Within::Node]) };
        if counts.any(|other| other != count) {
            return Err(self.error(element, "its attributes differ in length"));
        }
        let short = |shortage| self.fault(&element, shortage);
        self.take::<Within>(count).map_err(short)?;
        let translations = translations.as_ref().map(|e| e.floats::<3>(0..count)).transpose()?;
        let rotations = rotations.as_ref().map(|e| e.floats::<4>(0..count)).transpose()?;
        let scales = scales.as_ref().map(|e| e.floats::<3>(0..count)).transpose()?;
        let place = |i: usize| {
            let translation = translations.as_ref().map_or([0.0; 3], |all| all[i]);
            let scale = scales.as_ref().map_or([1.0; 3], |all| all[i]);
            let rotation = rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |all| all[i]);
            let rotation = DQuat::from_array(rotation.map(f64::from));
            if rotation.length() == 0.0 {
                return Err(self.error(&element, format!("rotation {i} is not a unit quaternion")));
            }
            let [scale, translation] = [scale, translation].map(|v| DVec3::from(v.map(f64::from)));
            let rotation = rotation.normalize();
            Ok(Within::Place(DAffine3::from_scale_rotation_translation(scale, rotation, translation)))
        };
        (0..count).map(place).collect()
    }

    /// All materials in file order, with textures where a triangle uses them.
    fn materials(&self, scene: &mut Scene) -> Result<(), SceneError> {
        let count = self.root.materials.len();
        let mut used = vec![false; count + 1];
        for &material in scene.meshes.iter().flat_map(|mesh| &mesh.materials) {
            used[material as usize] = true;
        }
        for (i, used) in used[..count].iter().enumerate() {
            let material = match self.material(i) {
                Err(defect) if !used => {
                    self.mended.mend(self.file, defect, tidy::UNNEEDED)?;
                    Material::default()
                }
                material => material?,
            };
            scene.materials.push(material);
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
        scene.images = textures.images.into_iter().map(Arc::new).collect();
        if textures.far_sets > 0 {
            scene
                .notes
                .push(format!("{} textures use coordinate sets above 1 and are left out", textures.far_sets));
        }
        let mut without = 0;
        for mesh in scene.meshes.iter_mut().map(Arc::make_mut) {
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

    fn note(
        &self,
        scene: &mut Scene,
        tally: &geometry::Tally,
        animations: usize,
        ranged: usize,
        played: bool,
    ) {
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
        note(
            tally.morphed > 0 && self.clips.is_empty(),
            format!("{} morphed meshes are shown with their default weights", tally.morphed),
        );
        note(tally.flat > 0, format!("{} triangles whose corners are one point are left out", tally.flat));
        if let Some(first) = self.unplayed.borrow().first() {
            let count = self.unplayed.borrow().len();
            note(
                true,
                format!("{count} channels of animations move what stays at rest here, such as {first}"),
            );
        }
        note(animations > 0 && !played, format!("{animations} animations are left out"));
        let unknown: Vec<&str> = self
            .root
            .extensions_used
            .iter()
            .map(String::as_str)
            .filter(|&name| !(SUPPORTED_EXTENSIONS.contains(&name) || played && name == POINTER))
            .collect();
        note(!unknown.is_empty(), format!("extensions left out: {}", unknown.join(", ")));
    }

    /// Transform of a node in its parent; 64 bits keep deep chains exact enough.
    pub(super) fn local_transform(&self, index: usize, exact: bool) -> Result<DAffine3, SceneError> {
        Ok(self.local(index, exact)?.transform())
    }

    /// Where a node is in its parent. Its numbers are those of the file, to 32 bits or, if `exact`, to 64.
    fn local(&self, index: usize, exact: bool) -> Result<Local, SceneError> {
        let node = &self.root.nodes[index];
        let fail = |problem: &str| Err(self.error(format!("nodes[{index}]"), problem));
        if let Some(matrix) = node.matrix {
            if node.translation.is_some() || node.rotation.is_some() || node.scale.is_some() {
                return fail("has both a matrix and translation, rotation or scale");
            }
            if !matrix.iter().all(|e| e.is_finite()) {
                return fail("its matrix is not finite");
            }
            self.check_last_row(&format!("nodes[{index}]"), &matrix)?;
            let matrix = self.node_numbers(index, "matrix", exact, matrix);
            return Ok(Local::Matrix(DAffine3::from_mat4(DMat4::from_cols_array(&matrix))));
        }
        let translation = node.translation.unwrap_or_default();
        let translation = DVec3::from(self.node_numbers(index, "translation", exact, translation));
        let rotation = node.rotation.unwrap_or_default().0;
        let rotation = DQuat::from_array(self.node_numbers(index, "rotation", exact, rotation));
        let scale = DVec3::from(self.node_numbers(index, "scale", exact, node.scale.unwrap_or([1.0; 3])));
        if !(translation.is_finite() && rotation.is_finite() && scale.is_finite()) {
            return fail("its translation, rotation or scale is not finite");
        }
        let length = rotation.length();
        if length == 0.0 {
            return fail("its rotation is not a unit quaternion");
        }
        if (length - 1.0).abs() > 1e-2 {
            let problem = format!("its rotation is not a unit quaternion but {length} long");
            self.mend(format!("nodes[{index}]"), problem, "it is normalised")?;
        }
        Ok(Local::Parts { translation, rotation, scale })
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
        let rigid = motion::seeing(&world).ok_or_else(|| {
            self.error(format!("nodes[{node}]"), "its camera has no direction: the transform is singular")
        })?;
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
                    self.cone(i, spot.inner_cone_angle, spot.outer_cone_angle)?
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

    /// The cone of light `index`. Angles that rounding has put beside their range are brought into it.
    fn cone(&self, index: usize, inner: f32, outer: f32) -> Result<LightKind, SceneError> {
        /// As a share of the angle.
        const HAIR: f32 = 1e-3;
        let wide = outer > FRAC_PI_2 && outer <= FRAC_PI_2 * (1.0 + HAIR);
        let narrow = inner >= outer && inner <= outer * (1.0 + HAIR);
        let negative = (-HAIR..0.0).contains(&inner);
        if wide || narrow || negative {
            let problem = format!("its cone angles are {inner} and {outer}");
            let element = format!("extensions.KHR_lights_punctual.lights[{index}].spot");
            self.mend(element, problem, "the inner one is a little smaller, and neither is out of range")?;
        }
        let outer = if wide { FRAC_PI_2 } else { outer };
        let inner = if narrow { outer * (1.0 - HAIR) } else { inner };
        Ok(LightKind::Spot { inner: if negative { 0.0 } else { inner }, outer })
    }

    fn placed(&self, node: usize, light: &Light, world: DAffine3) -> Result<Light, SceneError> {
        self.world_f32(node, DAffine3::from_translation(world.translation))?;
        let placed = motion::shining(light, &world).ok_or_else(|| {
            self.error(format!("nodes[{node}]"), "its light has no direction: the transform is singular")
        })?;
        let name = self.root.nodes[node].name.clone();
        let placed = Light { name: name.unwrap_or(placed.name), ..placed };
        placed.check().map_err(|problem| self.error(format!("nodes[{node}]"), problem))?;
        Ok(placed)
    }
}
