//! Path tracing: the reference (see [`path_trace`]).
//!
//! The layers `albedo`, `N`, `P` and `depth` are those of the pixel's centre. Radiance is not split by kind; instead
//! `path_trace.transport` draws one kind alone.

use super::method::RenderConfig;
use super::option::{BOUNCES, CliOption, OptionGroup, OptionValue};
use super::trial::{Trial, fails, holds};
use super::{Aov, Conditional, FrameInfo, Layers, Method, Progressive, Reach, Sweeps};
use crate::graph::Graph;
use crate::scene::DELTA_ROUGHNESS;
use crate::techniques::path_trace::{PixelFilter, Transport};
use crate::techniques::setting::BadValue;
use crate::techniques::{Kernels, compose, gbuffer, path_trace};

/// The registry's entry.
pub static METHOD: Method = Method {
    name: "path",
    about: "path tracing, the reference",
    description: "Paths from the camera ask a light at every vertex and find others by chance, weighted (multiple \
        importance sampling), until Russian roulette ends them. Known bias: light of more than `path_trace.max_depth` \
        edges is missing, and light of points, spots and suns by way of mirrors and glass. Known noise: grain, by one over \
        the root of the samples a pixel. Kajiya 1986; Veach 1997.",
    aovs: &[Aov::Albedo, Aov::N, Aov::P, Aov::Depth, Aov::Variance, Aov::HalfA, Aov::HalfB, Aov::Rate],
    conditional: &[Conditional {
        aov: Aov::Rate,
        option: "--adaptive",
        there: |config| config.path_trace.adaptive,
    }],
    own: None,
    check: |config| match config.pixel_samples {
        1 => Ok(()),
        _ => Err(BadValue::new("pixel_samples", "method path has path_trace.spp in its place")),
    },
    options: OPTIONS,
    progressive: Some(Progressive {
        key: "path_trace.spp",
        samples: |config| config.path_trace.spp,
        set_samples: |config, samples| config.path_trace.spp = samples,
        adaptive: |config| config.path_trace.adaptive,
        rounds: RenderConfig::max_depth,
    }),
    kernels: |kernels, _| kernels,
    costless: &[],
    reach: |_| Reach { pixels: 0, cell: 1 },
    cost: |config| 10.0 * f64::from(config.path_trace.spp),
    comparable: |config, max_depth| {
        config.path_trace.pixel_filter = PixelFilter::Center;
        config.path_trace.max_depth = max_depth.or(config.path_trace.max_depth);
    },
    pane_roughness: |_| DELTA_ROUGHNESS,
    sweeps: Sweeps {
        small: "
            [[sweep]]
            method = 'path'
            path_trace.spp = [1, 4, 16]
        ",
        paper: "",
        full: "
            [[sweep]]
            method = 'path'
            path_trace.spp = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024]
            [[sweep]]
            method = 'path'
            path_trace.estimator = 'naive'
            path_trace.spp = [16, 256]
        ",
        probe: "
            [[sweep]]
            method = 'path'
            path_trace.spp = 4
        ",
        finer: "",
    },
    diffuse_indirect: |config| {
        config.path_trace.transport = Transport::DiffuseIndirect;
        None
    },
    trials: TRIALS,
    record,
    asks_free_path: |_| false,
    left_out: |profile, _| {
        let lights = profile.point_lights + profile.spot_lights + profile.directional_lights;
        let missing =
            "bodies of glass block shadow rays: light of points, spots and suns through them is missing";
        if profile.volumes && lights > 0 { vec![missing.to_owned()] } else { Vec::new() }
    },
};

const OPTIONS: &[CliOption] = &[
    BOUNCES,
    CliOption {
        word: "--spp",
        key: "path_trace.spp",
        group: OptionGroup::Light,
        rare: false,
        help: "Paths a pixel of --method path: 4 times as many halve noise [default: 64]",
        more: "",
        value: OptionValue::Whole("N"),
    },
    CliOption {
        word: "--max-depth",
        key: "path_trace.max_depth",
        group: OptionGroup::Light,
        rare: true,
        help: "Edges of its longest paths, counted from the camera: 2 is direct light [default: --bounces + 2, or 64]",
        more: "",
        value: OptionValue::Whole("N"),
    },
    CliOption {
        word: "--estimator",
        key: "path_trace.estimator",
        group: OptionGroup::Light,
        rare: true,
        help: "How its paths find light [default: mis]",
        more: "mis: by rays to the lights and by chance, weighted. naive: by chance alone.",
        value: OptionValue::Word("ESTIMATOR", &["mis", "naive"]),
    },
    CliOption {
        word: "--transport",
        key: "path_trace.transport",
        group: OptionGroup::Light,
        rare: true,
        help: "Which light it counts [default: full]",
        more: "",
        value: OptionValue::Word("TRANSPORT", &["full", "direct", "diffuse-indirect"]),
    },
    CliOption {
        word: "--pixel-filter",
        key: "path_trace.pixel_filter",
        group: OptionGroup::Picture,
        rare: true,
        help: "Where in a pixel paths of --method path begin: anywhere, or at the centre [default: box]",
        more: "",
        value: OptionValue::Word("FILTER", &["box", "center"]),
    },
    CliOption {
        word: "--adaptive",
        key: "path_trace.adaptive",
        group: OptionGroup::Speed,
        rare: true,
        help: "Let --method path take up to 8 times as many paths where the picture is noisy, fewer elsewhere",
        more: "Not for references. --resume then needs --aov half_a,half_b,rate.",
        value: OptionValue::Flag,
    },
];

/// What it is tried with under stress.
const TRIALS: &[Trial] = &[
    holds("pane", &[]),
    holds("caustic", &[]),
    fails("caustic", &["path_trace.transport=direct"], "direct light goes through no body of glass"),
    holds("wires", &["path_trace.spp=128"]),
    fails("crease", &[], "the brightest pixel of few samples is noise"),
    holds("crease", &["path_trace.spp=1024"]),
];

/// # Panics
/// Without means to add to.
fn record(g: &mut Graph, k: &Kernels, config: &RenderConfig, frame: &FrameInfo) -> Layers {
    let means = frame.means.expect("progressive methods are given means");
    path_trace::path_trace(g, k, &config.path_trace, config.max_depth(), &means, frame.taken, frame.samples);
    let mut layers = Layers::new(means.all, gbuffer::gbuffer(g, k, frame.origin, frame.extent));
    if let Some(halves) = means.halves {
        layers.add_made(Aov::Variance, move |g| compose::variance(g, halves));
        layers.add(Aov::HalfA, halves[0]);
        layers.add(Aov::HalfB, halves[1]);
    }
    if let Some(rates) = means.rates {
        layers.add(Aov::Rate, rates);
    }
    layers
}
