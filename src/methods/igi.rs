//! Instant global illumination (Marques & Santos 2010; Wald et al. 2002; Keller 1997), with the paper's accelerations as
//! switches: imperfect visibility, downsampling, interleaved sampling.
//!
//! Known bias: light of more than `bounces` diffuse bounces, light nearer than `min_distance`, and rough specular
//! lobes are missing. Known noise: VPLs are shared by all pixels, so error shows as splotches, not grain.

use super::{Aov, FrameInfo, Layers, Method};
use crate::config::RenderConfig;
use crate::graph::Graph;
use crate::techniques::{Kernels, compose, gbuffer, indirect, vpl_shoot, whitted};

/// The registry's entry.
pub const METHOD: Method = Method {
    name: "igi",
    about: "instant global illumination with virtual point lights",
    aovs: &[
        Aov::Albedo,
        Aov::N,
        Aov::P,
        Aov::Direct,
        Aov::Specular,
        Aov::Indirect,
        Aov::Irradiance,
        Aov::Depth,
    ],
    progressive: false,
    record,
};

fn record(g: &mut Graph<'_>, k: &Kernels, config: &RenderConfig, frame: &FrameInfo) -> Layers {
    let min_distance = config.indirect.min_distance(frame.area, &config.vpl_shoot);
    // Passes that do not need each other stand side by side, the longest chains first: a GPU overlaps them.
    let paths = vpl_shoot::paths(g, k, &config.vpl_shoot);
    let gbuffer = gbuffer::gbuffer(g, k, frame.origin, frame.extent);
    let vpls = vpl_shoot::compact(g, &config.vpl_shoot, &paths, config.indirect.subsets());
    let geometry = config.indirect.filtered().then(|| gbuffer::unpack(g, k, &gbuffer));
    let reflections = whitted::tree(g, k, &config.whitted, &gbuffer, &vpls, min_distance);
    let samples = indirect::gather(g, k, &config.indirect, &gbuffer, &vpls, min_distance);
    let direct = whitted::direct(g, k, &gbuffer);
    if let Some(reflections) = &reflections {
        whitted::sort(g, k, reflections);
    }
    let indirect =
        indirect::reconstruct(g, k, &config.indirect, &gbuffer, geometry.as_ref(), &vpls, &samples);
    let specular = reflections.map(|reflections| whitted::specular(g, k, &reflections, &vpls));
    let beauty = compose::beauty(g, &gbuffer, direct, specular, indirect.irradiance);
    Layers {
        beauty,
        gbuffer,
        geometry,
        direct: Some(direct),
        specular,
        irradiance: Some(indirect.irradiance),
        halves: None,
        rates: None,
        vpl_count: Some(vpls.count),
        regathered: indirect.regathered,
    }
}
