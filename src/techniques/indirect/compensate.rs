//! What bounding VPLs takes from irradiance, given back by short paths from the receiver (Kollig & Keller 2004).

use super::{Missing, Scope};
use crate::graph::{Graph, Grid, Image, Res};
use crate::shaders::indirect::{compensate as kernel, compensate_missing as missing_kernel};

/// Rays of one thread of a pass, bounded as [`super::RANGE`] is.
const RAYS: u32 = 256;

/// Adds what is lost to the irradiance at the samples.
pub(super) fn compensate(g: &mut Graph, s: &Scope<'_>, irradiance: Res<Image>) {
    let (config, vertices) = (s.config, s.vpls.bounces);
    let step = (RAYS / (3 * vertices)).max(1);
    for first in (0..config.compensation).step_by(step as usize) {
        let (hits, albedo, vpls, count) = (s.gbuffer.hits, s.gbuffer.albedo, s.vpls.list, s.vpls.count);
        let bind = kernel::Bind { hits, albedo, irradiance, vpls, count };
        let spec = kernel::Spec {
            downsample: config.downsample,
            interleave: config.interleave,
            irregular: config.irregular(),
        };
        let params = kernel::Params {
            first,
            last: first + step,
            paths: config.compensation,
            vertices,
            min_distance: s.min_distance,
        };
        let kernel = kernel::kernel(spec, &s.kernels.scene);
        g.pass("compensate", &kernel, bind, params, Grid::Over(irradiance));
    }
}

/// The same for the listed pixels.
pub(super) fn compensate_missing(g: &mut Graph, s: &Scope<'_>, missing: Missing, irradiance: Res<Image>) {
    let Missing { list, args } = missing;
    let (hits, vpls, count) = (s.gbuffer.hits, s.vpls.list, s.vpls.count);
    let bind = missing_kernel::Bind { hits, list, args, irradiance, vpls, count };
    let params = missing_kernel::Params {
        paths: s.config.compensation,
        vertices: s.vpls.bounces,
        min_distance: s.min_distance,
    };
    let grid = Grid::Indirect { buffer: missing.args, offset: 0 };
    g.pass("compensate_missing", &missing_kernel::kernel(&s.kernels.scene), bind, params, grid);
}
