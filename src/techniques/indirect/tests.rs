//! The filters by themselves, on synthetic surfaces and samples.

use super::*;
use crate::accel::{Arrangement, Geometry as World, Structure};
use crate::common;
use crate::config::RenderConfig;
use crate::gpu_scene::GpuScene;
use crate::graph::{Executor, Graph, ImageDesc, RunOptions};
use crate::methods::{self, Aov, FrameInfo};
use crate::renderer::{BackendChoice, Renderer, RendererOptions};
use crate::scene::{Camera, Instance, Material, Mesh, Scene, SceneProfile, View, builtin};
use crate::shaders::{self, SceneData, Vpl};
use crate::techniques::gbuffer::{self, Geometry};
use crate::vk::{Backend, Device, Format};
use glam::{Affine3A, DVec3, Vec3, Vec4, dvec3, vec3};
use std::f64::consts::TAU;

const FILTERS: [Filter; 2] = [Filter::Paper, Filter::Combined];
const UPSAMPLES: [Upsample; 2] = [Upsample::Paper, Upsample::Plane];
const PATTERNS: [Pattern; 2] = [Pattern::Regular, Pattern::Irregular];

fn config(size: [u32; 2], downsample: u32, interleave: u32) -> RenderConfig {
    let indirect = IndirectConfig { downsample, interleave, ..common::plain().indirect };
    RenderConfig { size, indirect, ..common::plain() }
}

/// All filters at this picture size.
fn all_filters(size: [u32; 2], downsample: &[u32], interleave: &[u32]) -> Vec<RenderConfig> {
    let mut all = Vec::new();
    for &n in downsample {
        for &m in interleave.iter().filter(|&&m| n * m > 1) {
            for (filter, upsample) in FILTERS.into_iter().flat_map(|f| UPSAMPLES.map(|u| (f, u))) {
                if (filter, upsample) == (Filter::Paper, Upsample::Plane) && n == 1 {
                    continue; // nothing to upsample
                }
                for &pattern in &PATTERNS[..if m > 1 { 2 } else { 1 }] {
                    let mut config = config(size, n, m);
                    config.indirect = IndirectConfig { filter, upsample, pattern, ..config.indirect };
                    all.push(config);
                }
            }
        }
    }
    all
}

fn describe(c: &IndirectConfig) -> String {
    format!("{}x, {}x, {:?}, {:?}, {:?}", c.downsample, c.interleave, c.filter, c.upsample, c.pattern)
}

// ---- synthetic surfaces ----

/// Part of a plane.
struct Wall {
    point: DVec3,
    normal: DVec3,
    holds: fn(DVec3) -> bool,
}

fn wall(point: DVec3, normal: DVec3, holds: fn(DVec3) -> bool) -> Wall {
    Wall { point, normal: normal.normalize(), holds }
}

/// At the origin, looking along −Z.
fn camera() -> Camera {
    Camera::look_at("camera", Vec3::ZERO, Vec3::NEG_Z, 0.9)
}

/// Edge of a pixel (m) at this depth.
fn footprint(size: [u32; 2], depth: f64) -> f64 {
    2.0 * (0.45f64).tan() * depth / f64::from(size[1])
}

/// What pixels of the camera's picture see.
struct Seen {
    size: [u32; 2],
    normal_depth: Vec<Vec4>,
    position: Vec<Vec4>,
    /// Which wall.
    wall: Vec<Option<usize>>,
}

fn see(size: [u32; 2], walls: &[Wall]) -> Seen {
    let mut seen = Seen { size, normal_depth: vec![], position: vec![], wall: vec![] };
    let half = (0.45f64).tan();
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    for (y, x) in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (y, x))) {
        let at = |i: u32, n: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
        let ray = dvec3(at(x, size[0]) * half * aspect, -at(y, size[1]) * half, -1.0);
        let hits = walls.iter().enumerate().filter_map(|(i, wall)| {
            let t = wall.point.dot(wall.normal) / ray.dot(wall.normal);
            (t > 0.0 && (wall.holds)(t * ray)).then_some((t, i))
        });
        let hit = hits.min_by(|a, b| a.0.total_cmp(&b.0));
        let (normal_depth, position) = hit.map_or((Vec4::ZERO, Vec4::ZERO), |(t, i)| {
            let normal = walls[i].normal * -walls[i].normal.dot(ray).signum();
            (normal.as_vec3().extend(t as f32), (t * ray).as_vec3().extend(1.0))
        });
        seen.normal_depth.push(normal_depth);
        seen.position.push(position);
        seen.wall.push(hit.map(|(_, i)| i));
    }
    seen
}

impl Seen {
    fn index(&self, [x, y]: [u32; 2]) -> usize {
        (y * self.size[0] + x) as usize
    }
}

fn renderer(device: &Device, scene: Scene) -> Renderer {
    let options =
        RendererOptions { backend: BackendChoice::Force(Backend::Software), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

/// The pixel whose light a cell's sample has.
fn sample_pixel(size: [u32; 2], n: u32, cell: [u32; 2]) -> [u32; 2] {
    [0, 1].map(|axis| (cell[axis] * n + n / 2).min(size[axis] - 1))
}

/// Samples whose light is `field` (of cell and pixel) brought to the pixels, where no VPL is left to regather; and how
/// many pixels were to be regathered.
fn filtered(
    renderer: &mut Renderer,
    config: &RenderConfig,
    seen: &Seen,
    field: impl Fn([u32; 2], [u32; 2]) -> Vec3,
) -> (Vec<Vec3>, u32) {
    let n = config.indirect.downsample;
    let extent = seen.size.map(|side| side.div_ceil(n));
    let cells = (0..extent[1]).flat_map(|y| (0..extent[0]).map(move |x| [x, y]));
    let samples: Vec<Vec4> =
        cells.map(|cell| field(cell, sample_pixel(seen.size, n, cell)).extend(1.0)).collect();
    let kernels = renderer.kernels(config.whitted.mirror_roughness);
    let mut g = Graph::new();
    let float = ImageDesc::new(seen.size, Format::Rgba32Float);
    let mut image = |name: &'static str, desc: ImageDesc, bytes: &[u8]| {
        let image = g.image(name, desc);
        g.upload_image(name, image, bytes.to_vec());
        image
    };
    let gathered = image("samples", ImageDesc { extent, ..float }, bytemuck::cast_slice(&samples));
    let normal_depth = image("normal_depth", float, bytemuck::cast_slice(&seen.normal_depth));
    let position = image("position", float, bytemuck::cast_slice(&seen.position));
    let hits = vec![[0, 0, 0.3f32.to_bits(), 0.3f32.to_bits()]; seen.wall.len()];
    let hits = image("hits", float.with_format(Format::Rgba32Uint), bytemuck::cast_slice(&hits));
    let gb = GBuffer { hits, albedo: normal_depth, origin: [0, 0] };
    let vpls = upload_vpls(&mut g, &[], config.indirect.subsets());
    let geometry = Geometry { normal_depth, position };
    let samples = Samples { gathered, min_distance: 0.0 };
    let out = reconstruct(&mut g, &kernels, &config.indirect, &gb, Some(&geometry), &vpls, &samples);
    let irradiance = g.read_image::<[f32; 4]>(out.irradiance);
    let count = out.regathered.map(|args| g.read_buffer::<u32>(args));
    let mut run = renderer.run(g, config, &camera()).unwrap();
    let irradiance = run.take(irradiance).into_iter().map(|v| Vec4::from(v).truncate()).collect();
    (irradiance, count.map_or(0, |count| run.take(count)[3]))
}

/// VPLs, in any order, as the list that shooting makes of them.
fn upload_vpls(g: &mut Graph, vpls: &[Vpl], subsets: u32) -> Vpls {
    let mut list = vpls.to_vec();
    list.sort_by_key(|vpl| (vpl.path % subsets, vpl.path));
    let mut count = vec![list.len() as u32];
    count.extend((0..=subsets).map(|s| list.partition_point(|vpl| vpl.path % subsets < s) as u32));
    let subset_slots = count[1..].windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0).max(1);
    list.resize(list.len().max(1), Vpl::default());
    let slots = list.len() as u32;
    let buffer = g.buffer("vpls", size_of_val(&list[..]) as u64);
    g.upload("vpls", buffer, bytemuck::cast_slice(&list).to_vec());
    let counts = g.buffer("count", 4 * count.len() as u64);
    g.upload("count", counts, bytemuck::cast_slice(&count).to_vec());
    Vpls { list: buffer, count: counts, slots, subset_slots, bounces: 1 }
}

// ---- filters ----

/// A thin shadow on an even wall stays as dark as it is, whatever each subset brings; beyond reach nothing changes.
#[test]
fn thin_shadows_stay_dark() {
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = renderer(&device, builtin::triangle());
    let size = [40, 30];
    let seen = see(size, &[wall(dvec3(0.0, 0.0, -3.0), dvec3(0.0, 0.0, 1.0), |_| true)]);
    for interleave in [2, 3] {
        for pattern in PATTERNS {
            let mut config = config(size, 1, interleave);
            (config.indirect.filter, config.indirect.pattern) = (Filter::Combined, pattern);
            // Where the subsets' places are known each brings another share.
            let share = |[x, y]: [u32; 2]| match pattern {
                Pattern::Regular => 0.5 + (x % interleave + y % interleave) as f32,
                Pattern::Irregular => 1.0,
            };
            let cells = (0..interleave).flat_map(|y| (0..interleave).map(move |x| [x, y]));
            let lit = cells.map(share).sum::<f32>() / (interleave * interleave) as f32;
            let field = |cell: [u32; 2], [x, _]: [u32; 2]| {
                Vec3::splat(share(cell) * if x == 17 { 0.02 } else { 1.0 })
            };
            let (out, _) = filtered(&mut renderer, &config, &seen, field);
            for y in 8..22 {
                let at = |x: u32| out[seen.index([x, y])].x / lit;
                let what = format!("{interleave}x, {pattern:?}, row {y}");
                assert!((0.01..0.04).contains(&at(17)), "{what}: {}", at(17));
                assert!((at(8) - 1.0).abs() < 1e-5 && (at(28) - 1.0).abs() < 1e-5, "{what}");
            }
        }
    }
}

/// Steps, creases, slants and sky: whatever lends light lends the same, and what is not there lends nothing. The
/// pixels that are to be regathered keep the share of the subsets that were found.
#[test]
fn constants_are_preserved() {
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = renderer(&device, builtin::triangle());
    let size = [37, 27];
    let seen = see(
        size,
        &[
            wall(dvec3(0.0, 0.0, -3.0), dvec3(0.0, 0.0, 1.0), |p| p.x < -0.3),
            wall(dvec3(0.0, 0.0, -4.0), dvec3(0.6, 0.1, 1.0), |p| p.x > 0.2 && p.y < 1.0),
            wall(dvec3(0.0, -0.8, 0.0), dvec3(0.0, 1.0, 0.0), |p| p.z > -6.0),
            wall(dvec3(0.0, 0.0, -2.0), dvec3(0.0, 0.0, 1.0), |p| (0.5 - p.x).abs() < 0.02),
        ],
    );
    assert!(seen.wall.iter().any(Option::is_none) && (0..4).all(|i| seen.wall.contains(&Some(i))));
    let light = vec3(0.7, 1.0, 30.0);
    for config in all_filters(size, &[1, 2, 3, 4, 16], &[1, 2, 3]) {
        // What a miss holds must reach nobody.
        let field = |_, pixel| if seen.wall[seen.index(pixel)].is_some() { light } else { Vec3::splat(1e6) };
        let (out, regathered) = filtered(&mut renderer, &config, &seen, field);
        let (indirect, mut partial) = (&config.indirect, 0);
        let what = describe(indirect);
        // Without a fitting sample `paper` takes the nearest, whatever it is.
        let fallback = indirect.upsample == Upsample::Paper;
        for (i, &value) in out.iter().enumerate() {
            let Some(wall) = seen.wall[i] else {
                assert_eq!(value, Vec3::ZERO, "{what}: light in the sky");
                continue;
            };
            let share = value / light;
            if (share - 1.0).abs().max_element() < 1e-6 {
                continue;
            }
            let thin = wall == 3 || indirect.downsample == 16;
            assert!(regathered > 0 || fallback && thin, "{what}: {share} at pixel {i} on wall {wall}");
            let found = share.x * indirect.subsets() as f32;
            assert!(fallback || share.x < 1.0 && (found - found.round()).abs() < 1e-4, "{what}: {share}");
            partial += 1;
        }
        assert!(fallback || partial == regathered, "{what}: {partial} of {regathered}");
        assert!(partial < 200 || indirect.downsample == 16, "{what}: {partial}");
    }
}

/// Over one plane, facing and slanted, the mean of what is linear in the picture stays, off the borders. Irregular tiles
/// take each subset at random places.
#[test]
fn the_mean_of_a_linear_irradiance_is_preserved() {
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = renderer(&device, builtin::triangle());
    let size = [72, 72];
    let normals = [dvec3(0.0, 0.0, 1.0), dvec3(0.2, 0.1, 1.0)];
    for seen in normals.map(|normal| see(size, &[wall(dvec3(0.0, 0.0, -3.0), normal, |_| true)])) {
        let field = |[x, y]: [u32; 2]| 0.2 + 0.03 * x as f32 + 0.01 * y as f32;
        for config in all_filters(size, &[1, 2, 3, 4], &[1, 2, 3]) {
            let light = |_, pixel| vec3(field(pixel), 1.0, 0.0);
            let (out, regathered) = filtered(&mut renderer, &config, &seen, light);
            let what = describe(&config.indirect);
            assert_eq!(regathered, 0, "{what}");
            // Whole windows of all sizes.
            let inside = |axis: u32| (18..54).contains(&axis);
            let pixels = (0..72 * 72).map(|i| [i % 72, i / 72]).filter(|p| inside(p[0]) && inside(p[1]));
            let (mut got, mut expected) = (0.0, 0.0);
            for pixel in pixels {
                got += f64::from(out[seen.index(pixel)].x);
                expected += f64::from(field(pixel));
            }
            let error = got / expected - 1.0;
            let bound = if config.indirect.pattern == Pattern::Irregular { 3e-3 } else { 1e-3 };
            assert!(error.abs() < bound, "{what}: {:+.3} %", 100.0 * error);
        }
    }
}

/// The largest and smallest of what reaches pixels of the first wall, which is lit by 1, and the largest of the
/// second, which is dark.
fn bleeding(renderer: &mut Renderer, config: &RenderConfig, seen: &Seen) -> (f32, f32, f32) {
    let lit = |pixel: usize| seen.wall[pixel] == Some(0);
    let field = |_, pixel| Vec3::splat(f32::from(u8::from(lit(seen.index(pixel)))));
    let (out, regathered) = filtered(renderer, config, seen, field);
    assert_eq!(regathered, 0, "{}", describe(&config.indirect));
    let of = |bright: bool| (0..out.len()).filter(move |&i| lit(i) == bright).map(|i| out[i].x);
    (of(true).fold(0.0, f32::max), of(true).fold(9.0, f32::min), of(false).fold(0.0, f32::max))
}

/// `plane` and `combined` keep apart parallel planes as near as they promise to; the paper's upsampling does not.
#[test]
fn a_step_does_not_bleed() {
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = renderer(&device, builtin::triangle());
    let size = [48, 36];
    for config in all_filters(size, &[1, 2, 3, 4], &[1, 2, 3]) {
        let indirect = &config.indirect;
        let depth = 3.0;
        let cells =
            indirect.downsample * if indirect.filter == Filter::Combined { indirect.interleave } else { 1 };
        let reach = f64::from(indirect.plane_threshold) * footprint(size, depth + 1.0) * f64::from(cells);
        // The paper's discontinuity buffer tells planes apart by their depth alone.
        let tiled = indirect.filter == Filter::Paper && indirect.interleave > 1;
        let step = reach.max(if tiled { f64::from(indirect.depth_threshold) * (depth + 1.0) } else { 0.0 });
        let seen = see(
            size,
            &[
                wall(dvec3(0.0, 0.0, -depth), DVec3::Z, |p| p.x < 0.05),
                wall(dvec3(0.0, 0.0, -depth - step), DVec3::Z, |p| p.x >= 0.05),
            ],
        );
        let (most, least, dark) = bleeding(&mut renderer, &config, &seen);
        let what = describe(indirect);
        let upsampled_by_cosine = indirect.filter == Filter::Paper
            && indirect.upsample == Upsample::Paper
            && indirect.downsample > 1;
        if upsampled_by_cosine {
            assert!(least < 0.9 && dark > 0.1, "{what}: {least}, {dark}");
        } else {
            assert!(
                dark == 0.0 && (most - 1.0).abs() < 1e-6 && (least - 1.0).abs() < 1e-6,
                "{what}: {dark}, {least}"
            );
        }
    }
}

/// Two planes that meet: at 90° the cosine keeps them apart, at 45° only `plane` and `combined` do.
#[test]
fn a_crease_does_not_bleed() {
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = renderer(&device, builtin::triangle());
    let size = [48, 36];
    let creases = [
        (90, dvec3(1.0, 0.0, 1.0), dvec3(-1.0, 0.0, 1.0)),
        (45, dvec3(0.0, 0.0, 1.0), dvec3(-1.0, 0.0, 1.0)),
    ];
    for (angle, left, right) in creases {
        let edge = dvec3(0.1, 0.0, -3.0);
        let seen = see(size, &[wall(edge, left, |p| p.x < 0.1), wall(edge, right, |p| p.x >= 0.1)]);
        for config in all_filters(size, &[1, 2, 3, 4], &[1, 2, 3]) {
            let indirect = &config.indirect;
            let (_, least, dark) = bleeding(&mut renderer, &config, &seen);
            let what = format!("{angle}°, {}", describe(indirect));
            let by_cosine = indirect.filter == Filter::Paper && indirect.upsample == Upsample::Paper;
            if angle == 45 && by_cosine && indirect.downsample > 1 {
                assert!(least < 0.9 && dark > 0.03, "{what}: {least}, {dark}");
            } else {
                assert!(dark < 1e-6 && least > 1.0 - 1e-6, "{what}: {dark}, {least}");
            }
        }
    }
}

// ---- interleaving ----

/// A wall on z = 0 before a camera at z = 1 that sees a small part of it, nearly from the front.
fn small_wall() -> (Scene, Camera) {
    let mesh = Mesh {
        positions: [(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)]
            .map(|(x, y)| vec3(x, y, 0.0))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![0; 2],
        ..Mesh::default()
    };
    let scene = Scene {
        instances: vec![Instance {
            name: String::new(),
            mesh: 0,
            transform: Affine3A::IDENTITY,
            moves: false,
        }],
        meshes: vec![mesh.into()],
        materials: vec![Material::diffuse("wall", Vec3::splat(0.5))],
        ..Scene::default()
    };
    (scene, Camera::look_at("camera", vec3(0.0, 0.0, 1.0), Vec3::ZERO, 0.02))
}

/// Irradiance at the samples, and at the pixels, of the picture that `camera` sees, from these VPLs.
fn gathered_from(
    renderer: &mut Renderer,
    config: &RenderConfig,
    camera: &Camera,
    vpls: &[Vpl],
) -> (Vec<Vec3>, Vec<Vec3>) {
    let k = renderer.kernels(config.whitted.mirror_roughness);
    let mut g = Graph::new();
    let vpls = upload_vpls(&mut g, vpls, config.indirect.subsets());
    let gb = gbuffer::gbuffer(&mut g, &k, [0, 0], config.size);
    let geometry = config.indirect.filtered().then(|| gbuffer::unpack(&mut g, &k, &gb));
    let samples = gather(&mut g, &k, &config.indirect, &gb, &vpls, 0.0);
    let out = reconstruct(&mut g, &k, &config.indirect, &gb, geometry.as_ref(), &vpls, &samples);
    let tickets = [samples.gathered, out.irradiance].map(|image| g.read_image::<[f32; 4]>(image));
    let mut run = renderer.run(g, config, camera).unwrap();
    let [samples, pixels] =
        tickets.map(|t| run.take(t).into_iter().map(|v| Vec4::from(v).truncate()).collect::<Vec<_>>());
    (samples, pixels)
}

/// The subset that each sample uses.
fn subsets(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera) -> Vec<u32> {
    let one = |path: u32| Vpl {
        position: [0.0, 0.0, 3.0],
        normal: [0.0, 0.0, -1.0],
        path,
        bounce: 0,
        flux: [(path + 1) as f32, 1.0, 0.0],
        spread: 0.0,
    };
    let vpls: Vec<Vpl> = (0..config.indirect.subsets()).map(one).collect();
    let (samples, _) = gathered_from(renderer, config, camera, &vpls);
    samples.iter().map(|v| (v.x / v.y).round() as u32 - 1).collect()
}

#[test]
fn every_tile_holds_each_subset_once() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = small_wall();
    let mut renderer = renderer(&device, scene);
    for (n, m) in [(1, 2), (1, 3), (4, 3), (3, 2)] {
        let mut orders = std::collections::BTreeSet::new();
        for pattern in PATTERNS {
            let mut config = config([36 * n, 24 * n], n, m);
            config.indirect.pattern = pattern;
            let map = subsets(&mut renderer, &config, &camera);
            for (x, y) in (0..24 / m).flat_map(|y| (0..36 / m).map(move |x| (x, y))) {
                let cells = (0..m * m).map(|i| ((y * m + i / m) * 36 + x * m + i % m) as usize);
                let tile: Vec<u32> = cells.map(|cell| map[cell]).collect();
                let mut sorted = tile.clone();
                sorted.sort_unstable();
                assert!(sorted.iter().copied().eq(0..m * m), "{n}, {m}, {pattern:?}: {tile:?} at {x}, {y}");
                orders.insert((pattern == Pattern::Irregular, tile));
            }
        }
        let of = |irregular| orders.iter().filter(|(i, _)| *i == irregular).count();
        assert_eq!(of(false), 1, "a regular pattern has one tile");
        assert!(of(true) > 12, "{n}, {m}: {} orders", of(true));
    }
}

/// Power at frequency (`u`, `v`) cycles a block of side `n` that begins at (`x0`, `y0`).
fn power(values: &[f64], width: usize, [x0, y0]: [usize; 2], n: usize, u: i32, v: i32) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for y in 0..n {
        for x in 0..n {
            let angle = TAU * (f64::from(u) * x as f64 + f64::from(v) * y as f64) / n as f64;
            let value = values[(y0 + y) * width + x0 + x];
            re += value * angle.cos();
            im += value * angle.sin();
        }
    }
    re * re + im * im
}

/// Power at the frequencies of the tile and around them, summed over blocks.
fn tile_spectrum(values: &[f64], size: [u32; 2], m: u32) -> (f64, f64) {
    const BLOCK: usize = 24;
    let tile = (BLOCK as u32 / m) as i32;
    let (mut at, mut around) = (0.0, 0.0);
    for (x0, y0) in (8..size[1] as usize - BLOCK)
        .step_by(BLOCK)
        .flat_map(|y| (8..size[0] as usize - BLOCK).step_by(BLOCK).map(move |x| (x, y)))
    {
        for (u, v) in [(tile, 0), (0, tile), (tile, tile), (tile, -tile)] {
            at += power(values, size[0] as usize, [x0, y0], BLOCK, u, v);
            for (du, dv) in [(2, 0), (-2, 0), (0, 2), (0, -2)] {
                around += power(values, size[0] as usize, [x0, y0], BLOCK, u + du, v + dv) / 4.0;
            }
        }
    }
    (at, around)
}

/// Over a flat wall each window of a tile's size holds each regular subset once: nothing is left of the pattern. An
/// irregular one leaves noise without a peak at the tiles' frequency, before and after the paper's filter; and nothing
/// at all after the combined one, which averages subset by subset.
#[test]
fn interleaving_leaves_no_peak_at_the_frequency_of_the_tiles() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = small_wall();
    let mut renderer = renderer(&device, scene);
    let size = [136, 112];
    let seen = see(size, &[wall(dvec3(0.0, 0.0, -3.0), DVec3::Z, |_| true)]);
    for m in [2, 3] {
        for pattern in PATTERNS {
            let mut config = config(size, 1, m);
            config.indirect.pattern = pattern;
            let map = subsets(&mut renderer, &config, &camera);
            let (mut raw, mut paper) = ((0.0, 0.0), (0.0, 0.0));
            // The spectrum of each subset by itself, three at a time.
            for first in (0..m * m).step_by(3) {
                let light = |[x, y]: [u32; 2], _| {
                    let s = map[(y * size[0] + x) as usize];
                    Vec3::from([0, 1, 2].map(|c| f32::from(u8::from(s == first + c)) * (m * m) as f32))
                };
                for filter in FILTERS {
                    config.indirect.filter = filter;
                    let (out, _) = filtered(&mut renderer, &config, &seen, light);
                    let what = describe(&config.indirect);
                    for c in 0..3.min(m * m - first) as usize {
                        let inner = |i: &usize| {
                            let [x, y] = [i % size[0] as usize, i / size[0] as usize];
                            (8..128).contains(&x) && (8..104).contains(&y)
                        };
                        let values: Vec<f64> = out.iter().map(|v| f64::from(v[c])).collect();
                        if filter == Filter::Combined || pattern == Pattern::Regular {
                            let worst = (0..values.len())
                                .filter(inner)
                                .map(|i| (values[i] - 1.0).abs())
                                .fold(0.0, f64::max);
                            assert!(worst < 1e-6, "{what}: subset {} is off by {worst}", first + c as u32);
                        } else {
                            let (at, around) = tile_spectrum(&values, size, m);
                            paper = (paper.0 + at, paper.1 + around);
                            let samples: Vec<f64> =
                                map.iter().map(|&s| f64::from(u8::from(s == first + c as u32))).collect();
                            let (at, around) = tile_spectrum(&samples, size, m);
                            raw = (raw.0 + at, raw.1 + around);
                        }
                    }
                }
            }
            if pattern == Pattern::Irregular {
                println!("tiles of {m}: {:.3} before, {:.3} after", raw.0 / raw.1, paper.0 / paper.1);
                assert!(raw.0 < 1.5 * raw.1 && raw.0 > 0.5 * raw.1, "{m}: {raw:?}");
                assert!(paper.0 < 1.5 * paper.1 && paper.1 > 1.0, "{m}: {paper:?}");
            }
        }
    }
}

/// Paths that no number of subsets divides: the subsets differ in size, the mean does not. Also where VPLs take
/// several passes.
#[test]
fn uneven_subsets_keep_the_mean() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = small_wall();
    let mut renderer = renderer(&device, scene);
    let size = [36, 36];
    for (paths, filters) in [(30, true), (5, true), (1300, false)] {
        let vpl = |path: u32| {
            let place = [0, 1, 2].map(|d| crate::sampling::halton(d, path + 1, 0));
            let flux = [1.0 + place[0], 0.5 + 3.0 * place[1], place[2]];
            let position = [3.0 * place[0] - 1.5, 3.0 * place[1] - 1.5, 1.5 + place[2]];
            Vpl { position, normal: [0.0, 0.0, -1.0], path, bounce: 0, flux, spread: 0.0 }
        };
        let vpls: Vec<Vpl> = (0..paths).map(vpl).collect();
        let mean = |values: &[Vec3]| values.iter().map(|v| v.as_dvec3()).sum::<DVec3>() / values.len() as f64;
        let (_, canonical) = gathered_from(&mut renderer, &config(size, 1, 1), &camera, &vpls);
        let canonical = mean(&canonical);
        for mut config in all_filters(size, &[1, 4], &[2, 3]) {
            config.indirect.upsample = Upsample::Plane;
            if !filters && config.indirect.filter == Filter::Combined {
                continue;
            }
            let (samples, pixels) = gathered_from(&mut renderer, &config, &camera, &vpls);
            let what = format!("{paths} paths, {}", describe(&config.indirect));
            if config.indirect.downsample == 1 {
                let error = (mean(&samples) / canonical - 1.0).abs().max_element();
                assert!(error < 1e-3, "samples of {what}: {error}");
            }
            let inner = |i: &usize| (12..24).contains(&(i % 36)) && (12..24).contains(&(i / 36));
            let inner: Vec<Vec3> = (0..pixels.len()).filter(inner).map(|i| pixels[i]).collect();
            let error = (mean(&inner) / canonical - 1.0).abs().max_element();
            // Irregular tiles leave the paper's filter noise.
            let noisy =
                config.indirect.pattern == Pattern::Irregular && config.indirect.filter == Filter::Paper;
            assert!(noisy || error < 4e-3, "{what}: {error}");
        }
    }
}

// ---- the whole frame ----

/// Bands of workgroups, each its own submit, change no bit of a frame with all filters.
#[test]
fn many_submits_are_one_frame() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = builtin::by_name("cornell").unwrap();
    let world = World::of(&scene).unwrap();
    let gpu = GpuScene::upload(&device, &scene, &world).unwrap();
    let structure = Structure::build(&device, Backend::Software, &world, Arrangement::default()).unwrap();
    let camera = &scene.cameras[0];
    let View::Perspective { yfov } = camera.view else { panic!("cornell has a perspective camera") };
    let (half, axes) = ((0.5 * yfov).tan(), camera.transform.matrix3);
    let size = [40, 30];
    let mut data = SceneData {
        camera: shaders::Camera {
            eye: camera.transform.translation.to_array(),
            orthographic: 0,
            right: (axes.x_axis * half * 4.0 / 3.0).to_array(),
            up: (axes.y_axis * half).to_array(),
            forward: (-axes.z_axis).to_array(),
        },
        full_size: size,
        window_origin: [0, 0],
        pixel_offset: [0.5; 2],
        specular_depth: 5,
        mirror_roughness: 0.1,
        ..gpu.data
    };
    structure.describe(&mut data);
    let uniform = device.upload("scene", bytemuck::bytes_of(&data)).unwrap();
    let set =
        std::sync::Arc::new(device.scene_set(Backend::Software, uniform, structure.top_level()).unwrap());
    let kernels = Kernels::new(&SceneProfile::of(&scene, 0.1), structure.traversal());
    let frame = FrameInfo {
        origin: [0, 0],
        extent: size,
        area: scene.area() as f32,
        free_path: None,
        means: None,
        taken: 0,
        samples: 0,
    };
    for filter in FILTERS {
        let mut config = config(size, 3, 2);
        config.vpl_shoot.vpls = 60;
        config.indirect = IndirectConfig {
            filter,
            upsample: Upsample::Plane,
            pattern: Pattern::Irregular,
            ..config.indirect
        };
        let run = |submit_ms: f64| {
            let mut g = Graph::new();
            let mut layers = (methods::igi::METHOD.record)(&mut g, &kernels, &config, &frame);
            let irradiance = layers.image(&mut g, &kernels, Aov::Irradiance);
            let tickets = [layers.beauty, irradiance].map(|image| g.read_image::<[u32; 4]>(image));
            let count = g.read_buffer::<u32>(layers.regathered.unwrap());
            let mut executor = Executor::new(&device, Backend::Software).unwrap();
            let options = RunOptions { scene: Some(&set), submit_ms, ..RunOptions::default() };
            let mut run = executor.run(g, &options).unwrap();
            let images = tickets.map(|ticket| run.take(ticket));
            (images, run.take(count)[3], run.submits)
        };
        let (many, few) = (run(0.0), run(f64::INFINITY));
        assert!(many.1 > 0, "{filter:?}: no pixel is gathered anew");
        assert!(many.2 > 3 * few.2, "{} and {} submits", many.2, few.2);
        assert_eq!(many.1, few.1);
        assert!(many.0 == few.0, "{filter:?}");
    }
}
