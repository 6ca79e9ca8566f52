//! Scenes in time: nodes, skins, morph targets and clips that move them. A pose is a scene of its own, made from the parts as
//! they were read: the instances, shapes, lights, cameras and materials that there are at a time.

mod reach;
pub(super) mod rig;

use super::clip::{
    CameraProperty, Channel, Clip, LightProperty, MaterialProperty, NodeProperty, Target, together,
};
use super::deformation::Deformation;
use super::import::{self, Settled};
use super::limits::{MAX_COORDINATE, MAX_FACTOR, MAX_IOR, MAX_RADIANCE, MIN_EXTENT};
use super::mesh::is_small;
use super::origin::{self, Around};
use super::shape::Shape;
use super::{AlphaMode, Camera, Light, LightKind, Material, Motion, Scene, SceneError, View, slab};
use glam::{DAffine3, DMat3, DVec3, Vec3, Vec4};
use reach::Reach;
use rig::{Local, Node, Skin, Worlds};
use std::f32::consts::{FRAC_PI_2, PI};
use std::path::PathBuf;
use std::sync::Arc;

/// The parts of a scene, and the rig that they follow.
#[derive(Debug)]
pub(super) struct Rigged {
    pub(super) file: PathBuf,
    /// The scene's in the file.
    pub(super) element: String,
    pub(super) clips: Arc<Vec<Clip>>,
    /// Everything there may be, at rest, before a load's last steps but for those that are [settled](Self::settle).
    parts: Scene,
    rig: Rig,
    settled: Settled,
    /// One a shape; none of what a device cannot bring into shape.
    reaches: Vec<Option<Reach>>,
}

/// What the parts of a scene follow.
#[derive(Debug, Default)]
pub(super) struct Rig {
    pub(super) nodes: Vec<Node>,
    /// One an instance.
    pub(super) instances: Vec<Placed>,
    pub(super) shapes: Vec<Shaped>,
    /// Node and light source, one a light.
    pub(super) lights: Vec<(u32, u32)>,
    pub(super) sources: Vec<Source>,
    /// Node and view, one a camera.
    pub(super) cameras: Vec<(u32, u32)>,
    pub(super) views: Vec<View>,
    /// Emissive factor and strength, one a material.
    pub(super) glow: Vec<(Vec3, f32)>,
    /// Where positions are relative to others than the file's.
    pub(super) around: Option<Around>,
}

/// An instance's place.
#[derive(Debug)]
pub(super) struct Placed {
    pub(super) node: u32,
    pub(super) within: Within,
}

/// Where in its node an instance is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Within {
    /// A skin brings its mesh to the world.
    World,
    /// At the node itself.
    Node,
    Place(DAffine3),
}

impl Within {
    pub(super) fn at(&self, node: DAffine3) -> DAffine3 {
        match self {
            Self::World => DAffine3::IDENTITY,
            Self::Node => node,
            Self::Place(place) => node * *place,
        }
    }
}

/// A mesh that changes shape.
#[derive(Debug)]
pub(super) struct Shaped {
    pub(super) mesh: u32,
    pub(super) node: u32,
    pub(super) skin: Option<Arc<Skin>>,
    pub(super) shape: Arc<Shape>,
}

/// A light source before it is placed.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) kind: LightKind,
    pub(super) color: Vec3,
    pub(super) intensity: f32,
}

/// What channels change.
struct State {
    nodes: Vec<Node>,
    sources: Vec<Source>,
    views: Vec<View>,
    glow: Vec<(Vec3, f32)>,
}

impl Motion for Rigged {
    fn clips(&self) -> &[Clip] {
        &self.clips
    }

    fn pose(&self, scene: &Scene, clips: &[usize], time: f64, lazily: bool) -> Result<Scene, SceneError> {
        let mut pose = self.posed(clips, time, lazily)?;
        if self.parts.cameras.is_empty() {
            pose.cameras.clone_from(&scene.cameras);
        }
        pose.lights.extend(scene.lights.iter().skip(self.parts.lights.len()).cloned());
        pose.environment.clone_from(&scene.environment);
        pose.name.clone_from(&scene.name);
        pose.notes.clear();
        Ok(pose)
    }
}

impl Rigged {
    pub(super) fn new(file: PathBuf, element: String, clips: Arc<Vec<Clip>>, parts: Scene, rig: Rig) -> Self {
        let settled = Settled::default();
        let mut rigged = Self { file, element, clips, parts, rig, settled, reaches: Vec::new() };
        rigged.settle();
        rigged
    }

    /// Does what of a load's last steps no pose changes, and finds what a device can bring into shape.
    fn settle(&mut self) {
        let (parts, rig) = (&mut self.parts, &self.rig);
        let animated: Vec<u32> = self
            .clips
            .iter()
            .flat_map(|clip| &clip.channels)
            .filter_map(|channel| match channel.target {
                Target::Material(material, _) => Some(material),
                _ => None,
            })
            .collect();
        let mut shaped = vec![false; parts.meshes.len()];
        rig.shapes.iter().for_each(|shape| shaped[shape.mesh as usize] = true);
        let may_be_slab: Vec<bool> = parts.materials.iter().map(slab::may_be_slab).collect();
        let glass =
            |mesh: u32| parts.meshes[mesh as usize].materials.iter().any(|&m| may_be_slab[m as usize]);
        let mut moved = parts.instances.iter().filter(|i| i.moves || shaped[i.mesh as usize]);
        // A slab that stays and whose glass stays the same is a pane in every pose.
        let panes = rig.around.is_none()
            && !animated.iter().any(|&material| may_be_slab[material as usize])
            && !moved.any(|instance| glass(instance.mesh));
        // Where the air in a slab is looked for, so is what has changed shape.
        let lazy = panes || !may_be_slab.contains(&true);
        let reach = |of: &Shaped| Reach::of(of.mesh, &of.shape, parts).filter(|_| lazy);
        self.reaches = rig.shapes.iter().map(reach).collect();
        let mut stays: Vec<bool> = shaped.iter().map(|shaped| !shaped).collect();
        for (of, _) in rig.shapes.iter().zip(&self.reaches).filter(|(_, reach)| reach.is_some()) {
            stays[of.mesh as usize] = true;
        }
        for instance in &mut parts.instances {
            let mesh = instance.mesh as usize;
            instance.moves |= shaped[mesh] && stays[mesh];
        }
        self.settled = Settled::of(parts, |mesh| stays.get(mesh) != Some(&false), panes);
    }

    /// The scene at rest.
    pub(super) fn at_rest(&self) -> Result<Scene, SceneError> {
        let mut scene = self.posed(&[], 0.0, false)?;
        if self.parts.cameras.is_empty() {
            scene.cameras = vec![Scene::framing(self.bounds())];
            scene.notes.push(import::FRAMED.into());
        }
        Ok(scene)
    }

    /// Smallest and largest coordinates (m) of what clips that go together show at several times.
    fn bounds(&self) -> Option<(Vec3, Vec3)> {
        const TIMES: usize = 16;
        let clips = together(&self.clips);
        let end = clips.iter().map(|&clip| self.clips[clip].end()).fold(0.0, f64::max);
        let posed = |i| self.posed(&clips, end * i as f64 / TIMES as f64, false).ok()?.bounds();
        let all = (0..=TIMES).filter_map(posed);
        all.reduce(|(low, high), (a, b)| (low.min(a), high.max(b)))
    }

    /// At a time of some clips; without any it is at rest. If `lazily`, meshes that a device can bring into shape are left as
    /// they are at rest.
    fn posed(&self, clips: &[usize], time: f64, lazily: bool) -> Result<Scene, SceneError> {
        let rig = &self.rig;
        let mut scene = self.parts.clone();
        let mut state = State {
            nodes: rig.nodes.clone(),
            sources: rig.sources.clone(),
            views: rig.views.clone(),
            glow: rig.glow.clone(),
        };
        for channel in clips.iter().flat_map(|&clip| &self.clips[clip].channels) {
            state.apply(channel, time, &mut scene.materials);
        }
        for (material, (factor, strength)) in scene.materials.iter_mut().zip(&state.glow) {
            material.emission = (*factor * *strength).clamp(Vec3::ZERO, Vec3::splat(MAX_RADIANCE));
        }
        let worlds = Worlds::of(&state.nodes);
        let fail = |node: u32, problem: &str| SceneError::new(&self.file, format!("nodes[{node}]"), problem);

        for (instance, placed) in scene.instances.iter_mut().zip(&rig.instances) {
            let world = placed.within.at(worlds.at(placed.node));
            let around = rig.around.as_ref();
            let place = around.map_or(world, |around| around.placement(instance.mesh as usize, &world));
            instance.transform = origin::rounded(&place);
            if !instance.transform.is_finite() {
                return Err(fail(placed.node, "its transform in the world is too large"));
            }
        }
        for (shaped, reach) in rig.shapes.iter().zip(&self.reaches) {
            let joints = match &shaped.skin {
                Some(skin) => {
                    let world = |joint| Ok::<_, SceneError>(worlds.at(joint));
                    skin.transforms(world, worlds.at(shaped.node))?
                }
                None => Vec::new(),
            };
            let weights: Vec<f32> =
                state.nodes[shaped.node as usize].weights.iter().map(|&weight| weight as f32).collect();
            let origin =
                rig.around.as_ref().map_or(DVec3::ZERO, |around| around.meshes[shaped.mesh as usize]);
            let deformation =
                Deformation::new(shaped.mesh, Arc::clone(&shaped.shape), weights, joints, origin);
            if let Some(reach) = reach.as_ref().filter(|_| lazily)
                && let Some(deformation) = reach.bounded(&deformation, &scene)
            {
                scene.deformations.push(deformation);
                continue;
            }
            let rest = &mut scene.meshes[shaped.mesh as usize];
            let mut mesh = deformation.posed(rest).map_err(|vertex| {
                fail(shaped.node, &format!("vertex {vertex} of its mesh's pose is not finite"))
            })?;
            mesh.generate_tangents(&scene.materials);
            *rest = mesh.into();
        }
        // What is scaled to nothing is as good as hidden.
        let nothing: Vec<bool> = scene
            .meshes
            .iter()
            .map(|mesh| self.settled.bounds(mesh).or_else(|| mesh.ends()).is_none_or(|ends| is_small(&ends)))
            .collect();
        let mut shown = rig.instances.iter().map(|placed| worlds.shows(placed.node));
        scene.instances.retain(|instance| {
            let scale =
                instance.transform.matrix3.to_cols_array().into_iter().fold(0.0, |a, e: f32| e.abs().max(a));
            shown.next() == Some(true) && scale > MIN_EXTENT && !nothing[instance.mesh as usize]
        });

        for (light, &(node, source)) in scene.lights.iter_mut().zip(&rig.lights) {
            let source = &state.sources[source as usize];
            let world = worlds.at(node);
            let world = DAffine3 { translation: world.translation - scene.origin, ..world };
            let placed = source.light(&light.name);
            let lit = shining(&placed, &world).filter(|light| worlds.shows(node) && light.check().is_ok());
            // The number of lights stays, whichever are there.
            *light = lit.unwrap_or_else(|| Light { intensity: Vec3::ZERO, ..light.clone() });
        }
        for (camera, &(node, view)) in scene.cameras.iter_mut().zip(&rig.cameras) {
            let world = worlds.at(node);
            let world = DAffine3 { translation: world.translation - scene.origin, ..world };
            let seen = seeing(&world).map(|transform| Camera {
                transform: origin::rounded(&transform),
                view: state.views[view as usize],
                ..camera.clone()
            });
            // One that a transform leaves no direction keeps the one that it has at rest.
            if let Some(seen) = seen.filter(|camera| camera.check().is_ok()) {
                *camera = seen;
            }
        }
        import::finish_pose(scene, &self.settled, &self.file, &self.element)
    }
}

impl State {
    fn apply(&mut self, channel: &Channel, time: f64, materials: &mut [Material]) {
        let track = &channel.track;
        let one = || track.at(time)[0] as f32;
        let three = || {
            let value = track.at(time);
            DVec3::from_slice(&value)
        };
        match channel.target {
            Target::Node(node, property) => {
                let node = &mut self.nodes[node as usize];
                match (property, &mut node.local) {
                    (NodeProperty::Weights, _) => node.weights = track.at(time),
                    (NodeProperty::Visible, _) => node.visible = one() > 0.0,
                    (NodeProperty::Translation, Local::Parts { translation, .. }) => *translation = three(),
                    (NodeProperty::Rotation, Local::Parts { rotation, .. }) => {
                        *rotation = track.rotation_at(time)
                    }
                    (NodeProperty::Scale, Local::Parts { scale, .. }) => *scale = three(),
                    // The loader leaves such channels out.
                    (_, Local::Matrix(_)) => {}
                }
            }
            Target::Light(light, property) => {
                let source = &mut self.sources[light as usize];
                match (property, &mut source.kind) {
                    (LightProperty::Color, _) => source.color = three().as_vec3().max(Vec3::ZERO),
                    (LightProperty::Intensity, _) => source.intensity = one().max(0.0),
                    (LightProperty::InnerCone, LightKind::Spot { inner, .. }) => *inner = one(),
                    (LightProperty::OuterCone, LightKind::Spot { outer, .. }) => *outer = one(),
                    _ => {}
                }
            }
            Target::Camera(camera, property) => match (property, &mut self.views[camera as usize]) {
                (CameraProperty::Yfov, View::Perspective { yfov }) => *yfov = one().clamp(1e-3, PI - 1e-3),
                (CameraProperty::Ymag, View::Orthographic { ymag }) => {
                    *ymag = one().clamp(1e-6, MAX_COORDINATE);
                }
                _ => {}
            },
            Target::Material(material, property) => {
                let glow = &mut self.glow[material as usize];
                let of = &mut materials[material as usize];
                let share = || one().clamp(0.0, 1.0);
                match property {
                    MaterialProperty::BaseColor => {
                        let value = track.at(time);
                        let value = Vec4::from_array([0, 1, 2, 3].map(|i| value[i] as f32));
                        of.base_color = value.clamp(Vec4::ZERO, Vec4::ONE);
                    }
                    MaterialProperty::Metallic => of.metallic = share(),
                    MaterialProperty::Roughness => of.roughness = share(),
                    MaterialProperty::EmissiveFactor => glow.0 = three().as_vec3(),
                    MaterialProperty::EmissiveStrength => glow.1 = one(),
                    MaterialProperty::AlphaCutoff => {
                        if let AlphaMode::Mask { cutoff } = &mut of.alpha_mode {
                            *cutoff = one().max(0.0);
                        }
                    }
                    MaterialProperty::NormalScale => {
                        let map = of.normal_map.as_mut();
                        map.into_iter().for_each(|map| map.scale = one().clamp(-MAX_FACTOR, MAX_FACTOR));
                    }
                    MaterialProperty::Ior => of.ior = ior(one()),
                    MaterialProperty::Transmission => of.transmission = share(),
                    MaterialProperty::Specular => of.specular = share(),
                    MaterialProperty::SpecularColor => {
                        of.specular_color = three().as_vec3().clamp(Vec3::ZERO, Vec3::splat(MAX_FACTOR));
                    }
                    MaterialProperty::Clearcoat => of.clearcoat.get_or_insert_default().factor = share(),
                    MaterialProperty::ClearcoatRoughness => {
                        of.clearcoat.get_or_insert_default().roughness = share();
                    }
                    MaterialProperty::AttenuationDistance => {
                        let volume = of.volume.as_mut();
                        volume.into_iter().for_each(|volume| volume.attenuation_distance = one().max(1e-9));
                    }
                    MaterialProperty::AttenuationColor => {
                        let color = three().as_vec3().clamp(Vec3::ZERO, Vec3::ONE);
                        of.volume.as_mut().into_iter().for_each(|volume| volume.attenuation_color = color);
                    }
                }
            }
        }
    }
}

/// An index of refraction as glTF has it: 0 stands for an infinite one.
fn ior(value: f32) -> f32 {
    if value == 0.0 { MAX_IOR } else { value.clamp(1.0, MAX_IOR) }
}

impl Source {
    /// At the origin, along −Z. Angles between keys may pass each other.
    pub(super) fn light(&self, name: &str) -> Light {
        let kind = match self.kind {
            LightKind::Spot { inner, outer } => {
                let outer = outer.clamp(1e-3, FRAC_PI_2);
                let inner = if inner < outer { inner.max(0.0) } else { outer * 0.999 };
                LightKind::Spot { inner, outer }
            }
            kind => kind,
        };
        Light {
            name: name.to_owned(),
            kind,
            position: Vec3::ZERO,
            direction: Vec3::NEG_Z,
            intensity: self.color * self.intensity,
        }
    }
}

/// A light at the origin, along −Z, where `world` brings it; none if that leaves no direction.
pub(super) fn shining(light: &Light, world: &DAffine3) -> Option<Light> {
    let direction = (world.matrix3 * DVec3::NEG_Z).normalize_or_zero();
    let point = light.kind == LightKind::Point;
    (point || direction != DVec3::ZERO).then(|| Light {
        position: origin::rounded(&DAffine3::from_translation(world.translation)).translation.into(),
        direction: if direction == DVec3::ZERO { Vec3::NEG_Z } else { direction.as_vec3() },
        ..light.clone()
    })
}

/// Where a camera at the origin is that `world` moves, rigid: scales do not reach it; none if it is left no direction.
pub(super) fn seeing(world: &DAffine3) -> Option<DAffine3> {
    let backward = world.matrix3.z_axis.normalize_or_zero();
    let right = world.matrix3.x_axis.reject_from(backward).normalize_or_zero();
    (backward != DVec3::ZERO && right != DVec3::ZERO && world.is_finite()).then(|| {
        let axes = DMat3::from_cols(right, backward.cross(right), backward);
        DAffine3::from_mat3_translation(axes, world.translation)
    })
}
