//! Virtual point lights along quasi-random light paths (Keller, "Instant Radiosity", 1997; Marques & Santos
//! 2010, §4).
//!
//! P = ⌊vpls / bounces⌋ paths leave the lights, each chosen in proportion to its power, with Halton points:
//! base 2 for the light, 3 and 5 for its emission, the next pair of primes for each bounce. A path starts with
//! Φ = Φ_light / (p_light · P) and leaves, at each diffuse hit, a VPL of flux Φ_k = ρ_d Φ |ω·N_s| / |ω·N_g| that
//! shines as a Lambertian around the geometric normal; the last factor is the adjoint of shading normals (Veach
//! 1997, §5.3). Paths carry weights, none is absorbed. Mirrors and glass leave no VPL.
//!
//! Bias: light of more than `bounces` diffuse hits is missing. Few paths correlate in the high bases.
//! Cost: P paths of at most `bounces · (specular_depth + 1)` rays, one thread each.

use super::Kernels;
use crate::graph::{Buffer, Graph, Grid, Res};
use crate::shaders::{
    Vpl,
    vpl_shoot::{compact, paths},
};

/// How virtual point lights are made.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VplShootConfig {
    /// VPL slots, 1 … 2²⁴. ⌊vpls / bounces⌋ paths (at least one) are shot. More: less noise and weaker
    /// splotches, gather cost grows in proportion. The paper uses 30, 90 and 180.
    pub vpls: u32,
    /// Diffuse hits a path leaves VPLs at, 1 … 32: 1 is one indirect bounce. Fewer lose energy (a closed room
    /// of albedo ρ keeps 1 − ρ^(bounces+1) of it), more thin the paths. Ours: the paper leaves it to the user.
    pub bounces: u32,
}

impl Default for VplShootConfig {
    fn default() -> Self {
        Self { vpls: 180, bounces: 3 }
    }
}

impl VplShootConfig {
    /// Paths launched.
    #[must_use]
    pub fn paths(&self) -> u32 {
        (self.vpls / self.bounces).max(1)
    }

    /// Slots for VPLs; as many VPLs where no path ends early.
    #[must_use]
    pub fn slots(&self) -> u32 {
        self.paths() * self.bounces
    }
}

/// A list of VPLs on the device.
#[derive(Clone, Copy, Debug)]
pub struct Vpls {
    /// [`Vpl`]s, as many as `count` says, in order of their paths.
    pub list: Res<Buffer>,
    /// One unsigned integer.
    pub count: Res<Buffer>,
}

/// Shoots the paths and closes the gaps of those that ended early.
pub fn vpl_shoot(g: &mut Graph<'_>, k: &Kernels, config: &VplShootConfig) -> Vpls {
    g.group("vpl_shoot", |g| {
        let (launched, bytes) = (config.paths(), u64::from(config.slots()) * size_of::<Vpl>() as u64);
        let slots = g.buffer("slots", bytes);
        let list = g.buffer("vpls", bytes);
        let count = g.buffer("count", 4);
        g.pass(
            "paths",
            &paths::kernel(&k.scene),
            paths::Bind { slots },
            paths::Params { paths: launched, bounces: config.bounces },
            Grid::Of([launched, 1, 1]),
        );
        g.pass(
            "compact",
            &compact::kernel(),
            compact::Bind { slots, vpls: list, count },
            compact::Params { slots: config.slots() },
            Grid::Of([1, 1, 1]),
        );
        Vpls { list, count }
    })
}
