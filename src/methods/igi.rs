//! Instant global illumination, with the paper's accelerations as switches. What it is, and its known bias and noise:
//! [`METHOD`]'s description.

use super::method::RenderConfig;
use super::option::{BOUNCES, CliOption, OptionGroup, OptionValue};
use super::trial::{Trial, fails, holds};
use super::{Aov, FrameInfo, Layers, Method, Reach, Sweeps, VplCounts};
use crate::graph::Graph;
use crate::scene::{Feature, SceneProfile};
use crate::techniques::indirect::Visibility;
use crate::techniques::{Kernels, compose, gbuffer, indirect, radiance_cache, vpl_shoot, whitted};

/// The registry's entry.
pub static METHOD: Method = Method {
    name: "igi",
    about: "instant global illumination with virtual point lights",
    description: "Paths from the lights leave virtual point lights (VPLs) where they meet diffuse surfaces; every pixel \
        gathers indirect light from all of them or from an interleaved subset, one shadow ray each, and what these leave \
        out by a few rays that ask a cache of irradiance in the world. Imperfect visibility, downsampling and interleaved \
        sampling are switches. Known bias: the cache blurs over its cells, and without it (`indirect.compensation` 0) light \
        nearer than `indirect.min_distance` is missing; where `vpl_shoot.bounces` is set that of more diffuse bounces is, \
        too; VPLs shine as Lambertians, and know facets as they are, whatever `shadow_terminator` says. Known noise: VPLs \
        are shared by all pixels, so error shows as splotches, not grain; but grain by rays. Debattista et al. 2009; \
        Marques & Santos 2010; Wald et al. 2002; Keller 1997.",
    aovs: &[
        Aov::Albedo,
        Aov::N,
        Aov::P,
        Aov::Direct,
        Aov::Specular,
        Aov::Indirect,
        Aov::Glossy,
        Aov::Irradiance,
        Aov::Depth,
    ],
    conditional: &[],
    own: None,
    check: |_| Ok(()),
    options: OPTIONS,
    progressive: None,
    kernels: |kernels, config| kernels.with_indirect(&config.indirect),
    // Only paths end at what they find.
    costless: &[Feature::Unlit],
    reach: |config| Reach { pixels: config.indirect.reach(), cell: config.indirect.downsample },
    cost: |config| {
        let side = f64::from(config.indirect.downsample * config.indirect.interleave);
        5.0 + f64::from(config.vpl_shoot.vpls) / (side * side)
    },
    comparable: |_, _| (),
    pane_roughness: |config| config.whitted.mirror_roughness,
    sweeps: Sweeps { small: SMALL, paper: PAPER, full: FULL, probe: SMALL, finer: FINER },
    diffuse_indirect: |_| Some(Aov::Indirect),
    trials: TRIALS,
    record,
    asks_free_path: |config| config.indirect.compensation > 0,
    left_out,
};

const OPTIONS: &[CliOption] = &[
    CliOption {
        word: "--vpls",
        key: "vpl_shoot.vpls",
        group: OptionGroup::Light,
        rare: false,
        help: "Virtual point lights: more are smoother and slower [default: 720]",
        more: "",
        value: OptionValue::Whole("N"),
    },
    BOUNCES,
    CliOption {
        word: "--min-distance",
        key: "indirect.min_distance",
        group: OptionGroup::Light,
        rare: true,
        help: "Leave out light of virtual lights nearer than this (metres); 0 keeps all [default: by what is seen]",
        more: "",
        value: OptionValue::Distance("M"),
    },
    CliOption {
        word: "--downsample",
        key: "indirect.downsample",
        group: OptionGroup::Speed,
        rare: true,
        help: "Gather indirect light at one pixel in NxN [default: 1, every pixel]",
        more: "",
        value: OptionValue::Whole("N"),
    },
    CliOption {
        word: "--upsample",
        key: "indirect.upsample",
        group: OptionGroup::Speed,
        rare: true,
        help: "How the other pixels get theirs [default: paper]",
        more: "paper: by distance and normal, as in the paper. plane: only from pixels of the same plane; a pixel that has \
            none near gathers by itself.",
        value: OptionValue::Word("FILTER", &["paper", "plane"]),
    },
    CliOption {
        word: "--interleave",
        key: "indirect.interleave",
        group: OptionGroup::Speed,
        rare: true,
        help: "Split the VPLs over tiles of NxN pixels, N from 1 to 3; 1 is all at each pixel [default: 3]",
        more: "",
        value: OptionValue::Whole("N"),
    },
    CliOption {
        word: "--pattern",
        key: "indirect.pattern",
        group: OptionGroup::Speed,
        rare: true,
        help: "Order of the shares in a tile: the same in every tile, or another in each [default: regular]",
        more: "",
        value: OptionValue::Word("PATTERN", &["regular", "irregular"]),
    },
    CliOption {
        word: "--filter",
        key: "indirect.filter",
        group: OptionGroup::Speed,
        rare: true,
        help: "What hides the tiles of --interleave [default: combined]",
        more: "paper: the paper's two filters. combined: one filter that averages each share of the VPLs by itself.",
        value: OptionValue::Word("FILTER", &["paper", "combined"]),
    },
    CliOption {
        word: "--visibility",
        key: "indirect.visibility",
        group: OptionGroup::Speed,
        rare: true,
        help: "What blocks light from virtual lights [default: exact]",
        more: "Triangles (exact), or their bounding boxes: cheaper and less exact.",
        value: OptionValue::Word("KIND", Visibility::NAMES),
    },
    CliOption {
        word: "--box-split",
        key: "indirect.box_split",
        group: OptionGroup::Speed,
        rare: true,
        help: "Split triangles until no edge of a box is longer (metres) [default: no triangle is split]",
        more: "For --visibility boxes and boxes-plane.",
        value: OptionValue::Number("M"),
    },
];

const SMALL: &str = "
    [[sweep]]
    preset = 'fast'
    vpl_shoot.vpls = [60, 180, 720]
    vpl_shoot.bounces = [3, 8]
    [[sweep]]
    preset = ['paper-canonical', 'paper-interleaved']
    [[sweep]]
    preset = 'fast'
    indirect.downsample = [1, 4]
";

const PAPER: &str = "
    [[sweep]]
    preset = ['paper-canonical', 'paper-imperfect', 'paper-downsampled', 'paper-interleaved', 'fast']
    vpl_shoot.vpls = [30, 90, 180]
";

const FULL: &str = "
    [[sweep]]
    preset = 'fast'
    vpl_shoot.vpls = [30, 90, 180, 720, 1440, 2880]
    vpl_shoot.bounces = [1, 3, 8]
    [[sweep]]
    preset = 'fast'
    indirect.downsample = [1, 2, 4]
    indirect.interleave = [1, 2, 3]
    vpl_shoot.vpls = [180, 1440]
    vpl_shoot.bounces = 8
    [[sweep]]
    preset = ['paper-canonical', 'paper-imperfect', 'paper-downsampled', 'paper-interleaved']
    vpl_shoot.vpls = [30, 180, 720]
    [[sweep]]
    preset = 'fast'
    indirect.visibility = ['boxes', 'boxes-plane']
    vpl_shoot.vpls = [180, 720]
    [[sweep]]
    preset = 'fast'
    indirect.min_distance = 0
    vpl_shoot.vpls = [180, 720]
    [[sweep]]
    preset = 'fast'
    indirect.pattern = 'irregular'
    vpl_shoot.vpls = [180, 720]
";

const FINER: &str = "
    [[sweep]]
    preset = 'fast'
    vpl_shoot.vpls = [1440, 2880, 5760]
    vpl_shoot.bounces = [3, 8]
    [[sweep]]
    preset = 'fast'
    vpl_shoot.vpls = 1440
    vpl_shoot.bounces = 8
    indirect.downsample = 1
    indirect.interleave = [2, 3]
";

/// What it is tried with under stress.
const TRIALS: &[Trial] = &[
    holds("crease", &[]),
    holds("crease", &["preset=paper-canonical"]),
    fails(
        "crease",
        &["preset=paper-canonical", "indirect.min_distance=0"],
        "without a least distance the spots stay",
    ),
    holds("clamp", &[]),
    fails(
        "clamp",
        &["preset=paper-canonical"],
        "m = ½·√(A/N) is 18 cm here, which would take 8 % of walls lit evenly",
    ),
    holds("clamp", &["preset=paper-canonical", "vpl_shoot.vpls=4096"]),
    holds("glossy", &[]),
    fails("glossy", &["indirect.compensation=0"], "720 virtual lights are too few for a lobe"),
    fails("glossy", &["preset=paper-canonical"], "the lobe's light is missing"),
    holds("pane", &[]),
    fails("pane", &["preset=paper-canonical"], "shadow rays stop at panes"),
    holds("caustic", &[]),
    fails(
        "caustic",
        &["preset=fast"],
        "shadow rays stop at bodies of glass, and virtual lights light others only",
    ),
    holds("no-light", &[]),
    holds("no-light", &["preset=paper-interleaved"]),
    holds("no-light", &["preset=fast"]),
    holds("halton", &["seed=0"]),
    fails("halton", &["preset=paper-canonical", "seed=0"], "plain Halton points"),
    fails(
        "halton",
        &["preset=paper-canonical", "seed=0", "vpl_shoot.vpls=2048"],
        "in bases beyond a hundred 128 paths are still one line",
    ),
    holds("halton", &["preset=paper-canonical", "seed=1", "vpl_shoot.vpls=2048"]),
    holds("blinds", &[]),
    holds("blinds", &["indirect.visibility=boxes"]),
    holds("blinds", &["indirect.visibility=boxes-plane"]),
    fails("blinds", &["preset=paper-canonical"], "most light between slats is of more than three bounces"),
    holds("turned", &[]),
    fails("turned", &["indirect.visibility=boxes"], "a fifth is lost to the walls' boxes"),
    holds("turned", &["indirect.visibility=boxes-plane"]),
    fails("turned", &["preset=paper-canonical"], "light of more than three bounces is missing"),
    holds("thin-wall", &[]),
    holds("thin-wall", &["indirect.compensation=0"]),
    holds("thin-wall", &["preset=paper-canonical"]),
    holds("thin-wall", &["preset=paper-imperfect"]),
    fails("thin-wall", &["preset=paper-downsampled"], "samples of the floor beyond the wall fit"),
    fails("thin-wall", &["preset=paper-interleaved"], "the discontinuity buffer sees no wall edge on"),
    fails("thin-wall", &["preset=fast"], "floors of both rooms are one plane"),
    holds("ajar", &[]),
    fails("ajar", &["preset=paper-canonical"], "few virtual lights see the room"),
    holds("wires", &[]),
    fails(
        "wires",
        &["preset=paper-canonical"],
        "60 paths are few, and light of more than three bounces is missing",
    ),
    fails("wires", &["preset=paper-downsampled"], "no sample fits posts"),
    fails("wires", &["preset=fast"], "posts get light of their own, but shadows between samples stay unseen"),
    holds("bumpy", &[]),
    fails(
        "bumpy",
        &["preset=paper-canonical"],
        "60 paths are few, and light of more than three bounces is missing",
    ),
    fails("bumpy", &["preset=paper-interleaved"], "neighbours count whole or not at all, and few do"),
    holds("popping", &[]),
    fails("popping", &["preset=paper-canonical"], "virtual lights jump"),
    holds("popping", &["preset=paper-canonical", "vpl_shoot.vpls=2048"]),
    holds("switched-off", &[]),
    holds("switched-off", &["preset=fast"]),
    holds("crawling", &[]),
    holds("crawling", &["preset=paper-canonical"]),
    fails("crawling", &["preset=paper-downsampled"], "posts change with the samples that hit them"),
    holds("small", &[]),
    holds("small", &["preset=paper-imperfect"]),
    holds("large", &[]),
    holds("far", &[]),
    holds("duplicated", &[]),
    fails(
        "duplicated",
        &["preset=paper-canonical"],
        "the default min_distance follows the area, which is twice the room's",
    ),
    holds("duplicated", &["preset=paper-canonical", "indirect.min_distance=0.1"]),
];

fn left_out(profile: &SceneProfile, config: &RenderConfig) -> Vec<String> {
    let rough = config.whitted.mirror_roughness;
    let without = !config.indirect.glossy;
    let mut lines = Vec::new();
    if without && profile.rough_lobes {
        lines.push(format!("specular lobes rougher than {rough} are left out (indirect.glossy is false)"));
    }
    if without && profile.clearcoat {
        lines.push("clear coats are left out (indirect.glossy is false)".into());
    }
    if profile.rough_glass {
        lines.push(format!("glass rougher than {rough} transmits as if it were smooth"));
    }
    if profile.volumes {
        let more = if profile.emission || profile.environment {
            "--method path adds that of lamps that have a size and of the environment"
        } else {
            "so it is by --method path, whose rays hit no light here"
        };
        lines.push(format!("bodies of glass block shadow rays: light through them is missing; {more}"));
    }
    lines
}

fn record(g: &mut Graph, k: &Kernels, config: &RenderConfig, frame: &FrameInfo) -> Layers {
    let shoot = config.vpl_shoot.of(&k.profile);
    let min_distance = config.indirect.min_distance(frame.area, frame.free_path, &shoot);
    // Where VPLs leave nothing out rays find nothing.
    let needed = min_distance > 0.0 || k.glossy_lobes() || k.specular();
    let rays = if needed { config.indirect.compensation } else { 0 };
    let vpl_share = (rays > 0).then(|| config.indirect.behind_mirrors());
    // Passes that do not need each other stand side by side, the longest chains first: a GPU overlaps them.
    let paths = vpl_shoot::paths(g, k, &shoot, config.indirect.subsets());
    let gbuffer = gbuffer::gbuffer(g, k, frame.origin, frame.extent);
    let vpls = vpl_shoot::compact(g, k, &shoot, &paths, config.indirect.subsets(), min_distance);
    let reflections = whitted::tree(g, k, &config.whitted, &gbuffer, &vpls, min_distance, vpl_share);
    let samples = indirect::gather(g, k, &config.indirect, &gbuffer, &vpls, min_distance);
    let mut direct = whitted::direct(g, k, &config.whitted, &gbuffer, rays);
    let geometry = (config.indirect.filtered() || rays > 0).then(|| gbuffer::unpack(g, k, &gbuffer));
    if let Some(reflections) = &reflections {
        whitted::sort(g, k, reflections, &vpls);
    }
    let by_vpls = rays == 0;
    let mut glossy =
        by_vpls.then(|| indirect::glossy(g, k, &config.indirect, &gbuffer, &vpls, min_distance)).flatten();
    let filtered = geometry.as_ref().filter(|_| config.indirect.filtered());
    let indirect = indirect::reconstruct(g, k, &config.indirect, &gbuffer, filtered, &vpls, &samples);
    let mut irradiance = indirect.irradiance;
    let cache = (rays > 0).then(|| {
        let distances = radiance_cache::Distances::of(min_distance, frame.free_path);
        radiance_cache::cache(g, rays, frame.extent, &vpls, distances)
    });
    if let (Some(cache), Some(geometry)) = (&cache, &geometry) {
        let gathered = cache.gather(g, k, &gbuffer, geometry, config.indirect.planes(), irradiance);
        (irradiance, glossy) = (gathered.irradiance, gathered.glossy);
        if let Some(sky) = gathered.sky {
            direct = compose::with_sky(g, &gbuffer, direct, sky);
        }
    }
    let specular = reflections
        .map(|reflections| whitted::specular(g, k, &config.whitted, &reflections, &vpls, cache.as_ref()));
    let beauty = compose::beauty(g, &gbuffer, direct, specular, irradiance, glossy);
    let mut layers = Layers::new(beauty, gbuffer);
    layers.geometry = geometry;
    layers.add(Aov::Direct, direct);
    layers.add_or_black(Aov::Specular, specular);
    layers.add_made(Aov::Indirect, move |g| compose::indirect(g, &gbuffer, irradiance));
    layers.add_or_black(Aov::Glossy, glossy);
    layers.add(Aov::Irradiance, irradiance);
    layers.vpls = Some(VplCounts { count: vpls.count, paths: shoot.paths(), min_distance });
    layers.regathered = indirect.regathered;
    layers
}
