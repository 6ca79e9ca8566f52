//! Animations: what their channels move, and the keys of it. A channel that can't be played is left out and noted.

use super::context::Context;
use crate::ErrorClass;
use crate::scene::clip::{
    CameraProperty, Channel, Clip, Interpolation, LightProperty, MaterialProperty, NodeProperty, Target,
    Track,
};
use crate::scene::{SceneError, file};
use ::gltf::json;
use ::gltf::json::accessor::{ComponentType, Type};
use serde_json::Value;
use std::collections::HashSet;

/// What is done about a channel that is broken.
const LEFT_OUT: &str = "what it moves is at rest";

/// What a pointer of `KHR_animation_pointer` may name behind `/nodes/N`, and so on.
const NODES: &[(&str, NodeProperty)] = &[
    ("translation", NodeProperty::Translation),
    ("rotation", NodeProperty::Rotation),
    ("scale", NodeProperty::Scale),
    ("weights", NodeProperty::Weights),
    ("extensions/KHR_node_visibility/visible", NodeProperty::Visible),
];
const LIGHTS: &[(&str, LightProperty)] = &[
    ("color", LightProperty::Color),
    ("intensity", LightProperty::Intensity),
    ("spot/innerConeAngle", LightProperty::InnerCone),
    ("spot/outerConeAngle", LightProperty::OuterCone),
];
const CAMERAS: &[(&str, CameraProperty)] =
    &[("perspective/yfov", CameraProperty::Yfov), ("orthographic/ymag", CameraProperty::Ymag)];
const MATERIALS: &[(&str, MaterialProperty)] = &[
    ("pbrMetallicRoughness/baseColorFactor", MaterialProperty::BaseColor),
    ("pbrMetallicRoughness/metallicFactor", MaterialProperty::Metallic),
    ("pbrMetallicRoughness/roughnessFactor", MaterialProperty::Roughness),
    ("emissiveFactor", MaterialProperty::EmissiveFactor),
    ("alphaCutoff", MaterialProperty::AlphaCutoff),
    ("normalTexture/scale", MaterialProperty::NormalScale),
    ("extensions/KHR_materials_emissive_strength/emissiveStrength", MaterialProperty::EmissiveStrength),
    ("extensions/KHR_materials_ior/ior", MaterialProperty::Ior),
    ("extensions/KHR_materials_transmission/transmissionFactor", MaterialProperty::Transmission),
    ("extensions/KHR_materials_specular/specularFactor", MaterialProperty::Specular),
    ("extensions/KHR_materials_specular/specularColorFactor", MaterialProperty::SpecularColor),
    ("extensions/KHR_materials_clearcoat/clearcoatFactor", MaterialProperty::Clearcoat),
    ("extensions/KHR_materials_clearcoat/clearcoatRoughnessFactor", MaterialProperty::ClearcoatRoughness),
    ("extensions/KHR_materials_volume/attenuationDistance", MaterialProperty::AttenuationDistance),
    ("extensions/KHR_materials_volume/attenuationColor", MaterialProperty::AttenuationColor),
];

/// What changes no picture here, or can't be moved yet, by what its pointer ends with.
const INVISIBLE: &[&str] =
    &["/znear", "/zfar", "/aspectRatio", "/xmag", "/range", "/occlusionTexture/strength", "/thicknessFactor"];
const UNMOVED: &[&str] = &["/offset", "/scale", "/rotation", "/weights"];

/// Why a channel is not played.
enum Unplayed {
    Broken(String),
    /// Too little memory.
    Short(SceneError),
}

impl From<String> for Unplayed {
    fn from(problem: String) -> Self {
        Self::Broken(problem)
    }
}

impl From<&str> for Unplayed {
    fn from(problem: &str) -> Self {
        Self::Broken(problem.to_owned())
    }
}

impl From<SceneError> for Unplayed {
    fn from(error: SceneError) -> Self {
        match error.class() {
            ErrorClass::Memory => Self::Short(error),
            _ => Self::Broken(format!("{}: {}", error.element, error.problem)),
        }
    }
}

/// What of this kind a pointer names.
fn find<T: Copy>(properties: &[(&str, T)], path: &str) -> Option<T> {
    properties.iter().find(|(name, _)| *name == path).map(|&(_, property)| property)
}

impl Context<'_> {
    /// All animations that move anything.
    pub(super) fn clips(&self, animations: &[Value]) -> Result<Vec<Clip>, SceneError> {
        let mut clips = Vec::new();
        for (i, animation) in animations.iter().enumerate() {
            let element = format!("animations[{i}]");
            let (mut channels, mut moved) = (Vec::new(), HashSet::new());
            for (j, source) in list(animation, "channels").iter().enumerate() {
                match self.channel(&element, animation, source) {
                    Ok(Some(channel)) if !moved.insert(channel.target) => {
                        let problem = "an earlier one moves the same";
                        self.mend(format!("{element}.channels[{j}]"), problem, "the earlier one does")?;
                    }
                    Ok(channel) => channels.extend(channel),
                    Err(Unplayed::Broken(problem)) => {
                        self.mend(format!("{element}.channels[{j}]"), problem, LEFT_OUT)?;
                    }
                    Err(Unplayed::Short(error)) => return Err(error),
                }
            }
            if !channels.is_empty() {
                let name = animation["name"].as_str().map_or_else(|| format!("animation {i}"), str::to_owned);
                clips.push(Clip { name, index: i, channels });
            }
        }
        Ok(clips)
    }

    /// None where a channel names nothing that moves, which the standard allows.
    fn channel(&self, element: &str, animation: &Value, source: &Value) -> Result<Option<Channel>, Unplayed> {
        let Some(target) = self.target(&source["target"])? else { return Ok(None) };
        let index = source["sampler"].as_u64().ok_or("it names no sampler")?;
        let sampler = list(animation, "samplers").get(index as usize);
        let sampler = sampler.ok_or_else(|| format!("{element}.samplers[{index}] is not there"))?;
        let interpolation = match sampler.get("interpolation").map(Value::as_str) {
            None | Some(Some("LINEAR")) => Interpolation::Linear,
            Some(Some("STEP")) => Interpolation::Step,
            Some(Some("CUBICSPLINE")) => Interpolation::CubicSpline,
            Some(other) => {
                let other = file::shortened(other.unwrap_or("no string"));
                return Err(format!("its interpolation is {other}").into());
            }
        };
        let (times, shape) = self.numbers(sampler, "input", false)?;
        if shape != Type::Scalar {
            return Err(format!("its times are {shape:?}").into());
        }
        let (values, shape) = self.numbers(sampler, "output", source["target"]["path"] == "pointer")?;
        let switch = matches!(target, Target::Node(_, NodeProperty::Visible));
        let interpolation = if switch { Interpolation::Step } else { interpolation };
        let mut track = Track::new(interpolation, times, values)?;
        match target.width() {
            Some(width) if track.width() != width => {
                Err(format!("its values are of {} numbers, expected {width}", track.width()).into())
            }
            Some(width) if shape.multiplicity() != width => Err(format!("its values are {shape:?}").into()),
            None if self.morphs_of(target) != Some(track.width()) => {
                let targets = self.morphs_of(target).unwrap_or(0);
                Err(format!(
                    "its values are of {} weights, and there are {targets} morph targets",
                    track.width()
                )
                .into())
            }
            _ => {
                if matches!(target, Target::Node(_, NodeProperty::Rotation)) {
                    let off = track.normalise().ok_or("a rotation is not a unit quaternion but 0 long")?;
                    if off > 0.0 {
                        let problem = format!("its rotations are off unit length by up to {off}");
                        self.mend(element, problem, "they are normalised")?;
                    }
                }
                Ok(Some(Channel { target, track }))
            }
        }
    }

    /// All numbers of the accessor that a sampler names, and their shape.
    fn numbers(&self, sampler: &Value, key: &str, pointed: bool) -> Result<(Vec<f32>, Type), Unplayed> {
        let index = sampler[key].as_u64().filter(|&index| index < self.root.accessors.len() as u64);
        let index = index.ok_or_else(|| format!("the accessor of its {key} is not there"))?;
        let elements = self.elements(index as usize)?;
        let integers = key == "output" && (elements.normalized || pointed);
        if elements.component != ComponentType::F32 && !integers {
            return Err(
                format!("accessors[{index}] can't be its {key}: it is of {:?}", elements.component).into()
            );
        }
        let all = 0..elements.count;
        // Twice for a moment; what is kept stays taken.
        let kept = self.take::<f32>(elements.count * elements.shape.multiplicity());
        kept.map_err(|shortage| self.fault(format!("accessors[{index}]"), shortage))?;
        let budget = *self.budget.borrow();
        let flat = match elements.shape {
            Type::Scalar => elements.floats::<1>(all).map(|values| values.concat()),
            Type::Vec2 => elements.floats::<2>(all).map(|values| values.concat()),
            Type::Vec3 => elements.floats::<3>(all).map(|values| values.concat()),
            Type::Vec4 => elements.floats::<4>(all).map(|values| values.concat()),
            shape => return Err(format!("accessors[{index}] can't be its {key}: it is {shape:?}").into()),
        };
        self.budget.replace(budget);
        Ok((flat?, elements.shape))
    }

    fn target(&self, target: &Value) -> Result<Option<Target>, Unplayed> {
        let path = target["path"].as_str().ok_or("it has no path")?;
        if path == "pointer" {
            let pointer = target.pointer("/extensions/KHR_animation_pointer/pointer").and_then(Value::as_str);
            return self.pointed(pointer.ok_or("it has no pointer")?);
        }
        let Some(node) = target.get("node") else { return Ok(None) };
        let node = node.as_u64().filter(|&node| node < self.root.nodes.len() as u64);
        let node = node.ok_or_else(|| format!("its node {} is not there", target["node"]))? as u32;
        let property = find(NODES, path).filter(|property| *property != NodeProperty::Visible);
        let property = property.ok_or_else(|| format!("its path is {}", file::shortened(path)))?;
        Ok(Some(self.of_node(node, property)?))
    }

    fn of_node(&self, node: u32, property: NodeProperty) -> Result<Target, String> {
        let placed =
            matches!(property, NodeProperty::Translation | NodeProperty::Rotation | NodeProperty::Scale);
        if placed && self.root.nodes[node as usize].matrix.is_some() {
            return Err(format!("nodes[{node}] has a matrix, which can't be moved"));
        }
        Ok(Target::Node(node, property))
    }

    /// What a JSON pointer names.
    fn pointed(&self, pointer: &str) -> Result<Option<Target>, Unplayed> {
        let ends = |known: &[&str]| known.iter().any(|end| pointer.ends_with(end));
        if ends(INVISIBLE) {
            return Ok(None);
        }
        let unknown = || format!("{} is none of what can be moved", file::shortened(pointer));
        let parts = |list: &str, count: usize| {
            let (index, path) = pointer.strip_prefix(list)?.split_once('/')?;
            let index = index.parse().ok().filter(|&index: &u32| (index as usize) < count)?;
            Some((index, path))
        };
        let root = self.root;
        let lights: &[json::extensions::scene::khr_lights_punctual::Light] = root.as_ref();
        if let Some((node, path)) = parts("/nodes/", root.nodes.len())
            && let Some(property) = find(NODES, path)
        {
            return Ok(Some(self.of_node(node, property)?));
        }
        if let Some((light, path)) = parts("/extensions/KHR_lights_punctual/lights/", lights.len()) {
            return Ok(Some(Target::Light(light, find(LIGHTS, path).ok_or_else(unknown)?)));
        }
        if let Some((camera, path)) = parts("/cameras/", root.cameras.len()) {
            return Ok(Some(Target::Camera(camera, find(CAMERAS, path).ok_or_else(unknown)?)));
        }
        if let Some((material, path)) = parts("/materials/", root.materials.len())
            && let Some(property) = find(MATERIALS, path)
        {
            return Ok(Some(Target::Material(material, property)));
        }
        // Weights one by one end with their number.
        if ends(UNMOVED) || pointer.contains("/weights/") {
            self.unplayed.borrow_mut().push(file::shortened(pointer));
            return Ok(None);
        }
        Err(unknown().into())
    }

    /// How many morph targets the mesh of a node has.
    fn morphs_of(&self, target: Target) -> Option<usize> {
        let Target::Node(node, _) = target else { return None };
        let mesh = self.root.nodes[node as usize].mesh?;
        let primitives = &self.root.meshes[mesh.value()].primitives;
        primitives.iter().find_map(|primitive| primitive.targets.as_ref().map(Vec::len))
    }

    /// Nodes that a clip places, shows or hides.
    pub(super) fn animated_nodes(&self) -> HashSet<u32> {
        let targets = self.clips.iter().flat_map(|clip| &clip.channels).map(|channel| channel.target);
        let node = |target| match target {
            Target::Node(_, NodeProperty::Weights) => None,
            Target::Node(node, _) => Some(node),
            _ => None,
        };
        targets.filter_map(node).collect()
    }

    /// Whether any animation does this.
    pub(super) fn moves(&self, target: Target) -> bool {
        self.clips.iter().flat_map(|clip| &clip.channels).any(|channel| channel.target == target)
    }
}

fn list<'a>(parent: &'a Value, key: &str) -> &'a [Value] {
    parent.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}
