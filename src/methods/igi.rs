//! Instant global illumination, with the paper's accelerations as switches. What it is, and its known bias and noise:
//! [`METHOD`]'s description.

use super::{Aov, FrameInfo, Layers, Method};
use crate::config::RenderConfig;
use crate::graph::Graph;
use crate::scene::SceneProfile;
use crate::techniques::{Kernels, compose, gbuffer, indirect, vpl_shoot, whitted};

/// The registry's entry.
pub const METHOD: Method = Method {
    name: "igi",
    about: "instant global illumination with virtual point lights",
    description: "Paths from the lights leave virtual point lights (VPLs) where they meet diffuse surfaces; every pixel \
        gathers indirect light from all of them, one shadow ray each. Imperfect visibility, downsampling and interleaved \
        sampling are switches. Known bias: light of more than `vpl_shoot.bounces` diffuse bounces and light nearer than \
        `indirect.min_distance` is missing (`indirect.compensation` gives most of it back), light paths end at rough \
        metals, and VPLs shine as Lambertians. Known noise: VPLs are shared by all pixels, so error shows as splotches, \
        not grain; but grain by the rays to lights that have a size, most in smooth lobes. Marques & Santos 2010; Wald et al. 2002; Keller 1997.",
    aovs: &[
        Aov::Albedo,
        Aov::N,
        Aov::P,
        Aov::Direct,
        Aov::Specular,
        Aov::Indirect,
        Aov::Glossy,
        Aov::Irradiance,
        Aov::Depth,
    ],
    progressive: false,
    record,
    left_out,
};

fn left_out(profile: &SceneProfile, config: &RenderConfig) -> Vec<String> {
    let rough = config.whitted.mirror_roughness;
    let without = !config.indirect.glossy;
    let mut lines = Vec::new();
    if without && profile.rough_lobes {
        lines.push(format!("specular lobes rougher than {rough} are left out (indirect.glossy is false)"));
    }
    if without && profile.clearcoat {
        lines.push("clear coats are left out (indirect.glossy is false)".into());
    }
    if profile.rough_glass {
        lines.push(format!("glass rougher than {rough} transmits as if it were smooth"));
    }
    lines
}

fn record(g: &mut Graph, k: &Kernels, config: &RenderConfig, frame: &FrameInfo) -> Layers {
    let min_distance = config.indirect.min_distance(frame.area, &config.vpl_shoot);
    // Passes that do not need each other stand side by side, the longest chains first: a GPU overlaps them.
    let paths = vpl_shoot::paths(g, k, &config.vpl_shoot);
    let gbuffer = gbuffer::gbuffer(g, k, frame.origin, frame.extent);
    let vpls = vpl_shoot::compact(g, &config.vpl_shoot, &paths, config.indirect.subsets());
    let reflections = whitted::tree(g, k, &config.whitted, &gbuffer, &vpls, min_distance);
    let samples = indirect::gather(g, k, &config.indirect, &gbuffer, &vpls, min_distance);
    let direct = whitted::direct(g, k, &config.whitted, &gbuffer);
    let geometry = config.indirect.filtered().then(|| gbuffer::unpack(g, k, &gbuffer));
    if let Some(reflections) = &reflections {
        whitted::sort(g, k, reflections, &vpls);
    }
    let glossy = indirect::glossy(g, k, &config.indirect, &gbuffer, &vpls, min_distance);
    let indirect =
        indirect::reconstruct(g, k, &config.indirect, &gbuffer, geometry.as_ref(), &vpls, &samples);
    let specular =
        reflections.map(|reflections| whitted::specular(g, k, &config.whitted, &reflections, &vpls));
    let beauty = compose::beauty(g, &gbuffer, direct, specular, indirect.irradiance, glossy);
    Layers {
        beauty,
        gbuffer,
        geometry,
        direct: Some(direct),
        specular,
        irradiance: Some(indirect.irradiance),
        glossy,
        halves: None,
        rates: None,
        vpl_count: Some(vpls.count),
        regathered: indirect.regathered,
    }
}
