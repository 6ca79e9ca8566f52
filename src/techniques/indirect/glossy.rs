//! Glossy lobes of primary hits, lit by every VPL: never downsampled, interleaved or filtered.

use super::{RANGE, Scope};
use crate::graph::{Graph, Grid, Image, Res};
use crate::shaders::indirect::glossy as kernel;

/// Radiance (W/(sr·m²)) by lobes that are neither diffuse nor mirrors.
pub(super) fn glossy(g: &mut Graph, s: &Scope<'_>) -> Res<Image> {
    let out = g.image("glossy", g.desc(s.gbuffer.albedo));
    for first in (0..s.vpls.slots).step_by(RANGE as usize) {
        let bind = kernel::Bind {
            hits: s.gbuffer.hits,
            vpls: s.vpls.list,
            count: s.vpls.count,
            // Unread by the first range, which has nothing to continue.
            before: if first > 0 { out } else { s.gbuffer.albedo },
            out_radiance: out,
        };
        let params = kernel::Params { first, last: first + RANGE, min_distance: s.min_distance };
        let spec = kernel::Spec { continues: first > 0 };
        g.pass("glossy", &kernel::kernel(spec, &s.kernels.scene), bind, params, Grid::Over(out));
    }
    out
}
