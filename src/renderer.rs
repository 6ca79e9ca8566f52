//! From a scene and a configuration to a picture: owns the scene on the device, the structure rays are traced
//! in and the caches that frames share. A frame is a graph built anew, submitted and read back.

use crate::ErrorClass;
use crate::accel::{self, Geometry, Structure, StructureReport, software::MAX_STACK_DEPTH};
use crate::config::RenderConfig;
use crate::denoise::{self, Denoiser};
use crate::gpu_scene::GpuScene;
use crate::graph::{
    self, Desc, Executor, Graph, Image, ImageDesc, PassTime, Plan, Requirements, Res, Run, RunOptions, Tap,
    Ticket,
};
use crate::methods::{FrameInfo, NoLayer, Reach, VplCounts};
use crate::sampling::pixel_offset;
use crate::scene::{Camera, Feature, Light, Scene, SceneError, SceneProfile, View};
use crate::shaders::{self, COUNTER_LANES, RAY_COUNTERS};
use crate::techniques::indirect::{IndirectConfig, Visibility};
use crate::techniques::{Kernels, compose, glare, tone_map};
use crate::vk::{self, DeviceKind, MemoryKind};
use crate::vk::{Backend, Format};
use glam::Vec2;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

mod choice;
mod progressive;

pub use crate::layer::Layer;
pub use crate::methods::Aov;
pub use choice::{Timing, cached_timing};
pub use progressive::{Preview, Resume, noise};

/// Up to so many pixels every transient keeps memory of its own, about 250 bytes a pixel.
const UNSHARED_PIXELS: u64 = 1 << 20;

/// A GPU raises its clocks under load: below this, times are those of a sleepy one.
const WARM_UP: Duration = Duration::from_millis(500);

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The device or its driver.
    #[error(transparent)]
    Vulkan(#[from] vk::Error),
    /// The frame's graph: a wrong tap, or a limit of the device passed.
    #[error(transparent)]
    Graph(#[from] graph::Error),
    /// The structure rays are traced in.
    #[error(transparent)]
    Structure(#[from] accel::Error),
    /// The scene's own parts do not fit together.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The configuration.
    #[error(transparent)]
    Config(#[from] crate::config::ConfigError),
    /// The method does not draw a layer asked for.
    #[error(transparent)]
    Layer(#[from] NoLayer),
    /// What is to be continued is of another size.
    #[error("{0}")]
    Resume(String),
    /// The backend asked for does not exist on the device.
    #[error("device {device} has no ray query (VK_KHR_ray_query); use --backend software or auto")]
    NoRayQuery {
        /// The device's name.
        device: String,
    },
    /// The kind of visibility exists on the other backend only.
    #[error("visibility {visibility} is traced in software only; use --backend software or auto")]
    SoftwareOnly {
        /// Its word.
        visibility: &'static str,
    },
    /// The picture cannot be denoised.
    #[error(transparent)]
    Denoise(#[from] denoise::Error),
    /// Stopped by the caller.
    #[error("interrupted")]
    Cancelled,
}

impl Error {
    /// What kind of failure this is.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::Vulkan(error) => error.class(),
            Self::Graph(error) => error.class(),
            Self::Structure(error) => error.class(),
            Self::Denoise(error) => error.class(),
            Self::Scene(error) => error.class(),
            Self::Config(error) => error.class(),
            Self::Layer(error) => error.class(),
            Self::Resume(_) | Self::SoftwareOnly { .. } => ErrorClass::Input,
            Self::NoRayQuery { .. } => ErrorClass::Device,
            Self::Cancelled => ErrorClass::Interrupted,
        }
    }
}

/// Which backend to trace rays with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BackendChoice {
    /// Software on CPU devices and where ray query is missing; elsewhere the faster one on a built-in scene,
    /// timed once for each device and driver.
    #[default]
    Auto,
    /// The faster one on the scene at hand.
    Measure,
    /// This one.
    Force(Backend),
}

/// How a renderer is made.
#[derive(Clone, Copy, Debug, Default)]
pub struct RendererOptions {
    /// Which backend to trace rays with.
    pub backend: BackendChoice,
    /// The visibility that pictures will ask for: [`BackendChoice::Auto`] and [`BackendChoice::Measure`] take a
    /// backend that has it.
    pub visibility: Visibility,
}

/// What to bring back beside the picture, and how to report on the way.
#[derive(Clone, Copy, Default)]
pub struct FrameRequest<'a> {
    /// Further layers.
    pub aovs: &'a [Aov],
    /// Resources as passes left them, each `PASS:RESOURCE`; of the last pixel sample.
    pub taps: &'a [String],
    /// 0: render once. N: render once for the picture and, on a GPU for half a second, to warm up, then N times without
    /// bringing anything back, and report medians.
    pub repeat: u32,
    /// Progressive methods stop after this time.
    pub time: Option<Duration>,
    /// Progressive methods stop where [`noise`] is no more than this.
    pub noise: Option<f64>,
    /// Features to model although the scene has none of them: the picture is the same (see [`Renderer::unneeded`]).
    pub modelled: &'a [Feature],
    /// Further ways to draw this frame that are timed only, turn and turn about with it: each models these features
    /// instead of `modelled`, and takes all its samples, whatever `time`, `noise` and `resume` leave of them.
    pub beside: &'a [&'a [Feature]],
    /// What a progressive method goes on from.
    pub resume: Option<&'a Resume>,
    /// Denoises the picture, previews too; layers and [`Resume`] stay what the samples drew.
    pub denoiser: Option<&'a Denoiser>,
    /// What progressive methods show before they end.
    pub preview: Option<Preview<'a>>,
    /// Set to stop: between submits without a picture, between passes of progressive methods with what there is.
    pub cancel: Option<&'a AtomicBool>,
    /// Told what is being done.
    pub progress: Option<&'a dyn Fn(Progress<'_>)>,
}

impl FrameRequest<'_> {
    /// The layers asked for, then those that denoising takes.
    fn layers(&self) -> Vec<Aov> {
        let mut layers = self.aovs.to_vec();
        if self.denoiser.is_some() {
            layers.extend([Aov::Albedo, Aov::N].into_iter().filter(|aov| !self.aovs.contains(aov)));
        }
        layers
    }
}

/// How far a render has come.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Path of the pass at work.
    pub pass: &'a str,
    /// Share of the whole render, 0 … 1.
    pub done: f64,
}

/// What a pass took and traced.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PassStats {
    /// Path in the graph.
    pub path: String,
    /// Milliseconds on the device, each pass by itself: median over repeats of the sum over pixel samples. Absent
    /// where the device has no timestamps.
    pub ms: Option<f64>,
    /// Rays traced, for passes that trace any.
    pub rays: Option<u64>,
}

/// How a picture was denoised.
#[derive(Clone, Debug)]
pub struct Denoised {
    /// Radiance before, as the samples draw it.
    pub noisy: Layer,
    /// The denoiser's name and version.
    pub by: String,
    /// Milliseconds on the CPU.
    pub ms: f64,
}

/// A finished picture.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Radiance (W/(sr·m²)), linear Rec. 709.
    pub beauty: Layer,
    /// What was done to `beauty` and `display`, if they are denoised.
    pub denoised: Option<Denoised>,
    /// Tone-mapped sRGB, RGBA.
    pub display: Vec<u8>,
    /// Exposure that `display` was given, in stops.
    pub exposure_ev: f32,
    /// The layers asked for.
    pub aovs: Vec<(Aov, Layer)>,
    /// The taps asked for.
    pub taps: Vec<(String, Layer)>,
    /// Passes in order of execution, downloads left out.
    pub passes: Vec<PassStats>,
    /// Milliseconds on the device of the whole frame: median over repeats. Where passes overlap it is less than
    /// their sum: a GPU renders each repeat twice, the second time without timing passes.
    pub total_ms: Option<f64>,
    /// Milliseconds of each way of [`FrameRequest::beside`], as `total_ms`; by the host's clock where the device has no
    /// timestamps.
    pub beside_ms: Vec<f64>,
    /// Milliseconds from the first submit to the end of the last one, of the last repeat; without repeats to the end of
    /// the last download.
    pub wall_ms: f64,
    /// Rays of one render.
    pub rays: u64,
    /// VPLs that exist, of methods that have some.
    pub vpl_count: Option<u32>,
    /// Pixels, of the last pixel sample, that no filter could serve and that were gathered by themselves; `None`
    /// where the settings never do so.
    pub regathered: Option<u32>,
    /// Light paths launched, of methods that have VPLs.
    pub path_count: Option<u32>,
    /// The paper's min_d in force (m), of methods that have VPLs.
    pub min_distance: Option<f32>,
    /// Samples a pixel, of progressive methods.
    pub samples: Option<u32>,
    /// [`noise`] of beauty, where its halves were kept.
    pub noise: Option<f64>,
    /// Most bytes ever allocated on the device so far.
    pub peak_device_bytes: u64,
}

/// A scene ready to be rendered on a device.
#[derive(Debug)]
pub struct Renderer {
    executor: Executor,
    set: Arc<vk::SceneSet>,
    structure: Structure,
    gpu: GpuScene,
    scene: Scene,
    area: f32,
    backend: Backend,
    reason: String,
    device: vk::Device,
}

impl Renderer {
    /// Uploads a scene and builds the one structure its backend needs.
    ///
    /// # Errors
    /// An invalid scene, a backend the device lacks, or too little memory.
    pub fn new(device: &vk::Device, scene: Scene, options: &RendererOptions) -> Result<Self, Error> {
        scene.validate()?;
        let ray_query = device.info().ray_query;
        let software_only = options.visibility.software_only();
        let visibility = options.visibility.name();
        let (backend, reason) = match options.backend {
            BackendChoice::Force(Backend::RayQuery) if software_only => {
                return Err(Error::SoftwareOnly { visibility });
            }
            BackendChoice::Force(Backend::RayQuery) if !ray_query => {
                return Err(Error::NoRayQuery { device: device.info().name.clone() });
            }
            BackendChoice::Force(backend) => (backend, "as asked".into()),
            _ if software_only => (Backend::Software, format!("the only one with visibility {visibility}")),
            _ if !ray_query => (Backend::Software, "the device has no ray query".into()),
            BackendChoice::Auto if device.info().kind == DeviceKind::Cpu => {
                (Backend::Software, "the faster one on CPU devices".into())
            }
            BackendChoice::Auto => {
                let timing = choice::timing(device)?;
                (timing.fastest(), timing.to_string())
            }
            BackendChoice::Measure => {
                let timing = choice::time(device, &scene)?;
                (timing.fastest(), format!("{timing}, on this scene"))
            }
        };
        Self::with_backend(device, scene, backend, reason, !software_only)
    }

    fn with_backend(
        device: &vk::Device,
        scene: Scene,
        backend: Backend,
        reason: String,
        split: bool,
    ) -> Result<Self, Error> {
        let geometry = Geometry::of(&scene)?;
        let executor = Executor::new(device, backend)?;
        let mut gpu = GpuScene::upload(device, &scene, &geometry)?;
        let structure = Structure::build(device, backend, &geometry, split)?;
        structure.describe(&mut gpu.data);
        let uniform = device.buffer("scene", size_of::<shaders::SceneData>() as u64, MemoryKind::Upload)?;
        let set = Arc::new(device.scene_set(backend, uniform, structure.top_level())?);
        let area = scene.area() as f32;
        Ok(Self { executor, set, structure, gpu, scene, area, backend, reason, device: device.clone() })
    }

    /// Builds the second structure that `config` needs, unless it is there.
    fn ensure_boxes(&mut self, config: &IndirectConfig) -> Result<(), Error> {
        if config.visibility.software_only() && self.backend != Backend::Software {
            return Err(Error::SoftwareOnly { visibility: config.visibility.name() });
        }
        if config.visibility == Visibility::BoxesInline && !self.structure.is_whole() {
            self.structure.rebuild_whole(&self.device, &Geometry::of(&self.scene)?)?;
            self.structure.describe(&mut self.gpu.data);
        }
        let Some(options) = config.boxes().filter(|options| !self.structure.has_boxes(options)) else {
            return Ok(());
        };
        let geometry = Geometry::of(&self.scene)?;
        self.structure.build_boxes(&self.device, &geometry, &options)?;
        self.structure.describe(&mut self.gpu.data);
        if let Some(top) = self.structure.box_top_level() {
            unused(&mut self.set).set_boxes(top);
        }
        Ok(())
    }

    /// The backend in use, and why.
    #[must_use]
    pub fn backend(&self) -> (Backend, &str) {
        (self.backend, &self.reason)
    }

    /// The scene as it is now.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// What was built to trace rays in.
    #[must_use]
    pub fn structures(&self) -> &[StructureReport] {
        self.structure.reports()
    }

    /// Bytes of the scene's shading data on the device.
    #[must_use]
    pub fn scene_bytes(&self) -> u64 {
        self.gpu.bytes()
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> &vk::Device {
        &self.device
    }

    /// The specialization constants that describe the scene.
    #[cfg(feature = "compile")]
    pub(crate) fn scene_spec(&self) -> shaders::SceneSpec {
        let roughness = crate::techniques::whitted::WhittedConfig::default().mirror_roughness;
        // A kernel may outlive the lights and the threshold it was compiled with.
        shaders::SceneSpec {
            mirrors: true,
            glass: true,
            volumes: true,
            spot_lights: true,
            directional_lights: true,
            ..*self.kernels(roughness).scene_spec()
        }
    }

    /// Runs a graph of the caller's own on the scene, seen by `camera` at the size, window and seed of `config`.
    ///
    /// # Errors
    /// A graph declared wrongly, or the device's failure.
    pub fn run(&mut self, graph: Graph, config: &RenderConfig, camera: &Camera) -> Result<Run, Error> {
        config.validate()?;
        self.ensure_boxes(&config.indirect)?;
        self.write_uniform(config, camera, pixel_offset(0, 1), None)?;
        Ok(self.executor.run(graph, &RunOptions { scene: Some(&self.set), ..RunOptions::default() })?)
    }

    /// Replaces the lights; geometry, materials and structures stay as they are.
    ///
    /// # Errors
    /// A light with NaN, infinite or negative values, or too little memory.
    pub fn set_lights(&mut self, lights: Vec<Light>) -> Result<(), Error> {
        let before = std::mem::replace(&mut self.scene.lights, lights);
        if let Err(error) = self.scene.validate() {
            self.scene.lights = before;
            return Err(error.into());
        }
        self.gpu.set_lights(&self.device, &self.scene.lights)?;
        Ok(())
    }

    /// Renders.
    ///
    /// # Errors
    /// A bad configuration or tap, [`Error::Cancelled`], or the device's failure.
    pub fn render(
        &mut self,
        config: &RenderConfig,
        camera: &Camera,
        request: &FrameRequest<'_>,
    ) -> Result<Frame, Error> {
        config.validate()?;
        config.method.check_layers(config, &request.layers())?;
        self.ensure_boxes(&config.indirect)?;
        // A CPU device runs pass after pass: there the sum is the frame's time.
        let cpu = self.device.info().kind == DeviceKind::Cpu;
        let twice = if cpu { 1 } else { 2 };
        let begun = Instant::now();
        let runs = if request.repeat == 0 { 1 } else { 1 + twice * request.repeat };
        let mut rays = HashMap::new();
        let mut timed = Vec::new();
        let mut totals = Vec::new();
        let mut beside = vec![Vec::new(); request.beside.len()];
        let mut wall_ms = 0.0;
        let mut peak_device_bytes = 0;
        let mut frame = None;
        for run in 0..runs {
            let ways = 1.0 + request.beside.len() as f64;
            let report_way = |way: usize, progress: Progress<'_>| {
                if let Some(report) = request.progress {
                    let done = f64::from(run) + (way as f64 + progress.done) / ways;
                    report(Progress { done: done / f64::from(runs), ..progress });
                }
            };
            let report = |progress: Progress<'_>| report_way(0, progress);
            // The picture comes with the first run, the warm-up where there is one. Later ones bring nothing back: a GPU
            // that waits for its host between frames lowers its clocks.
            let picture = run == 0;
            let counters = picture.then(|| self.counters()).transpose()?;
            let pass_times = run <= request.repeat;
            let once = Once { picture, pass_times, counters: counters.as_ref(), progress: &report };
            let rendered = self.draw(config, camera, request, &once)?;
            if let Some(counters) = counters {
                rays = self.rays(&counters)?;
            }
            if picture && runs > 1 && !cpu {
                let again = Once { picture: false, pass_times, counters: None, progress: &report };
                while begun.elapsed() < WARM_UP {
                    self.draw(config, camera, request, &again)?;
                }
            }
            if pass_times && (run > 0 || runs == 1) {
                timed.push(rendered.times);
            }
            let counts = run + request.repeat >= runs || runs == 1;
            if counts {
                totals.push(rendered.total);
            }
            if picture {
                peak_device_bytes = self.device.memory().peak;
            }
            // In the first run too: it makes their kernels.
            for (way, &modelled) in request.beside.iter().enumerate().filter(|_| counts || picture) {
                let report = |progress: Progress<'_>| report_way(way + 1, progress);
                let whole = FrameRequest { time: None, noise: None, resume: None, preview: None, ..*request };
                let other = FrameRequest { modelled, ..whole };
                let once = Once { picture: false, pass_times, counters: None, progress: &report };
                let rendered = self.draw(config, camera, &other, &once)?;
                if counts {
                    beside[way].push(Some(rendered.total.unwrap_or(rendered.wall_ms)));
                }
            }
            wall_ms = rendered.wall_ms;
            frame = frame.or(rendered.frame);
        }
        let mut frame = frame.ok_or(Error::Cancelled)?;
        self.denoise(config, request, &mut frame)?;
        Ok(Frame {
            passes: summarise(&timed, &rays),
            total_ms: median(totals),
            beside_ms: beside.into_iter().filter_map(median).collect(),
            wall_ms,
            rays: rays.values().sum(),
            peak_device_bytes,
            ..frame
        })
    }

    /// Renders once, as the method does it.
    fn draw(
        &mut self,
        config: &RenderConfig,
        camera: &Camera,
        request: &FrameRequest<'_>,
        once: &Once<'_>,
    ) -> Result<Rendered, Error> {
        match &config.method.progressive {
            Some(method) => self.progressive(method, config, camera, request, once),
            None => self.once(config, camera, request, once),
        }
    }

    /// Renders all pixel samples once.
    fn once(
        &mut self,
        config: &RenderConfig,
        camera: &Camera,
        request: &FrameRequest<'_>,
        once: &Once<'_>,
    ) -> Result<Rendered, Error> {
        let start = Instant::now();
        let view = Window::of(config);
        let info = view.frame(self.area);
        let kernels = self.kernels_modelling(config, request.modelled);
        let samples = config.pixel_samples;
        let layers = request.layers();
        let means = self.means(config, &layers)?;
        let pixels = u64::from(info.extent[0]) * u64::from(info.extent[1]);
        let mut rendered = Rendered::new();
        for sample in 0..samples {
            self.write_uniform(config, camera, pixel_offset(sample, samples), once.counters)?;
            let mut g = Graph::new();
            let recorded = record(&mut g, &kernels, config, &view, &info, &layers, &means, sample);
            let last = sample + 1 == samples;
            let tickets = if last { Tickets::take(&mut g, config, recorded, once.picture) } else { None };
            let specs = if tickets.is_some() { request.taps } else { &[] };
            let taps = taps(&mut g, specs)?;
            let report = |p: graph::Progress<'_>| {
                (once.progress)(Progress {
                    pass: p.pass,
                    done: (f64::from(sample) + p.done) / f64::from(samples),
                });
            };
            let options = RunOptions {
                scene: Some(&self.set),
                cancel: request.cancel,
                progress: Some(&report),
                pass_times: once.pass_times,
                // Sharing memory makes passes wait for each other (5 % of a fast frame on an H100).
                alias: pixels > UNSHARED_PIXELS,
                ..RunOptions::default()
            };
            let mut run = self.executor.run(g, &options)?;
            rendered.add(&run);
            rendered.frame = tickets.map(|tickets| tickets.redeem(&mut run, view.extent, &layers, taps));
        }
        rendered.wall_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(rendered)
    }

    /// Denoises radiance and what is shown of it, if asked to, and takes out layers that only this takes.
    fn denoise(
        &mut self,
        config: &RenderConfig,
        request: &FrameRequest<'_>,
        frame: &mut Frame,
    ) -> Result<(), Error> {
        let Some(denoiser) = request.denoiser else { return Ok(()) };
        let start = Instant::now();
        let layer = |aov| part(frame.aovs.iter().find(|(a, _)| *a == aov).map(|(_, layer)| layer));
        let (albedo, normal) = (layer(Aov::Albedo), layer(Aov::N));
        let clean = denoiser.denoise(&denoise::Input { radiance: &frame.beauty, albedo, normal })?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let noisy = std::mem::replace(&mut frame.beauty, clean);
        frame.denoised = Some(Denoised { noisy, by: denoiser.name(), ms });
        frame.aovs.truncate(request.aovs.len());

        let Layer { width, height, ref data, .. } = frame.beauty;
        let texels: Vec<[f32; 4]> = data.chunks_exact(3).map(|c| [c[0], c[1], c[2], 1.0]).collect();
        let mut g = Graph::new();
        let radiance = g.image("denoised", ImageDesc::new([width, height], Format::Rgba32Float));
        g.upload_image("denoised", radiance, bytemuck::cast_slice(&texels).to_vec());
        let (display, exposure) = display(&mut g, config, radiance);
        let (display, exposure) = (g.read_image(display), g.read_buffer::<f32>(exposure));
        let mut run = self.executor.run(g, &RunOptions::default())?;
        frame.display = run.take(display);
        frame.exposure_ev = run.take(exposure).first().copied().unwrap_or_default();
        Ok(())
    }

    /// The techniques' kernels, specialised to the scene.
    #[must_use]
    pub fn kernels(&self, mirror_roughness: f32) -> Kernels {
        Kernels::new(&SceneProfile::of(&self.scene, mirror_roughness), self.structure.stack_depth())
    }

    /// Features that a frame with this configuration leaves out because the scene has none of them. With all of them in
    /// [`FrameRequest::modelled`] it is drawn by a pipeline that is not specialised to the scene.
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

    fn kernels_modelling(&self, config: &RenderConfig, features: &[Feature]) -> Kernels {
        modelling(self.kernels(config.whitted.mirror_roughness), config, features)
    }

    /// Images that average pixel samples, beauty first; none for a single sample.
    fn means(&self, config: &RenderConfig, aovs: &[Aov]) -> Result<Vec<Arc<vk::Image>>, Error> {
        if config.pixel_samples == 1 {
            return Ok(Vec::new());
        }
        let names = std::iter::once("beauty").chain(aovs.iter().map(|aov| aov.name()));
        let extent = Window::of(config).extent;
        let image =
            |name| Ok(Arc::new(self.device.image(&format!("mean.{name}"), extent, Format::Rgba32Float)?));
        names.map(image).collect()
    }

    fn counters(&self) -> Result<vk::Buffer, Error> {
        Ok(self.device.upload("ray_counters", &vec![0; RAY_COUNTERS.len() * COUNTER_LANES as usize * 8])?)
    }

    fn rays(&self, counters: &vk::Buffer) -> Result<HashMap<&'static str, u64>, Error> {
        let bytes = self.device.download(counters)?;
        let lanes = bytes.chunks_exact(8 * COUNTER_LANES as usize);
        let count = |cell: &[u8]| u64::from_le_bytes(std::array::from_fn(|i| cell[i]));
        let sums = lanes.map(|lanes| lanes.chunks_exact(8).map(count).sum());
        Ok(RAY_COUNTERS.into_iter().zip(sums).collect())
    }

    fn write_uniform(
        &mut self,
        config: &RenderConfig,
        camera: &Camera,
        pixel_offset: Vec2,
        counters: Option<&vk::Buffer>,
    ) -> Result<(), Error> {
        let data = shaders::SceneData {
            camera: camera_data(camera, config.size),
            full_size: config.size,
            window_origin: Window::of(config).traced_origin,
            pixel_offset: pixel_offset.to_array(),
            ray_counters: counters.map_or(0, vk::Buffer::address),
            seed: config.seed,
            specular_depth: config.whitted.specular_depth,
            mirror_roughness: config.whitted.mirror_roughness,
            energy_conserving: config.energy_conserving.into(),
            light_samples: if self.gpu.area_lights() { config.whitted.light_samples } else { 0 },
            ..self.gpu.data
        };
        let bytes = bytemuck::bytes_of(&data);
        if let Some(mapped) = unused(&mut self.set).uniform_mut() {
            mapped[..bytes.len()].copy_from_slice(bytes);
        }
        Ok(())
    }
}

/// The plan of one frame, made without any device.
///
/// # Errors
/// A bad configuration, or a limit that `requirements` names.
pub fn plan(
    scene: &Scene,
    config: &RenderConfig,
    aovs: &[Aov],
    requirements: &dyn Requirements,
) -> Result<Plan, Error> {
    config.validate()?;
    config.method.check_layers(config, aovs)?;
    let kernels = Kernels::new(&SceneProfile::of(scene, config.whitted.mirror_roughness), MAX_STACK_DEPTH);
    let kernels = modelling(kernels, config, &[]);
    let view = Window::of(config);
    let mut info = view.frame(scene.area() as f32);
    let mut g = Graph::new();
    if let Some(progressive) = &config.method.progressive {
        let image = |name| g.declare_image(name, ImageDesc::new(view.extent, Format::Rgba32Float));
        info.means = Some(progressive::means((progressive.adaptive)(config), aovs, image));
        info.samples = 1;
    }
    let recorded = record(&mut g, &kernels, config, &view, &info, aovs, &[], 0);
    Tickets::take(&mut g, config, recorded, true);
    Ok(g.plan(requirements)?)
}

/// The pixels asked for, and those that are traced because the ones asked for depend on them.
struct Window {
    origin: [u32; 2],
    extent: [u32; 2],
    traced_origin: [u32; 2],
    traced_extent: [u32; 2],
}

impl Window {
    fn of(config: &RenderConfig) -> Self {
        let [x0, y0, x1, y1] = config.window();
        let Reach { pixels: reach, cell } = (config.method.reach)(config);
        // Whole cells, or the samples that stand for them would lie outside.
        let low = |at: u32| at.saturating_sub(reach) / cell * cell;
        let high = |at: u32, size: u32| (at + reach).next_multiple_of(cell).min(size);
        let traced_origin = [low(x0), low(y0)];
        let traced_end = [high(x1, config.size[0]), high(y1, config.size[1])];
        Self {
            origin: [x0, y0],
            extent: [x1 - x0, y1 - y0],
            traced_origin,
            traced_extent: [0, 1].map(|axis| traced_end[axis] - traced_origin[axis]),
        }
    }

    fn frame(&self, area: f32) -> FrameInfo {
        let (origin, extent) = (self.traced_origin, self.traced_extent);
        FrameInfo { origin, extent, area, means: None, taken: 0, samples: 0 }
    }
}

/// The set while no run uses it: all of them have been waited for.
fn unused(set: &mut Arc<vk::SceneSet>) -> &mut vk::SceneSet {
    Arc::get_mut(set).expect("every run has been waited for")
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

/// How one render of all pixel samples is watched.
struct Once<'a> {
    /// Whether anything is brought back.
    picture: bool,
    pass_times: bool,
    counters: Option<&'a vk::Buffer>,
    progress: &'a dyn Fn(Progress<'_>),
}

/// The kernels for a frame, which model these, too.
fn modelling(kernels: Kernels, config: &RenderConfig, features: &[Feature]) -> Kernels {
    (config.method.kernels)(kernels.modelling(features), config)
}

/// What one render of all pixel samples came to.
struct Rendered {
    times: Vec<PassTime>,
    /// Milliseconds on the device.
    total: Option<f64>,
    /// Milliseconds by the host's clock.
    wall_ms: f64,
    frame: Option<Frame>,
}

impl Rendered {
    fn new() -> Self {
        Self { times: Vec::new(), total: Some(0.0), wall_ms: 0.0, frame: None }
    }

    /// Adds one graph's times.
    fn add(&mut self, run: &Run) {
        add_times(&mut self.times, &run.passes);
        self.total = self.total.zip(run.device_ms).map(|(sum, ms): (f64, f64)| sum + ms);
    }
}

/// What a frame's passes leave behind.
struct Recorded {
    /// Beauty, then the layers asked for; with several pixel samples their means.
    images: Vec<Res<Image>>,
    vpls: Option<VplCounts>,
    regathered: Option<Res<graph::Buffer>>,
}

#[expect(clippy::too_many_arguments, reason = "all that decides a frame")]
fn record(
    g: &mut Graph,
    kernels: &Kernels,
    config: &RenderConfig,
    view: &Window,
    info: &FrameInfo,
    aovs: &[Aov],
    means: &[Arc<vk::Image>],
    sample: u32,
) -> Recorded {
    let mut layers = (config.method.record)(g, kernels, config, info);
    let mut images = vec![layers.beauty];
    images.extend(aovs.iter().map(|&aov| layers.image(g, kernels, aov)));
    if view.extent != info.extent {
        let origin = [0, 1].map(|axis| view.origin[axis] - info.origin[axis]);
        images.iter_mut().for_each(|image| *image = compose::cut(g, *image, origin, view.extent));
    }
    for (image, mean) in images.iter_mut().zip(means) {
        let mean = g.import_image(mean.name().to_owned(), mean);
        compose::accumulate(g, *image, mean, sample);
        *image = mean;
    }
    Recorded { images, vpls: layers.vpls, regathered: layers.regathered }
}

/// A picture for a screen and its exposure, which glare leaves as it is.
fn display(g: &mut Graph, config: &RenderConfig, radiance: Res<Image>) -> (Res<Image>, Res<graph::Buffer>) {
    let exposure = tone_map::exposure(g, &config.tone_map, radiance);
    let spread = glare::glare(g, &config.glare, radiance, config.size[1]);
    (tone_map::tone_map(g, &config.tone_map, spread, exposure), exposure)
}

/// A part that a method says it has.
fn part<T>(part: Option<T>) -> T {
    part.expect("methods draw the layers they name")
}

/// Asks for what each `PASS:RESOURCE` names.
fn taps(g: &mut Graph, specs: &[String]) -> Result<Vec<(String, Tap)>, graph::Error> {
    specs.iter().map(|spec| Ok((spec.clone(), g.tap(spec)?))).collect()
}

/// Promises of everything a frame brings back.
struct Tickets {
    images: Vec<Ticket<[f32; 4]>>,
    display: Ticket<u8>,
    exposure: Ticket<f32>,
    vpls: Option<(Ticket<u32>, VplCounts)>,
    regathered: Option<Ticket<u32>>,
}

impl Tickets {
    /// None where no `picture` is wanted: then everything is made and left on the device.
    fn take(g: &mut Graph, config: &RenderConfig, recorded: Recorded, picture: bool) -> Option<Self> {
        let (display, exposure) = display(g, config, recorded.images[0]);
        if !picture {
            recorded.images.into_iter().for_each(|image| g.keep(image));
            g.keep(display);
            return None;
        }
        Some(Self {
            images: recorded.images.iter().map(|&image| g.read_image(image)).collect(),
            display: g.read_image(display),
            exposure: g.read_buffer(exposure),
            vpls: recorded.vpls.map(|vpls| (g.read_buffer(vpls.count), vpls)),
            regathered: recorded.regathered.map(|args| g.read_buffer(args)),
        })
    }

    fn redeem(
        self,
        run: &mut Run,
        [width, height]: [u32; 2],
        aovs: &[Aov],
        taps: Vec<(String, Tap)>,
    ) -> Frame {
        let mut images =
            self.images.into_iter().map(|ticket| run.take(ticket)).collect::<Vec<_>>().into_iter();
        let layer = |texels: Vec<[f32; 4]>, channels: std::ops::Range<usize>| Layer {
            width,
            height,
            channels: channels.len(),
            data: texels.iter().flat_map(|texel| texel[channels.clone()].iter().copied()).collect(),
        };
        let beauty = layer(images.next().unwrap_or_default(), 0..3);
        let aovs = aovs.iter().zip(images).map(|(&aov, texels)| {
            (aov, layer(texels, aov.first_channel()..aov.first_channel() + aov.channels()))
        });
        let aovs = aovs.collect();
        let taps = taps.into_iter().map(|(spec, tap)| (spec, tapped(run, tap))).collect();
        let (vpl_count, path_count, min_distance) = match self.vpls {
            Some((ticket, vpls)) => {
                (run.take(ticket).first().copied(), Some(vpls.paths), Some(vpls.min_distance))
            }
            None => (None, None, None),
        };
        Frame {
            beauty,
            denoised: None,
            display: run.take(self.display),
            exposure_ev: run.take(self.exposure).first().copied().unwrap_or_default(),
            aovs,
            taps,
            vpl_count,
            regathered: self.regathered.and_then(|ticket| run.take(ticket).last().copied()),
            passes: Vec::new(),
            total_ms: None,
            beside_ms: Vec::new(),
            wall_ms: 0.0,
            rays: 0,
            path_count,
            min_distance,
            samples: None,
            noise: None,
            peak_device_bytes: 0,
        }
    }
}

/// Images keep their shape, buffers become a row of words; integers keep their bits.
fn tapped(run: &mut Run, tap: Tap) -> Layer {
    let bytes = run.take(tap.ticket);
    let words = || bytes.chunks_exact(4).map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect();
    match tap.desc {
        Desc::Image(desc) => {
            let data: Vec<f32> = match desc.format {
                Format::Rgba8Unorm => bytes.iter().map(|&b| f32::from(b) / 255.0).collect(),
                Format::Rgba16Float => {
                    let halves = bytes.chunks_exact(2).map(|b| half::f16::from_ne_bytes([b[0], b[1]]));
                    halves.map(half::f16::to_f32).collect()
                }
                _ => words(),
            };
            let [width, height] = desc.extent;
            Layer { width, height, channels: data.len() / (width as usize * height as usize), data }
        }
        Desc::Buffer(_) | Desc::Scene => {
            let data: Vec<f32> = words();
            Layer { width: data.len() as u32, height: 1, channels: 1, data }
        }
    }
}

/// Adds one sample's times to those of the samples before. Downloads are not part of a frame's time.
fn add_times(sums: &mut Vec<PassTime>, passes: &[PassTime]) {
    let work =
        passes.iter().filter(|pass| !pass.path.starts_with("readback") && !pass.path.starts_with("tap/"));
    for pass in work {
        match sums.iter_mut().find(|sum| sum.path == pass.path) {
            Some(sum) => {
                sum.ms = sum.ms.zip(pass.ms).map(|(a, b)| a + b);
                sum.bands += pass.bands;
            }
            None => sums.push(pass.clone()),
        }
    }
}

fn summarise(timed: &[Vec<PassTime>], rays: &HashMap<&'static str, u64>) -> Vec<PassStats> {
    let Some(first) = timed.first() else { return Vec::new() };
    let stats = first.iter().map(|pass| PassStats {
        path: pass.path.clone(),
        ms: median(timed.iter().map(|t| t.iter().find(|p| p.path == pass.path).and_then(|p| p.ms)).collect()),
        rays: rays.get(pass.path.as_str()).copied(),
    });
    stats.collect()
}

/// `None` where any is missing.
fn median(values: Vec<Option<f64>>) -> Option<f64> {
    let mut values = values.into_iter().collect::<Option<Vec<f64>>>()?;
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[middle]),
        _ => Some(0.5 * (values[middle - 1] + values[middle])),
    }
}
