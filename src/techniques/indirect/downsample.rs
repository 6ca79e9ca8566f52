//! From one gather sample a window to every pixel: joint bilateral upsampling (Kopf et al. 2007; Marques & Santos
//! 2010, §4.2, eq. 2), and one filter that does the work of both.

use super::{Missing, Scope, Upsample};
use crate::graph::{Graph, Grid, Image, Res};
use crate::shaders::indirect::{combined as combined_kernel, upsample as upsample_kernel};
use crate::techniques::gbuffer::Geometry;
use crate::vk::Format;

/// Standard deviation of the paper's spatial Gaussian, in samples. Ours: the paper does not say.
const SIGMA: f32 = 0.5;

/// Irradiance of every pixel from samples of all VPLs; lists pixels without a fitting sample if asked to.
pub(super) fn upsample(
    g: &mut Graph,
    s: &Scope<'_>,
    geometry: &Geometry,
    gathered: Res<Image>,
    missing: Missing,
) -> Res<Image> {
    let out = g.image("irradiance", g.desc(s.gbuffer.albedo).with_format(Format::Rgba32Float));
    let bind = upsample_kernel::Bind {
        gathered,
        normal_depth: geometry.normal_depth,
        position: geometry.position,
        out_irradiance: out,
        list: missing.list,
        args: missing.args,
    };
    let spec = upsample_kernel::Spec {
        downsample: s.config.downsample,
        interleave: s.config.interleave,
        irregular: s.config.irregular(),
        plane: s.config.upsample == Upsample::Plane,
    };
    let params = upsample_kernel::Params {
        sigma: SIGMA,
        reach: s.config.plane_threshold,
        least_cosine: s.config.plane_cosine,
    };
    g.pass("upsample", &upsample_kernel::kernel(spec), bind, params, Grid::Over(out));
    out
}

/// Irradiance of every pixel from samples of subsets; lists what no sample could lend if asked to.
pub(super) fn combined(
    g: &mut Graph,
    s: &Scope<'_>,
    geometry: &Geometry,
    gathered: Res<Image>,
    missing: Missing,
) -> Res<Image> {
    let out = g.image("irradiance", g.desc(s.gbuffer.albedo).with_format(Format::Rgba32Float));
    let bind = combined_kernel::Bind {
        gathered,
        normal_depth: geometry.normal_depth,
        position: geometry.position,
        out_irradiance: out,
        list: missing.list,
        args: missing.args,
        albedo: s.gbuffer.albedo,
    };
    let spec = combined_kernel::Spec {
        downsample: s.config.downsample,
        interleave: s.config.interleave,
        irregular: s.config.irregular(),
        regather: s.config.upsample == Upsample::Plane,
    };
    let params = combined_kernel::Params {
        reach: s.config.plane_threshold,
        least_cosine: s.config.plane_cosine,
        least_found: s.config.least_found(),
    };
    g.pass("combined", &combined_kernel::kernel(spec), bind, params, Grid::Over(out));
    out
}
