//! The path tracer against closed forms, against itself by other ways to the same light, against an independent
//! renderer's pictures, and where it is interrupted and goes on.
//!
//! Pictures that are equal but for noise are compared pixel by pixel by Welch's t-test, at a level of α = 1e-5 for the
//! whole picture (Šidák 1967), as Mitsuba 3 does it. Seeds are fixed: a test passes always or never.

mod common;

use common::{assert_close, gray, mean, scene};

use common::quad;

use glam::{Affine3A, Vec3};
use parhelion::ErrorClass;
use parhelion::config::RenderConfig;
use parhelion::methods::path;
use parhelion::metrics;
use parhelion::output::{Attribute, read_exr};
use parhelion::renderer::{
    Aov, BackendChoice, Frame, FrameRequest, Preview, Renderer, RendererOptions, Resume,
};
use parhelion::scene::{
    self, AlphaMode, Camera, Environment, Instance, LoadOptions, Material, Mesh, Scene, View, Volume, builtin,
};
use parhelion::techniques::path_trace::{Estimator, PixelFilter, Transport};
use parhelion::vk::{Backend, Device};
use std::cell::RefCell;
use std::f32::consts::PI;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

// ---- scenes ----

/// A geodesic sphere that faces outwards, its normals smooth.
fn ball(center: Vec3, radius: f32, material: u32) -> Mesh {
    let mut mesh = Mesh::clone(&builtin::sphere(4, Vec3::ONE).meshes[0]);
    mesh.normals = mesh.positions.clone();
    mesh.positions.iter_mut().for_each(|p| *p = center + radius * *p);
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh.materials = vec![material; mesh.triangles.len()];
    mesh
}

fn lamp(radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), ..gray(0.0) }
}

fn glass(roughness: f32) -> Material {
    let clear = Volume { attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE };
    Material { metallic: 0.0, roughness, transmission: 1.0, volume: Some(clear), ..Material::default() }
}

/// A floor under a square lamp, with a rough golden ball, a block of varnish and a pane of partial coverage between.
fn table() -> (Scene, Camera) {
    let gold =
        Material { base_color: Vec3::new(1.0, 0.8, 0.4).extend(1.0), roughness: 0.4, ..Material::default() };
    let varnish =
        Material { base_color: Vec3::new(0.2, 0.3, 0.7).extend(1.0), metallic: 0.0, ..gold.clone() };
    let veil =
        Material { base_color: Vec3::splat(0.6).extend(0.4), alpha_mode: AlphaMode::Blend, ..gray(0.6) };
    let meshes = vec![
        quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0, 0),
        quad(Vec3::new(-0.7, 3.0, -0.7), Vec3::X * 1.4, Vec3::Z * 1.4, 1),
        ball(Vec3::new(-0.9, 0.6, 0.0), 0.6, 2),
        quad(Vec3::new(0.3, 0.0, -1.0), Vec3::X * 1.4, Vec3::Y * 1.2, 3),
        quad(Vec3::new(-0.2, 1.6, -0.5), Vec3::X, Vec3::Z, 4),
    ];
    let scene = scene(meshes, vec![gray(0.6), lamp(4.0), gold, varnish, veil]);
    (scene, Camera::look_at("side", Vec3::new(0.4, 1.8, 4.0), Vec3::new(0.0, 0.7, 0.0), 0.8))
}

// ---- rendering ----

fn renderer(device: &Device, scene: Scene, backend: Backend) -> Renderer {
    let options = RendererOptions { backend: BackendChoice::Force(backend), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

fn software(device: &Device, scene: Scene) -> Renderer {
    renderer(device, scene, Backend::Software)
}

fn config(width: u32, height: u32, spp: u32, max_depth: u32) -> RenderConfig {
    let mut config = RenderConfig { method: &path::METHOD, size: [width, height], ..common::plain() };
    config.path_trace.spp = spp;
    config.path_trace.max_depth = Some(max_depth);
    config
}

fn picture(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera) -> Vec<f32> {
    let data = renderer.render(config, camera, &FrameRequest::default()).unwrap().beauty.data;
    assert!(data.iter().all(|v| v.is_finite() && *v >= 0.0));
    data
}

// ---- statistics ----

/// Means with the variance of each, by `runs` of independent seeds.
struct Estimate {
    mean: Vec<f64>,
    variance: Vec<f64>,
    runs: f64,
}

fn estimate(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera, runs: u32) -> Estimate {
    let pictures: Vec<_> = (1..=runs)
        .map(|seed| picture(renderer, &RenderConfig { seed: config.seed + seed, ..config.clone() }, camera))
        .collect();
    let runs = f64::from(runs);
    let across = |f: &dyn Fn(f32, usize) -> f64| {
        (0..pictures[0].len()).map(|i| pictures.iter().map(|p| f(p[i], i)).sum::<f64>()).collect::<Vec<f64>>()
    };
    let mean: Vec<f64> = across(&|v, _| f64::from(v) / runs);
    let variance = across(&|v, i| (f64::from(v) - mean[i]).powi(2) / (runs * (runs - 1.0)));
    Estimate { mean, variance, runs }
}

/// Probability that a standard normal variable is further from 0 than z (Press et al., Numerical Recipes, §6.2).
fn two_sided(z: f64) -> f64 {
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.5 * x);
    let terms = [
        0.170_872_77,
        -0.822_152_23,
        1.488_515_87,
        -1.135_203_98,
        0.278_868_07,
        -0.186_288_06,
        0.096_784_18,
        0.374_091_96,
        1.000_023_68,
        -1.265_512_23,
    ];
    t * (terms.iter().fold(0.0, |sum, c| sum * t + c) - x * x).exp()
}

/// Asserts that two pictures differ by noise alone. Where both are without noise they must agree to rounding. `skip`
/// leaves out the share of pixels with the largest variance, whose own is badly known.
fn assert_equal_but_for_noise(what: &str, a: &Estimate, b: &Estimate, skip: f64) {
    let mut order: Vec<usize> = (0..a.mean.len()).collect();
    order.sort_by(|&i, &j| (a.variance[i] + b.variance[i]).total_cmp(&(a.variance[j] + b.variance[j])));
    order.truncate((order.len() as f64 * (1.0 - skip)).ceil() as usize);
    let (mut worst, mut at, mut tested) = (1.0f64, (0, 0.0), 0);
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in order {
        let (difference, variance) = (a.mean[i] - b.mean[i], a.variance[i] + b.variance[i]);
        if variance <= (1e-6 * a.mean[i]).powi(2) {
            assert!(
                difference.abs() <= 1e-4 * a.mean[i].abs() + 1e-9,
                "{what}: pixel {i}: {} {}",
                a.mean[i],
                b.mean[i]
            );
            continue;
        }
        let t = difference / variance.sqrt();
        let freedom = variance.powi(2)
            / (a.variance[i].powi(2) / (a.runs - 1.0) + b.variance[i].powi(2) / (b.runs - 1.0));
        // Student's t to a normal variable (Wallace 1959).
        let z = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) * (freedom * (t * t / freedom).ln_1p()).sqrt();
        (sum, squares) = (sum + z * t.signum(), squares + z * z);
        tested += 1;
        let p = two_sided(z);
        if p < worst {
            (worst, at) = (p, (i, t.signum() * z));
        }
    }
    assert!(tested > 0, "{what}: nothing is noisy");
    let n = f64::from(tested);
    let level = 1.0 - (1.0 - 1e-5f64).powf(1.0 / n);
    println!(
        "{what}: {tested} values, largest z {:+.2} (p = {worst:.1e}, level {level:.1e}), mean z {:+.3}, rms z {:.3}",
        at.1,
        sum / n,
        (squares / n).sqrt(),
    );
    assert!(worst > level, "{what}: pixel {} has z = {:+.2}, p = {worst:.1e} below {level:.1e}", at.0, at.1);
}

// ---- closed forms ----

/// A closed sphere of albedo ½ that emits ½, or is lit by a point light of intensity π: radiance 1 everywhere.
#[test]
fn the_sphere_of_albedo_half_is_one() {
    let Some((_guard, device)) = common::device() else { return };
    let mut glowing = builtin::sphere(4, Vec3::splat(0.5));
    glowing.lights.clear();
    glowing.materials[0].emission = Vec3::splat(0.5);
    let camera = glowing.cameras[0].clone();
    let mut glowing = software(&device, glowing);
    for estimator in [Estimator::Mis, Estimator::Naive] {
        let mut config = config(10, 10, 64, 100);
        config.path_trace.estimator = estimator;
        let data = picture(&mut glowing, &config, &camera);
        assert_close(&format!("glowing, {estimator:?}"), mean(&data), 1.0, 0.025);
    }
    let mut lit = builtin::sphere(4, Vec3::splat(0.5));
    lit.lights[0].intensity = Vec3::splat(PI);
    lit.lights[0].position = Vec3::ZERO;
    let data = picture(&mut software(&device, lit), &config(10, 10, 64, 100), &camera);
    assert_close("point light", mean(&data), 1.0, 0.025);
}

/// In light of radiance 1 from everywhere a white Lambertian and clear glass cannot be seen; rough glass, metal and
/// varnish lose what facets shadow, and the energy-conserving mix never gains.
#[test]
fn a_white_furnace_shows_nothing_brighter_than_itself() {
    let Some((_guard, device)) = common::device() else { return };
    let camera = Camera::look_at("furnace", Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, 0.6);
    let white = Material { metallic: 0.0, ..Material::default() };
    let pane = |roughness| Material { volume: None, ..glass(roughness) };
    for (what, material, expected) in [
        ("Lambertian", gray(1.0), 0.998..1.002),
        ("clear glass", glass(0.0), 0.998..1.002),
        ("clear pane", pane(0.0), 0.998..1.002),
        ("rough glass", glass(0.4), 0.80..1.002),
        ("rough pane", pane(0.4), 0.80..1.002),
        ("metal", Material { roughness: 0.5, ..Material::default() }, 0.80..1.002),
        ("varnish", Material { roughness: 0.2, ..white.clone() }, 0.80..1.002),
        ("rough varnish", white, 0.80..1.002),
    ] {
        let mut scene = scene(vec![ball(Vec3::ZERO, 1.0, 0)], vec![material]);
        scene.environment = Some(Environment::constant(Vec3::ONE).into());
        let mut config = config(16, 16, 64, 64);
        config.energy_conserving = true;
        config.path_trace.roulette_depth = 64;
        let data = picture(&mut software(&device, scene), &config, &camera);
        let mean = mean(&data);
        println!("{what}: {mean}");
        assert!(expected.contains(&mean), "{what}: {mean}");
    }
}

/// A veil of coverage α over a background of radiance B shows α·own + (1 − α)·B, and lets 1 − α of a light through.
#[test]
fn partial_coverage_lets_its_share_through() {
    let Some((_guard, device)) = common::device() else { return };
    let alpha = 0.3;
    let own = Material {
        base_color: Vec3::splat(0.2).extend(alpha),
        alpha_mode: AlphaMode::Blend,
        unlit: true,
        ..Material::default()
    };
    let veil = quad(Vec3::new(-9.0, -9.0, 1.0), Vec3::X * 18.0, Vec3::Y * 18.0, 0);
    let mut backed = scene(vec![veil], vec![own]);
    backed.environment = Some(Environment::constant(Vec3::splat(2.0)).into());
    let camera = Camera::look_at("front", Vec3::Z * 3.0, Vec3::ZERO, 0.6);
    let data = picture(&mut software(&device, backed), &config(16, 16, 256, 4), &camera);
    assert_close("veil", mean(&data), f64::from(alpha * 0.2 + (1.0 - alpha) * 2.0), 0.005);

    let mut floor = builtin::plane(4.0, 2.0, Vec3::splat(0.5));
    let camera = Camera::look_at("below the veil", Vec3::new(0.0, 0.5, 0.1), Vec3::ZERO, 0.6);
    let open = picture(&mut software(&device, floor.clone()), &config(16, 16, 4, 2), &camera);
    let black = Material { base_color: Vec3::ZERO.extend(alpha), alpha_mode: AlphaMode::Blend, ..gray(0.0) };
    for height in [1.0, 1.5] {
        let veil =
            quad(Vec3::new(-4.0, height, -4.0), Vec3::X * 8.0, Vec3::Z * 8.0, floor.materials.len() as u32);
        floor.instances.push(Instance {
            name: String::new(),
            mesh: floor.meshes.len() as u32,
            transform: Affine3A::IDENTITY,
            moves: false,
        });
        floor.meshes.push(veil.into());
        floor.materials.push(black.clone());
    }
    let veiled = picture(&mut software(&device, floor), &config(16, 16, 4, 2), &camera);
    assert_close("through two veils", mean(&veiled), mean(&open) * f64::from(1.0 - alpha).powi(2), 1e-4);
}

/// Kinds of transport add up, path by path: among Lambertians direct and diffuse indirect light are all there is.
#[test]
fn direct_and_indirect_light_are_all_of_it() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = builtin::by_name("cornell").unwrap();
    let camera = scene.cameras[0].clone();
    let mut renderer = software(&device, scene);
    let [full, direct, indirect] =
        [Transport::Full, Transport::Direct, Transport::DiffuseIndirect].map(|transport| {
            let mut config = config(16, 16, 16, 5);
            config.path_trace.transport = transport;
            picture(&mut renderer, &config, &camera)
        });
    for (i, all) in full.iter().enumerate() {
        let sum = direct[i] + indirect[i];
        assert!((sum - all).abs() <= 1e-4 * all, "value {i}: {} + {} is not {all}", direct[i], indirect[i]);
    }
    assert!(mean(&indirect) > 0.2 * mean(&full) && mean(&direct) > 0.2 * mean(&full));
}

// ---- other ways to the same light ----

/// Light found by asking for it and by chance is the same light.
#[test]
fn both_estimators_have_one_mean() {
    let Some((_guard, device)) = common::device() else { return };
    let sky = Environment {
        name: "sky".into(),
        width: 4,
        height: 2,
        texels: (0..8).map(|i| Vec3::splat(0.2 * i as f32)).collect(),
    };
    let (room, camera) = table();
    let mut outside = room.clone();
    outside.environment = Some(sky.into());
    for (what, scene) in [("lamp", room), ("lamp and sky", outside)] {
        let mut renderer = software(&device, scene);
        let mut of = |estimator, spp, seed| {
            let mut config = RenderConfig { seed, ..config(16, 10, spp, 6) };
            config.path_trace.estimator = estimator;
            config.path_trace.roulette_depth = 3;
            estimate(&mut renderer, &config, &camera, 16)
        };
        let (mis, naive) = (of(Estimator::Mis, 64, 0), of(Estimator::Naive, 512, 100));
        assert_equal_but_for_noise(what, &mis, &naive, 0.02);
        let noise = |e: &Estimate, spp: f64| spp * e.variance.iter().sum::<f64>();
        assert!(noise(&mis, 64.0) < 0.5 * noise(&naive, 512.0), "{what}: asking for light is worth it");
    }
}

/// The same of coarse smooth balls, whose light from below a facet arrives over it: close to a lamp, where that height is
/// much, and under a sky.
#[test]
fn both_estimators_have_one_mean_over_facets() {
    let Some((_guard, device)) = common::device() else { return };
    let mut mesh = Mesh::clone(&builtin::sphere(0, Vec3::ONE).meshes[0]);
    mesh.normals = mesh.positions.clone();
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let varnish = Material { metallic: 0.0, roughness: 0.4, ..gray(0.8) };
    // As high as the ball and behind it: much of it lies below the facets that are seen.
    let lamp_behind = quad(Vec3::new(1.5, -1.5, -2.0), Vec3::Y * 3.0, Vec3::Z * 4.0, 1);
    let mut scene = scene(vec![mesh, lamp_behind], vec![varnish, lamp(3.0)]);
    scene.environment = Some(Environment::constant(Vec3::splat(0.2)).into());
    let camera = Camera::look_at("front", Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 0.6);
    let mut renderer = software(&device, scene);
    let mut of = |estimator, spp, seed| {
        let mut config = RenderConfig { seed, ..config(12, 12, spp, 3) };
        config.path_trace.estimator = estimator;
        estimate(&mut renderer, &config, &camera, 16)
    };
    let (mis, naive) = (of(Estimator::Mis, 64, 0), of(Estimator::Naive, 512, 100));
    assert_equal_but_for_noise("facets", &mis, &naive, 0.02);
}

/// Light of a glowing ball focused by a glass one: only chance finds it, whichever estimator.
#[test]
fn a_caustic_is_the_same_with_and_without_asking() {
    let Some((_guard, device)) = common::device() else { return };
    let meshes = vec![
        quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, 0),
        ball(Vec3::new(0.0, 0.8, 0.0), 0.5, 1),
        ball(Vec3::new(0.3, 2.6, 0.0), 0.6, 2),
    ];
    let scene = scene(meshes, vec![gray(0.7), glass(0.0), lamp(5.0)]);
    let camera = Camera::look_at("floor", Vec3::new(0.0, 1.2, 2.5), Vec3::new(-0.1, 0.2, 0.0), 0.9);
    let mut renderer = software(&device, scene);
    let mut of = |estimator, seed| {
        let mut config = RenderConfig { seed, ..config(16, 16, 128, 8) };
        config.path_trace.estimator = estimator;
        estimate(&mut renderer, &config, &camera, 16)
    };
    let (mis, naive) = (of(Estimator::Mis, 0), of(Estimator::Naive, 100));
    assert_equal_but_for_noise("caustic", &mis, &naive, 0.02);
}

/// What traces the rays never shows.
#[test]
fn both_backends_have_one_mean() {
    let Some((_guard, device)) = common::ray_query_device() else { return };
    let (scene, camera) = table();
    let mut config = config(8, 8, 20, 4);
    config.path_trace.adaptive = true;
    let [a, b] = [(Backend::Software, 0), (Backend::RayQuery, 100)].map(|(backend, seed)| {
        let mut renderer = renderer(&device, scene.clone(), backend);
        estimate(&mut renderer, &RenderConfig { seed, ..config.clone() }, &camera, 16)
    });
    assert_equal_but_for_noise("backends", &a, &b, 0.02);
}

// ---- adaptive sampling ----

/// A floor under a small bright lamp that only chance finds, in front of a wall that glows: bright specks on the one
/// half of the picture, next to no noise on the other.
fn specks() -> (Scene, Camera) {
    let meshes = vec![
        quad(Vec3::new(-3.0, 0.0, -1.0), Vec3::Z * 4.0, Vec3::X * 6.0, 0),
        quad(Vec3::new(-0.3, 1.2, 0.2), Vec3::X * 0.6, Vec3::Z * 0.6, 1),
        quad(Vec3::new(-3.0, 0.0, -1.0), Vec3::X * 6.0, Vec3::Y * 6.0, 2),
    ];
    let scene = scene(meshes, vec![gray(0.7), lamp(20.0), lamp(0.5)]);
    (scene, Camera::look_at("front", Vec3::new(0.0, 2.0, 4.0), Vec3::new(0.0, 0.6, -1.0), 0.9))
}

fn naive(adaptive: bool, size: [u32; 2], spp: u32, seed: u32) -> RenderConfig {
    let mut config = RenderConfig { seed, ..config(size[0], size[1], spp, 3) };
    config.path_trace.estimator = Estimator::Naive;
    config.path_trace.adaptive = adaptive;
    config
}

/// Where samples go depends on what samples have shown; the mean does not.
#[test]
fn adaptive_sampling_has_the_same_mean() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = specks();
    let mut renderer = software(&device, scene);
    let mut of =
        |adaptive, spp, seed| estimate(&mut renderer, &naive(adaptive, [24, 24], spp, seed), &camera, 32);
    let (uniform, adaptive) = (of(false, 128, 0), of(true, 64, 1000));
    assert_equal_but_for_noise("adaptive", &adaptive, &uniform, 0.02);
}

/// One sample in three thousand finds the lamp. A mean of more samples where some did and fewer where none did would be a
/// fifth too dark.
#[test]
fn adaptive_sampling_is_not_fooled_by_luck() {
    let Some((_guard, device)) = common::device() else { return };
    let meshes = vec![
        quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, 0),
        quad(Vec3::new(-0.02, 1.2, -0.02), Vec3::X * 0.04, Vec3::Z * 0.04, 1),
    ];
    let scene = scene(meshes, vec![gray(0.7), lamp(1000.0)]);
    let camera = Camera::look_at("floor", Vec3::new(0.0, 0.8, 0.8), Vec3::ZERO, 0.6);
    let mut renderer = software(&device, scene);
    let expected = mean(&picture(&mut renderer, &config(24, 24, 64, 2), &camera));
    let runs = 128;
    let means: Vec<f64> = (0..runs)
        .map(|seed| {
            let mut config = naive(true, [24, 24], 64, seed);
            config.path_trace.max_depth = Some(2);
            mean(&picture(&mut renderer, &config, &camera)) / expected
        })
        .collect();
    let n = f64::from(runs);
    let average = means.iter().sum::<f64>() / n;
    let deviation = (means.iter().map(|m| (m - average).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt();
    println!("{average:.3} ± {deviation:.3} of what is expected");
    assert!((average - 1.0).abs() < 4.0 * deviation && deviation < 0.04, "{average} ± {deviation}");
}

/// As many samples leave less noise where noise is uneven.
#[test]
fn adaptive_sampling_pays() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = specks();
    let mut renderer = software(&device, scene);
    let mut of = |adaptive| {
        let frames = (0..4).map(|seed| {
            let config = naive(adaptive, [48, 48], 128, seed);
            renderer.render(&config, &camera, &request()).unwrap()
        });
        frames.map(|frame| frame.noise.unwrap().powi(2)).sum::<f64>()
    };
    let gain = of(false) / of(true);
    println!("samples to equal noise: {gain:.2} times fewer");
    assert!(gain > 1.25, "{gain}");
}

// ---- an independent renderer's pictures ----

/// Mitsuba's pictures with their variance; ours with as many pixels as they have blocks, which area averages permit.
fn against_reference(
    device: &Device,
    name: &str,
    camera: Option<&str>,
    block: usize,
    runs: u32,
    depths: &[u32],
) {
    let Some(folder) = common::shared("reference") else { return };
    let scene = scene::load(&folder.join(format!("{name}.glb")), &LoadOptions::default()).unwrap();
    let camera = match camera {
        Some(word) => {
            scene.cameras.iter().find(|c| c.name == word || c.camera_name.as_deref() == Some(word)).unwrap()
        }
        None => &scene.cameras[0],
    }
    .clone();
    let mut renderer = software(device, scene);
    for &depth in depths {
        let channels = |file: String| {
            let read = read_exr(&folder.join(file)).unwrap();
            (read.size, read.interleaved(&["R", "G", "B"]).unwrap())
        };
        let ([width, height], mean) = channels(format!("{name}_d{depth}.exr"));
        let (_, variance) = channels(format!("{name}_d{depth}.variance.exr"));
        let variance_of_one: Vec<f32> = variance.iter().map(|v| v * 16384.0).collect();
        let blocks = |data: &[f32]| metrics::block_average(data, width as usize, 3, block);
        let pixels = (block * block) as f64;
        let reference = Estimate {
            mean: blocks(&mean).iter().map(|&v| f64::from(v)).collect(),
            variance: blocks(&variance).iter().map(|&v| f64::from(v) / pixels).collect(),
            runs: 256.0,
        };
        let mut config = config(width / block as u32, height / block as u32, 64, depth);
        config.path_trace.roulette_depth = 4;
        let mut ours = estimate(&mut renderer, &config, &camera, runs);
        let total = |e: &Estimate| e.mean.iter().sum::<f64>();
        let bias = total(&ours) / total(&reference) - 1.0;
        let variance = ours.variance.iter().chain(&reference.variance).sum::<f64>();
        let deviation = variance.sqrt() / total(&reference);
        println!("{name}_d{depth}: bias {:+.3} % ± {:.3} %", 100.0 * bias, 100.0 * deviation);
        assert!(bias.abs() < 4.5 * deviation && bias.abs() < 0.02, "{name}_d{depth}: bias {bias}");
        // What happens to one sample in thousands the reference knows better than a few runs do.
        let within = blocks(&variance_of_one);
        let squares = blocks(&mean.iter().map(|v| v * v).collect::<Vec<_>>());
        let samples = f64::from(runs * config.path_trace.spp);
        for (i, variance) in ours.variance.iter_mut().enumerate() {
            let between = f64::from(squares[i]) - reference.mean[i].powi(2);
            *variance = variance.max((f64::from(within[i]) + between.max(0.0)) / samples);
        }
        assert_equal_but_for_noise(&format!("{name}_d{depth}"), &ours, &reference, 0.02);
    }
}

#[test]
fn the_cornell_box_with_a_point_light_is_mitsubas() {
    let Some((_guard, device)) = common::device() else { return };
    against_reference(&device, "cornell_point", None, 4, 16, &[2, 3, 100]);
}

#[test]
fn the_cornell_box_with_a_lamp_is_mitsubas() {
    let Some((_guard, device)) = common::device() else { return };
    against_reference(&device, "cornell_area", None, 4, 16, &[2, 3, 100]);
}

#[test]
fn the_cornell_box_with_a_mirror_is_mitsubas() {
    let Some((_guard, device)) = common::device() else { return };
    against_reference(&device, "cornell_mirror", None, 4, 16, &[2, 3, 100]);
}

#[test]
fn the_office_is_mitsubas() {
    let Some((_guard, device)) = common::device() else { return };
    against_reference(&device, "office_diffuse", Some("camera:norm"), 8, 16, &[2, 3, 100]);
}

// ---- virtual point lights ----

/// Among Lambertians virtual point lights converge to the path tracer's indirect light as 1/N: in a closed box where
/// nothing need be clamped, on an 8×8 grid over one of its faces.
#[test]
fn virtual_point_lights_converge_to_it() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = builtin::by_name("closed-box").unwrap();
    let (low, high) = scene.bounds().unwrap();
    // All of the far face and no more.
    let mut camera = Camera::look_at("face", low.midpoint(high), low.midpoint(high) - Vec3::Z, 1.0);
    let half = 0.5 * (high - low);
    camera.view = View::Orthographic { ymag: half.y };
    let mut renderer = software(&device, scene);
    let bounces = 2;
    let mut path = config(8, 8, 1 << 15, bounces + 2);
    path.path_trace.transport = Transport::DiffuseIndirect;
    path.path_trace.pixel_filter = PixelFilter::Center;
    let reference = picture(&mut renderer, &path, &camera);
    let mut points = Vec::new();
    for paths in [32u32, 128, 512, 2048] {
        let mut errors: Vec<f64> = (1..=8)
            .map(|seed| {
                let mut config = RenderConfig { size: [8, 8], seed, ..common::plain() };
                config.vpl_shoot.vpls = paths * bounces;
                config.vpl_shoot.bounces = Some(bounces);
                config.indirect.min_distance = Some(0.0);
                let request = FrameRequest { aovs: &[Aov::Indirect], ..FrameRequest::default() };
                let frame = renderer.render(&config, &camera, &request).unwrap();
                metrics::rel_mse(&frame.aovs[0].1.data, &reference)
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        points.push((f64::from(paths).ln(), (0.5 * (errors[3] + errors[4])).ln()));
    }
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>()
        / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>();
    let errors: Vec<_> = points.iter().map(|p| p.1.exp()).collect();
    println!("relMSE {errors:?}, slope {slope:.2}");
    assert!((-1.4..-0.7).contains(&slope), "{errors:?} falls with {slope}");
}

// ---- pictures that grow ----

fn request<'a>() -> FrameRequest<'a> {
    FrameRequest { aovs: &[Aov::HalfA, Aov::HalfB, Aov::Variance], ..FrameRequest::default() }
}

/// What a frame with [`request`]'s layers is continued from.
fn so_far(frame: &Frame) -> Resume {
    Resume {
        samples: frame.samples.unwrap(),
        mean: frame.beauty.clone(),
        halves: Some([frame.aovs[0].1.clone(), frame.aovs[1].1.clone()]),
        rates: frame.aovs.get(3).map(|(_, layer)| layer.clone()),
    }
}

/// A render stopped twice on the way and continued has the bits of one that was not.
#[test]
fn a_render_goes_on_where_it_stopped() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = table();
    let mut renderer = software(&device, scene);
    let render = |renderer: &mut Renderer, spp, resume: Option<&Resume>| {
        let config = RenderConfig { seed: 3, ..config(20, 12, spp, 5) };
        renderer.render(&config, &camera, &FrameRequest { resume, ..request() }).unwrap()
    };
    let whole = render(&mut renderer, 13, None);
    let first = render(&mut renderer, 2, None);
    let second = render(&mut renderer, 7, Some(&so_far(&first)));
    let third = render(&mut renderer, 13, Some(&so_far(&second)));
    assert_eq!((second.samples, third.samples), (Some(7), Some(13)));
    assert!(third.beauty == whole.beauty && third.aovs == whole.aovs, "other bits");
    assert_eq!(third.display, whole.display);
    assert!(second.beauty != whole.beauty && render(&mut renderer, 13, None).beauty == whole.beauty);
    // As much as there is already: nothing is added.
    assert!(render(&mut renderer, 13, Some(&so_far(&whole))).beauty == whole.beauty);

    let bare = Resume { halves: None, ..so_far(&first) };
    let mut config = config(20, 12, 13, 5);
    config.seed = 3;
    let plain = FrameRequest { resume: Some(&bare), ..FrameRequest::default() };
    assert!(renderer.render(&config, &camera, &plain).unwrap().beauty == whole.beauty);
    let error = renderer.render(&config, &camera, &FrameRequest { resume: Some(&bare), ..request() });
    assert!(error.unwrap_err().to_string().contains("half_a"));
    config.size = [12, 20];
    let error = renderer.render(&config, &camera, &plain).unwrap_err().to_string();
    assert!(error.contains("20x12") && error.contains("12x20"), "{error}");
}

/// Adaptive sampling goes on within rounds and between them, and refuses what it cannot go on from.
#[test]
fn adaptive_sampling_goes_on_where_it_stopped() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = table();
    let mut renderer = software(&device, scene);
    let aovs = [Aov::HalfA, Aov::HalfB, Aov::Variance, Aov::Rate];
    let config = |spp| {
        let mut config = RenderConfig { seed: 3, ..config(44, 28, spp, 4) };
        config.path_trace.adaptive = true;
        config
    };
    let mut render = |spp, resume: Option<&Resume>| {
        let request = FrameRequest { aovs: &aovs, resume, ..FrameRequest::default() };
        renderer.render(&config(spp), &camera, &request)
    };
    let whole = render(75, None).unwrap();
    let rates = &whole.aovs[3].1;
    let rate = |i: usize| rates.data[3 * i];
    assert!((0..44 * 28).any(|i| rate(i) > 1.0) && (0..44 * 28).any(|i| rate(i) < 1.0));
    let mut part: Option<Frame> = None;
    for spp in [7, 16, 21, 30, 32, 51, 75] {
        part = Some(render(spp, part.as_ref().map(so_far).as_ref()).unwrap());
    }
    let part = part.unwrap();
    assert!(part.beauty == whole.beauty && part.aovs == whole.aovs, "other bits");

    let good = so_far(&whole);
    let mut broken = good.clone();
    broken.rates.as_mut().unwrap().data[0] = 0.3;
    for resume in [Resume { rates: None, ..good.clone() }, broken] {
        let error = render(90, Some(&resume)).unwrap_err();
        assert!(error.to_string().contains("rate") && error.class() == ErrorClass::Input, "{error}");
    }
    let error = render(90, Some(&Resume { halves: None, ..good })).unwrap_err();
    assert!(error.to_string().contains("half_a"), "{error}");
}

/// Beauty is the mean of its halves; the variance they predict is the one pictures of other seeds show.
#[test]
fn halves_predict_the_noise() {
    let Some((_guard, device)) = common::device() else { return };
    let mut scene = builtin::sphere(2, Vec3::new(0.5, 0.6, 0.7));
    scene.lights.clear();
    // A checkered glow: without rare events a few renders know the variance.
    scene.materials.push(Material { emission: Vec3::ONE, ..scene.materials[0].clone() });
    (0..scene.meshes[0].materials.len()).for_each(|i| scene.mesh_mut(0).materials[i] = (i % 2) as u32);
    let camera = scene.cameras[0].clone();
    let mut renderer = software(&device, scene);
    let config = config(16, 16, 32, 4);
    let mut predicted = 0.0;
    for seed in 0..8 {
        let frame = renderer.render(&RenderConfig { seed, ..config.clone() }, &camera, &request()).unwrap();
        let layer = |i: usize| &frame.aovs[i].1.data;
        for (i, &all) in frame.beauty.data.iter().enumerate() {
            let half = 0.5 * (layer(0)[i] + layer(1)[i]);
            assert!((all - half).abs() <= 1e-5 * all, "value {i}: {all} is not {half}");
            let variance = 0.25 * (layer(0)[i] - layer(1)[i]).powi(2);
            assert!((layer(2)[i] - variance).abs() <= 1e-5 * variance, "variance {i}");
        }
        predicted += mean(layer(2)) / 8.0;
    }
    let seen = estimate(&mut renderer, &RenderConfig { seed: 100, ..config }, &camera, 16);
    // Of one render, not of the mean over them.
    let seen = 16.0 * seen.variance.iter().sum::<f64>() / seen.variance.len() as f64;
    assert_close("variance by halves", predicted, seen, 0.25);
}

/// Samples stop where the error asked for is reached, at a number that no clock decides, and the error is what was
/// asked for.
#[test]
fn noise_and_time_end_a_render() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = builtin::by_name("cornell").unwrap();
    let camera = scene.cameras[0].clone();
    let mut renderer = software(&device, scene);
    let most = config(16, 16, 4096, 4);
    let limit = 0.1;
    let quiet = FrameRequest { noise: Some(limit), ..FrameRequest::default() };
    let frame = renderer.render(&most, &camera, &quiet).unwrap();
    let samples = frame.samples.unwrap();
    assert!(samples < 4096 && frame.noise.unwrap() <= limit, "{samples} samples, error {:?}", frame.noise);
    assert_eq!(renderer.render(&most, &camera, &quiet).unwrap().samples, Some(samples));
    let reference = picture(&mut renderer, &RenderConfig { seed: 9, ..most.clone() }, &camera);
    let error = metrics::rel_mse(&frame.beauty.data, &reference).sqrt();
    println!("{samples} samples, error {error:.4} by a reference, {:.4} by halves", frame.noise.unwrap());
    assert!((0.6 * limit..1.3 * limit).contains(&error));

    let endless = RenderConfig { size: [64, 64], ..config(64, 64, 1 << 24, 4) };
    let short = FrameRequest { time: Some(Duration::from_millis(300)), ..FrameRequest::default() };
    let frame = renderer.render(&endless, &camera, &short).unwrap();
    assert!((1..1 << 24).contains(&frame.samples.unwrap()));
    let cancel = AtomicBool::new(true);
    let error = renderer.render(&endless, &camera, &FrameRequest { cancel: Some(&cancel), ..short });
    assert!(matches!(error, Err(parhelion::renderer::Error::Cancelled)), "nothing to show");
}

/// A time that is over before the first sample still gives a picture: the one that a sample makes.
#[test]
fn the_shortest_time_is_enough_for_a_picture() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = builtin::by_name("cornell").unwrap();
    let camera = scene.cameras[0].clone();
    let mut renderer = software(&device, scene);
    let over = FrameRequest { time: Some(Duration::from_nanos(1)), ..FrameRequest::default() };
    let frame = renderer.render(&config(16, 16, 1 << 24, 4), &camera, &over).unwrap();
    assert_eq!(frame.samples, Some(1));
    assert_eq!(frame.beauty.data, picture(&mut renderer, &config(16, 16, 1, 4), &camera));
    // A picture that goes on is one already.
    let resume = so_far(&renderer.render(&config(16, 16, 4, 4), &camera, &request()).unwrap());
    let more = FrameRequest { resume: Some(&resume), ..over };
    assert_eq!(renderer.render(&config(16, 16, 1 << 24, 4), &camera, &more).unwrap().samples, Some(4));
}

/// What is shown on the way is the picture that as many samples make; a stop keeps what there is.
#[test]
fn previews_are_whole_pictures() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = table();
    let mut renderer = software(&device, scene);
    for adaptive in [false, true] {
        let config = |spp| {
            let mut config = config(32, 24, spp, 4);
            config.path_trace.adaptive = adaptive;
            config
        };
        let cancel = AtomicBool::new(false);
        let seen: RefCell<Vec<Frame>> = RefCell::default();
        let show = |frame: &Frame| {
            seen.borrow_mut().push(frame.clone());
            cancel.store(frame.samples.unwrap() > 20, Ordering::SeqCst);
        };
        let preview = Some(Preview { every: Duration::from_nanos(1), show: &show });
        let endless = config(1 << 24);
        let request = FrameRequest { preview, cancel: Some(&cancel), ..FrameRequest::default() };
        let last = renderer.render(&endless, &camera, &request).unwrap();
        let mut seen = seen.into_inner();
        assert!(seen.len() > 1);
        assert_eq!(last.samples, seen[seen.len() - 1].samples, "a stop adds nothing");
        seen.push(last);
        for shown in seen {
            let whole =
                renderer.render(&config(shown.samples.unwrap()), &camera, &FrameRequest::default()).unwrap();
            assert!(
                whole.beauty == shown.beauty && whole.display == shown.display,
                "{:?} samples",
                shown.samples
            );
        }
    }
}

/// A crop holds the pixels of the whole, and pixels do not depend on the picture's other settings.
#[test]
fn a_crop_holds_the_pixels_of_the_whole() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = table();
    let mut renderer = software(&device, scene);
    let whole = picture(&mut renderer, &config(20, 12, 4, 5), &camera);
    let [x0, y0, x1, y1] = [5, 3, 13, 10];
    let crop = RenderConfig { crop: Some([x0, y0, x1, y1]), ..config(20, 12, 4, 5) };
    let part = picture(&mut renderer, &crop, &camera);
    let rows = (y0..y1).flat_map(|y| &whole[3 * (20 * y + x0) as usize..3 * (20 * y + x1) as usize]);
    assert!(rows.eq(&part), "other bits");
}

/// Taps work at the end, and one that is not there is refused before the first sample.
#[test]
fn taps_are_checked_first() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = table();
    let mut renderer = software(&device, scene);
    let tap = |name: &str| ["path_trace/trace:".to_owned() + name];
    let good = tap("mean");
    let request = FrameRequest { taps: &good, ..FrameRequest::default() };
    let frame = renderer.render(&config(4, 4, 3, 2), &camera, &request).unwrap();
    assert!(frame.taps[0].1.data.chunks(4).all(|texel| texel[3] == 3.0), "the mean's w counts samples");
    let bad = tap("median");
    let endless = config(64, 64, 1 << 24, 8);
    let error = renderer.render(&endless, &camera, &FrameRequest { taps: &bad, ..request }).unwrap_err();
    assert!(error.to_string().contains("median"), "{error}");
}

/// Layers that a method lacks are refused by name.
#[test]
fn layers_a_method_lacks_are_refused() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = table();
    let mut renderer = software(&device, scene);
    let mut ask = |config: &RenderConfig, aov| {
        let aovs = [aov];
        renderer.render(config, &camera, &FrameRequest { aovs: &aovs, ..FrameRequest::default() })
    };
    let path = config(4, 4, 1, 2);
    for aov in [Aov::Albedo, Aov::N, Aov::P, Aov::Depth, Aov::Variance] {
        assert_eq!(ask(&path, aov).unwrap().aovs[0].1.data.len(), 16 * aov.channels());
    }
    for (config, aov) in
        [(path.clone(), Aov::Irradiance), (path, Aov::Rate), (RenderConfig::default(), Aov::Variance)]
    {
        let error = ask(&config, aov).unwrap_err();
        assert_eq!(error.class(), ErrorClass::Input);
        let text = error.to_string();
        assert!(text.contains(config.method.name) && text.contains(aov.name()), "{text}");
    }
}

// ---- files ----

/// Runs the program in `folder`.
fn program(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parhelion"));
    let method: &[&str] = if args.contains(&"--method") { &[] } else { &["--method", "path"] };
    command.args(["render", "builtin:cornell"]).args(method).args(args).current_dir(folder);
    command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    command
}

fn succeed(folder: &Path, args: &[&str]) {
    let output = program(folder, args).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// One error that says what differs; nothing is written.
fn fail(folder: &Path, args: &[&str], words: &[&str]) {
    let output = program(folder, &[args, &["-o", "never.exr"]].concat()).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
    let error = message.lines().last().unwrap_or_default();
    assert!(
        error.starts_with("error: ") && words.iter().all(|word| error.contains(word)),
        "{args:?}: {error}"
    );
    assert!(!folder.join("never.exr").exists());
}

/// A picture is continued from its file to the bits of one that was rendered at once, and only where everything that
/// decides them is the same.
#[test]
fn files_are_resumed_to_the_same_bits() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let same = ["--size", "16x12", "--seed", "7", "--max-depth", "4", "--crop", "2,1,14,11"];
    let layers = ["--aov", "half_a,half_b,variance,depth"];
    let with = |rest: &[&'static str]| [&same[..], rest].concat();
    succeed(folder, &[&with(&["--spp", "11", "-o", "whole.exr"])[..], &layers].concat());
    succeed(folder, &[&with(&["--spp", "4", "-o", "part.exr"])[..], &layers].concat());
    succeed(
        folder,
        &[&with(&["--spp", "11", "--resume", "part.exr", "-o", "part.exr"])[..], &layers].concat(),
    );
    let [whole, part] = ["whole.exr", "part.exr"].map(|name| read_exr(&folder.join(name)).unwrap());
    assert!(whole.channels == part.channels && whole.channels.len() == 13, "other bits");
    assert_eq!(part.attributes["parhelion:samples"], Attribute::Number(11.0));
    for key in ["scene_hash", "sampling", "seed", "samples"] {
        let key = format!("parhelion:{key}");
        assert_eq!(whole.attributes[&key], part.attributes[&key]);
    }

    succeed(folder, &with(&["--spp", "4", "-o", "bare.exr"]));
    succeed(folder, &with(&["--spp", "11", "--resume", "bare.exr", "-o", "bare.exr"]));
    assert_eq!(read_exr(&folder.join("bare.exr")).unwrap().channels["G"], whole.channels["G"]);

    fail(folder, &with(&["--resume", "bare.exr", "--aov", "variance"]), &["bare.exr", "half_a"]);
    fail(
        folder,
        &[&same[4..], &["--size", "16x12", "--resume", "bare.exr", "--seed", "8"]].concat(),
        &["bare.exr", "seed", "7", "8"],
    );
    for (args, words) in [
        (&["--resume", "whole.exr", "--size", "20x12"][..], &["whole.exr", "size", "16x12", "20x12"][..]),
        (&["--resume", "whole.exr", "--size", "16x12"], &["whole.exr", "window"]),
        (&["--resume", "none.exr"], &["none.exr"]),
        (&["--resume", "never.txt"], &["never.txt"]),
    ] {
        fail(folder, args, words);
    }
    fail(
        folder,
        &with(&["--resume", "whole.exr", "--estimator", "naive"]),
        &["whole.exr", "sampling", "naive"],
    );
    fail(
        folder,
        &with(&["--resume", "whole.exr", "--camera", "0", "--environment", "1,1,1"]),
        &["scene hash"],
    );
    fail(folder, &with(&["--resume", "whole.exr", "--adaptive"]), &["whole.exr", "sampling", "adaptive"]);
    succeed(folder, &["--size", "8x8", "--spp", "1", "-o", "a.png"]);
    fail(folder, &with(&["--resume", "a.png"]), &["a.png"]);

    let layers = ["--adaptive", "--aov", "half_a,half_b,rate"];
    succeed(folder, &[&with(&["--spp", "39", "-o", "whole.exr"])[..], &layers].concat());
    succeed(folder, &[&with(&["--spp", "21", "-o", "part.exr"])[..], &layers].concat());
    let on = ["--spp", "39", "--resume", "part.exr", "-o", "part.exr"];
    succeed(folder, &[&with(&on)[..], &layers].concat());
    let [whole, part] = ["whole.exr", "part.exr"].map(|name| read_exr(&folder.join(name)).unwrap());
    assert!(whole.channels == part.channels && whole.channels.len() == 12, "other bits");
    succeed(folder, &with(&["--adaptive", "--spp", "4", "-o", "bare.exr"]));
    fail(folder, &with(&["--adaptive", "--resume", "bare.exr"]), &["bare.exr", "rate"]);
}

/// At every moment the file is a whole picture; an interrupted render leaves its last, and says that it is no success.
#[cfg(unix)]
#[test]
fn files_on_the_way_are_whole() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.exr");
    let endless = ["--size", "96x64", "--time", "1h", "--preview", "1ms", "-o", "a.exr", "--quiet"];
    let mut child = program(folder.path(), &endless).spawn().unwrap();
    let mut samples = Vec::new();
    while samples.len() < 5 {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        if !file.exists() {
            std::thread::sleep(Duration::from_millis(10));
            continue;
        }
        let picture = read_exr(&file).unwrap();
        assert_eq!((picture.size, picture.channels["R"].len()), ([96, 64], 96 * 64));
        let Attribute::Number(n) = picture.attributes["parhelion:samples"] else { panic!("no number") };
        if samples.last() != Some(&n) {
            samples.push(n);
        }
    }
    assert!(samples.is_sorted(), "{samples:?}");
    // The shell's own `kill`: a small system has no other.
    let interrupt = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &interrupt]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let Attribute::Number(n) = read_exr(&file).unwrap().attributes["parhelion:samples"] else {
        panic!("no number")
    };
    assert!(n >= samples[4]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing unfinished is left");
}

/// A limit to time is one more where a file says how many samples, even if as many as by default; over at once it still
/// leaves a picture.
#[test]
fn a_time_limits_beside_a_files_samples() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let default = RenderConfig::default().path_trace.spp;
    std::fs::write(folder.join("few.toml"), format!("path_trace.spp = {default}\n")).unwrap();
    let small = ["--size", "4x3", "--max-depth", "2", "-o", "a.exr"];
    let samples = |args: &[&str]| {
        succeed(folder, &[&small, args].concat());
        match read_exr(&folder.join("a.exr")).unwrap().attributes["parhelion:samples"] {
            Attribute::Number(samples) => samples,
            Attribute::Text(_) => unreachable!("a number"),
        }
    };
    assert_eq!(samples(&["--config", "few.toml", "--time", "20s"]), f64::from(default));
    assert_eq!(samples(&["--config", "few.toml", "--noise", "1e-9"]), f64::from(default));
    assert_eq!(samples(&["--config", "few.toml", "--spp", "3", "--time", "20s"]), 3.0);
    assert_eq!(samples(&["--time", "1e-6ms"]), 1.0);
}

/// Options say which method they are of, and an environment is a file or three numbers.
#[test]
fn options_of_other_methods_are_refused() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for args in [["--vpls", "9"], ["--downsample", "4"], ["--min-distance", "1"]] {
        fail(folder, &args, &[args[0], "path", "igi"]);
    }
    for args in [["--spp", "9"], ["--time", "1s"], ["--resume", "a.exr"], ["--transport", "direct"]] {
        fail(folder, &[&["--method", "igi"], &args[..]].concat(), &[args[0], "igi", "path"]);
    }
    for word in ["1,2", "1,2,-3", "1,2,nan", "sky.exr"] {
        fail(folder, &["--environment", word], &["--environment", word.rsplit(',').next().unwrap()]);
    }
    fail(folder, &["--aov", "irradiance"], &["--aov", "path", "irradiance"]);
    fail(folder, &["--pixel-samples", "4"], &["--pixel-samples", "spp"]);
}
