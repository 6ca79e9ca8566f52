//! Light through panes and past partial coverage: closed forms, and every method and estimator against the others.

mod common;

use common::{assert_close, gray, mean, quad, scene};
use glam::{Affine3A, Vec3, Vec4};
use parhelion::config::RenderConfig;
use parhelion::methods::{igi, path};
use parhelion::renderer::{Aov, BackendChoice, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{AlphaMode, Camera, Environment, Instance, Light, LightKind, Material, Scene, View};
use parhelion::techniques::indirect::Visibility;
use parhelion::techniques::path_trace::{Estimator, PixelFilter, Transport};
use parhelion::vk::{Backend, Device};
use std::f32::consts::PI;

// ---- scenes ----

fn pane(color: Vec3, transmission: f32) -> Material {
    Material {
        name: "pane".into(),
        base_color: color.extend(1.0),
        metallic: 0.0,
        roughness: 0.0,
        transmission,
        ..Material::default()
    }
}

fn veil(alpha: f32) -> Material {
    Material { base_color: Vec4::new(0.0, 0.0, 0.0, alpha), alpha_mode: AlphaMode::Blend, ..gray(0.0) }
}

fn sun(direction: Vec3, irradiance: f32) -> Light {
    Light {
        name: "sun".into(),
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: direction.normalize(),
        intensity: Vec3::splat(irradiance),
    }
}

fn point(position: Vec3, intensity: f32) -> Light {
    let kind = LightKind::Point;
    Light { name: "point".into(), kind, position, direction: Vec3::NEG_Z, intensity: Vec3::splat(intensity) }
}

/// A white floor with sheets of one material at these heights over it.
fn under(sheets: &[f32], material: Material) -> Scene {
    let sheet = |&y: &f32| quad(Vec3::new(-50.0, y, -50.0), Vec3::Z * 100.0, Vec3::X * 100.0, 1);
    let floor = quad(Vec3::new(-50.0, 0.0, -50.0), Vec3::Z * 100.0, Vec3::X * 100.0, 0);
    scene([floor].into_iter().chain(sheets.iter().map(sheet)).collect(), vec![gray(0.5), material])
}

/// Sees a spot of the floor from beneath the sheets, aslant.
fn floor_camera() -> Camera {
    let mut camera = Camera::look_at("floor", Vec3::new(0.013, 0.5, 0.017), Vec3::new(0.1, 0.0, 0.05), 0.5);
    camera.view = View::Perspective { yfov: 0.2 };
    camera
}

/// Share of light that a thin wall of index 1.5 lets through at |cosine|.
fn thin_wall(cosine: f64) -> f64 {
    let r = fresnel(cosine, 1.5);
    (1.0 - r) / (1.0 + r)
}

fn fresnel(cos_i: f64, eta: f64) -> f64 {
    let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (eta * eta)).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

// ---- rendering ----

fn renderer(device: &Device, scene: Scene, backend: Backend) -> Renderer {
    scene.validate().unwrap();
    let options = RendererOptions { backend: BackendChoice::Force(backend), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

fn paths(size: u32, spp: u32, max_depth: u32) -> RenderConfig {
    let mut config = RenderConfig { method: &path::METHOD, size: [size; 2], seed: 11, ..common::plain() };
    config.path_trace.spp = spp;
    config.path_trace.max_depth = Some(max_depth);
    config.path_trace.pixel_filter = PixelFilter::Center;
    config
}

fn vpls(size: u32) -> RenderConfig {
    RenderConfig { method: &igi::METHOD, size: [size; 2], seed: 11, ..common::plain() }
}

fn picture(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera) -> Vec<f32> {
    let data = renderer.render(config, camera, &FrameRequest::default()).unwrap().beauty.data;
    assert!(data.iter().all(|v| v.is_finite() && *v >= 0.0));
    data
}

fn layer(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera, aov: Aov) -> Vec<f32> {
    let request = FrameRequest { aovs: &[aov], ..FrameRequest::default() };
    renderer.render(config, camera, &request).unwrap().aovs.swap_remove(0).1.data
}

fn channel(data: &[f32], index: usize) -> Vec<f32> {
    data.chunks_exact(3).map(|rgb| rgb[index]).collect()
}

/// Mean of all of several pictures with its standard error, by seeds.
fn estimate(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera, runs: u32) -> (f64, f64) {
    let means: Vec<f64> = (0..runs)
        .map(|run| {
            mean(&picture(
                renderer,
                &RenderConfig { seed: config.seed + 977 * run, ..config.clone() },
                camera,
            ))
        })
        .collect();
    let n = f64::from(runs);
    let average = means.iter().sum::<f64>() / n;
    let variance = means.iter().map(|m| (m - average).powi(2)).sum::<f64>() / (n - 1.0);
    (average, (variance / n).sqrt())
}

/// Equal within so many standard errors of the difference, which must be small enough to tell 4 %.
fn assert_equal(what: &str, a: (f64, f64), b: (f64, f64)) {
    let error = a.1.hypot(b.1);
    let sigma = (a.0 - b.0) / error;
    println!("{what}: {:.5} ± {:.5} and {:.5} ± {:.5} ({sigma:+.2} σ)", a.0, a.1, b.0, b.1);
    assert!(error < 0.01 * a.0.max(b.0), "{what}: too noisy to tell");
    assert!(sigma.abs() < 4.5, "{what}: {} and {} differ by {sigma:.1} σ", a.0, b.0);
}

// ---- closed forms ----

#[test]
fn sun_and_point_shine_through_panes() {
    let Some((_guard, device)) = common::device() else { return };
    let tint = Vec3::new(1.0, 0.6, 0.25);
    for (count, transmission) in [(0, 1.0), (1, 1.0), (2, 1.0), (6, 1.0), (2, 0.5)] {
        let heights: Vec<f32> = (0..count).map(|i| 1.0 + 0.25 * i as f32).collect();
        let mut scene = under(&heights, pane(tint, transmission));
        let direction = Vec3::new(0.6, -1.0, 0.2).normalize();
        scene.lights = vec![sun(direction, PI)];
        let cosine = f64::from(-direction.y);
        let mut renderer = renderer(&device, scene, Backend::Software);
        for config in [paths(8, 4, 2), vpls(8)] {
            let data = if config.method == &path::METHOD {
                let mut direct = config.clone();
                direct.path_trace.transport = Transport::Direct;
                picture(&mut renderer, &direct, &floor_camera())
            } else {
                layer(&mut renderer, &config, &floor_camera(), Aov::Direct)
            };
            for c in 0..3 {
                let share = thin_wall(cosine) * f64::from(tint[c]) * f64::from(transmission);
                let expected = 0.5 * cosine * share.powi(count);
                let what = format!("{} through {count} panes, channel {c}", config.method.name);
                assert_close(&what, mean(&channel(&data, c)), expected, 2e-4);
            }
        }
    }
}

/// What is half there leaves half a shadow, what is not there none, whichever way light comes.
#[test]
fn partial_coverage_leaves_its_share_of_light() {
    let Some((_guard, device)) = common::device() else { return };
    for (alpha, sheets) in [(0.0, 1), (0.5, 1), (0.5, 3), (1.0, 1)] {
        let heights: Vec<f32> = (0..sheets).map(|i| 1.0 + 0.25 * i as f32).collect();
        let left = (1.0 - f64::from(alpha)).powi(sheets);
        let mut scene = under(&heights, veil(alpha));
        let direction = Vec3::new(0.6, -1.0, 0.2).normalize();
        scene.lights = vec![sun(direction, PI)];
        let lit = 0.5 * f64::from(-direction.y);
        let mut renderer = renderer(&device, scene, Backend::Software);
        // From beneath the sheets and from above them, where they veil what they light.
        let from_above = Camera::look_at("above", Vec3::new(0.1, 5.0, 0.2), Vec3::new(0.0, 0.0, 0.3), 0.2);
        for (camera, seen) in [(floor_camera(), 1.0), (from_above, left)] {
            for config in [paths(8, 2048, 2), vpls(8)] {
                let what = format!("{} past {sheets} sheets of {alpha}, {}", config.method.name, camera.name);
                let got = mean(&picture(&mut renderer, &config, &camera));
                let tolerance = if config.method == &path::METHOD { 0.03 } else { 2e-4 };
                if seen * left == 0.0 {
                    assert_eq!(got, 0.0, "{what}");
                } else {
                    assert_close(&what, got, lit * left * seen, tolerance);
                }
            }
        }
    }
}

/// A stack of panes in sight takes no specular bounce and no edge: what is behind is lit as if alone.
#[test]
fn panes_in_sight_are_no_bounce() {
    let Some((_guard, device)) = common::device() else { return };
    let heights: Vec<f32> = (0..8).map(|i| 1.0 + 0.25 * i as f32).collect();
    let mut scene = under(&heights, pane(Vec3::ONE, 1.0));
    scene.lights = vec![sun(Vec3::NEG_Y, PI)];
    let camera = Camera::look_at("above", Vec3::new(0.0, 9.0, 0.0), Vec3::new(0.05, 0.0, 0.05), 0.02);
    let mut renderer = renderer(&device, scene, Backend::Software);
    let expected = 0.5 * thin_wall(1.0).powi(16);
    let mut config = vpls(4);
    config.whitted.specular_depth = 0;
    assert_close("without a bounce", mean(&picture(&mut renderer, &config, &camera)), expected, 1e-4);
    let (got, error) = estimate(&mut renderer, &paths(4, 512, 2), &camera, 4);
    println!("path: {got} ± {error}, expected {expected}");
    assert!((got - expected).abs() < 4.5 * error && error < 0.03 * expected);
}

// ---- estimators against each other ----

/// A floor under panes and a lamp, or a sky.
fn glazed(lamp: bool, count: usize, material: Material) -> Scene {
    let square = |y: f32, half: f32, material: u32| {
        quad(Vec3::new(-half, y, -half), Vec3::X * (2.0 * half), Vec3::Z * (2.0 * half), material)
    };
    let mut meshes = vec![square(0.0, 2.0, 0)];
    meshes.extend((0..count).map(|i| square(0.6 + 0.1 * i as f32, 3.0, 1)));
    let shine = Material { emission: Vec3::splat(2.0), ..gray(0.2) };
    if lamp {
        meshes.push(square(1.6, 1.5, 2));
    }
    let mut scene = scene(meshes, vec![gray(0.5), material, shine]);
    if !lamp {
        scene.environment = Some(Environment::constant(Vec3::ONE).into());
    }
    scene
}

#[test]
fn asking_for_light_through_panes_changes_no_mean() {
    let Some((_guard, device)) = common::device() else { return };
    let camera = Camera::look_at("under", Vec3::new(0.3, 0.5, 0.9), Vec3::ZERO, 0.6);
    let tinted = pane(Vec3::new(0.9, 0.7, 0.5), 1.0);
    let half = Material { specular_color: Vec3::new(1.0, 0.5, 0.2), ..pane(Vec3::splat(0.9), 0.5) };
    let both = Material {
        base_color: Vec4::new(0.9, 0.8, 0.7, 0.7),
        alpha_mode: AlphaMode::Blend,
        ..pane(Vec3::ONE, 1.0)
    };
    for lamp in [true, false] {
        for (count, material) in [(1, &tinted), (6, &pane(Vec3::ONE, 1.0)), (2, &half), (2, &both)] {
            let mut renderer = renderer(&device, glazed(lamp, count, material.clone()), Backend::Software);
            for depth in 2..=4 {
                let config = paths(8, 64, depth);
                let mut naive = paths(8, 192, depth);
                naive.path_trace.estimator = Estimator::Naive;
                let what = format!(
                    "{count} panes of transmission {}, {}, depth {depth}",
                    material.transmission,
                    if lamp { "lamp" } else { "sky" }
                );
                let asked = estimate(&mut renderer, &config, &camera, 6);
                assert_equal(&what, asked, estimate(&mut renderer, &naive, &camera, 6));
            }
        }
    }
}

/// A closed room of two glazed sides under a sky and a sun, something in it.
fn room(material: Material) -> (Scene, Camera) {
    let q = quad;
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let o = Vec3::new(-1.0, 0.0, -1.0);
    let meshes = vec![
        q(o, z * 2.0, x * 2.0, 0),
        q(o, x * 2.0, y * 2.0, 0),
        q(o, y * 2.0, z * 2.0, 0),
        q(o + y * 2.0, x * 2.0, z * 2.0, 1),
        q(o + x * 2.0, z * 2.0, y * 2.0, 1),
        q(o + z * 2.0, y * 2.0, x * 2.0, 0),
        q(Vec3::new(-0.4, 0.0, -0.3), y * 0.8, z * 0.5, 0),
    ];
    let mut scene = scene(meshes, vec![gray(0.6), material]);
    scene.environment = Some(Environment::constant(Vec3::new(0.4, 0.5, 0.7)).into());
    scene.lights = vec![sun(Vec3::new(-0.7, -1.0, 0.3), 2.0), point(Vec3::new(0.2, 2.6, 0.1), 1.0)];
    (scene, Camera::look_at("room", Vec3::new(0.8, 1.2, 0.9), Vec3::new(-0.6, 0.5, -0.6), 0.9))
}

#[test]
fn virtual_point_lights_shine_through_panes() {
    let Some((_guard, device)) = common::device() else { return };
    let half = pane(Vec3::splat(0.8), 0.5);
    for (what, material) in
        [("panes", pane(Vec3::new(0.9, 0.8, 1.0), 1.0)), ("half panes", half), ("veils", veil(0.4))]
    {
        let (scene, camera) = room(material);
        let mut renderer = renderer(&device, scene, Backend::Software);
        let mut config = vpls(10);
        // Rays count diffuse bounces alone, as light paths do: in the end all light is there.
        config.vpl_shoot.vpls = 16384;
        config.vpl_shoot.bounces = None;
        config.indirect.min_distance = Some(0.3);
        config.indirect.compensation = 8;
        config.whitted.light_samples = 64;
        let virtual_lights = estimate(&mut renderer, &config, &camera, 24);
        let reference = estimate(&mut renderer, &paths(10, 512, 64), &camera, 4);
        assert_equal(what, virtual_lights, reference);
    }
}

/// Imperfect visibility has no boxes of panes, and still ones of what is opaque.
#[test]
fn boxes_hold_no_panes() {
    let Some((_guard, device)) = common::device() else { return };
    let clear = pane(Vec3::ONE, 1.0);
    for (material, blocks) in [(clear, false), (gray(0.0), true)] {
        // Light that goes down past the screen comes from the floor only.
        let mut scene = under(&[], gray(0.5));
        let screen = quad(Vec3::new(-20.0, 1.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0, 1);
        let wall = quad(Vec3::new(-1.0, 2.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, 0);
        scene.materials[1] = material;
        for mesh in [screen, wall] {
            scene.instances.push(Instance {
                name: String::new(),
                mesh: scene.meshes.len() as u32,
                transform: Affine3A::IDENTITY,
                moves: false,
            });
            scene.meshes.push(mesh.into());
        }
        scene.lights = vec![point(Vec3::new(0.0, 0.5, 0.0), 10.0)];
        let camera = Camera::look_at("up", Vec3::new(0.0, 1.5, 0.01), Vec3::new(0.0, 2.0, 0.0), 0.5);
        let mut renderer = renderer(&device, scene, Backend::Software);
        for visibility in
            [Visibility::Exact, Visibility::Boxes, Visibility::BoxesPlane, Visibility::BoxesInline]
        {
            let mut config = vpls(6);
            config.indirect.visibility = visibility;
            config.vpl_shoot.vpls = 64;
            config.vpl_shoot.bounces = Some(1);
            config.indirect.min_distance = Some(0.0);
            let lit = mean(&layer(&mut renderer, &config, &camera, Aov::Irradiance));
            println!("{visibility:?}, opaque {blocks}: {lit}");
            assert!(if blocks { lit < 0.2 } else { lit > 0.5 }, "{visibility:?}: {lit}");
        }
    }
}

#[test]
fn both_backends_see_through_panes() {
    let Some((_guard, device)) = common::ray_query_device() else { return };
    let mut material = pane(Vec3::new(0.9, 0.8, 0.6), 0.8);
    material.alpha_mode = AlphaMode::Blend;
    material.base_color.w = 0.6;
    let (scene, camera) = room(material);
    let mut config = vpls(12);
    config.vpl_shoot.vpls = 24;
    config.whitted.light_samples = 2;
    let draw = |backend| picture(&mut renderer(&device, scene.clone(), backend), &config, &camera);
    let (software, hardware) = (draw(Backend::Software), draw(Backend::RayQuery));
    let worst = software.iter().zip(&hardware).map(|(a, b)| (a - b).abs() / (a + 1e-3)).fold(0.0, f32::max);
    println!("largest difference: {worst:e}");
    assert!(worst < 1e-3);
}

// ---- slabs ----

#[test]
fn a_slab_passes_all_that_goes_to_and_fro_in_it() {
    let Some((_guard, device)) = common::device() else { return };
    let depth = Vec3::new(0.0, 0.4, 1.5);
    let mut scene = under(&[1.0], Material { slab: Some(depth), ..pane(Vec3::ONE, 1.0) });
    let direction = Vec3::new(0.6, -1.0, 0.2).normalize();
    scene.lights = vec![sun(direction, PI)];
    let cosine = f64::from(-direction.y);
    let r = fresnel(cosine, 1.5);
    let inside = (1.0 - (1.0 - cosine * cosine) / 2.25).sqrt();
    let mut renderer = renderer(&device, scene, Backend::Software);
    for config in [paths(6, 4, 2), vpls(6)] {
        let mut config = config;
        config.path_trace.transport = Transport::Direct;
        let data = if config.method == &path::METHOD {
            picture(&mut renderer, &config, &floor_camera())
        } else {
            layer(&mut renderer, &config, &floor_camera(), Aov::Direct)
        };
        for c in 0..3 {
            let a = (-f64::from(depth[c]) / inside).exp();
            let share = (1.0 - r).powi(2) * a / (1.0 - r * r * a * a);
            let what = format!("{}, channel {c}", config.method.name);
            assert_close(&what, mean(&channel(&data, c)), 0.5 * cosine * share, 3e-4);
        }
    }
}
