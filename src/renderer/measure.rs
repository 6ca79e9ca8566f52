//! Rendering as the command line asks for it: warm-up, repeats, ways side by side, limits to samples, time and noise.

use super::drawing::display;
use super::error::Error;
use super::frame::{Denoised, Frame, PassStats};
use super::growing::noise;
use super::request::{FrameRequest, Progress};
use super::stepper::{Stepper, Watch};
use super::submit::Renderer;
use super::times::{Tally, median, summarise};
use crate::config::RenderConfig;
use crate::denoise;
use crate::graph::{Graph, ImageDesc, RunOptions};
use crate::layer::Layer;
use crate::methods::Aov;
use crate::scene::Camera;
use crate::vk::{DeviceKind, Format};
use std::cell::Cell;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// How long a GPU draws before it is timed: under load it raises its clocks.
const WARM_UP: Duration = Duration::from_millis(500);

/// Seconds a graph of a picture that grows should take: what Ctrl-C and `--time` wait for.
const PASS_SECONDS: f64 = 0.25;

/// Samples before which noise is not estimated.
const LEAST_SAMPLES: u32 = 16;

/// One way to draw the frame, and what its pictures came to.
struct Way<'a> {
    stepper: Stepper,
    request: FrameRequest<'a>,
    timed: Vec<Tally>,
    /// Milliseconds of each by the host's clock.
    wall_ms: Vec<f64>,
}

impl<'a> Way<'a> {
    fn new(
        renderer: &mut Renderer,
        config: &RenderConfig,
        camera: &Camera,
        request: FrameRequest<'a>,
    ) -> Result<Self, Error> {
        let stepper = Stepper::of(renderer, config, camera, &request)?;
        Ok(Self { stepper, request, timed: Vec::new(), wall_ms: Vec::new() })
    }

    /// Milliseconds of each picture; by the host's clock where the device has none.
    fn milliseconds(&self) -> Vec<Option<f64>> {
        let ms = self.timed.iter().zip(&self.wall_ms);
        ms.map(|(tally, &wall_ms)| Some(tally.total.unwrap_or(wall_ms))).collect()
    }
}

impl Renderer {
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
        // A CPU device runs pass after pass: there the sum is the frame's time.
        let cpu = self.device().info().kind == DeviceKind::Cpu;
        let repeat = request.repeat as usize;
        let ways = 1 + request.beside.len();
        let draws = (ways + repeat * if cpu { ways } else { 1 + ways }) as f64;
        let drawn = Cell::new(0.0);
        let report = |progress: Progress<'_>| {
            if let Some(report) = request.progress {
                let done = ((drawn.get() + progress.done) / draws).min(1.0);
                report(Progress { done, ..progress });
            }
        };
        let begun = Instant::now();
        // The picture comes with the first draw, the warm-up where there is one. Later ones bring nothing back: a GPU
        // that waits for its host between frames lowers its clocks.
        let mut way = Way::new(self, config, camera, *request)?;
        let counters = self.counters()?;
        let watch = Watch {
            picture: true,
            pass_times: true,
            counters: Some(&counters),
            cancel: request.cancel.filter(|_| config.method.progressive.is_none()),
            report: &report,
        };
        self.draw(std::slice::from_mut(&mut way), 1, &watch, &drawn)?;
        let frame = way.stepper.take_frame();
        let rays = self.rays(&counters)?;
        let peak_device_bytes = self.device().memory().peak;
        let unseen = Watch { picture: false, counters: None, ..watch };
        if repeat > 0 {
            while !cpu && begun.elapsed() < WARM_UP {
                self.draw(std::slice::from_mut(&mut way), 1, &unseen, &Cell::new(drawn.get()))?;
            }
            (way.timed, way.wall_ms) = Default::default();
        }
        let mut ways = vec![way];
        for &modelled in request.beside {
            let whole = FrameRequest { time: None, noise: None, resume: None, preview: None, ..*request };
            ways.push(Way::new(self, config, camera, FrameRequest { modelled, ..whole })?);
        }
        // Their kernels are made in the first draw.
        self.draw(&mut ways[1..], 1, &unseen, &drawn)?;
        let mut timed = Vec::new();
        if repeat > 0 {
            let beside = ways[1..].iter_mut();
            beside.for_each(|way| (way.timed, way.wall_ms) = Default::default());
            let count = if cpu { ways.len() } else { 1 };
            self.draw(&mut ways[..count], repeat, &unseen, &drawn)?;
            if !cpu {
                timed = std::mem::take(&mut ways[0].timed);
                ways[0].wall_ms.clear();
                self.draw(&mut ways, repeat, &Watch { pass_times: false, ..unseen }, &drawn)?;
            }
        }
        let (way, beside) = ways.split_first().expect("there is one");
        let timed = if timed.is_empty() { &way.timed } else { &timed };
        let mut frame = Frame {
            passes: summarise(timed, &rays),
            total_ms: median(way.timed.iter().map(|tally| tally.total).collect()),
            beside_ms: beside.iter().filter_map(|way| median(way.milliseconds())).collect(),
            wall_ms: way.wall_ms.last().copied().unwrap_or_default(),
            host_ms: median(way.timed.iter().map(|tally| Some(tally.host_ms)).collect()).unwrap_or_default(),
            rays: rays.values().sum(),
            peak_device_bytes,
            ..frame.ok_or(Error::Cancelled)?
        };
        self.denoise(config, request, &mut frame)?;
        self.add_made(&mut frame);
        Ok(frame)
    }

    /// What bringing meshes into shape took belongs to the frame after it.
    fn add_made(&mut self, frame: &mut Frame) {
        let made = self.take_made();
        let ms: f64 = made.iter().filter_map(|pass| pass.ms).sum();
        frame.total_ms = frame.total_ms.map(|total| total + ms);
        let stats = made.into_iter().map(|pass| PassStats { path: pass.path, ms: pass.ms, rays: None });
        frame.passes.splice(0..0, stats);
    }

    /// Draws the ways by turns, each `times` times. Frames whose passes are not timed one by one are drawn
    /// one behind the other: while one is on the device, the next is prepared.
    fn draw(
        &mut self,
        ways: &mut [Way<'_>],
        times: usize,
        watch: &Watch<'_>,
        drawn: &Cell<f64>,
    ) -> Result<(), Error> {
        let apart = watch.pass_times || ways.len() > 1 || !self.device().info().timestamps;
        let start = Instant::now();
        for _ in 0..times {
            for Way { stepper, request, timed, wall_ms } in &mut *ways {
                let start = Instant::now();
                stepper.restart();
                match &stepper.drawing.config.method.progressive {
                    Some(_) => self.grow(stepper, request, watch)?,
                    None => stepper.take(self, stepper.target(), watch)?,
                }
                if apart {
                    stepper.settle(0, watch)?;
                    wall_ms.push(start.elapsed().as_secs_f64() * 1e3);
                }
                timed.extend(stepper.take_tallies());
                drawn.set(drawn.get() + 1.0);
            }
        }
        if let ([Way { stepper, timed, wall_ms, .. }], false) = (ways, apart) {
            stepper.settle(0, watch)?;
            timed.extend(stepper.take_tallies());
            wall_ms.resize(timed.len(), start.elapsed().as_secs_f64() * 1e3 / times as f64);
        }
        Ok(())
    }

    /// Takes samples until one of the limits is reached, and draws what is shown of them.
    fn grow(
        &mut self,
        stepper: &mut Stepper,
        request: &FrameRequest<'_>,
        watch: &Watch<'_>,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let cancelled = || request.cancel.is_some_and(|cancel| cancel.load(Ordering::SeqCst));
        let config = stepper.drawing.config.clone();
        let (first, target) = (stepper.samples(), stepper.target());
        let (mut next_check, mut shown) = (LEAST_SAMPLES.max(first), start);
        let ahead = stepper.ahead(self);
        let report = |progress: Progress<'_>| {
            let taken = progress.done * f64::from(target) - f64::from(first);
            let by_samples = taken / f64::from(target.saturating_sub(first).max(1));
            let by_time = request.time.map(|time| start.elapsed().as_secs_f64() / time.as_secs_f64());
            let done = by_time.map_or(by_samples, |by_time| by_time.max(by_samples)).clamp(0.0, 1.0);
            (watch.report)(Progress { done, ..progress });
        };
        let watch = Watch { report: &report, ..*watch };
        let mut seconds_a_sample: Option<f64> = None;

        // However short the time, there is a picture.
        let in_time = |samples| samples == 0 || request.time.is_none_or(|time| start.elapsed() < time);
        while stepper.samples() < target && !cancelled() && in_time(stepper.samples()) {
            let taken = stepper.samples();
            if let Some(limit) = request.noise
                && taken >= next_check
            {
                // At numbers of samples that no clock decides.
                next_check = taken + (taken / 4).max(2);
                let images = stepper.means(self)?;
                if matches!(&images[..], [mean, a, b] if noise(mean, a, b, taken) <= limit) {
                    break;
                }
            }
            let fitting = seconds_a_sample.map_or(1, |seconds| (PASS_SECONDS / seconds) as u32);
            let mut samples = fitting.clamp(1, target - taken);
            if request.noise.is_some() && next_check > taken {
                samples = samples.min(next_check - taken);
            }
            // What is cut short in the middle of a sample is no picture; nor is there one before the first.
            let cancel = request.cancel.filter(|_| taken == 0);
            let watch = Watch { cancel, ..watch };
            stepper.take(self, samples, &watch)?;
            stepper.settle(ahead, &watch)?;
            seconds_a_sample = stepper.seconds_a_sample();
            if let Some(preview) = request.preview
                && shown.elapsed() >= preview.every
                && stepper.samples() < target
            {
                let unwatched = Watch { picture: true, pass_times: false, counters: None, ..watch };
                if let Some(mut frame) = stepper.peek(self, &unwatched)? {
                    self.denoise(&config, request, &mut frame)?;
                    (preview.show)(&frame);
                }
                shown = Instant::now();
            }
        }
        if stepper.samples() == 0 {
            return Err(Error::Cancelled);
        }
        stepper.show(self, &watch)
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
        let layer = |aov| {
            let layer = frame.aovs.iter().find(|(a, _)| *a == aov).map(|(_, layer)| layer);
            layer.expect("denoising asks for its layers")
        };
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
}
