//! A scene on a device: shading data, the structures rays are traced in, and what the scene needs of a pipeline. Cheap to
//! clone and to edit: an edit replaces what it changes and shares the rest.

use super::deform::{Deformed, Deformer};
use super::drawing::modelling;
use super::edit::{Difference, Invalidated, Movable, Redone, emits};
use super::error::Error;
use super::resident::Resident;
use crate::accel::boxes::BoxOptions;
use crate::accel::{Arrangement, Geometry, Levels, Structure, StructureReport, levels};
use crate::config::RenderConfig;
use crate::gpu_scene::GpuScene;
use crate::graph::PassTime;
use crate::scene::{Borders, Feature, Instance, Scene, SceneProfile};
use crate::techniques::Kernels;
use crate::techniques::indirect::Visibility;
use crate::vk::{self, Backend};
use glam::DVec3;
use std::borrow::Cow;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A scene on a device. Renderers share it by `Arc`.
#[derive(Debug)]
pub struct Prepared {
    scene: Arc<Scene>,
    resident: Arc<Resident>,
    /// By mirror roughness, its bits.
    profiles: Mutex<Vec<(u32, SceneProfile)>>,
    /// Of what stays, once something has moved beside panes.
    borders: Option<Borders>,
    area: f32,
    /// Where something is to move.
    movable: Option<Movable>,
    /// Where meshes are brought into shape on the device, and what that took last.
    deformer: Option<Deformer>,
    made: Vec<PassTime>,
    /// Where kernels' coordinates begin, in the file's and in those of `scene` (m).
    origin: DVec3,
    offset: DVec3,
    revision: u64,
    backend: Backend,
    arrangement: Arrangement,
    reason: String,
    device: vk::Device,
}

impl Clone for Prepared {
    fn clone(&self) -> Self {
        Self {
            scene: Arc::clone(&self.scene),
            resident: Arc::clone(&self.resident),
            profiles: Mutex::new(self.profiles.lock().unwrap_or_else(PoisonError::into_inner).clone()),
            borders: self.borders.clone(),
            area: self.area,
            movable: self.movable.clone(),
            deformer: self.deformer.clone(),
            made: self.made.clone(),
            origin: self.origin,
            offset: self.offset,
            revision: self.revision,
            backend: self.backend,
            arrangement: self.arrangement,
            reason: self.reason.clone(),
            device: self.device.clone(),
        }
    }
}

impl Prepared {
    /// Uploads a valid scene and builds the one structure that `backend` needs; `reason` says why that backend.
    ///
    /// # Errors
    /// Too much geometry for the device, or too little memory.
    pub(super) fn new(
        device: &vk::Device,
        scene: Arc<Scene>,
        backend: Backend,
        reason: String,
        arrangement: Arrangement,
    ) -> Result<Self, Error> {
        let mut shaped = Cow::Borrowed(&*scene);
        if arrangement.levels == Levels::One && backend == Backend::Software || !is_deformable(&scene) {
            shaped = scene.shaped()?;
        }
        let mut near = shaped.near_origin();
        let mut geometry = Geometry::of(&near)?;
        if !near.deformations.is_empty() && !Deformer::fits(device, &geometry) {
            shaped = scene.shaped()?;
            near = shaped.near_origin();
            geometry = Geometry::of(&near)?;
        }
        let gpu = GpuScene::upload(device, &near, &geometry)?;
        let structure = Structure::build(device, backend, &geometry, arrangement)?;
        let mut resident = Resident { structure, gpu };
        let mut deformer = Deformer::new(device, &near, &geometry, &resident, arrangement.rebuild)?;
        let mut made = Vec::new();
        if let Some(of_rest) = &deformer {
            let deformed = of_rest.deform(device, &near, &resident)?;
            Deformed { resident, deformer, passes: made } = deformed;
            if let Some(moved) = resident.structure.moved(device, &geometry)? {
                resident.structure = moved;
            }
        }
        // What was taken to another origin is taken there again.
        let stays = matches!(near, Cow::Borrowed(_));
        let movable = (stays && geometry.moves()).then(|| Movable::of(&near, geometry));
        Ok(Self {
            deformer,
            made,
            area: movable.as_ref().map_or_else(|| near.area() as f32, Movable::area),
            movable,
            origin: near.origin,
            offset: near.origin - scene.origin,
            scene: Arc::clone(&scene),
            resident: Arc::new(resident),
            profiles: Mutex::default(),
            borders: None,
            revision: next_revision(),
            backend,
            arrangement,
            reason,
            device: device.clone(),
        })
    }

    /// Puts another scene in its place, of which it redoes what differs: see [`Renderer::edit`](super::Renderer::edit).
    ///
    /// # Errors
    /// An invalid scene, too much geometry for the device, or too little memory. Then all stays as it was.
    pub fn set_scene(&mut self, scene: Scene) -> Result<Invalidated, Error> {
        let scene = Arc::new(scene);
        let difference = Difference::between(&self.scene, &scene);
        if let Some(invalidated) = self.set_parts(&scene, difference)? {
            return Ok(invalidated);
        }
        scene.validate()?;
        let new = Self::new(&self.device, scene, self.backend, self.reason.clone(), self.arrangement)?;
        let traversal = |prepared: &Self| prepared.resident.structure.traversal();
        let known = std::mem::take(self.profiles.get_mut().unwrap_or_else(PoisonError::into_inner));
        let other = |(roughness, profile): &(u32, SceneProfile)| {
            !new.profile(f32::from_bits(*roughness)).is_served_by(profile)
        };
        let pipelines = known.iter().any(other) || traversal(self) != traversal(&new);
        *self = new;
        let bytes = self.resident.gpu.bytes();
        Ok(Invalidated { pictures: true, pipelines, structures: Redone::All, bytes })
    }

    /// Redoes what differs; does nothing where that is all.
    fn set_parts(
        &mut self,
        scene: &Arc<Scene>,
        difference: Difference,
    ) -> Result<Option<Invalidated>, Error> {
        if difference.rest {
            return Ok(None);
        }
        if difference.lights {
            Scene::validate_lights(&scene.lights)?;
        }
        if difference.materials {
            scene.validate_materials()?;
        }
        if difference.cameras {
            scene.validate_cameras()?;
        }
        let mut movable = self.movable.take();
        let redone = self.redo(scene, difference, movable.as_mut());
        let moves = difference.places || difference.shapes;
        if !matches!(redone, Ok(Some(_))) && moves {
            movable.iter_mut().for_each(|movable| movable.place(&self.scene));
        }
        self.movable = movable;
        let Some(Deformed { resident, deformer, passes }) = redone? else { return Ok(None) };
        let structures = match (difference.shapes, difference.places) {
            (true, _) => Redone::Shapes,
            (false, true) => Redone::Top,
            (false, false) => Redone::Nothing,
        };
        let bytes = resident.gpu.bytes_beside(&self.resident.gpu);
        let traversal = |resident: &Resident| resident.structure.traversal();
        let mut pipelines = traversal(&resident) != traversal(&self.resident);
        if difference.materials {
            self.borders = None;
        }
        for (roughness, profile) in self.profiles.get_mut().unwrap_or_else(PoisonError::into_inner) {
            let mut renewed = profile.clone();
            if difference.materials {
                renewed = SceneProfile::of(scene, f32::from_bits(*roughness));
            } else if moves && profile.panes {
                let borders = self.borders.get_or_insert_with(|| Borders::of(scene));
                renewed.set_places(scene, borders);
            } else if difference.lights {
                renewed.set_lights(&scene.lights);
            }
            pipelines |= !renewed.is_served_by(profile);
            *profile = renewed;
        }
        let pictures = Difference { cameras: false, ..difference } != Difference::default();
        if moves {
            self.area = self.movable.as_ref().map_or(self.area, Movable::area);
        }
        if pictures {
            self.revision = next_revision();
        }
        self.resident = Arc::new(resident);
        self.deformer = deformer;
        if difference.shapes {
            self.made = passes;
        }
        self.scene = Arc::clone(scene);
        Ok(Some(Invalidated { pictures, pipelines, structures, bytes }))
    }

    /// What is resident of `scene`; none where all is to be redone.
    fn redo(
        &self,
        scene: &Scene,
        difference: Difference,
        mut movable: Option<&mut Movable>,
    ) -> Result<Option<Deformed>, Error> {
        let Difference { lights, materials, emission, places, shapes, .. } = difference;
        let Resident { mut structure, mut gpu } = Resident::clone(&self.resident);
        let (mut deformer, mut passes) = (self.deformer.clone(), Vec::new());
        let (mut shine, mut lit) = (emission, lights || materials);
        if places || shapes {
            let Some(movable) = &mut movable else { return Ok(None) };
            movable.place(scene);
            let bounds = movable.bounds();
            scene.validate_places(movable.places(scene), bounds.unwrap_or_default())?;
            if !movable.is_near_origin(scene) {
                return Ok(None);
            }
            if shapes {
                let Some(shaper) = &self.deformer else { return Ok(None) };
                let deformed = shaper.deform(&self.device, scene, &self.resident)?;
                (Resident { structure, gpu }, deformer) = (deformed.resident, deformed.deformer);
                passes = deformed.passes;
            }
            let Some(moved) = structure.moved(&self.device, &movable.geometry)? else { return Ok(None) };
            structure = moved;
            let radius = gpu.data.scene_radius;
            gpu.place(&self.device, bounds, &movable.geometry, movable.ray_epsilon())?;
            lit |= radius != gpu.data.scene_radius;
            let mut pairs = self.scene.instances.iter().zip(&scene.instances);
            shine |= pairs.any(|(old, new)| old.transform != new.transform && emits(scene, new));
        }
        if materials {
            gpu.set_materials(&self.device, scene)?;
        }
        if shine {
            match movable {
                Some(movable) => gpu.shine(&self.device, scene, &movable.geometry)?,
                None => {
                    let near = scene.near_origin();
                    gpu.shine(&self.device, &near, &Geometry::of(&near)?)?;
                }
            }
        }
        if lit || shine {
            let near: Vec<_> = scene.lights.iter().map(|light| light.moved(-self.offset)).collect();
            gpu.set_lights(&self.device, &near)?;
        }
        Ok(Some(Deformed { resident: Resident { structure, gpu }, deformer, passes }))
    }

    /// The scene as it is now.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The backend in use, and why.
    #[must_use]
    pub fn backend(&self) -> (Backend, &str) {
        (self.backend, &self.reason)
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> &vk::Device {
        &self.device
    }

    /// What was built to trace rays in.
    #[must_use]
    pub fn structures(&self) -> &[StructureReport] {
        self.resident.structure.reports()
    }

    /// Bytes of the scene's shading data on the device.
    #[must_use]
    pub fn scene_bytes(&self) -> u64 {
        self.resident.gpu.bytes()
    }

    /// The scene's surface (m²).
    #[must_use]
    pub fn area(&self) -> f32 {
        self.area
    }

    /// What bringing meshes into shape took, since this was last asked.
    pub(super) fn take_made(&mut self) -> Vec<PassTime> {
        std::mem::take(&mut self.made)
    }

    /// Where kernels' coordinates begin, in the file's (m): 0 unless the scene [is far from there](Scene::near_origin).
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Where kernels' coordinates begin, in the scene's (m).
    pub(super) fn offset(&self) -> DVec3 {
        self.offset
    }

    /// Changes whenever an edit [invalidates pictures](Invalidated::pictures); no two scenes have the same.
    #[must_use]
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// What the scene needs of a pipeline; specular lobes of at most `mirror_roughness` (0 … 1) are mirrors. Read off the
    /// scene once and renewed by edits.
    #[must_use]
    pub fn profile(&self, mirror_roughness: f32) -> SceneProfile {
        let mut profiles = self.profiles.lock().unwrap_or_else(PoisonError::into_inner);
        let key = mirror_roughness.to_bits();
        if let Some((_, profile)) = profiles.iter().find(|(known, _)| *known == key) {
            return profile.clone();
        }
        let profile = SceneProfile::of(&self.scene, mirror_roughness);
        // Charts may try any number of values.
        profiles.truncate(7);
        profiles.insert(0, (key, profile.clone()));
        profile
    }

    /// The techniques' kernels, specialised to the scene.
    #[must_use]
    pub fn kernels(&self, mirror_roughness: f32) -> Kernels {
        Kernels::new(&self.profile(mirror_roughness), self.resident.structure.traversal())
    }

    /// The specialization constants that describe the scene.
    #[cfg(feature = "compile")]
    pub(crate) fn scene_spec(&self) -> crate::shaders::SceneSpec {
        let roughness = crate::techniques::whitted::WhittedConfig::default().mirror_roughness;
        // A kernel may outlive the lights and the threshold it was compiled with.
        crate::shaders::SceneSpec {
            mirrors: true,
            glass: true,
            panes: true,
            sheer: true,
            volumes: true,
            spot_lights: true,
            directional_lights: true,
            ..*self.kernels(roughness).scene_spec()
        }
    }

    /// Features that a frame with this configuration leaves out because the scene has none of them. With all of them in
    /// [`FrameRequest::modelled`](super::FrameRequest::modelled) it is drawn by a pipeline that is not specialised to
    /// the scene.
    #[must_use]
    pub fn unneeded(&self, config: &RenderConfig) -> Vec<Feature> {
        let kernels = self.kernels(config.whitted.mirror_roughness);
        let modelling = |features: &[Feature]| modelling(kernels.clone(), config, features);
        let specialised = modelling(&[]);
        let costs = |feature: &Feature| match (feature, self.backend) {
            (Feature::DeepStructure, Backend::RayQuery) => false,
            _ => !config.method.costless.contains(feature) && !modelling(&[*feature]).same_as(&specialised),
        };
        Feature::ALL.iter().copied().filter(costs).collect()
    }

    /// Whether the structures are those that a frame traces rays in.
    pub(super) fn serves(&self, config: &RenderConfig) -> bool {
        let structure = &self.resident.structure;
        let whole = config.indirect.visibility != Visibility::BoxesInline || structure.is_whole();
        whole && boxes(config).is_none_or(|options| structure.has_boxes(&options))
    }

    /// Builds the structures that a frame traces rays in, unless they are there.
    ///
    /// # Errors
    /// A backend that does not trace them, too much geometry, or too little memory.
    pub(super) fn serve(&mut self, config: &RenderConfig) -> Result<Invalidated, Error> {
        if config.indirect.visibility.software_only() && self.backend != Backend::Software {
            return Err(Error::SoftwareOnly { visibility: config.indirect.visibility.name() });
        }
        let whole = Arrangement { whole: true, levels: Levels::One, ..self.arrangement };
        let inline = config.indirect.visibility == Visibility::BoxesInline;
        if inline && self.deformer.is_some() {
            // One level is over triangles that the host has brought into shape.
            let (scene, reason) = (Arc::clone(&self.scene), self.reason.clone());
            let new = Self::new(&self.device, scene, self.backend, reason, whole)?;
            *self = Self { revision: self.revision, ..new };
        }
        let mut structure = self.resident.structure.clone();
        let shaped = self.scene.shaped()?;
        let geometry = Geometry::of(&shaped.near_origin())?;
        if inline && !structure.is_whole() {
            structure.rebuild_whole(&self.device, &geometry)?;
            self.arrangement = whole;
        }
        if let Some(options) = boxes(config).filter(|options| !structure.has_boxes(options)) {
            structure.build_boxes(&self.device, &geometry, &options)?;
        }
        let pipelines = structure.traversal() != self.resident.structure.traversal();
        self.resident = Arc::new(Resident { structure, gpu: self.resident.gpu.clone() });
        Ok(Invalidated { pictures: false, pipelines, structures: Redone::All, bytes: 0 })
    }

    pub(super) fn resident(&self) -> &Arc<Resident> {
        &self.resident
    }
}

/// Whether the device can bring the scene's meshes into shape.
fn is_deformable(scene: &Scene) -> bool {
    let deformed = |instance: &&Instance| scene.deformation(instance.mesh).is_some();
    let placeable = |instance: &Instance| levels::is_placeable(&instance.transform);
    !scene.deformations.is_empty()
        && scene.instances.iter().filter(deformed).all(placeable)
        && scene.bounds().is_none_or(|bounds| scene.is_surely_near_origin(bounds))
}

/// Boxes that a frame's imperfect visibility needs.
fn boxes(config: &RenderConfig) -> Option<BoxOptions> {
    config.indirect.boxes().map(|options| BoxOptions { panes: !config.panes, ..options })
}

fn next_revision() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}
