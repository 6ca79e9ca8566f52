//! Instant global illumination with every light and every material: lights that have a size, the environment, glossy
//! lobes and clear coats, against closed forms and against the path tracer.

mod common;

use common::{assert_close, gray, mean, scene};

use common::quad;

use glam::{Affine3A, DVec3, Vec3, Vec4};
use parhelion::config::RenderConfig;
use parhelion::graph::Typical;
use parhelion::methods::path;
use parhelion::metrics;
use parhelion::renderer::{self, Aov, BackendChoice, Frame, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{
    Camera, Clearcoat, Environment, Instance, Light, LightKind, Material, Mesh, Scene, builtin,
};
use parhelion::techniques::path_trace::{PixelFilter, Transport};
use parhelion::vk::{Backend, Device};
use std::f64::consts::PI;
use std::sync::Arc;

// ---- scenes ----

/// Shines on its front only.
fn lamp(albedo: f32, radiance: Vec3) -> Material {
    Material { emission: radiance, double_sided: false, ..gray(albedo) }
}

/// Reflects by its dielectric lobe and clear coat alone.
fn black(specular: f32) -> Material {
    Material { base_color: Vec4::W, metallic: 0.0, specular, ..Material::default() }
}

fn point_light(position: Vec3, intensity: Vec3) -> Light {
    Light { name: "point".into(), kind: LightKind::Point, position, direction: Vec3::NEG_Y, intensity }
}

/// A sphere of radius 1 about the origin, its faces flat and seen from inside.
fn sphere(material: Material) -> Scene {
    let mesh = Mesh::clone(&builtin::sphere(3, Vec3::ONE).meshes[0]);
    scene(vec![Mesh { materials: vec![0; mesh.triangles.len()], ..mesh }], vec![material])
}

/// Unit squares that face each other at distance 1.
fn plates(floor: Material, ceiling: Material) -> Scene {
    let meshes = vec![
        quad(Vec3::new(-0.5, 0.0, -0.5), Vec3::Z, Vec3::X, 0),
        quad(Vec3::new(-0.5, 1.0, -0.5), Vec3::X, Vec3::Z, 1),
    ];
    scene(meshes, vec![floor, ceiling])
}

/// A glossy floor between a red wall and a gray one, under a lamp and a point light. Only the floor is in the picture, and
/// all it sees is Lambertian.
fn glossy_floor(floor: Material) -> (Scene, Camera) {
    let red = Material::diffuse("red", Vec3::new(0.7, 0.2, 0.1));
    let meshes = vec![
        quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, 0),
        quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::X * 4.0, Vec3::Y * 3.0, 1),
        quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Y * 3.0, Vec3::Z * 4.0, 2),
        quad(Vec3::new(-0.6, 2.5, -1.2), Vec3::X * 1.0, Vec3::Z * 0.8, 3),
    ];
    let materials = vec![floor, red, gray(0.6), lamp(0.0, Vec3::new(6.0, 5.0, 4.0))];
    let mut scene = scene(meshes, materials);
    scene.lights.push(point_light(Vec3::new(1.0, 1.5, 0.4), Vec3::new(1.0, 1.5, 2.0)));
    (scene, Camera::look_at("floor", Vec3::new(0.3, 1.6, 2.6), Vec3::new(-0.2, 0.0, 0.3), 0.4))
}

fn varnish(roughness: f32) -> Material {
    let base_color = Vec3::new(0.2, 0.3, 0.6).extend(1.0);
    Material { base_color, metallic: 0.0, roughness, ..Material::default() }
}

fn gold(roughness: f32) -> Material {
    Material { base_color: Vec3::new(1.0, 0.8, 0.4).extend(1.0), roughness, ..Material::default() }
}

fn coated(roughness: f32) -> Material {
    let clearcoat = Some(Clearcoat { factor: 1.0, roughness, ..Clearcoat::default() });
    Material { clearcoat, ..varnish(0.5) }
}

// ---- measuring ----

fn renderer(device: &Device, scene: Scene, backend: Backend) -> Renderer {
    let options = RendererOptions { backend: BackendChoice::Force(backend), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

fn software(device: &Device, scene: Scene) -> Renderer {
    renderer(device, scene, Backend::Software)
}

fn config(width: u32, height: u32) -> RenderConfig {
    RenderConfig { size: [width, height], ..common::plain() }
}

fn shooting(size: u32, paths: u32, bounces: u32, min_distance: f32) -> RenderConfig {
    let mut config = config(size, size);
    config.vpl_shoot.vpls = paths * bounces;
    config.vpl_shoot.bounces = Some(bounces);
    config.indirect.min_distance = Some(min_distance);
    config
}

/// The path tracer at the positions that `igi` takes.
fn reference(size: u32, spp: u32, max_depth: u32, transport: Transport) -> RenderConfig {
    let mut config = RenderConfig { method: &path::METHOD, seed: 1000, ..config(size, size) };
    config.path_trace.spp = spp;
    config.path_trace.max_depth = Some(max_depth);
    config.path_trace.transport = transport;
    config.path_trace.pixel_filter = PixelFilter::Center;
    config
}

fn picture(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera, aovs: &[Aov]) -> Frame {
    let frame = renderer.render(config, camera, &FrameRequest { aovs, ..FrameRequest::default() }).unwrap();
    assert!(frame.beauty.data.iter().all(|v| v.is_finite() && *v >= 0.0));
    frame
}

/// Relative error at most `error` and a bias of at most `bias`.
fn assert_equal(what: &str, image: &[f32], reference: &[f32], error: f64, bias: f64) {
    let (is, off) = (metrics::rel_mse(image, reference), metrics::signed_bias(image, reference));
    println!("{what}: relMSE {is:.2e}, bias {:+.2} %", 100.0 * off);
    assert!(is <= error, "{what}: relMSE {is}");
    assert!(off.abs() <= bias, "{what}: bias {off}");
}

// ---- closed forms ----

/// A closed sphere that shines all over: direct light π L, and k bounces add π L (ρ + … + ρ^k), everywhere the same. Of a
/// lamp that shines on both sides what leaves the sphere is lost.
#[test]
fn a_shining_sphere_fills_itself() {
    let Some((_guard, device)) = common::device() else { return };
    let (rho, radiance) = (0.5, Vec3::new(0.5, 1.0, 2.0));
    let camera = Camera::look_at("centre", Vec3::new(0.02, 0.03, 0.01), Vec3::Z, 1.0);
    for double_sided in [false, true] {
        let shining = Material { double_sided, ..lamp(rho, radiance) };
        let mut renderer = software(&device, sphere(shining));
        for bounces in [1, 4] {
            let mut config = shooting(16, 1024, bounces, 0.0);
            config.whitted.light_samples = 64;
            let frame = picture(&mut renderer, &config, &camera, &[Aov::Irradiance, Aov::Direct]);
            for channel in 0..3 {
                let of =
                    |data: &[f32]| mean(&data.iter().skip(channel).step_by(3).copied().collect::<Vec<_>>());
                let (l, rho) = (f64::from(radiance[channel]), f64::from(rho));
                let all = (1.0 - rho.powi(bounces as i32 + 1)) / (1.0 - rho);
                assert_close("indirect", of(&frame.aovs[0].1.data), PI * l * (all - 1.0), 0.01);
                assert_close("direct", of(&frame.aovs[1].1.data), l + rho * l, 0.01);
            }
        }
    }
}

/// A constant environment of radiance L above a plane of albedo ρ: π L of irradiance, ρ L of radiance; L around it.
#[test]
fn a_plane_under_a_constant_sky() {
    let Some((_guard, device)) = common::device() else { return };
    let plane = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 0);
    let mut scene = scene(vec![plane], vec![gray(0.4)]);
    let sky = Vec3::new(1.0, 2.0, 4.0);
    scene.environment = Some(Environment::constant(sky).into());
    let mut renderer = software(&device, scene);
    let mut config = config(16, 16);
    for (samples, tolerance) in [(16, 0.01), (600, 1e-3)] {
        config.whitted.light_samples = samples;
        let camera = Camera::look_at("above", Vec3::new(0.0, 2.0, 0.1), Vec3::ZERO, 0.5);
        let frame = picture(&mut renderer, &config, &camera, &[Aov::Direct]);
        let green: Vec<f32> = frame.aovs[0].1.data.iter().skip(1).step_by(3).copied().collect();
        assert_close(&format!("{samples} samples"), mean(&green), 0.8, tolerance);
        assert_eq!(frame.beauty.data, frame.aovs[0].1.data, "nothing faces the plane");
    }
    let up = Camera::look_at("up", Vec3::Y, Vec3::new(0.1, 3.0, 0.0), 0.5);
    let frame = picture(&mut renderer, &config, &up, &[]);
    assert!(frame.beauty.data.chunks_exact(3).all(|texel| texel == sky.to_array()));
}

/// White surfaces in a constant environment are invisible once all bounces count: two facing squares, between which
/// what is left after k bounces falls by more than 0.2^k.
#[test]
fn white_plates_vanish_in_a_furnace() {
    let Some((_guard, device)) = common::device() else { return };
    let mut scene = plates(gray(1.0), gray(1.0));
    scene.environment = Some(Environment::constant(Vec3::ONE).into());
    let camera = Camera::look_at("floor", Vec3::new(0.0, 0.7, 1.5), Vec3::ZERO, 0.2);
    let mut config = shooting(16, 4096, 5, 0.0);
    config.whitted.light_samples = 256;
    let mut renderer = software(&device, scene);
    let mut shown = |config: &RenderConfig| {
        let frame = picture(&mut renderer, config, &camera, &[Aov::Direct]);
        let worst = frame.beauty.data.iter().map(|v| (v - 1.0).abs()).fold(0.0, f32::max);
        assert!(worst < 0.1, "{worst}");
        let direct = mean(&frame.aovs[0].1.data);
        assert!(direct < 0.9, "direct light alone is not all, but {direct}");
        mean(&frame.beauty.data)
    };
    // Paths that are aimed vary more from seed to seed.
    let aimed = (1..=4).map(|seed| shown(&RenderConfig { seed, ..config.clone() })).sum::<f64>() / 4.0;
    assert_close("radiance by paths that are aimed", aimed, 1.0, 0.01);
    config.vpl_shoot.guided = false;
    assert_close("radiance", shown(&config), 1.0, 0.01);
}

/// A mirror and a clear coat show the environment, by Fresnel's share; the coat over black nothing else.
#[test]
fn mirrors_and_clear_coats_show_the_environment() {
    let Some((_guard, device)) = common::device() else { return };
    let texels: Vec<Vec3> = (0..32).map(|i| Vec3::new(1.0 + i as f32, 2.0, (i % 7) as f32)).collect();
    let sky = Environment { name: "sky".into(), width: 8, height: 4, texels };
    let mirror = Material { base_color: Vec4::ONE, metallic: 1.0, roughness: 0.0, ..Material::default() };
    let coat = Clearcoat { factor: 0.5, ..Clearcoat::default() };
    let coated = Material { clearcoat: Some(coat), ..black(0.0) };
    for (what, material, share) in [("mirror", mirror, 1.0), ("coat", coated, 0.5)] {
        let square = quad(Vec3::new(-9.0, -9.0, 0.0), Vec3::X * 18.0, Vec3::Y * 18.0, 0);
        let mut scene = scene(vec![square], vec![material]);
        scene.environment = Some(sky.clone().into());
        let mut renderer = software(&device, scene);
        for degrees in [10.0f32, 60.0, 80.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let camera = Camera::look_at("", Vec3::new(-sin, 0.0, cos), Vec3::ZERO, 0.01);
            let frame = picture(&mut renderer, &config(1, 1), &camera, &[Aov::Specular]);
            let fresnel = if what == "coat" { 0.04 + 0.96 * (1.0 - cos).powi(5) } else { 1.0 };
            let expected = share * fresnel * sky.radiance(Vec3::new(sin, 0.0, cos));
            for (channel, &value) in frame.beauty.data.iter().enumerate() {
                assert_close(&format!("{what}, {degrees}°"), value.into(), expected[channel].into(), 2e-3);
            }
            assert_eq!(frame.beauty.data, frame.aovs[0].1.data);
        }
    }
}

/// Share of light that GGX facets which mirror all of it send on at cosine `mu`, once scattered (height-correlated
/// shadowing): ∫ D G₂ (o·h) / μ dω_h, by midpoints of the distribution of slopes.
fn ggx_albedo(mu: f64, roughness: f64) -> f64 {
    const N: u32 = 1024;
    let alpha2 = roughness.powi(4);
    let lambda = |cosine: f64| 0.5 * ((1.0 + alpha2 * (1.0 / (cosine * cosine) - 1.0)).sqrt() - 1.0);
    let o = DVec3::new((1.0 - mu * mu).sqrt(), 0.0, mu);
    let mut sum = 0.0;
    for i in 0..N * N {
        let [u, v] = [i / N, i % N].map(|i| (f64::from(i) + 0.5) / f64::from(N));
        let tan2 = alpha2 * u / (1.0 - u);
        let (cos, sin) = ((1.0 + tan2).sqrt().recip(), (tan2 / (1.0 + tan2)).sqrt());
        let (y, x) = (2.0 * PI * v).sin_cos();
        let h = DVec3::new(sin * x, sin * y, cos);
        let below = 2.0 * o.dot(h) * h - o;
        if o.dot(h) > 0.0 && below.z > 0.0 {
            sum += o.dot(h) / (mu * cos * (1.0 + lambda(mu) + lambda(below.z)));
        }
    }
    sum / f64::from(N * N)
}

/// Rough white metal in a white sky shows its directional albedo, without specks at the default samples; behind a mirror,
/// too.
#[test]
fn rough_metal_under_a_constant_sky_shows_its_albedo() {
    let Some((_guard, device)) = common::device() else { return };
    assert!((ggx_albedo(0.3, 0.35) - 0.915).abs() < 2e-3, "{}", ggx_albedo(0.3, 0.35));
    // A floor, and a mirror that hides next to nothing of the sky.
    let meshes = vec![
        quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, 0),
        quad(Vec3::new(4.0, 2.9, -0.1), Vec3::Z * 0.2, Vec3::Y * 0.2, 1),
    ];
    let white =
        |roughness| Material { base_color: Vec4::ONE, metallic: 1.0, roughness, ..Material::default() };
    for roughness in [0.11, 0.35, 0.5] {
        let mut scene = scene(meshes.clone(), vec![white(roughness), white(0.0)]);
        scene.environment = Some(Environment::constant(Vec3::ONE).into());
        let mut renderer = software(&device, scene);
        for mu in [1.0_f32, 0.5_f32.sqrt(), 0.3] {
            let expected = ggx_albedo(mu.into(), roughness.into());
            let eye = 5.0 * Vec3::new(1e-3, mu, (1.0 - mu * mu).sqrt());
            let camera = Camera::look_at("", eye, Vec3::ZERO, 0.01);
            let mut see = |samples, size| {
                let mut config = shooting(size, 1, 1, 0.0);
                config.whitted.light_samples = samples;
                picture(&mut renderer, &config, &camera, &[]).beauty.data
            };
            let name = format!("roughness {roughness}, cosine {mu}");
            assert_close(&name, mean(&see(512, 8)), expected, 2e-3);
            let few = see(16, 16);
            let deviation =
                few.iter().map(|&v| (f64::from(v) - expected).powi(2)).sum::<f64>() / few.len() as f64;
            assert!(deviation.sqrt() < 0.05 * expected, "{name}: deviation {}", deviation.sqrt());
            assert!(few.iter().all(|&v| v < 1.2), "{name}");
        }
        let mu = 0.6;
        let camera = Camera::look_at("", Vec3::new(0.0, 6.0, 0.0), Vec3::new(4.0, 3.0, 0.0), 0.01);
        let mut config = shooting(8, 1, 1, 0.0);
        config.whitted.light_samples = 512;
        let seen = picture(&mut renderer, &config, &camera, &[Aov::Specular]);
        assert_eq!(seen.beauty.data, seen.aovs[0].1.data);
        let expected = ggx_albedo(mu, roughness.into());
        assert_close(&format!("roughness {roughness}, mirrored"), mean(&seen.beauty.data), expected, 2e-3);
    }
}

/// Parallel unit squares at distance 1, one of which shines: the other gets π L F, the form factor F = 0.1998 (Howell's
/// catalogue, C-11), and sends ρ π L F² back by one bounce.
#[test]
fn a_lamp_lights_a_plate_and_gets_some_back() {
    let Some((_guard, device)) = common::device() else { return };
    let rho = 0.8;
    let mut renderer = software(&device, plates(gray(rho), lamp(1.0, Vec3::ONE)));
    let above = |y: f32, to: f32| {
        let view = parhelion::scene::View::Orthographic { ymag: 0.5 };
        Camera { view, ..Camera::look_at("", Vec3::new(0.0, y, 0.0), Vec3::new(0.0, to, 1e-4), 1.0) }
    };
    let mut config = shooting(16, 8192, 1, 0.0);
    config.whitted.light_samples = 256;
    let down = picture(&mut renderer, &config, &above(0.5, 0.0), &[Aov::Direct, Aov::Irradiance]);
    assert_close("direct", mean(&down.aovs[0].1.data), f64::from(rho) * 0.1998, 0.01);
    let up = picture(&mut renderer, &config, &above(0.5, 1.0), &[Aov::Irradiance]);
    // Light that bounced where the form factor is larger comes back more.
    let back = mean(&up.aovs[0].1.data) / (f64::from(rho) * PI * 0.1998 * 0.1998);
    assert!((1.0..1.2).contains(&back), "{back}");
}

// ---- against the path tracer ----

/// Direct light on glossy surfaces, by a point light, lamps large and small, one of them turned away, and skies, is the path
/// tracer's.
#[test]
fn direct_light_on_glossy_surfaces_is_the_path_tracers() {
    let Some((_guard, device)) = common::device() else { return };
    let texels = (0..128)
        .map(|i| if i == 42 { Vec3::new(20.0, 15.0, 9.0) } else { Vec3::splat(0.01 * (i % 9) as f32) });
    let spotted = Environment { name: "spotted".into(), width: 16, height: 8, texels: texels.collect() };
    let constant = Environment::constant(Vec3::new(0.2, 0.3, 0.5));
    let floors = [
        ("varnish", varnish(0.4), 1e-3, 6e-3),
        ("gold", gold(0.5), 1e-3, 6e-3),
        ("coat", coated(0.4), 1e-3, 6e-3),
        ("polished gold", gold(0.3), 4e-3, 12e-3),
    ];
    for (what, floor, error, bias) in floors {
        for sky in [None, Some(&constant), Some(&spotted)] {
            let (mut scene, camera) = glossy_floor(floor.clone());
            let small = lamp(0.0, Vec3::new(12.0, 25.0, 50.0));
            scene.materials.extend([small, lamp(0.0, Vec3::splat(9.0))]);
            for (origin, side, up, material) in [
                (Vec3::new(0.4, 0.9, -0.6), Vec3::X * 0.1, Vec3::Z * 0.1, 4),
                (Vec3::new(-1.2, 0.6, -0.8), Vec3::Z * 0.5, Vec3::X * 0.5, 5),
            ] {
                let mesh = scene.meshes.len() as u32;
                scene.meshes.push(quad(origin, side, up, material).into());
                scene.instances.push(Instance {
                    name: String::new(),
                    mesh,
                    transform: Affine3A::IDENTITY,
                    moves: false,
                });
            }
            scene.environment = sky.cloned().map(Arc::new);
            let sky = sky.map_or("no sky", |sky| &sky.name);
            let mut renderer = software(&device, scene);
            let mut config = config(12, 12);
            config.whitted.light_samples = 512;
            let direct = picture(&mut renderer, &config, &camera, &[Aov::Direct]).aovs.remove(0).1.data;
            let path = reference(12, 1024, 2, Transport::Direct);
            let expected = picture(&mut renderer, &path, &camera, &[]).beauty.data;
            assert_equal(&format!("{what}, {sky}"), &direct, &expected, error, bias);
            config.indirect.glossy = false;
            let dull = picture(&mut renderer, &config, &camera, &[Aov::Direct]).aovs.remove(0).1.data;
            let [dull, all] = [&dull, &direct].map(|image| metrics::rel_mse(image, &expected));
            assert!(dull > 3.0 * all, "{what}: without lobes the error is {dull}, not more than {all}");
        }
    }
}

/// With one bounce off Lambertian walls, by VPLs in the diffuse part and in the lobe.
#[test]
fn one_bounce_on_glossy_surfaces_is_the_path_tracers() {
    let Some((_guard, device)) = common::device() else { return };
    for (what, floor) in [("varnish", varnish(0.4)), ("gold", gold(0.5)), ("coat", coated(0.4))] {
        let (scene, camera) = glossy_floor(floor);
        let mut renderer = software(&device, scene);
        let mut config = shooting(16, 4096, 1, 0.02);
        config.whitted.light_samples = 512;
        let frame = picture(&mut renderer, &config, &camera, &[Aov::Glossy, Aov::Direct]);
        let expected =
            picture(&mut renderer, &reference(16, 2048, 3, Transport::Full), &camera, &[]).beauty.data;
        assert_equal(what, &frame.beauty.data, &expected, 5e-3, 0.01);
        let share = mean(&frame.aovs[0].1.data) / mean(&frame.beauty.data);
        assert!(share > 0.01, "{what}: the lobe's share is {share}");
        // Light that bounced, apart from the rest.
        let direct = &frame.aovs[1].1.data;
        let part = |all: &[f32]| mean(all) - mean(direct);
        assert_close(&format!("{what}, bounced"), part(&frame.beauty.data), part(&expected), 0.03);
    }
}

/// Light of a sky with a bright spot, and of a lamp that shines on both sides, by one bounce between plates.
#[test]
fn one_bounce_of_a_sky_is_the_path_tracers() {
    let Some((_guard, device)) = common::device() else { return };
    let mut scene = plates(gray(0.8), gray(0.5));
    let texels =
        (0..32).map(|i| if i == 11 { Vec3::new(30.0, 20.0, 10.0) } else { Vec3::splat(0.3) }).collect();
    scene.environment = Some(Environment { name: "sky".into(), width: 8, height: 4, texels }.into());
    scene.materials.push(Material { double_sided: true, ..lamp(0.2, Vec3::new(1.0, 2.0, 3.0)) });
    scene.meshes.push(quad(Vec3::new(0.6, 0.2, -0.3), Vec3::Z * 0.6, Vec3::Y * 0.6, 2).into());
    scene.instances.push(Instance {
        name: String::new(),
        mesh: 2,
        transform: Affine3A::IDENTITY,
        moves: false,
    });
    let camera = Camera::look_at("floor", Vec3::new(0.0, 0.7, 1.5), Vec3::ZERO, 0.2);
    let mut renderer = software(&device, scene);
    let mut indirect = vec![0.0; 3 * 16 * 16];
    // Most paths miss what lies between the plates.
    for seed in 0..8 {
        let config = RenderConfig { seed, ..shooting(16, 16384, 1, 0.02) };
        let one = picture(&mut renderer, &config, &camera, &[Aov::Indirect]).aovs.remove(0).1.data;
        indirect.iter_mut().zip(one).for_each(|(sum, v)| *sum += 0.125 * v);
    }
    let path = reference(16, 4096, 3, Transport::DiffuseIndirect);
    let expected = picture(&mut renderer, &path, &camera, &[]).beauty.data;
    assert_equal("indirect", &indirect, &expected, 2e-3, 0.015);
}

/// A mirror before a glossy floor shows what the camera would see from behind it.
#[test]
fn glossy_surfaces_behind_a_mirror_look_the_same() {
    let Some((_guard, device)) = common::device() else { return };
    let mirror = Material { metallic: 1.0, roughness: 0.0, ..Material::default() };
    let floor = quad(Vec3::new(-8.0, 0.0, -8.0), Vec3::Z * 16.0, Vec3::X * 8.0, 0);
    let lamps = quad(Vec3::new(-3.0, 2.0, -1.0), Vec3::X, Vec3::Z, 1);
    let block = quad(Vec3::new(-4.0, 0.0, -1.0), Vec3::Y, Vec3::Z * 2.0, 2);
    let all = vec![floor, lamps, block];
    let mut materials = vec![varnish(0.3), lamp(0.0, Vec3::splat(3.0)), gray(0.5), mirror];
    let lights = vec![point_light(Vec3::new(-1.0, 1.0, 0.5), Vec3::ONE)];
    let mut with_mirror = all.clone();
    with_mirror.push(quad(Vec3::new(0.0, -1.0, -20.0), Vec3::Y * 20.0, Vec3::Z * 40.0, 3));
    let with_mirror = Scene { lights: lights.clone(), ..scene(with_mirror, materials.clone()) };
    materials.pop();
    let without = Scene { lights, ..scene(all, materials) };
    // Narrow enough that nothing but the floor shows.
    let (eye, target) = (Vec3::new(-2.0, 1.5, 0.0), Vec3::new(0.0, 0.7, 0.05));
    let flip = |v: Vec3| Vec3::new(-v.x, v.y, v.z);
    let mut config = shooting(16, 64, 1, 0.1);
    config.whitted.light_samples = 1024;
    let seen =
        picture(&mut software(&device, with_mirror), &config, &Camera::look_at("", eye, target, 0.2), &[]);
    let camera = Camera::look_at("", flip(eye), flip(target), 0.2);
    let direct = picture(&mut software(&device, without), &config, &camera, &[Aov::Direct]);
    // VPLs differ: the mirror throws light paths back. Direct light, most of all there is, does not.
    let mirrored: Vec<f32> = (0..16 * 16)
        .flat_map(|i| {
            let at = 3 * (16 * (i / 16) + 15 - i % 16);
            direct.beauty.data[at..at + 3].to_vec()
        })
        .collect();
    assert!(mean(&direct.aovs[0].1.data) > 0.7 * mean(&direct.beauty.data));
    assert_equal("mirrored", &seen.beauty.data, &mirrored, 2e-2, 0.05);
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    0.5 * (values[values.len() / 2] + values[(values.len() - 1) / 2])
}

/// Median over eight seeds of the error of indirect light against the path tracer, for each number of VPLs.
fn errors(device: &Device, scene: Scene, camera: &Camera, size: u32, distance: Option<f32>) -> [f64; 4] {
    let mut renderer = software(device, scene);
    let path = reference(size, 4096, 3, Transport::DiffuseIndirect);
    let expected = picture(&mut renderer, &path, camera, &[]).beauty.data;
    [64, 256, 1024, 4096].map(|vpls| {
        let error = |seed| {
            let mut config = RenderConfig { seed, ..shooting(size, vpls, 1, 0.0) };
            config.indirect.min_distance = distance;
            let frame = picture(&mut renderer, &config, camera, &[Aov::Indirect]);
            metrics::rel_mse(&frame.aovs[0].1.data, &expected)
        };
        median((1..=8).map(error).collect())
    })
}

/// More VPLs near the path tracer's indirect light, although the default distance leaves some of it out.
#[test]
fn more_vpls_come_nearer_to_the_path_tracer() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = builtin::by_name("cornell").unwrap();
    let camera = scene.cameras[0].clone();
    let errors = errors(&device, scene, &camera, 16, None);
    println!("{errors:?}");
    assert!(errors.windows(2).all(|pair| pair[1] < 0.7 * pair[0]), "{errors:?}");
    assert!(errors[3] < 0.02, "{errors:?}");
}

/// In an empty box, at points that lie off its edges, variance without any distance falls as 1/N or faster.
#[test]
fn variance_falls_with_the_number_of_vpls() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = builtin::closed_box(Vec3::new(2.0, 1.5, 3.0), Vec3::splat(0.6), 1);
    let camera = Camera::look_at("", Vec3::new(1.0, 0.75, 2.0), Vec3::new(1.0, 0.75, 0.0), 0.5);
    let errors = errors(&device, scene, &camera, 8, Some(0.0));
    let slope = (errors[3] / errors[0]).ln() / 64.0f64.ln();
    println!("{errors:?}, slope {slope:.2}");
    assert!((-1.7..-0.8).contains(&slope), "{errors:?}: slope {slope}");
}

// ---- the picture as a whole ----

/// All at once: a lamp, a point light, a sky, a mirror, glossy surfaces and clear coats.
fn everything() -> (Scene, Camera) {
    let (mut scene, _) = glossy_floor(varnish(0.3));
    let meshes = [
        quad(Vec3::new(-1.5, 0.05, -1.0), Vec3::X * 0.8, Vec3::new(0.0, 0.8, -0.4), 4),
        quad(Vec3::new(-0.5, 0.05, -1.0), Vec3::X * 0.8, Vec3::new(0.0, 0.8, -0.4), 5),
        quad(Vec3::new(0.5, 0.05, -1.0), Vec3::X * 0.8, Vec3::new(0.0, 0.8, -0.4), 6),
    ];
    for mesh in meshes {
        let index = scene.meshes.len() as u32;
        scene.meshes.push(mesh.into());
        scene.instances.push(Instance {
            name: String::new(),
            mesh: index,
            transform: Affine3A::IDENTITY,
            moves: false,
        });
    }
    let mirror = Material { roughness: 0.0, ..gold(0.0) };
    scene.materials.extend([mirror, coated(0.0), coated(0.4)]);
    scene.environment = Some(Environment::constant(Vec3::new(0.2, 0.3, 0.5)).into());
    (scene, Camera::look_at("all", Vec3::new(0.3, 1.6, 2.6), Vec3::new(-0.2, 0.2, -0.4), 0.7))
}

fn small() -> RenderConfig {
    shooting(24, 64, 2, 0.2)
}

/// Beauty is the sum of its parts, and each has some of it.
#[test]
fn parts_sum_to_beauty() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = everything();
    let aovs = [Aov::Direct, Aov::Specular, Aov::Indirect, Aov::Glossy];
    let frame = picture(&mut software(&device, scene), &small(), &camera, &aovs);
    for (i, &beauty) in frame.beauty.data.iter().enumerate() {
        let sum: f32 = frame.aovs.iter().map(|(_, layer)| layer.data[i]).sum();
        assert!((beauty - sum).abs() <= 1e-6 * beauty.max(1e-3), "value {i}: {beauty} and {sum}");
    }
    for (aov, layer) in &frame.aovs {
        assert!(mean(&layer.data) > 0.005 * mean(&frame.beauty.data), "{}", aov.name());
    }
}

/// Filters and tiles of irradiance leave the glossy layer as it is.
#[test]
fn accelerations_leave_lobes_alone() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = everything();
    let mut renderer = software(&device, scene);
    let plain = picture(&mut renderer, &small(), &camera, &[Aov::Glossy]);
    let mut config = small();
    config.apply_preset("fast").unwrap();
    config.vpl_shoot = small().vpl_shoot;
    config.indirect.glossy = true;
    let fast = picture(&mut renderer, &config, &camera, &[Aov::Glossy]);
    let differ = plain.aovs[0].1.data.iter().zip(&fast.aovs[0].1.data);
    assert!(differ.clone().all(|(a, b)| (a - b).abs() <= 1e-5 * a.max(1e-3)), "lobes were filtered");
    assert!(plain.beauty.data != fast.beauty.data);
}

/// A crop holds the same bits, whatever light and material, with several pixel samples too; and these differ.
#[test]
fn a_crop_holds_the_same_bits() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = everything();
    let mut renderer = software(&device, scene);
    for pixel_samples in [1, 2] {
        let mut config = RenderConfig { pixel_samples, ..small() };
        let whole = picture(&mut renderer, &config, &camera, &[]).beauty.data;
        config.crop = Some([5, 7, 19, 22]);
        let crop = picture(&mut renderer, &config, &camera, &[]).beauty.data;
        for (y, row) in crop.chunks_exact(3 * 14).enumerate() {
            let at = 3 * (24 * (y + 7) + 5);
            assert_eq!(&whole[at..at + 3 * 14], row, "row {y} of {pixel_samples} samples");
        }
    }
}

/// Ray query and software draw the same picture.
#[test]
fn backends_draw_the_same_picture() {
    let Some((_guard, device)) = common::ray_query_device() else { return };
    let (scene, camera) = everything();
    let mut config = small();
    config.size = [16, 12];
    let a = picture(&mut renderer(&device, scene.clone(), Backend::RayQuery), &config, &camera, &[]);
    let b = picture(&mut software(&device, scene), &config, &camera, &[]);
    let error = metrics::rel_mse_trimmed(&a.beauty.data, &b.beauty.data);
    assert!(error < 1e-5, "relMSE {error}");
}

/// What a scene lacks adds no pass, and the switch takes lobes out again.
#[test]
fn off_means_off() {
    let passes = |scene: &Scene, config: &RenderConfig| -> Vec<String> {
        let plan = renderer::plan(scene, config, &[], &Typical).unwrap();
        plan.passes.iter().map(|pass| pass.path.clone()).collect()
    };
    let glossy = |on| {
        let mut config = small();
        config.indirect.glossy = on;
        config
    };
    let plain = builtin::by_name("cornell").unwrap();
    let dull = passes(&plain, &glossy(false));
    assert_eq!(dull, passes(&plain, &glossy(true)));
    assert!(!dull.iter().any(|path| path.contains("glossy")));
    let (rich, _) = everything();
    let count = |config: &RenderConfig| {
        let all = passes(&rich, config);
        ["indirect/glossy", "whitted/direct"].map(|path| all.iter().filter(|p| p.starts_with(path)).count())
    };
    assert_eq!(count(&glossy(true)), [1, 1]);
    assert_eq!(count(&glossy(false)), [0, 1]);
    let mut many = glossy(true);
    many.whitted.light_samples = 1000;
    many.vpl_shoot.vpls = 2000;
    assert_eq!(count(&many), [4, 4]);
}
