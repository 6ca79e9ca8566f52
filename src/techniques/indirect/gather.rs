//! One shadow ray from every VPL of a sample's subset to the sample (Marques & Santos 2010, eq. 1).

use super::{Missing, RANGE, SampleGrid, Scope};
use crate::graph::{Graph, Grid, Image, ImageDesc, Res};
use crate::shaders::indirect::{gather as kernel, regather as regather_kernel};
use crate::vk::Format;

/// Irradiance at the samples (W/m²): of all VPLs, or with interleaving of a subset, times the number of subsets.
pub(super) fn gather(g: &mut Graph, s: &Scope<'_>, grid: &SampleGrid) -> Res<Image> {
    let (config, code) = (s.config, &kernel::CODE.workgroup);
    let tiles: [u32; 2] = std::array::from_fn(|axis| {
        let first = grid.first_cell[axis] / config.interleave;
        let last = (grid.first_cell[axis] + grid.extent[axis] - 1) / config.interleave;
        (last - first + 1).next_multiple_of(code[axis])
    });
    let out = g.image("gathered", ImageDesc::new(grid.extent, Format::Rgba32Float));
    for first in (0..s.vpls.subset_slots).step_by(RANGE as usize) {
        let bind = kernel::Bind {
            hits: s.gbuffer.hits,
            albedo: s.gbuffer.albedo,
            vpls: s.vpls.list,
            count: s.vpls.count,
            // Unread by the first range, which has nothing to continue.
            before: if first > 0 { out } else { s.gbuffer.albedo },
            out_irradiance: out,
        };
        let spec = kernel::Spec {
            continues: first > 0,
            downsample: config.downsample,
            interleave: config.interleave,
            irregular: config.irregular(),
        };
        let params =
            kernel::Params { first, last: first + RANGE, min_distance: s.min_distance, block: tiles };
        let invocations = match config.interleave {
            1 => Grid::Over(out),
            m => Grid::Of([m * tiles[0], m * tiles[1], code[2]]),
        };
        g.pass("gather", &kernel::kernel(spec, &s.kernels.scene), bind, params, invocations);
    }
    out
}

/// Gathers at the listed pixels, which start from zero.
pub(super) fn regather(g: &mut Graph, s: &Scope<'_>, missing: Missing, irradiance: Res<Image>) {
    for first in (0..s.vpls.slots).step_by(RANGE as usize) {
        let bind = regather_kernel::Bind {
            hits: s.gbuffer.hits,
            vpls: s.vpls.list,
            count: s.vpls.count,
            list: missing.list,
            args: missing.args,
            irradiance,
        };
        let params = regather_kernel::Params { first, last: first + RANGE, min_distance: s.min_distance };
        let grid = Grid::Indirect { buffer: missing.args, offset: 0 };
        g.pass("regather", &regather_kernel::kernel(&s.kernels.scene), bind, params, grid);
    }
}
