//! Virtual point lights along quasi-random light paths (Keller, "Instant Radiosity", 1997; Marques & Santos
//! 2010, §4).
//!
//! P = ⌊vpls / bounces⌋ paths leave the lights, each chosen in proportion to its power, with Halton points:
//! base 2 for the light, 3 and 5 for its emission, the next pair of primes for each bounce. Emissive triangles and the
//! environment are lights like others, but take four numbers: in scenes with any, bases 3 and 5 choose the direction
//! (emitters: by cosine, from a side that emits; environment: by its radiance), 7 and 11 the place (emitters: uniform by
//! area; environment: on the disc through the scene's bounding sphere), and bounces begin at 13. A path starts with
//! Φ = Φ_light / (p_light · P), π L A of an emitter's side and π R² ∫L dω of the environment, and leaves, at each diffuse hit, a VPL of flux Φ_k = ρ_d Φ |ω·N_s| / |ω·N_g| that
//! shines as a Lambertian around the geometric normal; the last factor is the adjoint of shading normals (Veach
//! 1997, §5.3). Paths carry weights, none is absorbed. Mirrors and glass leave no VPL.
//!
//! Bias: light of more than `bounces` diffuse hits is missing. Few paths correlate in the high bases.
//! Cost: P paths of at most `bounces · (specular_depth + 1)` rays, one thread each.

use super::Kernels;
use super::setting::{BadValue, Settings, within};
use crate::graph::{Buffer, Graph, Grid, Res};
use crate::shaders::{
    BLOCK_SLOTS, Vpl,
    vpl_shoot::{compact, count, paths, scan, seen, view},
};

/// How virtual point lights are made.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VplShootConfig {
    /// VPL slots, 1 … 2²⁴. ⌊vpls / bounces⌋ paths (at least one) are shot. More: less noise and weaker
    /// splotches, gather cost grows in proportion. The paper uses 30, 90 and 180. Two lists
    /// take 44 bytes a slot each; a device that binds 128 MiB at a time has room for 3 050 402.
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

impl Settings for VplShootConfig {
    fn check(&self) -> Result<(), BadValue> {
        within("vpl_shoot.vpls", self.vpls, 1..=1 << 24)?;
        within("vpl_shoot.bounces", self.bounces, 1..=32)
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
    /// [`Vpl`]s, as many as `count` says, in order of their paths. A subset is a run of paths: taking every ninth
    /// would fix two digits of Halton's base 3 in each, and with them a part of the directions.
    pub list: Res<Buffer>,
    /// Unsigned integers: how many VPLs there are, then where each subset starts and where the last one ends.
    pub count: Res<Buffer>,
    /// Most VPLs there can be.
    pub slots: u32,
    /// Most VPLs a subset can have.
    pub subset_slots: u32,
    /// Most VPLs a path can leave.
    pub bounces: u32,
}

/// What light paths left behind, with the gaps of those that ended early.
#[derive(Clone, Copy, Debug)]
pub struct Paths {
    slots: Res<Buffer>,
}

/// Shoots the paths.
pub fn paths(g: &mut Graph, k: &Kernels, config: &VplShootConfig) -> Paths {
    g.group("vpl_shoot", |g| {
        let slots = g.buffer("slots", bytes(config));
        let params = paths::Params { paths: config.paths(), bounces: config.bounces };
        let grid = Grid::Of([config.paths(), 1, 1]);
        g.pass("paths", &paths::kernel(&k.scene), paths::Bind { slots }, params, grid);
        Paths { slots }
    })
}

/// Closes the gaps and notes where each of `subsets` equal parts of the paths starts.
pub fn compact(g: &mut Graph, config: &VplShootConfig, paths: &Paths, subsets: u32) -> Vpls {
    g.group("vpl_shoot", |g| {
        let &Paths { slots } = paths;
        let list = g.buffer("vpls", bytes(config));
        let counts = g.buffer("count", 4 * (u64::from(subsets) + 2));
        let blocks = config.slots().div_ceil(BLOCK_SLOTS);
        let before = (blocks > 1).then(|| {
            let blocks_of = g.buffer("blocks", 4 * u64::from(blocks));
            let grid = Grid::Of([blocks * count::CODE.workgroup[0], 1, 1]);
            let bind = count::Bind { slots, blocks: blocks_of };
            g.pass("count", &count::kernel(), bind, count::Params { slots: config.slots() }, grid);
            let bind = scan::Bind { blocks: blocks_of };
            g.pass("scan", &scan::kernel(), bind, scan::Params { blocks }, Grid::Of([1, 1, 1]));
            blocks_of
        });
        let spec = compact::Spec { blocks: before.is_some() };
        // Unread where there is one block.
        let bind = compact::Bind { slots, blocks: before.unwrap_or(slots), vpls: list, count: counts };
        let params = compact::Params { paths: config.paths(), bounces: config.bounces, subsets };
        let grid = Grid::Of([blocks * compact::CODE.workgroup[0], 1, 1]);
        g.pass("compact", &compact::kernel(spec), bind, params, grid);
        let subset_slots = config.paths().div_ceil(subsets) * config.bounces;
        Vpls { list, count: counts, slots: config.slots(), subset_slots, bounces: config.bounces }
    })
}

/// Which paths light anything that is seen.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Position, shading and geometric normal (nine numbers) of points that the camera sees; normals 0 where it sees none.
    pub points: Res<Buffer>,
    /// An unsigned integer each: 1 if a VPL of the path lights any of them.
    pub paths: Res<Buffer>,
}

/// Points seen along a side of the picture.
const POINTS_SIDE: u32 = 16;

/// Asks of every path for points all over the window of `extent` pixels that begins at pixel `origin`.
pub fn seen(
    g: &mut Graph,
    k: &Kernels,
    config: &VplShootConfig,
    paths: &Paths,
    origin: [u32; 2],
    extent: [u32; 2],
) -> Seen {
    g.group("vpl_shoot", |g| {
        let count = POINTS_SIDE * POINTS_SIDE;
        let points = g.buffer("points", u64::from(count) * 36);
        let params = view::Params { origin, extent, side: POINTS_SIDE };
        g.pass("view", &view::kernel(&k.scene), view::Bind { points }, params, Grid::Of([count, 1, 1]));
        let found = g.buffer("seen", 4 * u64::from(config.paths()));
        let bind = seen::Bind { slots: paths.slots, points, seen: found };
        let params = seen::Params { paths: config.paths(), bounces: config.bounces, points: count };
        g.pass("seen", &seen::kernel(&k.scene), bind, params, Grid::Of([config.paths(), 1, 1]));
        Seen { points, paths: found }
    })
}

fn bytes(config: &VplShootConfig) -> u64 {
    u64::from(config.slots()) * size_of::<Vpl>() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;
    use crate::graph::{Executor, RunOptions};
    use crate::sampling::hash;
    use crate::vk::Backend;

    /// Around the limits of workgroups and blocks, and where a thread scans several blocks.
    #[test]
    fn gaps_close_as_in_a_serial_scan() {
        let Some((_guard, device)) = common::device() else { return };
        let mut executor = Executor::new(&device, Backend::Software).unwrap();
        let block = BLOCK_SLOTS;
        let small = [1, 2, 255, 256, 257, block - 1, block, block + 1, 3 * block + 5, 256 * block + 1];
        let shapes = [(1, 1), (1, 9), (3, 4)];
        let mut cases: Vec<_> = small.into_iter().flat_map(|n| shapes.map(|(b, s)| (n, b, s))).collect();
        cases.push((1 << 21, 1, 9));
        for (vpls, bounces, subsets) in cases {
            // Some gaps, none, nothing else.
            for gaps in [4, u32::MAX, 1].into_iter().take(if vpls < block { 3 } else { 1 }) {
                let config = VplShootConfig { vpls, bounces };
                let gap = |slot: u32| hash(slot).is_multiple_of(gaps);
                let slot = |slot| Vpl {
                    path: slot,
                    flux: if gap(slot) { [0.0; 3] } else { [1.0; 3] },
                    ..Vpl::default()
                };
                let data: Vec<Vpl> = (0..config.slots()).map(slot).collect();
                let mut g = Graph::new();
                let slots = g.buffer("slots", bytes(&config));
                g.upload("slots", slots, bytemuck::cast_slice(&data).to_vec());
                let vpls = compact(&mut g, &config, &Paths { slots }, subsets);
                let (list, count) = (g.read_buffer::<Vpl>(vpls.list), g.read_buffer::<u32>(vpls.count));
                let mut run = executor.run(g, &RunOptions::default()).unwrap();
                let (list, count) = (run.take(list), run.take(count));

                let what = format!("{config:?}, {subsets} subsets, gaps {gaps}");
                let kept: Vec<u32> = (0..config.slots()).filter(|&slot| !gap(slot)).collect();
                assert_eq!(count[0] as usize, kept.len(), "{what}");
                assert!(list.iter().zip(&kept).all(|(vpl, &slot)| vpl.path == slot), "{what}");
                for (subset, &start) in (0..=subsets).zip(&count[1..]) {
                    let paths = config.paths();
                    let first = bounces * (subset * (paths / subsets) + subset.min(paths % subsets));
                    let before = kept.partition_point(|&slot| slot < first);
                    assert_eq!(start as usize, before, "{what}: subset {subset}");
                }
            }
        }
    }
}
