//! Path tracing: the reference (see [`path_trace`]).
//!
//! The layers `albedo`, `N`, `P` and `depth` are those of the pixel's centre. Radiance is not split by kind; instead
//! `path_trace.transport` draws one kind alone.

use super::{Aov, FrameInfo, Layers, Method};
use crate::config::RenderConfig;
use crate::graph::Graph;
use crate::techniques::{Kernels, gbuffer, path_trace};

/// The registry's entry.
pub const METHOD: Method = Method {
    name: "path",
    about: "path tracing, the reference",
    description: "Paths from the camera ask a light at every vertex and find others by chance, weighted (multiple \
        importance sampling), until Russian roulette ends them. Known bias: light of more than `path_trace.max_depth` \
        edges is missing, and light of points, spots and suns by way of mirrors and glass. Known noise: grain, by one over \
        the root of the samples a pixel. Kajiya 1986; Veach 1997.",
    aovs: &[Aov::Albedo, Aov::N, Aov::P, Aov::Depth, Aov::Variance, Aov::HalfA, Aov::HalfB, Aov::Rate],
    progressive: true,
    record,
    left_out: |_, _| Vec::new(),
};

/// # Panics
/// Without means to add to.
fn record(g: &mut Graph, k: &Kernels, config: &RenderConfig, frame: &FrameInfo) -> Layers {
    let means = frame.means.expect("progressive methods are given means");
    path_trace::path_trace(g, k, &config.path_trace, config.max_depth(), &means, frame.taken, frame.samples);
    Layers {
        beauty: means.all,
        gbuffer: gbuffer::gbuffer(g, k, frame.origin, frame.extent),
        geometry: None,
        direct: None,
        specular: None,
        irradiance: None,
        glossy: None,
        halves: means.halves,
        rates: means.rates,
        vpl_count: None,
        regathered: None,
    }
}
