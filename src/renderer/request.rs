//! What is asked of a render.

use super::frame::Frame;
use crate::accel::{Levels, Rebuild};
use crate::denoise::Denoiser;
use crate::layer::Layer;
use crate::methods::Aov;
use crate::scene::Feature;
use crate::techniques::indirect::Visibility;
use crate::vk::Backend;
use std::fmt;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

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
    /// Whether the software structure has a level for placements. The picture is the same.
    pub levels: Levels,
    /// When nodes over what changes shape are built anew.
    pub rebuild: Rebuild,
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
    /// Progressive methods stop where [`noise`](super::noise) is no more than this.
    pub noise: Option<f64>,
    /// Features that are modelled as if the scene had them: the picture is the same (see [`Prepared::unneeded`](super::Prepared::unneeded)).
    pub modelled: &'a [Feature],
    /// Further ways to draw this frame that are only timed, by turns with it: each models these features
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
    pub(super) fn layers(&self) -> Vec<Aov> {
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
