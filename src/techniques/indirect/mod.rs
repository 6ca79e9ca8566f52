//! Indirect irradiance at primary hits from virtual point lights (Marques & Santos 2010, eq. 1).
//!
//! E(x) = (1/π) Σ_k Φ_k V(x, y_k) G(x, y_k), one shadow ray a VPL with G > 0, where
//! G = cosθ_x cosθ_k / d² · f(0.8 m, 1.2 m, d) with the paper's cubic smooth step f. Irradiance, not radiance, is
//! kept: the albedo multiplies when the picture is composed, so filters never blur textures.
//!
//! Bias: f drops light from VPLs nearer than m; in a convex box about 4/(3π) · m · ΣL_edge / A of one bounce.
//! Cost: a shadow ray for every pixel and VPL that face each other; nearly all of a frame.

use super::{Kernels, gbuffer::GBuffer, vpl_shoot::VplShootConfig, vpl_shoot::Vpls};
use crate::graph::{Graph, Grid, Image, Res};
use crate::shaders::indirect::gather;

/// How virtual point lights are gathered.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IndirectConfig {
    /// The paper's min_d (m): light from VPLs nearer than 0.8 of it is dropped, from 1.2 of it on complete.
    /// More hides the splotches around VPLs and darkens corners; 0 keeps all light and its infinite variance.
    /// Absent: ½·√(A/N) for a scene of area A and N VPLs (ours: the paper does not say).
    pub min_distance: Option<f32>,
}

impl IndirectConfig {
    /// The distance in force for a scene of `area` m².
    #[must_use]
    pub fn min_distance(&self, area: f32, shoot: &VplShootConfig) -> f32 {
        self.min_distance.unwrap_or_else(|| 0.5 * (area / shoot.vpls as f32).sqrt())
    }
}

/// VPLs one pass loops over. Bounds what a single workgroup can take, and stays below a limit of lavapipe before
/// Mesa 23: it leaves a shader's loops after 65 535 iterations in all, those of traversal included, without a word.
pub(crate) const RANGE: u32 = 512;

/// Gathers irradiance (W/m²) from all VPLs.
pub fn indirect(
    g: &mut Graph<'_>,
    k: &Kernels,
    shoot: &VplShootConfig,
    gb: &GBuffer,
    vpls: &Vpls,
    min_distance: f32,
) -> Res<Image> {
    g.group("indirect", |g| {
        let desc = g.desc(gb.albedo);
        let mut sum = None;
        for first in (0..shoot.slots()).step_by(RANGE as usize) {
            let out = g.image("irradiance", desc);
            let bind = gather::Bind {
                hits: gb.hits,
                albedo: gb.albedo,
                vpls: vpls.list,
                count: vpls.count,
                // Unread by the first range, which has nothing to continue.
                sum: sum.unwrap_or(gb.albedo),
                out_irradiance: out,
            };
            let kernel = gather::kernel(gather::Spec { continues: sum.is_some() }, &k.scene);
            let params = gather::Params { first, last: first + RANGE, min_distance };
            g.pass("gather", &kernel, bind, params, Grid::Over(out));
            sum = Some(out);
        }
        sum.unwrap_or(gb.albedo)
    })
}
