//! What comes of a render.

use crate::layer::Layer;
use crate::methods::Aov;

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
#[derive(Clone, Debug, Default)]
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
    /// Passes in order of execution, without downloads.
    pub passes: Vec<PassStats>,
    /// Milliseconds on the device of the whole frame: median over repeats. Where passes overlap it is less than
    /// their sum: a GPU renders each repeat twice, the second time without timing passes.
    pub total_ms: Option<f64>,
    /// Milliseconds of each way of [`FrameRequest::beside`](super::FrameRequest::beside), as `total_ms`; by the host's clock where the device has no
    /// timestamps.
    pub beside_ms: Vec<f64>,
    /// Milliseconds by the host's clock from the first submit to the end of the last one: of a repeat, on a GPU the mean
    /// over repeats drawn one behind the other; without repeats to the end of the last download.
    pub wall_ms: f64,
    /// Milliseconds that the host itself worked to record, plan and submit the frame, waits left out: median over repeats.
    pub host_ms: f64,
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
    /// [`noise`](super::noise) of beauty, where its halves were kept.
    pub noise: Option<f64>,
    /// Most bytes ever allocated on the device so far.
    pub peak_device_bytes: u64,
}
