//! Virtual point lights along quasi-random light paths (Keller, "Instant Radiosity", 1997; Marques & Santos
//! 2010, §4).
//!
//! P paths leave the lights, each chosen in proportion to its power, with Halton points:
//! base 2 for the light, 3 and 5 for its emission, the next pair of primes for each bounce (with roulette or candidates for the
//! first three, Owen-scrambled points after them). Emissive triangles and the
//! environment are lights like others, but take four numbers: in scenes with any, bases 3 and 5 choose the direction
//! (emitters: by cosine, from a side that emits; environment: by its radiance), 7 and 11 the place (emitters: uniform by
//! area; environment: on the disc through the scene's bounding sphere), and bounces begin at 13. A path starts with
//! Φ = Φ_light / (p_light · P), π L A of an emitter's side and π R² ∫L dω of the environment, and leaves, at each diffuse hit, a VPL of flux Φ_k = ρ_d Φ |ω·N_s| / |ω·N_g| that
//! shines as a Lambertian around the geometric normal; the last factor is the adjoint of shading normals (Veach
//! 1997, §5.3). Mirrors and glass leave no VPL.
//!
//! Roulette ends paths unless `bounces` does: one goes on with the probability that its power falls by, at most 0.9, which
//! its flux is divided by, so that light of any number of bounces counts (Keller 1997 calls these fractional absorption).
//! Then paths are traced twice, to count their VPLs and to list them, and memory has room for 2 · vpls: of more than that,
//! as many are kept as fit, each with the same probability, which their flux is divided by too, so that no light is lost.
//!
//! Candidates: more paths are shot than VPLs are asked for, and of theirs only as many are kept, each with a probability
//! that follows its share of the light at points all over the picture, and that its flux is divided by: the root mean square of
//! the share, since that leaves least noise, and half of the probability alike for all (Georgiev & Slusallek, "Simple and
//! Robust Iterative Importance Sampling of Virtual Point Lights", 2010). Unless paths are guided, all shares above the mean of
//! all count as that. In Sponza, where three of four VPLs light nothing that is seen, relMSE falls from 0.055 to 0.038 at half
//! the VPLs.
//!
//! Guides: paths from the camera, retraced. A light path that starts where one of them met the sky's or the sun's light leaves
//! that place towards where it had come from, three times of four, so that light off the ground outside finds the window: in a
//! school room the picture's mean then varies by 8 % from seed to seed in place of 30 %.
//!
//! Spread: a guided path stands for all that might have started around it, the more the fewer start there. Its VPLs shine as
//! discs of that area do along their axis, Φ/π · cosθ cosθ'/(d² + r²), where that is wider than bounding reaches: plain paths,
//! which carry a hundred times as much, would be spots else.
//!
//! Bias: light of more than `bounces` diffuse hits is missing, where that is set. Few paths correlate in high bases, where all bounces are Halton's.
//! Cost: one thread a path; of at most `bounces · (specular_depth + 1)` rays, or by roulette twice 1/(1 − ρ) of them.

use super::Kernels;
use super::setting::{BadValue, Settings, within};
use crate::graph::{Buffer, Graph, Grid, Res};
use crate::sampling::MAX_BOUNCES;
use crate::scene::SceneProfile;
use crate::shaders::{
    BLOCK_SLOTS, Receiver, Vpl,
    vpl_shoot::{
        accept, aim, bound, compact, count, paths, pilot, roulette, scan, seen, totals, view, weigh,
    },
};

/// How virtual point lights are made.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VplShootConfig {
    /// VPLs, 1 … 2²⁴, about: as many as a mean of three diffuse hits a path leaves, twice as many at most; with `bounces`
    /// at most these. More: less noise and weaker splotches, gather cost grows in proportion. The paper uses 30, 90 and
    /// 180. They take 96 bytes each; a device that binds 128 MiB at a time has room for 1 398 101.
    pub vpls: u32,
    /// Diffuse hits a path leaves VPLs at, 1 … 32: 1 is one indirect bounce. Fewer lose energy (a closed room
    /// of albedo ρ keeps 1 − ρ^(bounces+1) of it), more thin the paths. Absent: any number, roulette ends paths. Ours: the
    /// paper leaves it to the user; presets set 3.
    pub bounces: Option<u32>,
    /// Whether VPLs shine with all light that their surface scatters in lobes that no mirror ray follows, rough metals,
    /// rough clear coats and reflections of dielectrics included, and light paths take mirrors' share at surfaces that are
    /// both. Energy is kept, direction is not: VPLs stay Lambertians. Without it that light is missing, two to seven per
    /// cent of a furnished room. Ours; presets turn it off.
    pub lobes: bool,
    /// Whether paths of the environment and of directional lights are aimed at what matters to the picture, which 4096
    /// paths from the camera find beforehand. Their density is known, so that the mean stays; a quarter of the paths starts
    /// as without. Without it most miss a room in a large scene. Nothing where lights are all near. Ours; presets turn it off.
    pub guided: bool,
    /// Candidates for each VPL, 1 … 64: so many times as many paths are shot, and of their VPLs those are likelier kept that
    /// light 256 points all over the picture; the mean stays. There are 65 536 candidates at most. 1: all are kept. More: less
    /// noise where much light goes elsewhere, and a ray for each candidate and point. Eight times as many where paths are
    /// guided: most of those are lost on the way in. Ours, after Georgiev & Slusallek 2010; presets set 1.
    pub candidates: u32,
}

impl Default for VplShootConfig {
    fn default() -> Self {
        Self { vpls: 720, bounces: None, lobes: true, guided: true, candidates: 8 }
    }
}

impl Settings for VplShootConfig {
    fn check(&self) -> Result<(), BadValue> {
        within("vpl_shoot.vpls", self.vpls, 1..=1 << 24)?;
        within("vpl_shoot.candidates", self.candidates, 1..=64)?;
        self.bounces.map_or(Ok(()), |bounces| within("vpl_shoot.bounces", bounces, 1..=MAX_BOUNCES))
    }
}

/// VPLs of a path that roulette ends, as many as paths are launched for.
const MEAN_BOUNCES: u32 = 3;

/// No path that roulette ends is longer: 2·10⁻¹² of those that nothing else ends would be.
const ENDLESS: u32 = 256;

/// Most candidates there are, unless more VPLs are asked for.
const MOST_CANDIDATES: u32 = 1 << 16;

/// So many times as many candidates are shot where paths are guided: most of those are lost on the way in.
const MORE_GUIDED: u32 = 8;

impl VplShootConfig {
    /// As it is for a scene of this profile.
    #[must_use]
    pub fn of(&self, profile: &SceneProfile) -> Self {
        let more = if self.candidates > 1 && self.guides(profile) { MORE_GUIDED } else { 1 };
        Self { candidates: more * self.candidates, ..self.clone() }
    }

    fn guides(&self, profile: &SceneProfile) -> bool {
        self.guided && (profile.environment || profile.directional_lights > 0)
    }

    /// Candidates that are shot for each VPL.
    fn candidates(&self) -> u32 {
        self.candidates.min(MOST_CANDIDATES / self.vpls).max(1)
    }

    /// Paths launched.
    #[must_use]
    pub fn paths(&self) -> u32 {
        (self.candidates() * self.vpls / self.bounces.unwrap_or(MEAN_BOUNCES)).max(1)
    }

    /// VPLs that the list of `subsets` parts of all that are shot has room for: of each, and of all.
    fn room(&self, subsets: u32) -> [u32; 2] {
        match self.bounces {
            Some(bounces) => [self.paths().div_ceil(subsets) * bounces, self.paths() * bounces],
            None => {
                let part = (2 * self.candidates() * self.vpls).div_ceil(subsets);
                [part, part * subsets]
            }
        }
    }

    fn most_bounces(&self) -> u32 {
        self.bounces.unwrap_or(ENDLESS)
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

/// Paths of the pilot along a side of the picture.
const PILOT_SIDE: u32 = 64;

/// Numbers of four bytes in a guide.
const GUIDE_WORDS: u64 = 11;

/// Finds where light from infinitely far away matters; `None` where there is none or it is not asked for.
fn guides(g: &mut Graph, k: &Kernels, config: &VplShootConfig) -> Option<Res<Buffer>> {
    config.guides(&k.profile).then(|| {
        let count = PILOT_SIDE * PILOT_SIDE;
        let found = g.buffer("found", 4 * GUIDE_WORDS * u64::from(count));
        let params = pilot::Params { side: PILOT_SIDE };
        g.pass("pilot", &pilot::kernel(&k.scene), pilot::Bind { found }, params, Grid::Of([count, 1, 1]));
        let guides = g.buffer("guides", 8 + 4 * GUIDE_WORDS * u64::from(count));
        let bind = aim::Bind { found, guides };
        g.pass("aim", &aim::kernel(), bind, aim::Params { found: count }, Grid::Of([1, 1, 1]));
        guides
    })
}

/// Whether any surface has lobes that are neither diffuse nor mirrors, or is both.
fn lobes(k: &Kernels, config: &VplShootConfig) -> bool {
    config.lobes && (k.profile.rough_lobes || k.profile.clearcoat || k.profile.polished)
}

/// What light paths left behind.
#[derive(Clone, Copy, Debug)]
pub enum Paths {
    /// VPLs, `bounces` slots a path, with the gaps of those that ended early.
    Slots(Res<Buffer>),
    /// How many VPLs each path leaves, and room for a list of them.
    Counted {
        /// Unsigned integers; `glsl/vpl_shoot/tally.glsl` says which.
        tally: Res<Buffer>,
        /// The list.
        vpls: Res<Buffer>,
        /// Where paths are aimed at.
        guides: Res<Buffer>,
        /// Whether they are.
        guided: bool,
    },
}

/// Shoots the paths, for `subsets` equal parts of them.
pub fn paths(g: &mut Graph, k: &Kernels, config: &VplShootConfig, subsets: u32) -> Paths {
    g.group("vpl_shoot", |g| {
        let guides = guides(g, k, config);
        let (guided, lobes) = (guides.is_some(), lobes(k, config));
        // Unread where there are none.
        let guides = guides.unwrap_or_else(|| g.buffer_with("guides", vec![0; 8 + 4 * GUIDE_WORDS as usize]));
        if let Some(bounces) = config.bounces {
            let slots = g.buffer("slots", bytes(config.room(1)[1]));
            let params = paths::Params { paths: config.paths(), bounces };
            let grid = Grid::Of([config.paths(), 1, 1]);
            let spec = paths::Spec { lobes, guided, scrambled: config.candidates() > 1 };
            let kernel = paths::kernel(spec, &k.scene);
            g.pass("paths", &kernel, paths::Bind { slots, guides }, params, grid);
            return Paths::Slots(slots);
        }
        let tally = g.buffer("tally", 4 * (u64::from(config.paths()) + u64::from(2 * (subsets + 1))));
        g.fill("none", tally, 0);
        let vpls = g.buffer("vpls", bytes(config.room(subsets)[1]));
        roulette(g, k, config, subsets, roulette::Bind { tally, vpls, guides }, guided, false);
        Paths::Counted { tally, vpls, guides, guided }
    })
}

fn roulette(
    g: &mut Graph,
    k: &Kernels,
    config: &VplShootConfig,
    subsets: u32,
    bind: roulette::Bind,
    guided: bool,
    lists: bool,
) {
    let params = roulette::Params {
        paths: config.paths(),
        bounces: ENDLESS,
        subsets,
        room: config.room(subsets)[0],
        lists: lists.into(),
    };
    let name = if lists { "list" } else { "paths" };
    let kernel = roulette::kernel(roulette::Spec { lobes: lobes(k, config), guided }, &k.scene);
    g.pass(name, &kernel, bind, params, Grid::Of([config.paths(), 1, 1]));
}

/// Lists the VPLs and notes where each of `subsets` equal parts of the paths starts: the same number as they were shot for.
/// Of candidates those that matter more, where light of VPLs nearer than `min_distance` (m) does not.
pub fn compact(
    g: &mut Graph,
    k: &Kernels,
    config: &VplShootConfig,
    paths: &Paths,
    subsets: u32,
    min_distance: f32,
) -> Vpls {
    let shot = list(g, k, config, paths, subsets);
    if config.candidates() == 1 { shot } else { accept(g, k, config, &shot, subsets, min_distance) }
}

fn list(g: &mut Graph, k: &Kernels, config: &VplShootConfig, paths: &Paths, subsets: u32) -> Vpls {
    g.group("vpl_shoot", |g| {
        let count = g.buffer("count", 4 * (u64::from(subsets) + 2));
        let list = match *paths {
            Paths::Slots(slots) => close_gaps(g, config, slots, count, subsets),
            Paths::Counted { tally, vpls, guides, guided } => {
                let params = bound::Params { paths: config.paths(), subsets, room: config.room(subsets)[0] };
                g.pass("bound", &bound::kernel(), bound::Bind { tally, count }, params, Grid::Of([1, 1, 1]));
                roulette(g, k, config, subsets, roulette::Bind { tally, vpls, guides }, guided, true);
                vpls
            }
        };
        let [subset_slots, slots] = config.room(subsets);
        Vpls { list, count, slots, subset_slots, bounces: config.most_bounces() }
    })
}

/// One VPL in so many says how bright the picture is.
const TOTALS_STEP: u32 = 16;

/// Keeps those that matter to the whole picture, whatever part of it is drawn.
fn accept(
    g: &mut Graph,
    k: &Kernels,
    config: &VplShootConfig,
    shot: &Vpls,
    subsets: u32,
    min_distance: f32,
) -> Vpls {
    let points = view(g, k, [0, 0], [0, 0]);
    g.group("vpl_shoot", |g| {
        let totals = g.buffer("totals", 4 * u64::from(POINTS));
        let bind = totals::Bind { vpls: shot.list, count: shot.count, points, totals };
        let params = totals::Params { points: POINTS, step: TOTALS_STEP, min_distance };
        g.pass(
            "totals",
            &totals::kernel(&k.scene),
            bind,
            params,
            Grid::Of([POINTS, totals::CODE.workgroup[1], 1]),
        );
        let weights = g.buffer("weights", 4 * u64::from(shot.slots));
        let bind = weigh::Bind { vpls: shot.list, count: shot.count, points, totals, matters: weights };
        let params = weigh::Params { points: POINTS, min_distance };
        g.pass(
            "weigh",
            &weigh::kernel(&k.scene),
            bind,
            params,
            Grid::Of([shot.slots, weigh::CODE.workgroup[1], 1]),
        );
        let room = config.vpls.div_ceil(subsets);
        let subset_slots = room + 1;
        let slots = subset_slots * subsets;
        let vpls = g.buffer("accepted", bytes(slots));
        let count = g.buffer("accepted_count", 4 * (u64::from(subsets) + 2));
        let bind = accept::Bind { candidates: shot.list, found: shot.count, weights, vpls, count };
        let kernel = accept::kernel(accept::Spec { guided: config.guides(&k.profile) });
        g.pass("accept", &kernel, bind, accept::Params { subsets, room }, Grid::Of([1, 1, 1]));
        Vpls { list: vpls, count, slots, subset_slots, bounces: shot.bounces }
    })
}

fn close_gaps(
    g: &mut Graph,
    config: &VplShootConfig,
    slots: Res<Buffer>,
    counts: Res<Buffer>,
    subsets: u32,
) -> Res<Buffer> {
    let [_, all] = config.room(1);
    let list = g.buffer("vpls", bytes(all));
    let blocks = all.div_ceil(BLOCK_SLOTS);
    let before = (blocks > 1).then(|| {
        let blocks_of = g.buffer("blocks", 4 * u64::from(blocks));
        let grid = Grid::Of([blocks * count::CODE.workgroup[0], 1, 1]);
        let bind = count::Bind { slots, blocks: blocks_of };
        g.pass("count", &count::kernel(), bind, count::Params { slots: all }, grid);
        let bind = scan::Bind { blocks: blocks_of };
        g.pass("scan", &scan::kernel(), bind, scan::Params { blocks }, Grid::Of([1, 1, 1]));
        blocks_of
    });
    let spec = compact::Spec { blocks: before.is_some() };
    // Unread where there is one block.
    let bind = compact::Bind { slots, blocks: before.unwrap_or(slots), vpls: list, count: counts };
    let params = compact::Params { paths: config.paths(), bounces: config.most_bounces(), subsets };
    let grid = Grid::Of([blocks * compact::CODE.workgroup[0], 1, 1]);
    g.pass("compact", &compact::kernel(spec), bind, params, grid);
    list
}

/// Which paths light anything that is seen.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// [`Receiver`]s: points that the camera sees; normals 0 where it sees none.
    pub points: Res<Buffer>,
    /// An unsigned integer each: 1 if a VPL of the path lights any of them.
    pub paths: Res<Buffer>,
}

/// Points seen along a side of the picture.
const POINTS_SIDE: u32 = 16;

/// Points that [`view`] finds.
pub(super) const POINTS: u32 = POINTS_SIDE * POINTS_SIDE;

/// Points that the camera sees all over the window of `extent` pixels that begins at pixel `origin`: as of [`Seen`].
pub(super) fn view(g: &mut Graph, k: &Kernels, origin: [u32; 2], extent: [u32; 2]) -> Res<Buffer> {
    g.group("vpl_shoot", |g| {
        let points = g.buffer("points", u64::from(POINTS) * size_of::<Receiver>() as u64);
        let params = view::Params { origin, extent, side: POINTS_SIDE };
        g.pass("view", &view::kernel(&k.scene), view::Bind { points }, params, Grid::Of([POINTS, 1, 1]));
        points
    })
}

/// Asks of every path for points all over the window of `extent` pixels that begins at pixel `origin`.
pub fn seen(
    g: &mut Graph,
    k: &Kernels,
    config: &VplShootConfig,
    vpls: &Vpls,
    origin: [u32; 2],
    extent: [u32; 2],
) -> Seen {
    let points = view(g, k, origin, extent);
    g.group("vpl_shoot", |g| {
        let found = g.buffer("seen", 4 * u64::from(config.paths()));
        g.fill("none", found, 0);
        let bind = seen::Bind { vpls: vpls.list, count: vpls.count, points, seen: found };
        let params = seen::Params { points: POINTS };
        g.pass("seen", &seen::kernel(&k.scene), bind, params, Grid::Of([vpls.slots, 1, 1]));
        Seen { points, paths: found }
    })
}

fn bytes(vpls: u32) -> u64 {
    u64::from(vpls) * size_of::<Vpl>() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;
    use crate::config::RenderConfig;
    use crate::graph::{Executor, RunOptions};
    use crate::renderer::{BackendChoice, Renderer, RendererOptions};
    use crate::sampling::hash;
    use crate::scene::{Environment, Light, LightKind, Mesh, Scene, builtin};
    use crate::vk::Backend;
    use glam::{Vec3, vec3};

    #[test]
    fn more_candidates_are_shot_where_paths_are_guided() {
        let sky = SceneProfile { environment: true, ..SceneProfile::default() };
        let sun = SceneProfile { directional_lights: 1, ..SceneProfile::default() };
        let ours = VplShootConfig::default();
        let all = VplShootConfig { candidates: 1, ..ours.clone() };
        let plain = VplShootConfig { guided: false, ..ours.clone() };
        for far in [&sky, &sun] {
            assert_eq!(ours.of(far).candidates, MORE_GUIDED * ours.candidates);
            assert!(all.of(far) == all && plain.of(far) == plain);
        }
        assert!(ours.of(&SceneProfile::default()) == ours);
    }

    const SEEDS: u32 = 24;

    /// A hut with a window, the ground before it, sky and sun.
    fn hut() -> Scene {
        let mut mesh = Mesh::default();
        let blocks = [
            [[-6.0, -0.2, -6.0], [6.0, 0.0, 6.0]],
            [[-2.0, 0.0, -2.2], [2.0, 3.0, -2.0]],
            [[-2.2, 0.0, -2.2], [-2.0, 3.0, 2.2]],
            [[2.0, 0.0, -2.2], [2.2, 3.0, 2.2]],
            [[-2.2, 3.0, -2.2], [2.2, 3.2, 2.2]],
            // Around the window.
            [[-2.0, 0.0, 2.0], [2.0, 1.0, 2.2]],
            [[-2.0, 2.0, 2.0], [2.0, 3.0, 2.2]],
            [[-2.0, 1.0, 2.0], [-0.5, 2.0, 2.2]],
            [[0.5, 1.0, 2.0], [2.0, 2.0, 2.2]],
        ];
        for [low, high] in blocks.map(|block| block.map(Vec3::from)) {
            builtin::block(&mut mesh, low, high, 0);
        }
        let camera = builtin::look(vec3(1.5, 1.5, 1.5), vec3(-1.0, 1.0, -2.0));
        let mut scene = builtin::scene(mesh, vec![common::gray(0.6)], Vec3::ZERO, camera);
        let direction = vec3(0.1, -1.0, -0.3).normalize();
        scene.lights = vec![Light { kind: LightKind::Directional, direction, ..scene.lights[0].clone() }];
        scene.environment = Some(Environment::constant(Vec3::splat(0.2)).into());
        scene
    }

    /// Flux (W) that arrives in the hut, straight from outside and by one bounce: means over seeds and their standard errors.
    fn flux_inside(renderer: &mut Renderer, guided: bool, vpls: u32) -> [[f64; 2]; 2] {
        let mut sums = [[0.0; 2]; 2];
        for seed in 0..SEEDS {
            let mut config = RenderConfig { size: [32, 32], seed, ..common::plain() };
            config.vpl_shoot = VplShootConfig { vpls, bounces: Some(2), guided, ..config.vpl_shoot };
            let camera = renderer.scene().cameras[0].clone();
            let k = renderer.kernels(config.whitted.mirror_roughness).with_indirect(&config.indirect);
            let mut g = Graph::new();
            let paths = paths(&mut g, &k, &config.vpl_shoot, 1);
            let vpls = compact(&mut g, &k, &config.vpl_shoot, &paths, 1, 0.0);
            let (list, count) = (g.read_buffer::<Vpl>(vpls.list), g.read_buffer::<u32>(vpls.count));
            let mut run = renderer.run(g, &config, &camera).unwrap();
            let count = run.take(count)[0] as usize;
            let mut flux = [0.0; 2];
            for vpl in &run.take(list)[..count] {
                let [x, y, z] = vpl.position;
                if x.abs() < 2.01 && (-0.01..3.01).contains(&y) && z.abs() < 2.01 {
                    flux[vpl.bounce as usize] += f64::from(vpl.flux.iter().sum::<f32>());
                }
            }
            for (sum, flux) in sums.iter_mut().zip(flux) {
                sum[0] += flux;
                sum[1] += flux * flux;
            }
        }
        let n = f64::from(SEEDS);
        sums.map(|[sum, squares]| [sum / n, ((squares - sum * sum / n) / (n * (n - 1.0))).sqrt()])
    }

    /// Guides bring the flux that plain paths bring, and more evenly, by way of the ground as well.
    #[test]
    fn guided_paths_bring_the_same_flux() {
        let Some((_guard, device)) = common::device() else { return };
        let options = RendererOptions {
            backend: BackendChoice::Force(Backend::Software),
            ..RendererOptions::default()
        };
        let mut renderer = Renderer::new(&device, hut(), &options).unwrap();
        let plain = flux_inside(&mut renderer, false, 1 << 18);
        let guided = flux_inside(&mut renderer, true, 1 << 16);
        for bounce in 0..2 {
            let ([a, sa], [b, sb]) = (plain[bounce], guided[bounce]);
            println!("{bounce} bounces: {a} ± {sa} W plainly, {b} ± {sb} W guided");
            assert!((a - b).abs() < 4.0 * sa.hypot(sb) && sa.hypot(sb) < 0.05 * a);
            assert!(sb * sb < 2.0 * sa * sa, "of a quarter of the paths");
        }
    }

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
                let config = VplShootConfig { vpls, bounces: Some(bounces), ..VplShootConfig::default() };
                let [_, all] = config.room(1);
                let gap = |slot: u32| hash(slot).is_multiple_of(gaps);
                let slot = |slot| Vpl {
                    path: slot,
                    flux: if gap(slot) { [0.0; 3] } else { [1.0; 3] },
                    ..Vpl::default()
                };
                let data: Vec<Vpl> = (0..all).map(slot).collect();
                let mut g = Graph::new();
                let slots = g.buffer("slots", bytes(all));
                g.upload("slots", slots, bytemuck::cast_slice(&data).to_vec());
                let count = g.buffer("count", 4 * (u64::from(subsets) + 2));
                let list = close_gaps(&mut g, &config, slots, count, subsets);
                let (list, count) = (g.read_buffer::<Vpl>(list), g.read_buffer::<u32>(count));
                let mut run = executor.run(g, &RunOptions::default()).unwrap();
                let (list, count) = (run.take(list), run.take(count));

                let what = format!("{config:?}, {subsets} subsets, gaps {gaps}");
                let kept: Vec<u32> = (0..all).filter(|&slot| !gap(slot)).collect();
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
