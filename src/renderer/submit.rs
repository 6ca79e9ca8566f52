//! Graphs on a prepared scene: each is handed to the device with a uniform buffer of its own, so that several can be under
//! way.

use super::edit::Invalidated;
use super::error::Error;
use super::prepared::Prepared;
use super::resident::Resident;
use super::window::Window;
use crate::config::{LightChoice, RenderConfig};
use crate::gpu_scene::MOST_ASKED_LIGHTS;
use crate::graph::{Executor, Graph, PassTime, Run, RunOptions};
use crate::sampling::pixel_offset;
use crate::scene::{Camera, Light, Scene, View};
use crate::shaders::{self, COUNTER_LANES, RAY_COUNTERS};
use crate::vk::{self, MemoryKind, SceneSet};
use glam::Vec2;
use std::collections::HashMap;
use std::ops::Deref;
use std::sync::Arc;

/// Draws a scene on a device: the scene prepared for it, and the caches that frames share.
///
/// What can be asked of [`Prepared`] can be asked of it.
#[derive(Debug)]
pub struct Renderer {
    pub(super) executor: Executor,
    /// One for each run under way at a time, and the parts of the scene that it names.
    slots: Vec<(Arc<SceneSet>, Arc<Resident>)>,
    prepared: Arc<Prepared>,
    /// The last free path, and of what: measuring it is a run of its own.
    pub(super) free_path: Option<(u64, RenderConfig, Camera, Option<f32>)>,
}

impl Deref for Renderer {
    type Target = Prepared;

    fn deref(&self) -> &Prepared {
        &self.prepared
    }
}

impl Renderer {
    /// Another renderer of a prepared scene; both see their own edits only.
    ///
    /// # Errors
    /// What the driver says.
    pub fn of(prepared: Arc<Prepared>) -> Result<Self, Error> {
        let executor = Executor::new(prepared.device(), prepared.backend().0)?;
        Ok(Self { executor, slots: Vec::new(), prepared, free_path: None })
    }

    /// The scene as it is on the device.
    #[must_use]
    pub fn prepared(&self) -> &Arc<Prepared> {
        &self.prepared
    }

    /// Changes the scene. What has changed decides what is redone:
    ///
    /// | edit | shading data that is uploaded | structures | pipelines |
    /// |---|---|---|---|
    /// | cameras, names | none | stay | stay |
    /// | lights | lights, and what they are chosen by | stay | stay unless what there is of them changes |
    /// | materials | materials; where emission changes, tables of emissive triangles | stay | stay unless what there is of them changes |
    /// | [`Instance::transform`](crate::scene::Instance::transform) where it [is to move](crate::scene::Instance::moves) | a record an instance; where what moves emits, tables of emissive triangles | the level over placements alone; boxes for imperfect visibility all; all, where there is one level, as `boxes-inline` needs | stay unless there are panes, or the level is deeper than before |
    /// | [`Scene::deformations`] of the same meshes | a record an instance; vertices are made on the device | the level over placements, and what is below it of these meshes; all, where there is one level; boxes all | as for placements |
    /// | what rays are blocked by (of materials `alpha_mode`, and whether they pass light and are panes), other instances, meshes, images or environment, a scene that leaves the origin far behind | all | all | stay where they serve |
    ///
    /// Meshes, images and the environment are the same as before where their `Arc` is. [`Invalidated`] says what was redone. Where
    /// this fails nothing changes.
    ///
    /// ```no_run
    /// # fn turn(renderer: &mut parhelion::renderer::Renderer) -> Result<(), parhelion::renderer::Error> {
    /// let invalidated = renderer.edit(|scene| scene.lights[0].position.x += 0.1)?;
    /// assert_eq!(invalidated.structures, parhelion::renderer::Redone::Nothing);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A scene that is invalid now, too much geometry for the device, or too little memory.
    pub fn edit(&mut self, change: impl FnOnce(&mut Scene)) -> Result<Invalidated, Error> {
        let mut scene = self.scene().clone();
        change(&mut scene);
        self.set_scene(scene)
    }

    /// Replaces the scene, such as by another [pose](crate::scene::Scene::pose), and redoes what differs, as [`edit`](Self::edit)
    /// does.
    ///
    /// # Errors
    /// As for [`edit`](Self::edit).
    pub fn set_scene(&mut self, scene: Scene) -> Result<Invalidated, Error> {
        Arc::make_mut(&mut self.prepared).set_scene(scene)
    }

    /// What bringing meshes into shape took, since this was last asked; what other renderers share is theirs.
    pub(super) fn take_made(&mut self) -> Vec<PassTime> {
        Arc::get_mut(&mut self.prepared).map(Prepared::take_made).unwrap_or_default()
    }

    /// Replaces the lights alone.
    ///
    /// # Errors
    /// A light with NaN, infinite or negative values, or too little memory.
    pub fn set_lights(&mut self, lights: Vec<Light>) -> Result<Invalidated, Error> {
        self.edit(|scene| scene.lights = lights)
    }

    /// Builds the structures that a frame traces rays in, unless they are there.
    pub(super) fn serve(&mut self, config: &RenderConfig) -> Result<(), Error> {
        if self.prepared.serves(config) {
            return Ok(());
        }
        Arc::make_mut(&mut self.prepared).serve(config).map(drop)
    }

    /// Runs a graph of the caller's own on the scene, seen by `camera` at the size, window and seed of `config`.
    ///
    /// # Errors
    /// A graph declared wrongly, or the device's failure.
    pub fn run(&mut self, graph: Graph, config: &RenderConfig, camera: &Camera) -> Result<Run, Error> {
        config.validate()?;
        self.serve(config)?;
        let scene = self.set(config, camera, pixel_offset(0, 1), None)?;
        Ok(self.executor.run(graph, &RunOptions { scene: Some(&scene), ..RunOptions::default() })?)
    }

    /// The scene as kernels of a run see it. No run under way has the same.
    pub(super) fn set(
        &mut self,
        config: &RenderConfig,
        camera: &Camera,
        pixel_offset: Vec2,
        counters: Option<&Arc<vk::Buffer>>,
    ) -> Result<Arc<SceneSet>, Error> {
        let resident = Arc::clone(self.prepared.resident());
        let (area_lights, samples) = (resident.area_lights(), config.whitted.light_samples);
        let mut known = resident.data();
        if config.light_choice == LightChoice::Power {
            known.light_nodes = 0;
        }
        let sampled = known.light_nodes != 0 && known.light_count > MOST_ASKED_LIGHTS;
        let lobes =
            config.indirect.glossy && self.prepared.profile(config.whitted.mirror_roughness).rough_lobes;
        let data = shaders::SceneData {
            camera: camera_data(&camera.moved(-self.prepared.offset()), config.size),
            full_size: config.size,
            window_origin: Window::of(config).traced_origin,
            pixel_offset: pixel_offset.to_array(),
            ray_counters: counters.map_or(0, |counters| counters.address()),
            seed: config.seed,
            vpl_share: config.indirect.behind_mirrors(),
            specular_depth: config.whitted.specular_depth,
            mirror_roughness: config.whitted.mirror_roughness,
            pane_roughness: (config.method.pane_roughness)(config),
            energy_conserving: config.energy_conserving.into(),
            asked_lights: if sampled { 0 } else { known.light_count },
            light_samples: if area_lights || sampled { samples } else { 0 },
            lobe_samples: if area_lights && lobes { samples } else { 0 },
            ..known
        };
        if let Some(counters) = counters {
            let mut set = self.new_set(&resident, &data)?;
            set.keep(Arc::clone(counters) as _);
            return Ok(Arc::new(set));
        }
        self.slots.retain_mut(|(set, of)| Arc::ptr_eq(of, &resident) || Arc::get_mut(set).is_none());
        let free = self.slots.iter_mut().find_map(|(set, of)| {
            let free = Arc::get_mut(set).filter(|_| Arc::ptr_eq(of, &resident)).is_some();
            free.then_some(set)
        });
        if let Some(set) = free {
            write(Arc::get_mut(set).expect("nobody else has it"), &data);
            return Ok(Arc::clone(set));
        }
        let set = Arc::new(self.new_set(&resident, &data)?);
        self.slots.push((Arc::clone(&set), resident));
        Ok(set)
    }

    fn new_set(&self, resident: &Arc<Resident>, data: &shaders::SceneData) -> Result<SceneSet, Error> {
        let device = self.prepared.device();
        let uniform = device.buffer("scene", size_of::<shaders::SceneData>() as u64, MemoryKind::Upload)?;
        let structure = &resident.structure;
        let mut set = device.scene_set(self.prepared.backend().0, uniform, structure.top_level())?;
        if let Some(top) = structure.box_top_level() {
            set.set_boxes(top);
        }
        set.keep(Arc::clone(resident) as _);
        write(&mut set, data);
        Ok(set)
    }

    /// Cells that rays are counted in, all zero.
    pub(super) fn counters(&self) -> Result<Arc<vk::Buffer>, Error> {
        let zeros = vec![0; RAY_COUNTERS.len() * COUNTER_LANES as usize * 8];
        Ok(Arc::new(self.prepared.device().upload("ray_counters", &zeros)?))
    }

    /// Rays by pass.
    pub(super) fn rays(&self, counters: &vk::Buffer) -> Result<HashMap<&'static str, u64>, Error> {
        let bytes = self.prepared.device().download(counters)?;
        let lanes = bytes.chunks_exact(8 * COUNTER_LANES as usize);
        let count = |cell: &[u8]| u64::from_le_bytes(std::array::from_fn(|i| cell[i]));
        let sums = lanes.map(|lanes| lanes.chunks_exact(8).map(count).sum());
        Ok(RAY_COUNTERS.into_iter().zip(sums).collect())
    }
}

fn write(set: &mut SceneSet, data: &shaders::SceneData) {
    let bytes = bytemuck::bytes_of(data);
    if let Some(mapped) = set.uniform_mut() {
        mapped[..bytes.len()].copy_from_slice(bytes);
    }
}

fn camera_data(camera: &Camera, size: [u32; 2]) -> shaders::Camera {
    let aspect = size[0] as f32 / size[1] as f32;
    let (half_height, orthographic) = match camera.view {
        View::Perspective { yfov } => ((0.5 * yfov).tan(), 0),
        View::Orthographic { ymag } => (ymag, 1),
    };
    let axes = camera.transform.matrix3;
    shaders::Camera {
        eye: camera.transform.translation.to_array(),
        orthographic,
        right: (axes.x_axis * (half_height * aspect)).to_array(),
        up: (axes.y_axis * half_height).to_array(),
        forward: (-axes.z_axis).to_array(),
    }
}
