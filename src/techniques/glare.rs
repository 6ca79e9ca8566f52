//! Glare: the light that lenses and eyes scatter around bright things. Radiance becomes (1−s)·radiance +
//! s·(kernel ∗ radiance), s the strength and the kernel's integral 1, so no light is added or lost.
//!
//! The kernel is a sum of smooth spots, each twice as wide as the one before and with the same share of the light: up
//! to the radius it falls with 1/r², as the eye's glare does beyond 1° (Stiles and Holladay; Spencer et al. 1995). The
//! spots are levels of a pyramid (after Jimenez 2014, *Next Generation Post Processing in Call of Duty*) with
//! quadratic B-splines in place of its filters: they keep the sum of all pixels and the centre of every spot, wherever
//! it lies on the pyramid's grid. Borders are mirrored, so that a constant picture stays constant and what would leave
//! the picture stays in it.
//!
//! Only pictures for screens have glare; linear radiance is that before it. A crop's glare is its own: it knows
//! nothing of the lights beside it. Cost: two passes a doubling of the radius, 8/3 of the picture's pixels in all.

use super::setting::{BadValue, Settings, within};
use crate::graph::{Graph, Grid, Image, Res};
use crate::shaders::glare::{down, up};

/// How light spreads around bright things.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GlareConfig {
    /// Share of every pixel's light that spreads, 0 … 1. 0, the default, is no glare and no pass.
    pub strength: f32,
    /// Standard deviation of the widest spot, as a share of the whole picture's height, 0.001 … 0.5. More spreads the
    /// same light farther and thinner.
    pub radius: f32,
}

impl Default for GlareConfig {
    fn default() -> Self {
        Self { strength: 0.0, radius: 0.1 }
    }
}

impl Settings for GlareConfig {
    fn check(&self) -> Result<(), BadValue> {
        within("glare.strength", self.strength, 0.0..=1.0)?;
        within("glare.radius", self.radius, 0.001..=0.5)
    }
}

/// Spreads light; `height` is that of the whole picture (pixels). Strength 0 returns the image itself.
pub fn glare(g: &mut Graph, config: &GlareConfig, radiance: Res<Image>, height: u32) -> Res<Image> {
    if config.strength == 0.0 {
        return radiance;
    }
    g.group("glare", |g| {
        let shares = shares(config.radius * height as f32);
        let mut levels = vec![radiance];
        for _ in &shares {
            let fine = levels[levels.len() - 1];
            let desc = g.desc(fine);
            let mut half = desc;
            half.extent = desc.extent.map(|pixels| pixels.div_ceil(2));
            let out = g.image("level", half);
            let bind = down::Bind { fine, out_coarse: out };
            g.pass("down", &down::kernel(), bind, down::Params {}, Grid::Over(out));
            levels.push(out);
        }
        let mut sum = levels[shares.len()];
        for coarser in (0..shares.len()).rev() {
            // The coarsest level has not been weighted yet; the picture itself keeps what does not spread.
            let last = coarser + 1 == shares.len();
            let mut coarse_share = if last { shares[coarser] } else { 1.0 };
            let share = match coarser {
                0 => {
                    coarse_share *= config.strength;
                    1.0 - config.strength
                }
                level => shares[level - 1],
            };
            let level = levels[coarser];
            let out = g.image("glare", g.desc(level));
            let bind = up::Bind { level, coarse: sum, out_sum: out };
            g.pass("up", &up::kernel(), bind, up::Params { share, coarse_share }, Grid::Over(out));
            sum = out;
        }
        sum
    })
}

/// Share of the light in each level, finest first: the same for all but the last, which fades in as the radius (pixels)
/// grows. The spot of level n has the variance (4ⁿ − 1)/2: 3/4 of a level's pixel for each step down and each step up.
fn shares(radius: f32) -> Vec<f32> {
    let levels = (0.5 * (2.0 * radius * radius + 1.0).log2()).max(1.0);
    let count = levels.ceil();
    (1..=count as u32).map(|level| (levels - level as f32 + 1.0).min(1.0) / levels).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_one_and_grow_with_the_radius() {
        let mut before = 0.0;
        for radius in [0.001_f32, 1.0, 1.3, 3.0, 11.9, 60.0, 8192.0] {
            let shares = shares(radius);
            assert!((shares.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{radius}: {shares:?}");
            assert!(shares.iter().all(|&share| share > 0.0), "{radius}: {shares:?}");
            let variance: f32 =
                (1..).zip(&shares).map(|(n, share)| share * (4.0_f32.powi(n) - 1.0) / 2.0).sum();
            assert!(variance >= before, "{radius}");
            before = variance;
        }
        // The widest spot is as wide as asked for.
        let whole = shares((0.5 * (4.0_f32.powi(5) - 1.0)).sqrt());
        assert_eq!(whole.len(), 5);
        assert!(whole.iter().all(|share| (share - 0.2).abs() < 1e-5), "{whole:?}");
    }
}
