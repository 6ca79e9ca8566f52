//! Parts into a picture: beauty = direct + specular + albedo/π · irradiance + glossy, all radiance (W/(sr·m²)).

use super::gbuffer::GBuffer;
use crate::graph::{Graph, Grid, Image, ImageDesc, Res};
use crate::shaders::compose as kernels;

/// Sums what reaches the camera.
pub fn beauty(
    g: &mut Graph,
    gb: &GBuffer,
    direct: Res<Image>,
    specular: Option<Res<Image>>,
    irradiance: Res<Image>,
    glossy: Option<Res<Image>>,
) -> Res<Image> {
    g.group("compose", |g| {
        let out = g.image("beauty", g.desc(direct));
        let bind = kernels::beauty::Bind {
            direct,
            // Unread where there is none.
            specular: specular.unwrap_or(direct),
            irradiance,
            albedo: gb.albedo,
            glossy: glossy.unwrap_or(direct),
            out_radiance: out,
        };
        let spec = kernels::beauty::Spec { specular: specular.is_some(), lobes: glossy.is_some() };
        let kernel = kernels::beauty::kernel(spec);
        g.pass("beauty", &kernel, bind, kernels::beauty::Params {}, Grid::Over(out));
        out
    })
}

/// Indirect radiance at primary hits by itself.
pub fn indirect(g: &mut Graph, gb: &GBuffer, irradiance: Res<Image>) -> Res<Image> {
    g.group("compose", |g| {
        let out = g.image("indirect", g.desc(irradiance));
        let bind = kernels::indirect::Bind { irradiance, albedo: gb.albedo, out_radiance: out };
        g.pass("indirect", &kernels::indirect::kernel(), bind, kernels::indirect::Params {}, Grid::Over(out));
        out
    })
}

/// Direct light with irradiance that rays have found of the environment.
pub fn with_sky(g: &mut Graph, gb: &GBuffer, direct: Res<Image>, irradiance: Res<Image>) -> Res<Image> {
    g.group("compose", |g| {
        let out = g.image("direct", g.desc(direct));
        let bind = kernels::sky::Bind { direct, irradiance, albedo: gb.albedo, out_radiance: out };
        g.pass("sky", &kernels::sky::kernel(), bind, kernels::sky::Params {}, Grid::Over(out));
        out
    })
}

/// Takes `value` into the running mean of `count` samples before it.
pub fn accumulate(g: &mut Graph, value: Res<Image>, mean: Res<Image>, count: u32) {
    g.group("compose", |g| {
        let bind = kernels::accumulate::Bind { value, mean };
        let params = kernels::accumulate::Params { count };
        g.pass("accumulate", &kernels::accumulate::kernel(), bind, params, Grid::Over(value));
    });
}

/// Variance of the mean of all samples, estimated by the means of two halves of them.
pub fn variance(g: &mut Graph, [half_a, half_b]: [Res<Image>; 2]) -> Res<Image> {
    g.group("compose", |g| {
        let out = g.image("variance", g.desc(half_a));
        let bind = kernels::variance::Bind { half_a, half_b, out_variance: out };
        g.pass("variance", &kernels::variance::kernel(), bind, kernels::variance::Params {}, Grid::Over(out));
        out
    })
}

/// An image like `like` without any light.
pub fn black(g: &mut Graph, like: Res<Image>) -> Res<Image> {
    let out = g.image("black", g.desc(like));
    g.clear_image("black", out);
    out
}

/// The part of `extent` pixels of an image that begins at pixel `origin`.
pub fn cut(g: &mut Graph, image: Res<Image>, origin: [u32; 2], extent: [u32; 2]) -> Res<Image> {
    g.group("compose", |g| {
        let out = g.image("cut", ImageDesc { extent, ..g.desc(image) });
        let bind = kernels::cut::Bind { image, out_cut: out };
        g.pass("cut", &kernels::cut::kernel(), bind, kernels::cut::Params { origin }, Grid::Over(out));
        out
    })
}
