//! How far it is from what the camera sees to what that sees.

use crate::graph::{Buffer, Graph, Grid, Res};
use crate::shaders::indirect::free_path as kernel;
use crate::techniques::Kernels;
use crate::techniques::vpl_shoot::{self, POINTS};

/// Rays of a point.
const RAYS: u32 = 16;

/// Lengths (m) of cosine-distributed rays from points all over the window of `extent` pixels that begins at pixel `origin`;
/// below 0 where there is none, or nothing is met.
pub fn free_path(g: &mut Graph, k: &Kernels, origin: [u32; 2], extent: [u32; 2]) -> Res<Buffer> {
    let points = vpl_shoot::view(g, k, origin, extent);
    g.group("indirect", |g| {
        let lengths = g.buffer("lengths", 4 * u64::from(POINTS * RAYS));
        let params = kernel::Params { points: POINTS, rays: RAYS };
        let grid = Grid::Of([POINTS * RAYS, 1, 1]);
        g.pass("free_path", &kernel::kernel(&k.scene), kernel::Bind { points, lengths }, params, grid);
        lengths
    })
}
