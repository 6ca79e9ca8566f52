//! The discontinuity buffer of interleaved sampling (Wald et al. 2002; Marques & Santos 2010, §4.3).

use super::Scope;
use crate::graph::{Graph, Grid, Image, Res};
use crate::shaders::indirect::interleave as kernel;
use crate::techniques::gbuffer::Geometry;

/// The mean of neighbouring samples on the same surface, which have other subsets.
pub(super) fn interleave(
    g: &mut Graph,
    s: &Scope<'_>,
    geometry: &Geometry,
    gathered: Res<Image>,
) -> Res<Image> {
    let out = g.image("interleaved", g.desc(gathered));
    let bind = kernel::Bind { gathered, normal_depth: geometry.normal_depth, out_irradiance: out };
    let spec = kernel::Spec {
        downsample: s.config.downsample,
        interleave: s.config.interleave,
        irregular: s.config.irregular(),
    };
    let params = kernel::Params {
        depth_threshold: s.config.depth_threshold,
        normal_threshold: s.config.normal_threshold,
    };
    g.pass("interleave", &kernel::kernel(spec), bind, params, Grid::Over(out));
    out
}
