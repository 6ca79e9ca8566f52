//! Unidirectional path tracing (Kajiya 1986) with next-event estimation, multiple importance sampling (power heuristic;
//! Veach 1997) and Russian roulette: the reference other methods are measured against.
//!
//! Each pixel keeps running means of its samples; a pass adds some samples more, the same ones whatever the passes they
//! come in. Samples are Owen-scrambled (0, 2)-sequences, one set for each pixel and each pair of decisions of a path
//! (Burley 2020). Materials and lights are those of `glsl/lib/bsdf.glsl` and `lights.glsl`.
//!
//! Bias: none beyond `max_depth`. Noise falls with one over the root of the number of samples. Not found at all: light of
//! point, spot and directional lights by way of mirrors and glass but panes (no ray hits them, and shadow rays stop there),
//! in either estimator. Through a pane, as past partial coverage, is no vertex and no edge. Textures are read at level 0, nearest or bilinear: there are no mip levels, samples average what a
//! pixel covers.
//!
//! Cost: two rays an edge. One kernel, a thread a pixel, sample after sample. Two other ways were measured against it, in
//! the Office and the Conference room, 8 edges: threads that begin their pixel's next sample as soon as a path ends take
//! 1.07 and 1.07 times as long on an H100 (800×600, 64 samples), 1.01 and 1.11 times on lavapipe (160×120, 16 samples);
//! queues of path states between kernels that generate, extend, shade and ask for light 1.14 and 1.15 times there, 1.02
//! and 1.11 times here. The H100 traces 291 and 201 million paths a second.

pub(crate) mod adaptive;

use super::Kernels;
use super::setting::{BadValue, Settings, within};
use crate::graph::{Graph, Grid, Image, Res};
use crate::shaders::{self, path_trace::trace};
use adaptive::Round;

/// Most paths a pixel: 32-bit floats count no further.
pub const MAX_SPP: u32 = 1 << 24;

/// How light is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// Every vertex asks one light for light, the path's own edges find emitters too, and the power heuristic weighs
    /// both.
    #[default]
    Mis,
    /// Only the path's own edges find emitters and the environment. Noisier; the same mean. Point, spot and directional
    /// lights are asked as above: no edge finds them.
    Naive,
}

/// Which light counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Transport {
    /// All of it.
    #[default]
    Full,
    /// Emission seen by the camera, and light scattered once, by no mirror or body of smooth glass.
    Direct,
    /// Light scattered twice or more, at every vertex by the Lambertian part alone: the `indirect` layer of `igi`.
    DiffuseIndirect,
}

/// Where in a pixel samples lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PixelFilter {
    /// Uniform over the pixel's square: the picture is an area average.
    #[default]
    Box,
    /// Its centre: edges are jagged, as with one pixel sample of other methods.
    Center,
}

/// How paths are traced.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathTraceConfig {
    /// Paths a pixel, 1 … 2²⁴. Noise falls with the root, time grows in proportion. Powers of two stratify best.
    pub spp: u32,
    /// Edges of the longest path, counted from the camera, 1 … 65536: 1 is emission alone, 2 adds direct light. Fewer
    /// lose light. Absent: what `igi` takes into account, `vpl_shoot.bounces` + 2, or 64 where that is absent too.
    pub max_depth: Option<u32>,
    /// How light is found. Both have the same mean.
    pub estimator: Estimator,
    /// Which light counts.
    pub transport: Transport,
    /// Where in a pixel samples lie.
    pub pixel_filter: PixelFilter,
    /// Edges after which a path goes on with a probability that follows its throughput (Russian roulette), 1 … 65536.
    /// Fewer are faster and noisier; no bias.
    pub roulette_depth: u32,
    /// Whether noisy parts of the picture take more samples, up to 8 times the mean, at the cost of others, down to a
    /// quarter. Off for references: it makes noise whose size depends on the samples themselves. A crop
    /// is then not the whole's bits.
    pub adaptive: bool,
}

impl Default for PathTraceConfig {
    fn default() -> Self {
        Self {
            spp: 64,
            max_depth: None,
            estimator: Estimator::default(),
            transport: Transport::default(),
            pixel_filter: PixelFilter::default(),
            roulette_depth: 5,
            adaptive: false,
        }
    }
}

impl Settings for PathTraceConfig {
    fn check(&self) -> Result<(), BadValue> {
        within("path_trace.spp", self.spp, 1..=MAX_SPP)?;
        self.max_depth.map_or(Ok(()), |edges| within("path_trace.max_depth", edges, 1..=65536))?;
        within("path_trace.roulette_depth", self.roulette_depth, 1..=65536)
    }
}

/// What paths have come to so far; images of the window's size that outlive a graph.
#[derive(Clone, Copy, Debug)]
pub struct Means {
    /// Mean radiance, and the number of samples it is of.
    pub all: Res<Image>,
    /// The same of samples 0, 2, 4, … and of samples 1, 3, 5, …
    pub halves: Option<[Res<Image>; 2]>,
    /// Where sampling is adaptive: samples for each that pixels take on average, what rates so far have done to the
    /// variance (1: nothing), and samples before the last change of rates.
    pub rates: Option<Res<Image>>,
}

/// Takes `samples` further paths a pixel, of at most `max_depth` edges, into the means of `taken`.
pub fn path_trace(
    g: &mut Graph,
    k: &Kernels,
    config: &PathTraceConfig,
    max_depth: u32,
    means: &Means,
    taken: u32,
    samples: u32,
) {
    let emitters = k.area_lights();
    let spec = trace::Spec {
        transport: match config.transport {
            Transport::Full => shaders::TRANSPORT_FULL,
            Transport::Direct => shaders::TRANSPORT_DIRECT,
            Transport::DiffuseIndirect => shaders::TRANSPORT_DIFFUSE_INDIRECT,
        },
        connect: match config.estimator {
            Estimator::Mis if emitters || k.lights() > 0 => shaders::CONNECT_ALL,
            Estimator::Naive if k.lights() > 0 => shaders::CONNECT_DELTA,
            _ => shaders::CONNECT_NONE,
        },
        box_filter: config.pixel_filter == PixelFilter::Box,
        finds_light: k.finds_light(),
        halves: means.halves.is_some(),
        adaptive: means.rates.is_some(),
    };
    let max_depth = if config.transport == Transport::Direct { max_depth.min(2) } else { max_depth };
    // Without rates there is one round without end.
    let round = means.rates.map_or(Round { start: 0, end: u32::MAX }, |_| Round::of(taken));
    let [half_a, half_b] = means.halves.unwrap_or([means.all; 2]);
    g.group("path_trace", |g| {
        let bind = trace::Bind { mean: means.all, half_a, half_b, rates: means.rates.unwrap_or(means.all) };
        let params = trace::Params {
            before: round.start,
            first: taken - round.start,
            samples,
            max_depth,
            roulette_depth: config.roulette_depth,
        };
        g.pass("trace", &trace::kernel(spec, &k.scene), bind, params, Grid::Over(means.all));
    });
}
