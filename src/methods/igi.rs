//! Instant global illumination (Marques & Santos 2010; Wald et al. 2002; Keller 1997), without accelerations.
//!
//! Known bias: light of more than `bounces` diffuse bounces, light nearer than `min_distance`, and rough specular
//! lobes are missing. Known noise: VPLs are shared by all pixels, so error shows as splotches, not grain.

use super::{FrameInfo, Layers, Method};
use crate::config::RenderConfig;
use crate::graph::Graph;
use crate::techniques::{Kernels, compose, gbuffer, indirect, vpl_shoot, whitted};

/// The registry's entry.
pub const METHOD: Method =
    Method { name: "igi", about: "instant global illumination with virtual point lights", record };

fn record(g: &mut Graph<'_>, k: &Kernels, config: &RenderConfig, frame: &FrameInfo) -> Layers {
    let min_distance = config.indirect.min_distance(frame.area, &config.vpl_shoot);
    let vpls = vpl_shoot::vpl_shoot(g, k, &config.vpl_shoot);
    let gbuffer = gbuffer::gbuffer(g, k, frame.extent);
    let direct = whitted::direct(g, k, &gbuffer);
    let specular = whitted::specular(g, k, &config.whitted, &gbuffer, &vpls, &config.vpl_shoot, min_distance);
    let irradiance = indirect::indirect(g, k, &config.vpl_shoot, &gbuffer, &vpls, min_distance);
    let beauty = compose::beauty(g, &gbuffer, direct, specular, irradiance);
    Layers { beauty, gbuffer, direct, specular, irradiance, vpl_count: vpls.count }
}
