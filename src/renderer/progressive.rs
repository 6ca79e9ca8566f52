//! Pictures that grow: passes of some samples each add to running means that outlive their graphs, until there are
//! enough samples, the time is over, the noise is low enough or the caller has seen enough. Which samples come in which
//! pass never shows.

use super::{
    Error, Frame, FrameRequest, Layer, Once, Progress, Recorded, Rendered, Renderer, Tickets, Window, record,
    taps,
};
use crate::config::RenderConfig;
use crate::graph::{self, Graph, Image, Res, RunOptions};
use crate::methods::{Aov, FrameInfo, Progressive};
use crate::scene::Camera;
use crate::techniques::Kernels;
use crate::techniques::path_trace::Means;
use crate::techniques::path_trace::adaptive::{MAX_RATE, Rates, Round, relative_variance};
use crate::vk::{self, Format};
use glam::Vec2;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Seconds a pass should take: what Ctrl-C and `--time` wait for.
const PASS_SECONDS: f64 = 0.25;

/// Rounds of a thread's loop in one pass at most: some drivers end shaders' loops after 65 535 in all.
const PASS_ROUNDS: u32 = 128;

/// Samples before which noise is not estimated.
const LEAST_SAMPLES: u32 = 16;

/// What a progressive render has come to: enough to go on from it to the same bits as without a break, on the same
/// device and backend with the same settings and seed. All layers have three channels and the window's size.
#[derive(Clone, Debug)]
pub struct Resume {
    /// Samples a pixel.
    pub samples: u32,
    /// Beauty.
    pub mean: Layer,
    /// The layers [`Aov::HalfA`] and [`Aov::HalfB`], which only those two, [`Aov::Variance`], a limit to noise and
    /// adaptive sampling need.
    pub halves: Option<[Layer; 2]>,
    /// The layer [`Aov::Rate`], which only adaptive sampling needs.
    pub rates: Option<Layer>,
}

/// Shows a picture on the way.
#[derive(Clone, Copy)]
pub struct Preview<'a> {
    /// Time between two previews.
    pub every: Duration,
    /// Is shown everything the final frame has but passes and times.
    pub show: &'a dyn Fn(&Frame),
}

impl fmt::Debug for Preview<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Preview").field("every", &self.every).finish_non_exhaustive()
    }
}

/// Relative error of a picture by two independent halves of its samples, `a` of one more or as many as `b`: the root of
/// the relative mean squared error ([`crate::metrics::rel_mse`]) to be expected of `mean`.
#[must_use]
pub fn noise(mean: &[f32], a: &[f32], b: &[f32], samples: u32) -> f64 {
    let (n, count) = (f64::from(samples), mean.len().max(1) as f64);
    let share = f64::from(samples.div_ceil(2)) / n * (f64::from(samples / 2) / n);
    let terms = relative_variance(mean, a, b, share);
    (terms.sum::<f64>() / count).sqrt()
}

/// The means that drawing `aovs` takes.
pub(super) fn means(
    adaptive: bool,
    aovs: &[Aov],
    mut image: impl FnMut(&'static str) -> Res<Image>,
) -> Means {
    let halves = adaptive || aovs.iter().any(|aov| aov.takes_halves());
    Means {
        all: image("mean"),
        halves: halves.then(|| [image("half_a"), image("half_b")]),
        rates: adaptive.then(|| image("rates")),
    }
}

/// Images that outlive the graphs, and what they hold.
struct State {
    all: Arc<vk::Image>,
    halves: Option<[Arc<vk::Image>; 2]>,
    rates: Option<(Arc<vk::Image>, Rates)>,
    samples: u32,
    /// Whether the means hold anything; black or `contents` is what they begin with.
    begun: bool,
    contents: Option<Vec<Vec<u8>>>,
    /// Whether the rates are on the device.
    rated: bool,
}

/// What decides a picture, once for all its graphs.
struct Session<'a> {
    config: &'a RenderConfig,
    request: &'a FrameRequest<'a>,
    kernels: Kernels,
    view: Window,
}

impl State {
    fn new(
        device: &vk::Device,
        extent: [u32; 2],
        halves: bool,
        adaptive: bool,
        resume: Option<&Resume>,
    ) -> Result<Self, Error> {
        let image = |name| device.image(name, extent, Format::Rgba32Float).map(Arc::new);
        let all = image("mean")?;
        let halves = if halves { Some([image("half_a")?, image("half_b")?]) } else { None };
        let samples = resume.map_or(0, |resume| resume.samples);
        let rates = match resume {
            _ if !adaptive => None,
            None => Some(Rates::new(extent)),
            Some(resume) => Some(rates(resume, extent)?),
        };
        let contents =
            resume.map(|resume| contents(resume, extent, halves.is_some(), rates.as_ref())).transpose()?;
        let rates = rates.map(|rates| Ok::<_, Error>((image("rates")?, rates))).transpose()?;
        Ok(Self { all, halves, rates, samples, begun: false, contents, rated: false })
    }

    /// The images in a graph, with a first content where they have none.
    fn import(&self, g: &mut Graph) -> Means {
        let all = g.import_image("mean", &self.all);
        let halves =
            self.halves.as_ref().map(|[a, b]| [g.import_image("half_a", a), g.import_image("half_b", b)]);
        if !self.begun {
            let images = std::iter::once(all).chain(halves.into_iter().flatten());
            for (index, image) in images.enumerate() {
                match &self.contents {
                    Some(contents) => g.upload_image("resume", image, contents[index].clone()),
                    None => g.clear_image("begin", image),
                }
            }
        }
        let rates = self.rates.as_ref().map(|(image, rates)| {
            let image = g.import_image("rates", image);
            if !self.rated {
                g.upload_image("rates", image, bytemuck::cast_slice(&rates.texels()).to_vec());
            }
            image
        });
        Means { all, halves, rates }
    }
}

impl Session<'_> {
    /// Records the method, with `samples` samples more.
    fn record(
        &self,
        g: &mut Graph,
        area: f32,
        state: &State,
        samples: u32,
        aovs: &[Aov],
    ) -> (Means, Recorded) {
        let means = state.import(g);
        let taken = state.samples;
        let info = FrameInfo { means: Some(means), taken, samples, ..self.view.frame(area) };
        (means, record(g, &self.kernels, self.config, &self.view, &info, aovs, &[], 0))
    }
}

/// Checks a layer's shape.
fn fits(layer: &Layer, extent: [u32; 2], channels: usize) -> Result<(), Error> {
    if [layer.width, layer.height] == extent && layer.channels == channels {
        return Ok(());
    }
    let (given, [width, height]) = ((layer.width, layer.height), extent);
    Err(Error::Resume(format!("{}x{} pixels in place of {width}x{height}", given.0, given.1)))
}

/// The rates it goes on at.
fn rates(resume: &Resume, extent: [u32; 2]) -> Result<Rates, Error> {
    let layer = resume
        .rates
        .as_ref()
        .ok_or_else(|| Error::Resume("there is no layer rate, which adaptive sampling needs".into()))?;
    fits(layer, extent, 3)?;
    Rates::read(extent, &layer.data)
        .ok_or_else(|| Error::Resume("the layer rate holds what no render leaves there".into()))
}

/// Texels of the means, what the samples behind each colour weigh in w.
fn contents(
    resume: &Resume,
    extent: [u32; 2],
    halves: bool,
    rates: Option<&Rates>,
) -> Result<Vec<Vec<u8>>, Error> {
    let n = resume.samples;
    let mut layers = vec![&resume.mean];
    if halves {
        let Some(halves) = &resume.halves else {
            return Err(Error::Resume(
                "there are no layers half_a and half_b, which noise, variance and adaptive sampling need"
                    .into(),
            ));
        };
        layers.extend(halves);
    }
    let weight = |pixel: usize, layer: usize| match rates {
        Some(rates) => rates.weights(pixel, n)[layer],
        None => [n, n.div_ceil(2), n / 2][layer] as f32,
    };
    let texels = |(index, layer): (usize, &Layer)| {
        fits(layer, extent, 3)?;
        let colours = layer.data.chunks_exact(3).enumerate();
        let texels = colours.map(|(pixel, c)| [c[0], c[1], c[2], weight(pixel, index)]);
        Ok(bytemuck::cast_slice(&texels.collect::<Vec<[f32; 4]>>()).to_vec())
    };
    layers.into_iter().enumerate().map(texels).collect()
}

impl Renderer {
    /// Takes samples until one of the limits is reached.
    pub(super) fn progressive(
        &mut self,
        method: &Progressive,
        config: &RenderConfig,
        camera: &Camera,
        request: &FrameRequest<'_>,
        once: &Once<'_>,
    ) -> Result<Rendered, Error> {
        let start = Instant::now();
        let view = Window::of(config);
        let adaptive = (method.adaptive)(config);
        let halves = adaptive || request.noise.is_some() || request.aovs.iter().any(|aov| aov.takes_halves());
        let mut state = State::new(&self.device, view.extent, halves, adaptive, request.resume)?;
        self.write_uniform(config, camera, Vec2::splat(0.5), once.counters)?;
        let kernels = self.kernels_modelling(config, request.modelled);
        let session = Session { config, request, kernels, view };
        // A tap that is not there is known before the first sample.
        let mut g = Graph::new();
        session.record(&mut g, self.area, &state, 0, &request.layers());
        taps(&mut g, request.taps)?;
        drop(g);
        let cancelled = || request.cancel.is_some_and(|cancel| cancel.load(Ordering::SeqCst));
        let target = (method.samples)(config);
        let (first, mut next_check) = (state.samples, LEAST_SAMPLES.max(state.samples));
        let mut rendered = Rendered::new();
        let (mut seconds_a_sample, mut shown) = (None, start);
        let rate = if adaptive { MAX_RATE } else { 1 };
        let most = (PASS_ROUNDS / (method.rounds)(config).saturating_mul(rate)).max(1);

        // However short the time, there is a picture.
        let in_time = |samples| samples == 0 || request.time.is_none_or(|time| start.elapsed() < time);
        while state.samples < target && !cancelled() && in_time(state.samples) {
            if request.noise.is_some() && state.samples >= next_check {
                // At numbers of samples that no clock decides.
                next_check = state.samples + (state.samples / 4).max(2);
                if self.noise_of(&state)? <= request.noise.unwrap_or_default() {
                    break;
                }
            }
            if adaptive && state.samples > 0 && Round::of(state.samples).start == state.samples {
                self.next_round(&mut state)?;
            }
            let fitting = seconds_a_sample.map_or(1, |seconds: f64| (PASS_SECONDS / seconds) as u32);
            let mut samples = fitting.clamp(1, most).min(target - state.samples);
            if request.noise.is_some() && next_check > state.samples {
                samples = samples.min(next_check - state.samples);
            }
            if adaptive {
                samples = samples.min(Round::of(state.samples).end - state.samples);
            }
            let pass_start = Instant::now();
            let done = |share: f64| {
                let now = f64::from(state.samples - first) + share * f64::from(samples);
                let by_samples = now / f64::from(target - first);
                let by_time = request.time.map(|time| start.elapsed().as_secs_f64() / time.as_secs_f64());
                by_time.map_or(by_samples, |by_time| by_time.max(by_samples)).min(1.0)
            };
            let report =
                |p: graph::Progress<'_>| (once.progress)(Progress { pass: p.pass, done: done(p.done) });
            let mut g = Graph::new();
            session.record(&mut g, self.area, &state, samples, &[]);
            let options = RunOptions {
                scene: Some(&self.set),
                progress: Some(&report),
                pass_times: once.pass_times,
                ..RunOptions::default()
            };
            let run = self.executor.run(g, &options)?;
            (state.begun, state.rated) = (true, true);
            rendered.add(&run);
            state.samples += samples;
            seconds_a_sample = Some((pass_start.elapsed().as_secs_f64() / f64::from(samples)).max(1e-9));
            if let Some(preview) = request.preview
                && shown.elapsed() >= preview.every
                && state.samples < target
            {
                let preview_of = Once { picture: true, pass_times: false, counters: None, ..*once };
                if let (_, Some(mut frame)) = self.finish(&session, &state, &preview_of)? {
                    self.denoise(config, request, &mut frame)?;
                    (preview.show)(&frame);
                }
                shown = Instant::now();
            }
        }
        if state.samples == 0 {
            return Err(Error::Cancelled);
        }
        let (run, frame) = self.finish(&session, &state, once)?;
        rendered.add(&run);
        rendered.frame = frame;
        rendered.wall_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(rendered)
    }

    /// The picture as it is.
    fn finish(
        &mut self,
        session: &Session<'_>,
        state: &State,
        once: &Once<'_>,
    ) -> Result<(graph::Run, Option<Frame>), Error> {
        let &Session { config, request, .. } = session;
        let mut g = Graph::new();
        let layers = request.layers();
        let (means, recorded) = session.record(&mut g, self.area, state, 0, &layers);
        let halves = means.halves.filter(|_| once.picture);
        let halves = halves.map(|halves| halves.map(|half| g.read_image::<[f32; 4]>(half)));
        let tickets = Tickets::take(&mut g, config, recorded, once.picture);
        let specs = if once.picture { request.taps } else { &[] };
        let taps = taps(&mut g, specs)?;
        let options =
            RunOptions { scene: Some(&self.set), pass_times: once.pass_times, ..RunOptions::default() };
        let mut run = self.executor.run(g, &options)?;
        let Some(tickets) = tickets else { return Ok((run, None)) };
        let halves = halves.map(|halves| halves.map(|half| colours(&run.take(half))));
        let mut frame = tickets.redeem(&mut run, session.view.extent, &layers, taps);
        frame.samples = Some(state.samples);
        let halves = halves.filter(|_| state.samples > 1);
        frame.noise = halves.map(|[a, b]| noise(&frame.beauty.data, &a, &b, state.samples));
        Ok((run, Some(frame)))
    }

    fn noise_of(&mut self, state: &State) -> Result<f64, Error> {
        let images = self.means_of(state)?;
        Ok(match &images[..] {
            [mean, a, b] => noise(mean, a, b, state.samples),
            _ => f64::INFINITY,
        })
    }

    /// Decides the rates of the round that begins.
    fn next_round(&mut self, state: &mut State) -> Result<(), Error> {
        let images = self.means_of(state)?;
        if let (Some((_, rates)), [mean, a, b]) = (&mut state.rates, &images[..]) {
            *rates = rates.next(mean, a, b, state.samples);
            state.rated = false;
        }
        Ok(())
    }

    /// Mean and halves, RGB.
    fn means_of(&mut self, state: &State) -> Result<Vec<Vec<f32>>, Error> {
        let mut g = Graph::new();
        let Means { all, halves, .. } = state.import(&mut g);
        let tickets = std::iter::once(all).chain(halves.into_iter().flatten());
        let tickets: Vec<_> = tickets.map(|image| g.read_image::<[f32; 4]>(image)).collect();
        let mut run = self.executor.run(g, &RunOptions::default())?;
        Ok(tickets.into_iter().map(|ticket| colours(&run.take(ticket))).collect())
    }
}

fn colours(texels: &[[f32; 4]]) -> Vec<f32> {
    texels.iter().flat_map(|texel| [texel[0], texel[1], texel[2]]).collect()
}
