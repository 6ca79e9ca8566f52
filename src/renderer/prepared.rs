//! A scene on a device: shading data, the structures rays are traced in, and what the scene needs of a pipeline. Cheap to
//! clone and to edit: an edit replaces what it changes and shares the rest.

use super::drawing::modelling;
use super::error::Error;
use crate::accel::boxes::BoxOptions;
use crate::accel::{Arrangement, Geometry, Structure, StructureReport};
use crate::config::RenderConfig;
use crate::gpu_scene::GpuScene;
use crate::scene::{Feature, Light, Scene, SceneProfile};
use crate::shaders::SceneData;
use crate::techniques::Kernels;
use crate::techniques::indirect::Visibility;
use crate::vk::{self, Backend};
use glam::DVec3;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A scene on a device. Renderers share it by `Arc`.
#[derive(Debug)]
pub struct Prepared {
    scene: Arc<Scene>,
    resident: Arc<Resident>,
    /// By mirror roughness, its bits.
    profiles: Mutex<Vec<(u32, SceneProfile)>>,
    area: f32,
    /// Where kernels' coordinates begin, in the file's and in those of `scene` (m).
    origin: DVec3,
    offset: DVec3,
    revision: u64,
    backend: Backend,
    arrangement: Arrangement,
    reason: String,
    device: vk::Device,
}

/// What runs in flight use of a scene, and keep.
#[derive(Clone, Debug)]
pub(super) struct Resident {
    pub(super) structure: Structure,
    gpu: GpuScene,
}

/// What an edit makes worthless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Invalidated {
    /// Pictures drawn before, and what a progressive one has come to.
    pub pictures: bool,
    /// The pipelines: the scene needs others than before.
    pub pipelines: bool,
    /// The structures that rays are traced in.
    pub structures: bool,
}

impl Clone for Prepared {
    fn clone(&self) -> Self {
        Self {
            scene: Arc::clone(&self.scene),
            resident: Arc::clone(&self.resident),
            profiles: Mutex::new(self.profiles.lock().unwrap_or_else(PoisonError::into_inner).clone()),
            area: self.area,
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
        scene: Scene,
        backend: Backend,
        reason: String,
        arrangement: Arrangement,
    ) -> Result<Self, Error> {
        let near = scene.near_origin();
        let geometry = Geometry::of(&near)?;
        let gpu = GpuScene::upload(device, &near, &geometry)?;
        let structure = Structure::build(device, backend, &geometry, arrangement)?;
        Ok(Self {
            area: near.area() as f32,
            origin: near.origin,
            offset: near.origin - scene.origin,
            scene: Arc::new(scene),
            resident: Arc::new(Resident { structure, gpu }),
            profiles: Mutex::default(),
            revision: next_revision(),
            backend,
            arrangement,
            reason,
            device: device.clone(),
        })
    }

    /// Another scene in its place, on the same device and backend.
    ///
    /// # Errors
    /// An invalid scene, too much geometry for the device, or too little memory.
    pub(super) fn of_scene(&self, scene: Scene) -> Result<Self, Error> {
        scene.validate()?;
        Self::new(&self.device, scene, self.backend, self.reason.clone(), self.arrangement)
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

    /// Replaces the lights; geometry, materials and structures stay as they are, and so does all else where this fails.
    ///
    /// # Errors
    /// A light with NaN, infinite or negative values, or too little memory.
    pub fn set_lights(&mut self, lights: Vec<Light>) -> Result<Invalidated, Error> {
        Scene::validate_lights(&lights)?;
        let mut gpu = self.resident.gpu.clone();
        let near: Vec<_> = lights.iter().map(|light| light.moved(-self.offset)).collect();
        gpu.set_lights(&self.device, &near)?;
        let mut pipelines = false;
        for (_, profile) in self.profiles.get_mut().unwrap_or_else(PoisonError::into_inner) {
            let before = profile.clone();
            profile.set_lights(&lights);
            pipelines |= *profile != before;
        }
        self.resident = Arc::new(Resident { structure: self.resident.structure.clone(), gpu });
        Arc::make_mut(&mut self.scene).lights = lights;
        self.revision = next_revision();
        Ok(Invalidated { pictures: true, pipelines, structures: false })
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
        let mut structure = self.resident.structure.clone();
        let geometry = Geometry::of(&self.scene.near_origin())?;
        if config.indirect.visibility == Visibility::BoxesInline && !structure.is_whole() {
            structure.rebuild_whole(&self.device, &geometry)?;
        }
        if let Some(options) = boxes(config).filter(|options| !structure.has_boxes(options)) {
            structure.build_boxes(&self.device, &geometry, &options)?;
        }
        let pipelines = structure.traversal() != self.resident.structure.traversal();
        self.resident = Arc::new(Resident { structure, gpu: self.resident.gpu.clone() });
        Ok(Invalidated { pictures: false, pipelines, structures: true })
    }

    pub(super) fn resident(&self) -> &Arc<Resident> {
        &self.resident
    }
}

impl Resident {
    /// What kernels know of the scene, camera and frame still to be filled in.
    pub(super) fn data(&self) -> SceneData {
        let mut data = self.gpu.data;
        self.structure.describe(&mut data);
        data
    }

    /// Whether anything that has a size shines.
    pub(super) fn area_lights(&self) -> bool {
        self.gpu.area_lights()
    }
}

/// Boxes that a frame's imperfect visibility needs.
fn boxes(config: &RenderConfig) -> Option<BoxOptions> {
    config.indirect.boxes().map(|options| BoxOptions { panes: !config.panes, ..options })
}

fn next_revision() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}
