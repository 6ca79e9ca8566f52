//! What rays bring that ask the radiance cache: bits whatever part of the picture is drawn, and light against path tracing.

mod common;

use common::{assert_close, gray, mean, quad, scene};
use glam::Vec3;
use parhelion::config::RenderConfig;
use parhelion::renderer::{BackendChoice, Frame, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{Camera, Environment, Material, Scene, builtin};
use parhelion::vk::Backend;

fn configuration(assignments: &[&str]) -> RenderConfig {
    let mut config = common::plain();
    assignments.iter().for_each(|assignment| config.apply_override(assignment).unwrap());
    config
}

fn renderer_of(device: &parhelion::vk::Device, scene: Scene) -> Renderer {
    let options =
        RendererOptions { backend: BackendChoice::Force(Backend::Software), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

fn renderer(device: &parhelion::vk::Device, scene: &str) -> Renderer {
    renderer_of(device, builtin::by_name(scene).unwrap())
}

fn draw(renderer: &mut Renderer, config: &RenderConfig) -> Frame {
    let camera = renderer.scene().cameras[0].clone();
    renderer.render(config, &camera, &FrameRequest::default()).unwrap()
}

const ALL: [&str; 5] = [
    "indirect.compensation=4",
    "vpl_shoot.vpls=180",
    "vpl_shoot.candidates=8",
    "indirect.interleave=3",
    "indirect.filter=combined",
];

/// The Office has mirrors, glass and glossy lobes.
#[test]
fn a_part_has_the_bits_of_the_whole() {
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = renderer(&device, "office");
    let mut config = configuration(&ALL);
    config.size = [32, 24];
    let whole = draw(&mut renderer, &config);
    assert!(whole.beauty.data == draw(&mut renderer, &config).beauty.data, "two frames differ");
    for [x0, y0, x1, y1] in [[0, 0, 32, 9], [5, 7, 18, 20], [31, 23, 32, 24]] {
        config.crop = Some([x0, y0, x1, y1]);
        let part = draw(&mut renderer, &config);
        for y in y0..y1 {
            let row = |width: u32, x: u32, y: u32| 3 * (y * width + x) as usize;
            let (of_whole, of_part) = (row(32, x0, y), row(x1 - x0, 0, y - y0));
            let length = 3 * (x1 - x0) as usize;
            let [whole, part] = [&whole.beauty.data[of_whole..], &part.beauty.data[of_part..]];
            assert!(whole[..length] == part[..length], "row {y} of {:?}", config.crop);
        }
    }
}

/// Mean light of a room over seeds, beside path tracing's: with rays it is all there whatever bounds VPLs, without them it
/// is not.
#[test]
fn rays_bring_what_bounding_takes() {
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = renderer(&device, "two-albedo");
    let mut over_seeds = |assignments: &[&str], seeds: u32| {
        let mut sum = 0.0;
        for seed in 1..=seeds {
            let mut config = configuration(assignments);
            (config.size, config.seed) = ([24, 18], seed);
            sum += mean(&draw(&mut renderer, &config).beauty.data);
        }
        sum / f64::from(seeds)
    };
    let truth = over_seeds(&["method=path", "path_trace.spp=512", "path_trace.pixel_filter=center"], 1);
    let vpls = "vpl_shoot.vpls=900";
    for (distance, candidates) in [("1", "1"), ("100", "1"), ("1", "8")] {
        let distance = &format!("indirect.min_distance={distance}");
        let candidates = &format!("vpl_shoot.candidates={candidates}");
        let with = over_seeds(&[vpls, distance, candidates, "indirect.compensation=8"], 6) / truth;
        assert!((with - 1.0).abs() < 0.03, "{distance}: {with}");
        let without = over_seeds(&[vpls, distance], 2) / truth;
        assert!(without < 0.95, "{distance}: {without} without rays");
    }
}

/// A floor that is a mirror: records know the light that it brings, of a lamp that rays find in it, too.
#[test]
fn records_know_what_mirrors_bring() {
    let Some((_guard, device)) = common::device() else { return };
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| 2.0 * axis);
    let sides = [(y, x, z, 0), (Vec3::ZERO, y, z, 0), (x, z, y, 0), (Vec3::ZERO, x, y, 0), (z, y, x, 0)];
    let floor = (Vec3::ZERO, z, x, 1);
    let lamp = (Vec3::new(0.7, 1.9, 0.7), 0.6 * Vec3::X, 0.6 * Vec3::Z, 2);
    let squares = sides.into_iter().chain([floor, lamp]);
    let squares = squares.map(|(corner, u, v, material)| quad(corner, u, v, material)).collect();
    let base_color = Vec3::splat(0.9).extend(1.0);
    let mirror = Material { metallic: 1.0, roughness: 0.0, base_color, ..Material::default() };
    let mut scene =
        scene(squares, vec![gray(0.6), mirror, Material { emission: Vec3::splat(5.0), ..gray(0.0) }]);
    scene.cameras = vec![Camera::look_at("camera", Vec3::new(0.3, 1.2, 1.8), Vec3::new(1.4, 0.9, 0.0), 1.2)];
    let mut renderer = renderer_of(&device, scene);
    let mut brought = |assignments: &[&str], seed: u32| {
        let mut config = configuration(assignments);
        (config.size, config.seed) = ([24, 18], seed);
        mean(&draw(&mut renderer, &config).beauty.data)
    };
    let truth = brought(&["method=path", "path_trace.spp=1024", "path_trace.pixel_filter=center"], 1);
    let by_rays = ["vpl_shoot.vpls=720", "indirect.min_distance=100", "indirect.compensation=8"];
    let found = (1..=6).map(|seed| brought(&by_rays, seed)).sum::<f64>() / 6.0;
    assert_close("light", found, truth, 0.02);
}

/// A sky that is bright on one side: rays and samples of lights together bring what samples alone do, on open ground and past
/// a wall, and on open ground what the sky sends: ρ/π ∫ L cosθ dω, π/2 of each half of the sky.
#[test]
fn rays_bring_their_share_of_the_sky() {
    let Some((_guard, device)) = common::device() else { return };
    let (rho, bright, dim) = (0.5, 3.0, 1.0);
    let texel = |i: usize| Vec3::splat(if i % 64 < 32 { bright } else { dim });
    let sky = Environment {
        name: "halves".into(),
        width: 64,
        height: 32,
        texels: (0..64 * 32).map(texel).collect(),
    };
    let ground = quad(Vec3::new(-9.0, 0.0, -9.0), 18.0 * Vec3::Z, 18.0 * Vec3::X, 0);
    let wall = quad(Vec3::new(0.5, 0.0, -9.0), 18.0 * Vec3::Z, 4.0 * Vec3::Y, 1);
    for walled in [false, true] {
        let meshes = if walled { vec![ground.clone(), wall.clone()] } else { vec![ground.clone()] };
        let mut scene = scene(meshes, vec![gray(rho), gray(0.0)]);
        scene.environment = Some(sky.clone().into());
        scene.cameras =
            vec![Camera::look_at("down", Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 0.001), 0.6)];
        let mut renderer = renderer_of(&device, scene);
        let mut brought = |assignments: &[&str]| {
            let mut config = configuration(assignments);
            config.size = [32, 32];
            mean(&draw(&mut renderer, &config).beauty.data)
        };
        let alone = brought(&["whitted.light_samples=256"]);
        if !walled {
            let expected = f64::from(rho) * f64::from(bright + dim) / 2.0;
            assert_close("samples", alone, expected, 0.005);
        }
        for filter in ["indirect.filter=paper", "indirect.filter=combined"] {
            let beside = brought(&["whitted.light_samples=8", "indirect.compensation=8", filter]);
            assert_close(&format!("rays and samples, walled: {walled}"), beside, alone, 0.01);
        }
    }
}
