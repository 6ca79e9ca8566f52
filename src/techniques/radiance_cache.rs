//! A radiance cache in the world (instant caching: Debattista, Dubla, Santos & Chalmers 2009), asked by rays from primary
//! hits: what VPLs leave out, without the noise of asking a light or a VPL at each of their ends.
//!
//! Rays go where the surface scatters light to: as many as [`super::indirect::IndirectConfig::compensation`] says, shared
//! out over the diffuse part and the lobes by what they reflect. Mirrors and glass are followed. At a surface that scatters
//! light they count 1 − f(d) for the diffuse part, what bounding took from VPLs (Kollig & Keller 2004), and whole for lobes
//! and behind mirrors and glass, where no VPL is asked.
//!
//! Cells are cubes of a grid, apart for six directions of normals and either side of triangles, their edges about as wide as
//! a ray's footprint. A record is the irradiance of a cell: up to 16 points of its surfaces, found by rays across it, lit by
//! 32 samples of the lights and 64 VPLs, four of five chosen by what they bring if nothing is between (Talbot et al. 2005).
//! Where one of these points does not see all others, a wall divides the cell: the record holds both sides, and a ray's end
//! asks which it is on. It depends on cell and seed alone, so that crops and tiles keep their bits. So many ends ask at a time
//! that all their cells have a place; where those of ends before them leave too little room, the table is emptied first, and
//! what was in it is made anew if it is asked for again, to the same bits.
//!
//! Light of the environment that the diffuse part gets straight is found by these rays, too, weighed against the samples of
//! lights ([`super::whitted`]) by the balance heuristic (Veach 1997, §9.2): through a window few of either arrive, but what
//! rays find neighbours share.
//!
//! Bias: a record is a mean over one side of its cell, so light leaks as far as a cell's edge, and where two walls divide one
//! through the second; surfaces are seen as Lambertians with the albedo of all that they scatter; records take surfaces
//! nearer than the smallest edge to be lit as they are themselves; of lamps that rays find by way of mirrors and glass a
//! record takes no more than of all else, and a point behind mirrors and glass a quarter of what else arrives for each ray.
//! Pixels on one plane lend each other what their rays find, two pixels far, and fourteen what they find by way of mirrors
//! and glass, unless VPLs say that there is a shadow's edge between: that blurs contacts.
//! Noise: grain by the rays' directions. Cost: a ray each, one more where a coat over something else is a mirror or a wall
//! divides the cell, and about 240 for a record.

use super::Kernels;
use super::gbuffer::{GBuffer, Geometry, Planes};
use super::vpl_shoot::Vpls;
use crate::graph::{Buffer, Graph, Grid, Image, Res};
use crate::shaders::radiance_cache::{
    forget, light, make_room, record, request, request_points, resolve, resolve_points, smooth, want,
};
use crate::shaders::{PointArgs, Record, WantedArgs};
use std::mem::offset_of;

/// Most cells there is room for, 36 bytes each: twice as many as ends ask for at a time.
const SLOTS: u32 = 1 << 20;

/// Ends of rays that are kept at a time, 16 bytes each.
const ENDS: u32 = 1 << 21;

/// Ways (pixels) between what is averaged: all that rays find, by the first, and by the others what few of them find, lamps in
/// mirrors and glass.
const STEPS: [i32; 3] = [1, 2, 4];

/// Pixels that an average reaches.
pub const REACH: u32 = 2 * (STEPS[0] + STEPS[1] + STEPS[2]) as u32;

/// Distances that decide what rays bring.
#[derive(Clone, Copy, Debug)]
pub struct Distances {
    /// That bounds VPLs (m).
    pub min_distance: f32,
    /// The smallest cells' edge (m).
    pub edge: f32,
}

/// Edge of the smallest cells, in median ways from what the camera sees to what that sees.
const EDGE: f32 = 0.06;

/// And at most, in ways that bounding lets rays go to diffuse light.
const NEAR: f32 = 0.25;

impl Distances {
    /// For a scene where half of the ways from what the camera sees are shorter than `free_path` (m).
    #[must_use]
    pub fn of(min_distance: f32, free_path: Option<f32>) -> Self {
        // Where nothing sees anything no ray ends in a cell.
        let edge = EDGE * free_path.unwrap_or(1.0);
        Self { min_distance, edge: if min_distance > 0.0 { edge.min(NEAR * min_distance) } else { edge } }
    }
}

/// Records on the device.
#[derive(Clone, Copy, Debug)]
pub struct Cache {
    cells: Res<Buffer>,
    records: Res<Buffer>,
    wanted: Res<Buffer>,
    args: Res<Buffer>,
    slots: u32,
    vpls: Vpls,
    /// A point sends so many.
    rays: u32,
    distances: Distances,
}

/// Points behind mirrors and glass that send rays, as [`super::whitted`] lists them.
pub(super) struct Points {
    pub(super) list: Res<Buffer>,
    pub(super) seen: Res<Buffer>,
    pub(super) order: Res<Buffer>,
    pub(super) args: Res<Buffer>,
    pub(super) capacity: u32,
}

/// Irradiance and radiance with what the rays found.
#[derive(Clone, Copy, Debug)]
pub struct Gathered {
    /// At every pixel (W/m²).
    pub irradiance: Res<Image>,
    /// That lobes reflect (W/(sr·m²)), where there are any.
    pub glossy: Option<Res<Image>>,
    /// Irradiance by the environment (W/m²), where there is one: what samples of lights leave of it.
    pub sky: Option<Res<Image>>,
}

/// An empty cache, for `rays` rays of each of so many pixels.
pub fn cache(g: &mut Graph, rays: u32, extent: [u32; 2], vpls: &Vpls, distances: Distances) -> Cache {
    let ends = rays.saturating_mul(extent[0]).saturating_mul(extent[1]);
    of_slots(g, (2 * ends.min(SLOTS / 2)).next_power_of_two(), rays, vpls, distances)
}

/// With room for so many cells, a power of two.
fn of_slots(g: &mut Graph, slots: u32, rays: u32, vpls: &Vpls, distances: Distances) -> Cache {
    g.group("radiance_cache", |g| {
        let cells = g.buffer("cells", 8 * u64::from(slots));
        let records = g.buffer("records", size_of::<Record>() as u64 * u64::from(slots));
        let wanted = g.buffer("wanted", 4 * u64::from(slots / 2));
        let args = g.buffer("args", size_of::<WantedArgs>() as u64);
        g.fill("clear", cells, 0);
        g.fill("none", args, 0);
        Cache { cells, records, wanted, args, slots, vpls: *vpls, rays, distances }
    })
}

impl Cache {
    /// Puts the light of `count` ends in their place.
    fn light(&self, g: &mut Graph, k: &Kernels, ends: Res<Buffer>, count: u32) {
        let &Self {
            cells, records, wanted, args, slots, distances: Distances { edge: least_edge, .. }, ..
        } = self;
        let asks = slots / 2;
        let dispatch = |offset: usize| Grid::Indirect { buffer: args, offset: offset as u64 };
        for first in (0..count).step_by(asks as usize) {
            let last = count.min(first + asks);
            let range = Grid::Of([last - first, 1, 1]);
            let forget_groups = slots.div_ceil(forget::CODE.workgroup[0]);
            let params = make_room::Params { asks: last - first, slots, forget_groups };
            let one = Grid::Of([1, 1, 1]);
            g.pass("make_room", &make_room::kernel(), make_room::Bind { args }, params, one);
            let bind = forget::Bind { table: cells, args };
            let grid = dispatch(offset_of!(WantedArgs, forget));
            g.pass("forget", &forget::kernel(), bind, forget::Params { slots }, grid);
            let bind = want::Bind { ends, table: cells, wanted, args };
            g.pass("want", &want::kernel(), bind, want::Params { first, last, slots }, range);
            let Vpls { list: vpls, count, bounces, .. } = self.vpls;
            let bind = record::Bind { vpls, count, table: cells, wanted, args, records };
            let grid = dispatch(offset_of!(WantedArgs, record));
            g.pass("record", &record::kernel(&k.scene), bind, record::Params { least_edge, bounces }, grid);
            let bind = light::Bind { table: cells, records, ends };
            let params = light::Params { first, last, slots, least_edge };
            g.pass("light", &light::kernel(&k.scene), bind, params, range);
        }
    }

    /// Adds what rays of primary hits find to `gathered`, averaged over neighbours on the same of these `planes`.
    pub fn gather(
        &self,
        g: &mut Graph,
        k: &Kernels,
        gb: &GBuffer,
        geometry: &Geometry,
        planes: Option<Planes>,
        gathered: Res<Image>,
    ) -> Gathered {
        let &Self { rays, distances: Distances { min_distance, edge: least_edge }, .. } = self;
        g.group("radiance_cache", |g| {
            let desc = g.desc(gb.albedo);
            let [width, height] = desc.extent;
            let rows = (ENDS / (width * rays)).clamp(1, height);
            let others = g.image("found", desc);
            let mut mirrored = if k.specular() { g.image("found_by_mirrors", desc) } else { others };
            let glossy = g.image("found_by_lobes", desc);
            let mut sky = if k.profile.environment { g.image("found_of_sky", desc) } else { others };
            let ends = g.buffer("ends", 16 * u64::from(width * rows * rays));
            for first_row in (0..height).step_by(rows as usize) {
                let end_row = (first_row + rows).min(height);
                let bind = request::Bind {
                    hits: gb.hits,
                    albedo: gb.albedo,
                    ends,
                    out_irradiance: mirrored,
                    out_radiance: glossy,
                    out_sky: sky,
                };
                let params = request::Params { rays, first_row, end_row, min_distance, least_edge };
                let strip = Grid::Of([width, end_row - first_row, 1]);
                g.pass("request", &request::kernel(&k.scene), bind, params, strip);
                self.light(g, k, ends, width * (end_row - first_row) * rays);
                let bind =
                    resolve::Bind { albedo: gb.albedo, ends, out_irradiance: others, radiance: glossy };
                let params = resolve::Params { rays, first_row, end_row };
                g.pass("resolve", &resolve::kernel(), bind, params, strip);
            }
            let mut smooth = |mirrored, step: i32, last: bool| {
                let out = g.image("smooth", desc);
                let bind = smooth::Bind {
                    normal_depth: geometry.normal_depth,
                    position: geometry.position,
                    mirrored,
                    others,
                    gathered,
                    out_irradiance: out,
                };
                let spec = smooth::Spec { step, last, mirrored: !last || k.specular() };
                let Planes { reach, least_cosine } =
                    planes.unwrap_or(Planes { reach: 1.0, least_cosine: 0.0 });
                g.pass(
                    "smooth",
                    &smooth::kernel(spec),
                    bind,
                    smooth::Params { reach, least_cosine },
                    Grid::Over(out),
                );
                out
            };
            if planes.is_some() && k.specular() {
                for &step in &STEPS[1..] {
                    mirrored = smooth(mirrored, step, false);
                }
            }
            if planes.is_some() && k.profile.environment {
                for &step in &STEPS[..2] {
                    sky = smooth(sky, step, false);
                }
            }
            let irradiance = smooth(mirrored, planes.map_or(0, |_| STEPS[0]), true);
            let glossy = k.glossy_lobes().then_some(glossy);
            Gathered { irradiance, glossy, sky: k.profile.environment.then_some(sky) }
        })
    }

    /// Adds what rays of listed points find to their light.
    pub(super) fn gather_points(&self, g: &mut Graph, k: &Kernels, points: &Points) {
        let &Self { rays, distances: Distances { min_distance, edge: least_edge }, .. } = self;
        let &Points { list, seen, order, args, capacity } = points;
        let step = (ENDS / rays).min(capacity);
        let ends = g.buffer("ends", 16 * u64::from(step * rays));
        let grid = Grid::Indirect { buffer: args, offset: offset_of!(PointArgs, collect) as u64 };
        for first in (0..capacity).step_by(step as usize) {
            let last = first + step;
            // Of points that are not there.
            g.fill("none", ends, 0);
            let bind = request_points::Bind { list: args, points: list, seen, order, ends };
            let params = request_points::Params { rays, capacity, first, last, min_distance, least_edge };
            g.pass("request_points", &request_points::kernel(&k.scene), bind, params, grid);
            self.light(g, k, ends, step * rays);
            let bind = resolve_points::Bind { list: args, points: list, order, ends };
            let params = resolve_points::Params { rays, capacity, first, last };
            g.pass("resolve_points", &resolve_points::kernel(&k.scene), bind, params, grid);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;
    use crate::config::RenderConfig;
    use crate::renderer::{BackendChoice, Renderer, RendererOptions};
    use crate::scene::builtin;
    use crate::techniques::{gbuffer, vpl_shoot};
    use crate::vk::Backend;

    /// Irradiance that rays bring in a room with a mirror, as bits.
    fn brought(renderer: &mut Renderer, slots: u32) -> Vec<[u32; 4]> {
        let config = RenderConfig { size: [24, 18], ..common::plain() };
        let camera = renderer.scene().cameras[0].clone();
        let k = renderer.kernels(config.whitted.mirror_roughness).with_indirect(&config.indirect);
        let mut g = Graph::new();
        let gb = gbuffer::gbuffer(&mut g, &k, [0, 0], config.size);
        let paths = vpl_shoot::paths(&mut g, &k, &config.vpl_shoot, 1);
        let vpls = vpl_shoot::compact(&mut g, &k, &config.vpl_shoot, &paths, 1, 0.0);
        let desc = g.desc(gb.albedo);
        let dark = g.image("dark", desc);
        g.clear_image("dark", dark);
        let cache = of_slots(&mut g, slots, 4, &vpls, Distances { min_distance: 4.0, edge: 0.2 });
        let geometry = gbuffer::unpack(&mut g, &k, &gb);
        let found = cache.gather(&mut g, &k, &gb, &geometry, None, dark);
        let ticket = g.read_image(found.irradiance);
        renderer.run(g, &config, &camera).unwrap().take(ticket)
    }

    /// Records that had to make room for others are made anew to the same bits.
    #[test]
    fn an_emptied_table_changes_no_bit() {
        let Some((_guard, device)) = common::device() else { return };
        let scene = builtin::by_name("cornell").unwrap();
        let options = RendererOptions {
            backend: BackendChoice::Force(Backend::Software),
            ..RendererOptions::default()
        };
        let mut renderer = Renderer::new(&device, scene, &options).unwrap();
        let [roomy, narrow] = [1 << 14, 128].map(|slots| brought(&mut renderer, slots));
        let lit = roomy.iter().filter(|texel| f32::from_bits(texel[0]) > 0.0).count();
        assert!(2 * lit > roomy.len(), "{lit} of {} pixels get anything", roomy.len());
        assert!(roomy == narrow);
    }
}
