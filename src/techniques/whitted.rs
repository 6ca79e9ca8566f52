//! Direct light and specular paths (Whitted 1980; Marques & Santos 2010, §4).
//!
//! `direct`: emission and, with a shadow ray to every light, direct light on primary hits; the environment where there
//! are none. Emissive triangles, the environment and lights without size if they are more than 8 get `light_samples`
//! stratified rays together, chosen as `light_choice` says. With `indirect.glossy` all lobes reflect that are no mirrors,
//! else the Lambertian part alone.
//! `specular`: the tree of mirrored and transmitted rays behind primary hits, with emission, direct light and
//! (at full resolution, from every VPL, as in the paper) indirect light where they end. Four passes: `tree`
//! follows the rays and lists the points they end at, `sort` brings them into spatial order, `light` lights the
//! list, `sum` gathers each pixel's share; large pictures are cut into strips, so that lists stay short. Opaque mirrors
//! follow Schlick's approximation as glTF does, glass the exact Fresnel equations; a transmissive surface without volume
//! is a thin wall with R' = 2R / (1 + R), straight through, and one with volume refracts and absorbs. Smooth clear coats
//! are mirrors too.
//!
//! Surfaces of partial coverage and panes (smooth thin walls) let their share straight through, for camera rays and shadow
//! rays alike, as no bounce.
//!
//! Bias: specular paths deeper than `specular_depth` are left out, and so are reflections between panes that bring less
//! than 1e-5 of their light; other transmissive surfaces block shadow rays, so there are no caustics from point lights but
//! through VPLs.
//! Where a surface has a glossy lobe, as many rays again follow all that it scatters by but mirrors and find emissive
//! triangles and the environment; the power heuristic weighs both (Veach 1997). Beside them of the environment only what
//! exceeds its mean is chosen (MIS compensation; Karlík et al. 2019).
//! Noise: grain by the rays to and from lights that have a size, where a lobe sees many of them, or few of much light.
//! Cost: one shadow ray a light and `light_samples`, twice as many on glossy surfaces; behind mirrors and glass also one a
//! VPL.

use super::radiance_cache::{Cache, Points};
use super::setting::{BadValue, Settings, within};
use super::{Kernels, gbuffer::GBuffer, vpl_shoot::Vpls};
use crate::graph::{Buffer, Graph, Grid, Image, Res};
use crate::shaders::{
    MAX_SPECULAR_DEPTH, PointArgs, Reached, Seen,
    whitted::{self as kernels, collect, light, sort, sum, tree},
};
use crate::vk::Format;
use std::mem::offset_of;

/// Lights and VPLs that one pass takes; bounded as [`super::indirect::RANGE`] is.
const RANGE: u32 = 256;

/// Pixels of a strip, as far as it is more than a row, whose points are listed at a time: 64 bytes each, 32 more where
/// surfaces are glossy or lights have a size.
const LISTED_PIXELS: u32 = 1 << 20;

/// Sums of light at a point that are kept apart, 12 bytes each: enough to fill any device with short lists.
const ROOM: u32 = 1 << 22;

/// How the tree of specular rays grows, and how lights that have a size are sampled.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WhittedConfig {
    /// Specular bounces in a row, 0 … 16, for camera rays and light paths alike. Fewer darken what is seen
    /// through glass and in facing mirrors. Ours: the paper does not say.
    pub specular_depth: u32,
    /// Roughness (perceptual) up to which a surface or a clear coat is a mirror, 0 … 1. More turns glossy surfaces into
    /// mirrors; lobes above it count with `indirect.glossy`. Ours: the paper does not say.
    pub mirror_roughness: f32,
    /// Shadow rays from a point to emissive triangles and the environment together, 1 … 4096, and with `indirect.glossy` as
    /// many again by the lobes of glossy surfaces. Lights without size get one each, or a share of these where they are
    /// more than 8 and `light_choice` is `tree`. More: smoother penumbrae and highlights; time in proportion. No bias. Ours:
    /// the paper's lights are points.
    pub light_samples: u32,
}

impl Default for WhittedConfig {
    fn default() -> Self {
        Self { specular_depth: 5, mirror_roughness: 0.1, light_samples: 8 }
    }
}

impl Settings for WhittedConfig {
    fn check(&self) -> Result<(), BadValue> {
        within("whitted.specular_depth", self.specular_depth, 0..=MAX_SPECULAR_DEPTH)?;
        within("whitted.mirror_roughness", self.mirror_roughness, 0.0..=1.0)?;
        within("whitted.light_samples", self.light_samples, 1..=4096)
    }
}

impl WhittedConfig {
    /// Sources that light a point at most: lights, samples of those that have a size, VPLs, rays of its lobes.
    fn sources(&self, k: &Kernels, vpls: &Vpls, vpl_share: u32) -> u32 {
        let samples = if k.samples_lights() { self.light_samples } else { 0 };
        let vpls = vpls.slots.div_ceil(vpl_share);
        k.asked_lights() + samples + vpls + if k.glossy_lobes() { samples } else { 0 }
    }
}

/// Radiance by emission, direct light and the environment at the end of camera rays. With `rays` (of a
/// [`super::radiance_cache`], of each pixel) without what those bring of the environment.
pub fn direct(g: &mut Graph, k: &Kernels, config: &WhittedConfig, gb: &GBuffer, rays: u32) -> Res<Image> {
    g.group("whitted", |g| {
        let out = g.image("direct", g.desc(gb.albedo));
        let samples = if k.samples_lights() { config.light_samples } else { 1 };
        for first in (0..samples).step_by(RANGE as usize) {
            let bind = kernels::direct::Bind {
                hits: gb.hits,
                albedo: gb.albedo,
                // Unread by the first range, which has nothing to continue.
                before: if first > 0 { out } else { gb.albedo },
                out_radiance: out,
            };
            let spec = kernels::direct::Spec {
                continues: first > 0,
                beside_rays: rays > 0 && k.profile.environment,
            };
            let kernel = kernels::direct::kernel(spec, &k.scene);
            let params = kernels::direct::Params { first, last: first + RANGE, rays };
            g.pass("direct", &kernel, bind, params, Grid::Over(out));
        }
        out
    })
}

/// Where specular paths from the camera end: lists of points still to be lit, a strip of the picture at a time.
#[derive(Clone, Copy, Debug)]
pub struct Reflections {
    gbuffer: GBuffer,
    emitted: Res<Image>,
    last: Res<Image>,
    points: Res<Buffer>,
    seen: Res<Buffer>,
    order: Res<Buffer>,
    /// Of the first strip.
    args: Res<Buffer>,
    /// Rows of a strip.
    rows: u32,
    /// Points that a list holds. Those beyond are lit where they are found: slower, the same light.
    capacity: u32,
    min_distance: f32,
    /// Where points send rays: one VPL in so many lights them.
    vpl_share: Option<u32>,
}

/// Follows mirrors and glass in the first strip; `vpl_share`: one VPL in so many lights a point, where points send rays,
/// too. `None` where the scene has neither or no specular bounce is asked for.
pub fn tree(
    g: &mut Graph,
    k: &Kernels,
    config: &WhittedConfig,
    gb: &GBuffer,
    vpls: &Vpls,
    min_distance: f32,
    vpl_share: Option<u32>,
) -> Option<Reflections> {
    (k.specular() && (config.specular_depth > 0 || k.sheer())).then(|| {
        g.group("whitted", |g| {
            let desc = g.desc(gb.albedo);
            let [width, height] = desc.extent;
            let rows = (LISTED_PIXELS / width).clamp(1, height);
            let capacity = width * rows;
            let emitted = g.image("emitted", desc);
            let last = g.image("last", desc.with_format(Format::R32Uint));
            let points = g.buffer("points", u64::from(capacity) * size_of::<Reached>() as u64);
            let known = if vpl_share.is_some() || k.glossy() || k.samples_lights() || k.scene.curved {
                capacity
            } else {
                1
            };
            let seen = g.buffer("seen", u64::from(known) * size_of::<Seen>() as u64);
            let order = g.buffer("order", u64::from(capacity) * 4);
            let args = point_args(g);
            let gbuffer = *gb;
            let reflections = Reflections {
                gbuffer,
                emitted,
                last,
                points,
                seen,
                order,
                args,
                rows,
                capacity,
                min_distance,
                vpl_share,
            };
            follow(g, k, &reflections, vpls, args, 0);
            reflections
        })
    })
}

fn point_args(g: &mut Graph) -> Res<Buffer> {
    let none = PointArgs { light: [0, 0, 1], ..PointArgs::default() };
    g.buffer_with("light_args", bytemuck::bytes_of(&none).to_vec())
}

/// Invocations over a strip.
fn strip(g: &Graph, r: &Reflections) -> Grid {
    Grid::Of([g.desc(r.emitted).extent[0], r.rows, 1])
}

/// Lists the points of the strip that begins in this row.
fn follow(g: &mut Graph, k: &Kernels, r: &Reflections, vpls: &Vpls, args: Res<Buffer>, first_row: u32) {
    let bind = tree::Bind {
        hits: r.gbuffer.hits,
        albedo: r.gbuffer.albedo,
        vpls: vpls.list,
        count: vpls.count,
        out_emitted: r.emitted,
        out_last: r.last,
        points: r.points,
        args,
        seen: r.seen,
    };
    let (capacity, min_distance) = (r.capacity, r.min_distance);
    let end_row = end_row(g, r, first_row);
    let params = tree::Params { capacity, range: RANGE, min_distance, first_row, end_row };
    let grid = strip(g, r);
    g.pass(
        "tree",
        &tree::kernel(tree::Spec { senders: r.vpl_share.is_some() }, &k.scene),
        bind,
        params,
        grid,
    );
}

fn end_row(g: &Graph, r: &Reflections, first_row: u32) -> u32 {
    (first_row + r.rows).min(g.desc(r.emitted).extent[1])
}

/// Brings the points of the first strip into an order that [`specular`] lights faster; a step of its own so that others
/// can run beside it.
pub fn sort(g: &mut Graph, k: &Kernels, reflections: &Reflections, vpls: &Vpls) {
    g.group("whitted", |g| arrange(g, k, reflections, vpls, reflections.args));
}

fn arrange(g: &mut Graph, k: &Kernels, r: &Reflections, vpls: &Vpls, args: Res<Buffer>) {
    let bind = sort::Bind { args, points: r.points, order: r.order, count: vpls.count };
    let params = sort::Params { capacity: r.capacity, room: room(r.capacity), range: RANGE };
    g.pass("sort", &sort::kernel(&k.scene), bind, params, Grid::Of([1, 1, 1]));
}

fn room(capacity: u32) -> u32 {
    capacity.saturating_mul(RANGE).min(ROOM).max(capacity)
}

/// Radiance through mirrors and glass: the points lit by all lights and VPLs, and by what their rays find in a `cache`.
pub fn specular(
    g: &mut Graph,
    k: &Kernels,
    config: &WhittedConfig,
    reflections: &Reflections,
    vpls: &Vpls,
    cache: Option<&Cache>,
) -> Res<Image> {
    let &Reflections { emitted, last, points, seen, order, rows, capacity, min_distance, .. } = reflections;
    let sources = config.sources(k, vpls, reflections.vpl_share.unwrap_or(1));
    g.group("whitted", |g| {
        let parts = g.buffer("parts", u64::from(room(capacity)) * 12);
        let out = g.image("specular", g.desc(emitted));
        let mut args = reflections.args;
        for first_row in (0..g.desc(emitted).extent[1]).step_by(rows as usize) {
            if first_row > 0 {
                args = point_args(g);
                follow(g, k, reflections, vpls, args, first_row);
                arrange(g, k, reflections, vpls, args);
            }
            let (vpls, count) = (vpls.list, vpls.count);
            for first in (0..sources).step_by(RANGE as usize) {
                let range = first + RANGE;
                let bind = light::Bind { vpls, count, args, points, parts, seen, order };
                let params = light::Params { capacity, first, last: range, min_distance };
                let grid = Grid::Indirect { buffer: args, offset: offset_of!(PointArgs, light) as u64 };
                g.pass("light", &light::kernel(&k.scene), bind, params, grid);
                let bind = collect::Bind { count, args, parts, points, order };
                let params = collect::Params { capacity, first, last: range };
                let grid = Grid::Indirect { buffer: args, offset: offset_of!(PointArgs, collect) as u64 };
                g.pass("collect", &collect::kernel(&k.scene), bind, params, grid);
            }
            if let Some(cache) = cache {
                cache.gather_points(g, k, &Points { list: points, seen, order, args, capacity });
            }
            let bind = sum::Bind { emitted, last, points, out_radiance: out };
            let params = sum::Params { first_row, end_row: end_row(g, reflections, first_row) };
            let grid = strip(g, reflections);
            g.pass("sum", &sum::kernel(&k.scene), bind, params, grid);
        }
        out
    })
}
