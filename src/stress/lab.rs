//! Where scenes are rendered and measured.

use super::Options;
use crate::config::RenderConfig;
use crate::methods::{self, Aov};
use crate::renderer::{Error, FrameRequest, Layer, Renderer, RendererOptions};
use crate::scene::{Camera, Light, Scene};
use crate::techniques::path_trace::PixelFilter;
use crate::vk;
use std::collections::HashMap;

/// Samples a pixel of references.
const REFERENCE_SPP: u32 = 512;

/// Seed of references, which no picture is drawn with.
const REFERENCE_SEED: u32 = 0x5eed;

/// Which light is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Part {
    /// All of it.
    All,
    /// What diffuse surfaces reflect of light that others scattered.
    Indirect,
}

/// A scene by name.
#[derive(Clone, Copy)]
pub(super) struct Subject {
    /// Unlike that of any other subject of the same case.
    pub(super) name: &'static str,
    pub(super) make: fn() -> Scene,
}

/// What is changed for one picture of a subject.
#[derive(Clone, Debug, Default)]
pub(super) struct Shot {
    /// Unlike that of any other shot of the subject.
    pub(super) index: usize,
    /// In place of the scene's.
    pub(super) lights: Option<Vec<Light>>,
    /// In place of the scene's first.
    pub(super) camera: Option<Camera>,
}

/// Something to look at.
pub(super) struct Plate {
    pub(super) label: String,
    pub(super) layer: Layer,
}

/// What a measurement found.
pub(super) struct Measured {
    pub(super) value: f64,
    /// The method's own picture first.
    pub(super) plates: Vec<Plate>,
}

impl Measured {
    pub(super) fn new<const N: usize>(value: f64, plates: [(&str, Layer); N]) -> Self {
        let plates = plates.map(|(label, layer)| Plate { label: label.into(), layer });
        Self { value, plates: plates.into() }
    }
}

struct Stage {
    renderer: Renderer,
    lights: Vec<Light>,
    camera: Camera,
}

/// Renderers and references of one case.
pub(super) struct Lab<'a> {
    device: &'a vk::Device,
    options: &'a Options<'a>,
    stages: HashMap<&'static str, Stage>,
    references: HashMap<(&'static str, usize, Part), Layer>,
}

impl<'a> Lab<'a> {
    pub(super) fn new(device: &'a vk::Device, options: &'a Options<'a>) -> Self {
        Self { device, options, stages: HashMap::new(), references: HashMap::new() }
    }

    /// The word for what traces rays.
    pub(super) fn backend(&self) -> Option<vk::Backend> {
        self.stages.values().next().map(|stage| stage.renderer.backend().0)
    }

    fn stage(&mut self, subject: &Subject) -> Result<&mut Stage, Error> {
        let stage = match self.stages.remove(subject.name) {
            Some(stage) => stage,
            None => {
                let scene = (subject.make)();
                let lights = scene.lights.clone();
                let camera = scene.cameras.first().cloned().unwrap_or_else(|| scene.frame_camera());
                let options = RendererOptions { backend: self.options.backend, ..RendererOptions::default() };
                Stage { renderer: Renderer::new(self.device, scene, &options)?, lights, camera }
            }
        };
        Ok(self.stages.entry(subject.name).or_insert(stage))
    }

    /// The scene of a subject.
    pub(super) fn scene(&mut self, subject: &Subject) -> Result<&Scene, Error> {
        Ok(self.stage(subject)?.renderer.scene())
    }

    /// A subject's first camera.
    pub(super) fn camera(&mut self, subject: &Subject) -> Result<Camera, Error> {
        Ok(self.stage(subject)?.camera.clone())
    }

    /// One picture, and a layer beside it.
    fn draw(
        &mut self,
        subject: &Subject,
        shot: &Shot,
        config: &RenderConfig,
        aov: Option<Aov>,
    ) -> Result<Layer, Error> {
        let cancel = self.options.cancel;
        let stage = self.stage(subject)?;
        let lights = shot.lights.as_ref().unwrap_or(&stage.lights);
        if *lights != stage.renderer.scene().lights {
            stage.renderer.set_lights(lights.clone())?;
        }
        let camera = shot.camera.as_ref().unwrap_or(&stage.camera);
        let aovs = aov.map_or(Vec::new(), |aov| vec![aov]);
        let request = FrameRequest { aovs: &aovs, cancel, ..FrameRequest::default() };
        let frame = stage.renderer.render(config, camera, &request)?;
        Ok(frame.aovs.into_iter().next().map_or(frame.beauty, |(_, layer)| layer))
    }

    /// A picture by the method of `config`.
    pub(super) fn picture(
        &mut self,
        subject: &Subject,
        shot: &Shot,
        config: &RenderConfig,
        part: Part,
    ) -> Result<Layer, Error> {
        let mut config = config.clone();
        let aov = match part {
            Part::All => None,
            Part::Indirect => (config.method.diffuse_indirect)(&mut config),
        };
        self.draw(subject, shot, &config, aov)
    }

    /// A layer that every method draws.
    pub(super) fn layer(
        &mut self,
        subject: &Subject,
        config: &RenderConfig,
        aov: Aov,
    ) -> Result<Layer, Error> {
        self.draw(subject, &Shot::default(), config, Some(aov))
    }

    /// The same picture by path tracing with many samples, drawn once for each subject and shot of a case.
    pub(super) fn reference(
        &mut self,
        subject: &Subject,
        shot: &Shot,
        config: &RenderConfig,
        part: Part,
    ) -> Result<Layer, Error> {
        let key = (subject.name, shot.index, part);
        if let Some(layer) = self.references.get(&key) {
            return Ok(layer.clone());
        }
        let mut reference = RenderConfig {
            method: methods::REFERENCE,
            size: config.size,
            seed: REFERENCE_SEED,
            vpl_shoot: config.vpl_shoot.clone(),
            ..RenderConfig::default()
        };
        reference.path_trace.spp = REFERENCE_SPP;
        reference.path_trace.pixel_filter = PixelFilter::Center;
        let layer = self.picture(subject, shot, &reference, part)?;
        self.references.insert(key, layer.clone());
        Ok(layer)
    }
}
