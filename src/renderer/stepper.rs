//! Drawing step by step: for pictures that grow, for a budget of time, for a window.

use super::drawing::{Drawing, FrameResources, Tickets, modelling, taps};
use super::error::Error;
use super::frame::Frame;
use super::growing::{Growing, colours, noise};
use super::request::{FrameRequest, Progress};
use super::submit::Renderer;
use super::times::Tally;
use super::window::Window;
use crate::config::RenderConfig;
use crate::graph::{Graph, Image, InFlight, Res, RunOptions, Tap, Ticket};
use crate::memory::Budget;
use crate::methods::{Aov, FrameInfo};
use crate::sampling::pixel_offset;
use crate::scene::{Camera, Feature};
use crate::techniques::path_trace::adaptive::{MAX_RATE, Round};
use crate::vk::{self, DeviceKind, Format};
use glam::Vec2;
use std::collections::VecDeque;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Up to so many pixels every transient keeps memory of its own, about 250 bytes a pixel: sharing memory makes passes wait
/// for each other (5 % of a fast frame on an H100).
const UNSHARED_PIXELS: u64 = 1 << 20;

/// Rounds of a thread's loop in one graph at most: some drivers end shaders' loops after 65 535 in all.
const GRAPH_ROUNDS: u32 = 128;

/// Draws a picture step by step.
///
/// A step takes samples: of methods that grow as many as are asked for at a time, of others pixel samples
/// ([`RenderConfig::pixel_samples`]), one alone if there is only one. It hands them to the device and returns while they
/// are at work there; at most one step is, while the next is prepared. [`picture`](Self::picture) waits and brings back
/// what there is; how samples were split into steps never shows in it.
///
/// What an edit of the scene [invalidates](super::Invalidated) is noticed by the next step, which begins anew.
///
/// ```no_run
/// use parhelion::config::RenderConfig;
/// use parhelion::renderer::{Renderer, RendererOptions, Stepper};
/// use parhelion::scene::builtin;
/// use parhelion::vk::{Device, DeviceOptions};
/// use std::time::{Duration, Instant};
///
/// let device = Device::open(&DeviceOptions::default())?;
/// let scene = builtin::by_name("cornell")?;
/// let camera = scene.cameras[0].clone();
/// let mut renderer = Renderer::new(&device, scene, &RendererOptions::default())?;
///
/// let mut config = RenderConfig::default();
/// config.apply_override("method=path")?;
/// let mut stepper = Stepper::new(&mut renderer, &config, &camera, &[])?;
/// let begun = Instant::now();
/// while stepper.samples() < stepper.target() && begun.elapsed() < Duration::from_secs(2) {
///     stepper.step(&mut renderer, 4)?;
/// }
/// let frame = stepper.picture(&mut renderer)?;
/// println!("{} samples a pixel", frame.samples.unwrap_or(1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Stepper {
    pub(super) drawing: Drawing,
    camera: Camera,
    modelled: Vec<Feature>,
    taps: Vec<String>,
    revision: u64,
    images: Images,
    target: u32,
    taken: u32,
    under_way: VecDeque<UnderWay>,
    /// Seconds that a sample took last, and when the last run ended.
    seconds_a_sample: Option<f64>,
    last_end: Option<Instant>,
    /// What the runs came to, by picture, since they were last asked for.
    tallies: VecDeque<Tally>,
    frame: Option<Frame>,
}

/// What samples are added to.
enum Images {
    /// Means of pixel samples, beauty first; none for a single sample.
    Averaged(Vec<Arc<vk::Image>>),
    Growing(Growing),
}

/// A graph handed to the device.
struct UnderWay {
    flight: InFlight,
    begun: Instant,
    /// Milliseconds that the host worked for it.
    host_ms: f64,
    /// Samples before it, and those it takes.
    taken: u32,
    samples: u32,
    /// Runs of later pictures come behind.
    ends_picture: bool,
    brings: Option<Brings>,
}

/// What a graph brings back.
struct Brings {
    tickets: Tickets,
    taps: Vec<(String, Tap)>,
    halves: Option<[Ticket<[f32; 4]>; 2]>,
}

/// How steps are watched.
#[derive(Clone, Copy)]
pub(super) struct Watch<'a> {
    /// Whether a picture is brought back at the end.
    pub(super) picture: bool,
    pub(super) pass_times: bool,
    pub(super) counters: Option<&'a Arc<vk::Buffer>>,
    pub(super) cancel: Option<&'a AtomicBool>,
    /// Told, while somebody waits, of the pass at work and the share of all samples that is done.
    pub(super) report: &'a dyn Fn(Progress<'_>),
}

const UNWATCHED: Watch<'_> =
    Watch { picture: true, pass_times: false, counters: None, cancel: None, report: &|_| {} };

impl fmt::Debug for Stepper {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Stepper")
            .field("samples", &self.taken)
            .field("target", &self.target)
            .finish_non_exhaustive()
    }
}

/// Refuses a picture that the host has no room for: texels as the device has them and numbers as they are kept, of beauty
/// and `layers` more, and what a screen shows.
fn room([width, height]: [u32; 2], layers: usize) -> Result<(), Error> {
    let bytes = u64::from(width) * u64::from(height) * (28 * (1 + layers as u64) + 4);
    // To ask takes as long as a small frame.
    if bytes < 64 << 20 {
        return Ok(());
    }
    Budget::of_process().take(bytes).map_err(|shortage| Error::NoRoom { width, height, shortage })
}

impl Stepper {
    /// Prepares to draw beauty and `layers`; nothing is drawn yet.
    ///
    /// # Errors
    /// A bad configuration, a layer that the method does not draw, or too little memory.
    pub fn new(
        renderer: &mut Renderer,
        config: &RenderConfig,
        camera: &Camera,
        layers: &[Aov],
    ) -> Result<Self, Error> {
        Self::of(renderer, config, camera, &FrameRequest { aovs: layers, ..FrameRequest::default() })
    }

    /// Prepares what a request asks for.
    pub(super) fn of(
        renderer: &mut Renderer,
        config: &RenderConfig,
        camera: &Camera,
        request: &FrameRequest<'_>,
    ) -> Result<Self, Error> {
        config.validate()?;
        let layers = request.layers();
        config.method.check_layers(config, &layers)?;
        renderer.serve(config)?;
        let window = Window::of(config);
        room(window.extent, layers.len() + request.taps.len())?;
        let device = renderer.device();
        let images = match &config.method.progressive {
            Some(method) => {
                let adaptive = (method.adaptive)(config);
                let halves =
                    adaptive || request.noise.is_some() || layers.iter().any(|aov| aov.takes_halves());
                let growing = Growing::new(device, window.extent, halves, adaptive, request.resume)?;
                Images::Growing(growing)
            }
            None if config.pixel_samples == 1 => Images::Averaged(Vec::new()),
            None => {
                let names = std::iter::once("beauty").chain(layers.iter().map(|aov| aov.name()));
                let image = |name| device.image(&format!("mean.{name}"), window.extent, Format::Rgba32Float);
                Images::Averaged(names.map(|name| image(name).map(Arc::new)).collect::<Result<_, _>>()?)
            }
        };
        let kernels = renderer.kernels(config.whitted.mirror_roughness);
        let kernels = modelling(kernels, config, request.modelled);
        let asks = (config.method.asks_free_path)(config);
        let free_path = if asks { renderer.free_path(config, camera)? } else { None };
        let mut stepper = Self {
            target: match &config.method.progressive {
                Some(method) => (method.samples)(config),
                None => config.pixel_samples,
            },
            taken: 0,
            drawing: Drawing {
                config: config.clone(),
                kernels,
                window,
                layers,
                origin: renderer.origin(),
                free_path,
            },
            camera: camera.clone(),
            modelled: request.modelled.to_vec(),
            taps: request.taps.to_vec(),
            revision: renderer.revision(),
            images,
            under_way: VecDeque::new(),
            seconds_a_sample: None,
            last_end: None,
            tallies: VecDeque::from([Tally::default()]),
            frame: None,
        };
        stepper.restart();
        stepper.check_taps(renderer.area())?;
        Ok(stepper)
    }

    /// A tap that is not there is known before the first sample.
    fn check_taps(&self, area: f32) -> Result<(), Error> {
        if let (Images::Growing(growing), false) = (&self.images, self.taps.is_empty()) {
            let mut g = Graph::new();
            self.record_grown(&mut g, area, growing, 0, true);
            taps(&mut g, &self.taps)?;
        }
        Ok(())
    }

    /// Samples a pixel that were handed to the device.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.taken
    }

    /// Samples a pixel that the configuration asks for.
    #[must_use]
    pub fn target(&self) -> u32 {
        self.target
    }

    /// Sees the scene from elsewhere; the picture begins anew.
    pub fn set_camera(&mut self, camera: &Camera) {
        if self.camera != *camera {
            self.camera = camera.clone();
            self.forget();
        }
    }

    /// Hands up to `samples` samples a pixel more to the device; waits until all before them are done. Returns how many
    /// they are: 0 once all are taken.
    ///
    /// # Errors
    /// The device's failure.
    pub fn step(&mut self, renderer: &mut Renderer, samples: u32) -> Result<u32, Error> {
        self.renew(renderer)?;
        let before = self.taken;
        if before < self.target {
            self.frame = None;
        }
        self.take(renderer, samples, &UNWATCHED)?;
        self.settle(self.ahead(renderer), &UNWATCHED)?;
        self.take_tallies();
        Ok(self.taken - before)
    }

    /// Waits, and brings back the picture by all samples so far; takes the first sample if there is none.
    ///
    /// # Errors
    /// The device's failure.
    pub fn picture(&mut self, renderer: &mut Renderer) -> Result<Frame, Error> {
        self.renew(renderer)?;
        if self.taken == 0 {
            self.take(renderer, 1, &UNWATCHED)?;
        }
        self.settle(0, &UNWATCHED)?;
        if self.frame.is_none() {
            self.frame = self.peek(renderer, &UNWATCHED)?;
        }
        self.take_tallies();
        Ok(self.frame.clone().expect("a picture was asked for"))
    }

    /// The picture by all samples so far; its graph is no part of a picture's time.
    pub(super) fn peek(
        &mut self,
        renderer: &mut Renderer,
        watch: &Watch<'_>,
    ) -> Result<Option<Frame>, Error> {
        self.settle(0, watch)?;
        let tallies = std::mem::replace(&mut self.tallies, VecDeque::from([Tally::default()]));
        let shown = self.show(renderer, watch).and_then(|()| self.settle(0, watch));
        self.tallies = tallies;
        shown.map(|()| self.frame.take())
    }

    /// Begins anew where an edit has made worthless what was drawn.
    fn renew(&mut self, renderer: &mut Renderer) -> Result<(), Error> {
        let config = &self.drawing.config;
        renderer.serve(config)?;
        // Structures may be deeper since.
        let kernels = renderer.kernels(config.whitted.mirror_roughness);
        self.drawing.kernels = modelling(kernels, config, &self.modelled);
        if self.revision != renderer.revision() {
            self.revision = renderer.revision();
            self.drawing.origin = renderer.origin();
            self.forget();
        }
        // The renderer remembers it as long as scene and camera are the same.
        if (self.drawing.config.method.asks_free_path)(&self.drawing.config) {
            self.drawing.free_path = renderer.free_path(&self.drawing.config, &self.camera)?;
        }
        Ok(())
    }

    fn forget(&mut self) {
        self.under_way.clear();
        if let Images::Growing(growing) = &mut self.images {
            growing.forget();
        }
        self.restart();
    }

    /// Draws the same picture again; what is under way of the last one is finished.
    pub(super) fn restart(&mut self) {
        self.taken = match &mut self.images {
            Images::Averaged(_) => 0,
            Images::Growing(growing) => {
                growing.restart();
                growing.first()
            }
        };
        self.frame = None;
    }

    /// Seconds that a sample took last.
    pub(super) fn seconds_a_sample(&self) -> Option<f64> {
        self.seconds_a_sample
    }

    /// Runs that are worth having under way while the next is prepared: none on a CPU device, which would do both, and none
    /// where memory matters more, since the last graphs of a picture have transients of their own.
    pub(super) fn ahead(&self, renderer: &Renderer) -> usize {
        let [width, height] = self.drawing.window.traced_extent.map(u64::from);
        let cpu = renderer.device().info().kind == DeviceKind::Cpu;
        usize::from(!cpu && width * height <= UNSHARED_PIXELS)
    }

    /// Hands samples over: of what grows as many in one graph as a driver bears, else a graph each.
    pub(super) fn take(
        &mut self,
        renderer: &mut Renderer,
        samples: u32,
        watch: &Watch<'_>,
    ) -> Result<(), Error> {
        let ahead = self.ahead(renderer);
        let mut left = samples.min(self.target.saturating_sub(self.taken));
        while left > 0 {
            self.settle(ahead, watch)?;
            left -= match &self.images {
                Images::Averaged(_) => self.take_averaged(renderer, watch)?,
                Images::Growing(_) => self.take_grown(renderer, left, watch)?,
            };
        }
        Ok(())
    }

    fn take_averaged(&mut self, renderer: &mut Renderer, watch: &Watch<'_>) -> Result<u32, Error> {
        let Images::Averaged(means) = &self.images else { return Ok(0) };
        let begun = Instant::now();
        let (sample, window, config) = (self.taken, &self.drawing.window, &self.drawing.config);
        let mut g = Graph::new();
        let info = window.frame(renderer.area());
        let recorded = self.drawing.record(&mut g, &info, &self.drawing.layers, means, sample);
        let last = sample + 1 == self.target;
        let brings =
            if last { self.brings(&mut g, recorded, watch.picture, None, &self.taps)? } else { None };
        let offset = pixel_offset(sample, config.pixel_samples);
        self.submit(renderer, g, begun, offset, (1, brings, last), watch)?;
        self.taken += 1;
        Ok(1)
    }

    fn take_grown(&mut self, renderer: &mut Renderer, most: u32, watch: &Watch<'_>) -> Result<u32, Error> {
        let config = &self.drawing.config;
        let Some(method) = &config.method.progressive else { return Ok(0) };
        let adaptive = (method.adaptive)(config);
        let rate = if adaptive { MAX_RATE } else { 1 };
        let bearable = (GRAPH_ROUNDS / (method.rounds)(config).saturating_mul(rate)).max(1);
        let mut samples = most.min(bearable);
        if adaptive {
            let round = Round::of(self.taken);
            if self.taken > 0 && round.start == self.taken {
                let images = self.means(renderer)?;
                if let Images::Growing(growing) = &mut self.images {
                    growing.next_round(&images, self.taken);
                }
            }
            samples = samples.min(round.end - self.taken);
        }
        let Images::Growing(growing) = &self.images else { return Ok(0) };
        let begun = Instant::now();
        let mut g = Graph::new();
        self.record_grown(&mut g, renderer.area(), growing, samples, false);
        self.submit(renderer, g, begun, Vec2::splat(0.5), (samples, None, false), watch)?;
        self.taken += samples;
        Ok(samples)
    }

    /// Draws what is shown of the samples so far; brings it back if a picture is watched for.
    pub(super) fn show(&mut self, renderer: &mut Renderer, watch: &Watch<'_>) -> Result<(), Error> {
        let begun = Instant::now();
        let mut g = Graph::new();
        let (recorded, halves, specs) = match &self.images {
            Images::Growing(growing) => {
                let (halves, recorded) = self.record_grown(&mut g, renderer.area(), growing, 0, true);
                let halves = halves.filter(|_| watch.picture);
                (recorded, halves.map(|halves| halves.map(|half| g.read_image(half))), &self.taps[..])
            }
            Images::Averaged(means) => {
                let means = means.iter().map(|mean| g.import_image(mean.name().to_owned(), mean)).collect();
                // The passes to be tapped are those of a sample.
                (FrameResources::of(means), None, &[][..])
            }
        };
        let brings = self.brings(&mut g, recorded, watch.picture, halves, specs)?;
        self.submit(renderer, g, begun, Vec2::splat(0.5), (0, brings, true), watch)
    }

    /// Records a method that grows, with `samples` samples more.
    fn record_grown(
        &self,
        g: &mut Graph,
        area: f32,
        growing: &Growing,
        samples: u32,
        layers: bool,
    ) -> (Option<[Res<Image>; 2]>, FrameResources) {
        let means = growing.import(g);
        let window = self.drawing.window.frame(area);
        let info = FrameInfo { means: Some(means), taken: self.taken, samples, ..window };
        let layers = if layers { &self.drawing.layers[..] } else { &[] };
        (means.halves, self.drawing.record(g, &info, layers, &[], 0))
    }

    fn brings(
        &self,
        g: &mut Graph,
        recorded: FrameResources,
        picture: bool,
        halves: Option<[Ticket<[f32; 4]>; 2]>,
        specs: &[String],
    ) -> Result<Option<Brings>, Error> {
        let tickets = Tickets::take(g, &self.drawing.config, recorded, picture);
        let Some(tickets) = tickets else { return Ok(None) };
        let taps = taps(g, specs)?;
        Ok(Some(Brings { tickets, taps, halves }))
    }

    fn submit(
        &mut self,
        renderer: &mut Renderer,
        g: Graph,
        begun: Instant,
        offset: Vec2,
        (samples, brings, ends_picture): (u32, Option<Brings>, bool),
        watch: &Watch<'_>,
    ) -> Result<(), Error> {
        let scene = renderer.set(&self.drawing.config, &self.camera, offset, watch.counters)?;
        let [width, height] = self.drawing.window.traced_extent.map(u64::from);
        let grown = matches!(self.images, Images::Growing(_));
        let options = RunOptions {
            scene: Some(&scene),
            pass_times: watch.pass_times,
            alias: grown || width * height > UNSHARED_PIXELS,
            cancel: watch.cancel,
            ..RunOptions::default()
        };
        let flight = renderer.executor.submit(g, &options)?;
        let host_ms = begun.elapsed().as_secs_f64() * 1e3;
        if let Images::Growing(growing) = &mut self.images {
            growing.submitted();
        }
        let taken = self.taken;
        self.under_way.push_back(UnderWay { flight, begun, host_ms, taken, samples, ends_picture, brings });
        Ok(())
    }

    /// Waits until at most `left` runs are under way.
    pub(super) fn settle(&mut self, left: usize, watch: &Watch<'_>) -> Result<(), Error> {
        while self.under_way.len() > left {
            let Some(mut front) = self.under_way.pop_front() else { break };
            let progress = |flight: &InFlight| {
                flight.progress(|p| {
                    let done = f64::from(front.taken) + f64::from(front.samples) * p.done;
                    (watch.report)(Progress { pass: p.pass, done: done / f64::from(self.target) });
                });
            };
            loop {
                if watch.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
                    self.under_way.clear();
                    return Err(Error::Cancelled);
                }
                let over = front.flight.step()?;
                progress(&front.flight);
                if over {
                    break;
                }
            }
            let mut run = front.flight.wait()?;
            if front.samples > 0 {
                let begun = self.last_end.map_or(front.begun, |end| end.max(front.begun));
                let seconds = begun.elapsed().as_secs_f64() / f64::from(front.samples);
                self.seconds_a_sample = Some(seconds.max(1e-9));
            }
            self.last_end = Some(Instant::now());
            self.tallies.back_mut().expect("there is always one").add(&run, front.host_ms);
            if front.ends_picture {
                self.tallies.push_back(Tally::default());
            }
            let Some(Brings { tickets, taps, halves }) = front.brings else { continue };
            let halves = halves.map(|halves| halves.map(|half| colours(&run.take(half))));
            let mut frame = tickets.redeem(&mut run, &self.drawing, taps);
            if matches!(self.images, Images::Growing(_)) {
                frame.samples = Some(front.taken);
                let halves = halves.filter(|_| front.taken > 1);
                frame.noise = halves.map(|[a, b]| noise(&frame.beauty.data, &a, &b, front.taken));
            }
            self.frame = Some(frame);
        }
        Ok(())
    }

    /// What was brought back last.
    pub(super) fn take_frame(&mut self) -> Option<Frame> {
        self.frame.take()
    }

    /// What the runs of each finished picture came to, since this was last asked.
    pub(super) fn take_tallies(&mut self) -> Vec<Tally> {
        let last = self.tallies.pop_back().unwrap_or_default();
        let finished = std::mem::take(&mut self.tallies).into();
        self.tallies.push_back(last);
        finished
    }

    /// Mean and halves, RGB, of what grows.
    pub(super) fn means(&mut self, renderer: &mut Renderer) -> Result<Vec<Vec<f32>>, Error> {
        self.settle(0, &UNWATCHED)?;
        let Images::Growing(growing) = &self.images else { return Ok(Vec::new()) };
        let mut g = Graph::new();
        let means = growing.import(&mut g);
        let tickets = std::iter::once(means.all).chain(means.halves.into_iter().flatten());
        let tickets: Vec<_> = tickets.map(|image| g.read_image::<[f32; 4]>(image)).collect();
        let mut run = renderer.executor.run(g, &RunOptions::default())?;
        Ok(tickets.into_iter().map(|ticket| colours(&run.take(ticket))).collect())
    }
}
