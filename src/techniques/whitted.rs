//! Direct light and specular paths (Whitted 1980; Marques & Santos 2010, §4).
//!
//! `direct`: emission and, with a shadow ray to every light, direct light on the diffuse part of primary hits.
//! `specular`: the tree of mirrored and transmitted rays behind primary hits, with emission, direct light and
//! (at full resolution, from every VPL, as in the paper) indirect light where they end. Three passes: `tree`
//! follows the rays and lists the points they end at, `light` lights the list, `sum` gathers each pixel's share;
//! on an H100 1.4 ms in the Conference room, where one kernel that does it all takes 10.9. Opaque mirrors follow
//! Schlick's approximation as glTF does, glass the exact Fresnel equations; a transmissive surface without volume
//! is a thin wall with R' = 2R / (1 + R), straight through, and one with volume refracts and absorbs.
//!
//! Bias: lobes rougher than `mirror_roughness` and specular paths deeper than `specular_depth` are left out;
//! transmissive surfaces block shadow rays, so there are no caustics from point lights but through VPLs.
//! Cost: one shadow ray a light; behind mirrors and glass also one a VPL.

use super::indirect::RANGE;
use super::{
    Kernels,
    gbuffer::GBuffer,
    vpl_shoot::{VplShootConfig, Vpls},
};
use crate::graph::{Graph, Grid, Image, Res};
use crate::shaders::{
    Reached,
    whitted::{self as kernels, light, sum, tree},
};
use crate::vk::Format;

/// How the tree of specular rays grows.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WhittedConfig {
    /// Specular bounces in a row, 0 … 16, for camera rays and light paths alike. Fewer darken what is seen
    /// through glass and in facing mirrors. Ours: the paper does not say.
    pub specular_depth: u32,
    /// Roughness (perceptual) up to which a surface is a mirror, 0 … 1. More turns glossy surfaces into
    /// mirrors; lobes above it are left out. Ours: the paper does not say.
    pub mirror_roughness: f32,
}

impl Default for WhittedConfig {
    fn default() -> Self {
        Self { specular_depth: 5, mirror_roughness: 0.1 }
    }
}

/// Radiance by emission and direct light at primary hits.
pub fn direct(g: &mut Graph<'_>, k: &Kernels, gb: &GBuffer) -> Res<Image> {
    g.group("whitted", |g| {
        let out = g.image("direct", g.desc(gb.albedo));
        let bind = kernels::direct::Bind { hits: gb.hits, albedo: gb.albedo, out_radiance: out };
        g.pass(
            "direct",
            &kernels::direct::kernel(&k.scene),
            bind,
            kernels::direct::Params {},
            Grid::Over(out),
        );
        out
    })
}

/// Radiance through mirrors and glass; `None` where the scene has neither or no specular bounce is asked for.
pub fn specular(
    g: &mut Graph<'_>,
    k: &Kernels,
    config: &WhittedConfig,
    gb: &GBuffer,
    vpls: &Vpls,
    shoot: &VplShootConfig,
    min_distance: f32,
) -> Option<Res<Image>> {
    (k.specular() && config.specular_depth > 0).then(|| {
        g.group("whitted", |g| {
            let desc = g.desc(gb.albedo);
            // Points beyond are lit where they are found: slower, the same light.
            let capacity = desc.extent[0] * desc.extent[1];
            let emitted = g.image("emitted", desc);
            let sources = k.lights() + shoot.slots();
            let last = g.image("last", desc.with_format(Format::R32Uint));
            let points = g.buffer("points", u64::from(capacity) * size_of::<Reached>() as u64);
            let list = g.buffer("list", 4);
            g.fill("empty", list, 0);
            let (vpls, count) = (vpls.list, vpls.count);
            g.pass(
                "tree",
                &tree::kernel(&k.scene),
                tree::Bind { hits: gb.hits, vpls, count, out_emitted: emitted, out_last: last, points, list },
                tree::Params { capacity, range: RANGE, min_distance },
                Grid::Over(emitted),
            );
            for first in (0..sources).step_by(RANGE as usize) {
                g.pass(
                    "light",
                    &light::kernel(&k.scene),
                    light::Bind { vpls, count, list, points },
                    light::Params { capacity, first, last: first + RANGE, min_distance },
                    Grid::Of([capacity, light::CODE.workgroup[1], 1]),
                );
            }
            let out = g.image("specular", desc);
            let bind = sum::Bind { emitted, last, points, out_radiance: out };
            g.pass("sum", &sum::kernel(&k.scene), bind, sum::Params {}, Grid::Over(out));
            out
        })
    })
}
