//! Downsampling, interleaving and their filters in whole pictures: against the canonical path, against crops and
//! across backends. The filters by themselves are tested beside their code.

mod common;

use common::mean;

use common::quad;

use std::collections::BTreeSet;

use glam::{Affine3A, Vec3, vec3};
use parhelion::config::RenderConfig;
use parhelion::graph::{Typical, check};
use parhelion::renderer::{self, Aov, BackendChoice, Frame, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{Camera, Instance, Light, LightKind, Material, Mesh, Scene, builtin};
use parhelion::shaders::Vpl;
use parhelion::techniques::indirect::{Filter, IndirectConfig, Pattern, Upsample, Visibility};
use parhelion::vk::{Backend, Device};
use std::sync::Arc;

const FILTERS: [Filter; 2] = [Filter::Paper, Filter::Combined];
const UPSAMPLES: [Upsample; 2] = [Upsample::Paper, Upsample::Plane];
const PATTERNS: [Pattern; 2] = [Pattern::Regular, Pattern::Irregular];

// ---- scenes ----

fn point_light(position: Vec3, intensity: f32) -> Light {
    Light {
        name: "point".into(),
        kind: LightKind::Point,
        position,
        direction: Vec3::NEG_Y,
        intensity: Vec3::splat(intensity),
    }
}

fn scene(meshes: Vec<Mesh>, materials: Vec<Material>, lights: Vec<Light>) -> Scene {
    let instances = (0..meshes.len() as u32)
        .map(|mesh| Instance { name: String::new(), mesh, transform: Affine3A::IDENTITY, moves: false })
        .collect();
    let meshes = meshes.into_iter().map(Arc::new).collect();
    Scene { name: "test".into(), meshes, instances, materials, lights, ..Scene::default() }
}

fn gray(albedo: f32) -> Material {
    Material::diffuse("gray", Vec3::splat(albedo))
}

/// Open to the sky: floor and wall that meet at 90°, a slanted board, and wires and a speck of a pixel's size before
/// them.
fn clutter() -> (Scene, Camera) {
    let mut meshes = vec![
        quad(vec3(-2.0, 0.0, -3.0), Vec3::X * 4.0, Vec3::Z * 4.0, 0),
        quad(vec3(-2.0, 0.0, -3.0), Vec3::X * 2.4, Vec3::Y * 1.6, 1),
        quad(vec3(0.1, 0.1, -2.2), vec3(0.9, 0.3, 0.5), vec3(-0.1, 0.9, -0.4), 0),
        quad(vec3(0.9, 1.5, -1.0), Vec3::X * 0.03, Vec3::Y * 0.03, 1),
    ];
    meshes.extend((0..4).map(|i| {
        let x = -0.9 + 0.37 * i as f32;
        quad(vec3(x, 0.1, -1.1), Vec3::X * 0.035, vec3(0.15, 1.5, 0.0), 0)
    }));
    let lights = vec![point_light(vec3(0.4, 2.2, -0.5), 8.0), point_light(vec3(-1.5, 0.6, -0.3), 3.0)];
    let camera = Camera::look_at("camera", vec3(0.1, 0.9, 1.2), vec3(0.0, 0.8, -2.0), 0.9);
    (scene(meshes, vec![gray(0.7), Material::diffuse("red", vec3(0.8, 0.3, 0.2))], lights), camera)
}

/// A cube of 2 m, closed, with its camera.
fn closed_box() -> (Scene, Camera) {
    let scene = builtin::closed_box(Vec3::splat(2.0), Vec3::splat(0.6), 1);
    let camera = scene.cameras[0].clone();
    (scene, camera)
}

// ---- rendering ----

fn renderer_on(device: &Device, backend: Backend, scene: Scene) -> Renderer {
    let options = RendererOptions { backend: BackendChoice::Force(backend), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

fn software(device: &Device, scene: Scene) -> Renderer {
    renderer_on(device, Backend::Software, scene)
}

fn config(size: [u32; 2], downsample: u32, interleave: u32) -> RenderConfig {
    let indirect = IndirectConfig { downsample, interleave, ..common::plain().indirect };
    let mut config = RenderConfig { size, indirect, ..common::plain() };
    config.vpl_shoot.vpls = 60;
    config.vpl_shoot.bounces = Some(2);
    config
}

/// All filters that differ, for these windows and tiles.
fn all_filters(size: [u32; 2], windows: &[(u32, u32)]) -> Vec<RenderConfig> {
    let mut all = Vec::new();
    for &(n, m) in windows {
        for (filter, upsample) in FILTERS.into_iter().flat_map(|f| UPSAMPLES.map(|u| (f, u))) {
            if n == 1 && (filter, upsample) == (Filter::Paper, Upsample::Plane) {
                continue; // nothing to upsample
            }
            for &pattern in &PATTERNS[..if m > 1 { 2 } else { 1 }] {
                let mut config = config(size, n, m);
                config.indirect = IndirectConfig { filter, upsample, pattern, ..config.indirect };
                all.push(config);
            }
        }
    }
    all
}

fn describe(c: &IndirectConfig) -> String {
    let visibility = c.visibility.name();
    let (n, m) = (c.downsample, c.interleave);
    format!(
        "{visibility}, split {:?}, {n}x, {m}x, {:?}, {:?}, {:?}, {} paths",
        c.box_split, c.filter, c.upsample, c.pattern, c.compensation
    )
}

fn picture(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera) -> Frame {
    let request = FrameRequest { aovs: &[Aov::Irradiance], ..FrameRequest::default() };
    renderer.render(config, camera, &request).unwrap()
}

fn irradiance(frame: &Frame) -> &[f32] {
    &frame.aovs[0].1.data
}

fn tapped(
    renderer: &mut Renderer,
    config: &RenderConfig,
    camera: &Camera,
    taps: &[&str],
) -> (Frame, Vec<Vec<u32>>) {
    let taps: Vec<String> = taps.iter().map(|&tap| tap.to_owned()).collect();
    let request = FrameRequest { aovs: &[Aov::Irradiance], taps: &taps, ..FrameRequest::default() };
    let frame = renderer.render(config, camera, &request).unwrap();
    let words = frame.taps.iter().map(|(_, tap)| tap.data.iter().map(|v| v.to_bits()).collect()).collect();
    (frame, words)
}

fn close(a: &[f32], b: &[f32]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-5 * b)
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

// ---- switches ----

/// A choice of each switch: visibility, box_split, downsample, upsample, interleave, pattern, filter, compensation.
const CHOICES: [usize; 8] = [4, 2, 4, 2, 3, 2, 2, 2];

fn switched(choice: [usize; 8]) -> RenderConfig {
    let mut config = config([48, 36], [1, 2, 3, 4][choice[2]], choice[4] as u32 + 1);
    config.indirect = IndirectConfig {
        visibility: Visibility::ALL[choice[0]],
        box_split: [None, Some(0.5)][choice[1]],
        upsample: UPSAMPLES[choice[3]],
        pattern: PATTERNS[choice[5]],
        filter: FILTERS[choice[6]],
        compensation: [0, 2][choice[7]],
        ..config.indirect
    };
    config
}

/// Every combination that is valid.
fn product() -> Vec<[usize; 8]> {
    let all = (0..CHOICES.iter().product()).map(|mut i: usize| {
        CHOICES.map(|n| {
            let choice = i % n;
            i /= n;
            choice
        })
    });
    all.filter(|&choice| switched(choice).validate().is_ok()).collect()
}

/// The pairs of choices that a combination holds.
fn pairs(choice: [usize; 8]) -> impl Iterator<Item = [usize; 4]> {
    (0..8).flat_map(move |a| (a + 1..8).map(move |b| [a, choice[a], b, choice[b]]))
}

/// Few combinations that hold every pair of choices that any holds: always that with the most new ones.
fn all_pairs() -> Vec<[usize; 8]> {
    let product = product();
    let mut left: BTreeSet<_> = product.iter().flat_map(|&choice| pairs(choice)).collect();
    let mut table = Vec::new();
    while !left.is_empty() {
        let new = |choice: &&[usize; 8]| pairs(**choice).filter(|pair| left.contains(pair)).count();
        let best = *product.iter().max_by_key(new).unwrap();
        pairs(best).for_each(|pair| {
            left.remove(&pair);
        });
        table.push(best);
    }
    table
}

/// The walls are parallel to the axes, so that even boxes hide nothing.
#[test]
fn every_pair_of_switches_renders_the_closed_box() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = closed_box();
    let mut renderer = software(&device, scene);
    let canonical = [0, 1].map(|choice| {
        let frame = picture(&mut renderer, &switched([0, 0, 0, 0, 0, 0, 0, choice]), &camera);
        (mean(irradiance(&frame)), mean(&frame.beauty.data))
    });
    assert!(canonical[1].0 > 1.05 * canonical[0].0, "{canonical:?}");
    let table = all_pairs();
    println!("{} of {} combinations", table.len(), product().len());
    for choice in table {
        let config = switched(choice);
        let frame = picture(&mut renderer, &config, &camera);
        let what = describe(&config.indirect);
        let (expected, beauty) = canonical[choice[7]];
        assert!(
            irradiance(&frame).iter().chain(&frame.beauty.data).all(|v| v.is_finite() && *v >= 0.0),
            "{what}"
        );
        let error = mean(irradiance(&frame)) / expected - 1.0;
        println!("{:+.2} %  {what}", 100.0 * error);
        assert!(error.abs() < 0.1, "{what}: {:+.2} %", 100.0 * error);
        let error = mean(&frame.beauty.data) / beauty - 1.0;
        assert!(error.abs() < 0.05, "beauty, {what}: {:+.2} %", 100.0 * error);
    }
}

/// Each switch by itself, where it does anything, gives the same light on both backends.
#[test]
fn every_switch_alone_is_the_same_on_both_backends() {
    let Some((_guard, device)) = common::ray_query_device() else { return };
    let (scene, camera) = closed_box();
    let [mut software, mut ray_query] =
        [Backend::Software, Backend::RayQuery].map(|backend| renderer_on(&device, backend, scene.clone()));
    let alone: [&[&str]; 11] = [
        &[],
        &["compensation=2"],
        &["visibility=boxes"],
        &["visibility=boxes-plane"],
        &["visibility=boxes", "box_split=0.5"],
        &["downsample=4"],
        &["downsample=4", "upsample=plane"],
        &["interleave=3"],
        &["interleave=2", "pattern=irregular"],
        &["interleave=3", "filter=combined"],
        &["downsample=2", "filter=combined", "upsample=plane"],
    ];
    for settings in alone {
        let mut config = config([12, 9], 1, 1);
        config.vpl_shoot.vpls = 20;
        for setting in settings {
            config.apply_override(&format!("indirect.{setting}")).unwrap();
        }
        let [a, b] = [&mut software, &mut ray_query].map(|renderer| picture(renderer, &config, &camera));
        let largest = irradiance(&a).iter().copied().fold(0.0, f32::max);
        let differ =
            irradiance(&a).iter().zip(irradiance(&b)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(largest > 0.0 && differ < 1e-4 * largest, "{settings:?}: {differ} of {largest}");
    }
    let mut config = config([12, 9], 1, 1);
    config.indirect.visibility = Visibility::BoxesInline;
    let error = ray_query.render(&config, &camera, &FrameRequest::default()).unwrap_err();
    assert!(matches!(error, renderer::Error::SoftwareOnly { visibility: "boxes-inline" }), "{error}");
}

/// The whole product is planned without a device: each plan is right and holds the passes its switches ask for.
#[test]
fn every_combination_of_switches_is_planned() {
    let (scene, _) = closed_box();
    for choice in product() {
        let config = switched(choice);
        let c = &config.indirect;
        let plan = renderer::plan(&scene, &config, &[], &Typical).unwrap();
        check(&plan).unwrap();
        let has = |name: &str| plan.passes.iter().any(|pass| pass.path == name);
        let what = describe(c);
        let (n, m) = (c.downsample, c.interleave);
        let paper = c.filter == Filter::Paper;
        assert!(has("indirect/gather"), "{what}");
        assert_eq!(has("gbuffer/geometry"), n * m > 1 || c.compensation > 0, "{what}");
        assert_eq!(has("indirect/interleave"), paper && m > 1, "{what}");
        assert_eq!(has("indirect/upsample"), paper && n > 1, "{what}");
        assert_eq!(has("indirect/combined"), !paper && n * m > 1, "{what}");
        let regathers = c.upsample == Upsample::Plane && (n > 1 || !paper && m > 1);
        assert_eq!(has("indirect/regather"), regathers, "{what}");
        assert_eq!(has("radiance_cache/request"), c.compensation > 0, "{what}");
        assert!(plan.culled.iter().all(|culled| !culled.path.starts_with("indirect")), "{what}");
    }
}

/// The words that choose among filters mean nothing where there is nothing to filter, nor does compensation where no
/// distance takes light: the same graph, the same bits.
#[test]
fn off_means_off() {
    let (scene, camera) = clutter();
    let canonical = RenderConfig { size: [32, 24], ..config([32, 24], 1, 1) };
    let mut off = canonical.clone();
    let words = (Upsample::Plane, Pattern::Irregular, Filter::Combined);
    (off.indirect.upsample, off.indirect.pattern, off.indirect.filter) = words;
    let [a, b] = [&canonical, &off].map(|config| renderer::plan(&scene, config, &[], &Typical).unwrap());
    assert_eq!(a.json(&[]), b.json(&[]));
    let extra = ["geometry", "interleave", "upsample", "combined", "regather", "missing", "compensate"];
    assert!(a.passes.iter().all(|pass| extra.iter().all(|name| !pass.path.contains(name))));
    assert!(a.resources.iter().all(|resource| extra.iter().all(|name| !resource.name.contains(name))));
    let json = |compensation| {
        let mut config = canonical.clone();
        (config.indirect.compensation, config.indirect.min_distance) = (compensation, Some(0.0));
        renderer::plan(&scene, &config, &[], &Typical).unwrap().json(&[])
    };
    assert_eq!(json(0), json(4));
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = software(&device, scene);
    let before = picture(&mut renderer, &canonical, &camera);
    assert_eq!(renderer.structures().len(), 1);
    assert_eq!(before.regathered, None);
    // Nothing stays behind from pictures with everything on.
    let mut on = off.clone();
    (on.indirect.downsample, on.indirect.interleave, on.indirect.visibility) = (4, 3, Visibility::BoxesPlane);
    on.indirect.compensation = 2;
    assert!(bits(irradiance(&picture(&mut renderer, &on, &camera))) != bits(irradiance(&before)));
    let after = picture(&mut renderer, &off, &camera);
    assert!(bits(&after.beauty.data) == bits(&before.beauty.data));
    assert!(bits(irradiance(&after)) == bits(irradiance(&before)));
}

// ---- crops and sizes ----

/// Compares crops of a picture with the whole of it.
fn assert_crops(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera, crops: &[[u32; 4]]) {
    let whole = picture(renderer, config, camera);
    let width = config.size[0];
    for &crop in crops {
        let [x0, y0, x1, y1] = crop;
        let part = picture(renderer, &RenderConfig { crop: Some(crop), ..config.clone() }, camera);
        for (part, whole) in
            [(&part.beauty.data[..], &whole.beauty.data[..]), (irradiance(&part), irradiance(&whole))]
        {
            let rows = (y0..y1).flat_map(|y| {
                whole[(3 * (y * width + x0)) as usize..(3 * (y * width + x1)) as usize].iter().copied()
            });
            let expected: Vec<f32> = rows.collect();
            let differ = part.iter().zip(&expected).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
            assert_eq!(part.len(), expected.len());
            assert_eq!(differ, 0, "{}, crop {crop:?}: of {} numbers", describe(&config.indirect), part.len());
        }
    }
}

#[test]
fn crops_hold_the_pixels_of_the_whole_picture() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = clutter();
    let mut renderer = software(&device, scene);
    let size = [61, 47];
    let windows: Vec<_> = (1..=4).flat_map(|n| (1..=3).map(move |m| (n, m))).collect();
    for config in all_filters(size, &windows) {
        assert_crops(&mut renderer, &config, &camera, &[[33, 27, 38, 31], [59, 45, 61, 47], [0, 19, 9, 20]]);
    }
    let mut sampled = config(size, 3, 2);
    sampled.pixel_samples = 2;
    sampled.indirect.filter = Filter::Combined;
    let single = picture(&mut renderer, &RenderConfig { pixel_samples: 1, ..sampled.clone() }, &camera);
    assert!(picture(&mut renderer, &sampled, &camera).beauty != single.beauty);
    assert_crops(&mut renderer, &sampled, &camera, &[[21, 17, 30, 23]]);
    sampled.indirect.upsample = Upsample::Plane;
    sampled.indirect.compensation = 3;
    for (n, m) in [(1, 1), (3, 2)] {
        (sampled.indirect.downsample, sampled.indirect.interleave) = (n, m);
        assert_crops(&mut renderer, &sampled, &camera, &[[21, 17, 30, 23]]);
    }
}

/// Pictures smaller than a window or a tile. A single pixel is its own sample.
#[test]
fn pictures_smaller_than_their_windows() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = closed_box();
    let mut renderer = software(&device, scene);
    for size in [[1, 1], [3, 2], [5, 1], [7, 13]] {
        let canonical = picture(&mut renderer, &config(size, 1, 1), &camera);
        for config in all_filters(size, &[(4, 1), (16, 1), (1, 3), (4, 3), (16, 2)]) {
            let frame = picture(&mut renderer, &config, &camera);
            let (c, what) = (&config.indirect, format!("{size:?}, {}", describe(&config.indirect)));
            assert!(irradiance(&frame).iter().all(|v| v.is_finite()), "{what}");
            // One window: its sample's light everywhere, or a pixel's own where that does not fit.
            if c.interleave == 1 && size[0].max(size[1]) <= c.downsample {
                let at = |pixel: usize| &irradiance(&canonical)[3 * pixel..3 * pixel + 3];
                let [x, y] = size.map(|side| (c.downsample / 2).min(side - 1));
                for (pixel, got) in irradiance(&frame).chunks(3).enumerate() {
                    let own = c.upsample == Upsample::Plane && close(got, at(pixel));
                    assert!(own || close(got, at((y * size[0] + x) as usize)), "{what}, pixel {pixel}");
                }
            }
            if size == [1, 1] && c.interleave == 1 {
                assert!(close(irradiance(&frame), irradiance(&canonical)), "{what}");
            }
        }
    }
}

// ---- what is filtered ----

/// A floor under a ceiling, seen from between. Squares of the floor about as large as a pixel have `albedos` in turn;
/// what they have does not change the light they get, since no light goes from floor to floor.
fn checkered(albedos: [f32; 2]) -> (Scene, Camera) {
    let mut floor = Mesh::default();
    for (x, z) in (0..40).flat_map(|x| (0..40).map(move |z| (x, z))) {
        let first = floor.positions.len() as u32;
        let o = vec3(x as f32, 0.0, z as f32) * 0.1 - vec3(2.0, 0.0, 2.0);
        floor.positions.extend([o, o + Vec3::Z * 0.1, o + vec3(0.1, 0.0, 0.1), o + Vec3::X * 0.1]);
        floor.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        floor.materials.extend([(x + z) % 2; 2]);
    }
    let ceiling = quad(vec3(-2.0, 2.0, -2.0), Vec3::X * 4.0, Vec3::Z * 4.0, 2);
    let materials = vec![gray(albedos[0]), gray(albedos[1]), gray(0.8)];
    let scene = scene(vec![floor, ceiling], materials, vec![point_light(vec3(0.3, 1.2, 0.1), 5.0)]);
    (scene, Camera::look_at("camera", vec3(0.0, 1.5, 0.4), Vec3::ZERO, 0.8))
}

/// Filters see irradiance: none of it depends on a checkerboard of black and white on the floor.
#[test]
fn irradiance_is_filtered_and_not_radiance() {
    let Some((_guard, device)) = common::device() else { return };
    let [(plain, camera), (checker, _)] = [checkered([0.5; 2]), checkered([0.0, 0.9])];
    let [mut plain, mut checker] = [plain, checker].map(|scene| software(&device, scene));
    for mut config in all_filters([32, 24], &[(4, 1), (1, 3), (3, 2)]) {
        config.vpl_shoot.bounces = Some(1);
        let aovs = [Aov::Irradiance, Aov::Albedo, Aov::Indirect];
        let request = FrameRequest { aovs: &aovs, ..FrameRequest::default() };
        let [a, b] =
            [&mut plain, &mut checker].map(|renderer| renderer.render(&config, &camera, &request).unwrap());
        let what = describe(&config.indirect);
        assert!(mean(irradiance(&a)) > 0.0);
        // Black squares leave no VPLs, so that those of the ceiling are summed in another order.
        assert!(close(irradiance(&a), irradiance(&b)), "{what}");
        let (albedo, indirect) = (&b.aovs[1].1.data, &b.aovs[2].1.data);
        assert!(albedo.contains(&0.0) && albedo.contains(&0.9));
        for ((&radiance, &albedo), &irradiance) in indirect.iter().zip(albedo).zip(irradiance(&b)) {
            let expected = albedo * irradiance / std::f32::consts::PI;
            assert!((radiance - expected).abs() <= 1e-6 * expected, "{what}: {radiance}, not {expected}");
        }
    }
}

/// A board before the sky is as bright at its silhouette as without filters.
#[test]
fn the_sky_darkens_no_silhouette() {
    let Some((_guard, device)) = common::device() else { return };
    // Lit evenly, by a wall behind the camera.
    let board = quad(vec3(-0.5, -0.5, 0.0), Vec3::X, Vec3::Y, 0);
    let wall = quad(vec3(-6.0, -6.0, 4.0), Vec3::X * 12.0, Vec3::Y * 12.0, 0);
    let scene = scene(vec![board, wall], vec![gray(0.8)], vec![point_light(vec3(0.0, 0.0, 2.0), 9.0)]);
    let camera = Camera::look_at("camera", vec3(0.0, 0.0, 2.0), Vec3::ZERO, 0.7);
    let mut renderer = software(&device, scene);
    let size = [34, 31];
    let mut base = config(size, 1, 1);
    (base.vpl_shoot.vpls, base.vpl_shoot.bounces) = (540, Some(1));
    let canonical = picture(&mut renderer, &base, &camera);
    assert!(irradiance(&canonical).contains(&0.0), "no sky");
    for mut config in all_filters(size, &[(4, 1), (1, 3), (3, 1), (2, 2), (4, 3)]) {
        config.vpl_shoot = base.vpl_shoot.clone();
        let frame = picture(&mut renderer, &config, &camera);
        let c = &config.indirect;
        let (got, expected) = (irradiance(&frame), irradiance(&canonical));
        let error = mean(got) / mean(expected) - 1.0;
        let bound = if c.interleave > 1 { 0.06 } else { 0.03 };
        assert!(error.abs() < bound, "{}: {:+.2} %", describe(c), 100.0 * error);
        for (i, (&got, &expected)) in got.iter().zip(expected).enumerate() {
            let what = format!("{}, pixel {}, {}", describe(c), i / 3 % 34, i / 102);
            // Where not every subset has a sample, at corners, a pixel has those that do: perhaps none that is lit.
            let bound = if c.interleave == 1 || expected == 0.0 { 0.06 * expected } else { f32::MAX };
            assert!((got - expected).abs() <= bound, "{what}: {got}, not {expected}");
        }
    }
}

// ---- thin things ----

/// Wires a pixel wide before a wall that is lit otherwise.
fn wires() -> (Scene, Camera) {
    let camera = Camera::look_at("camera", vec3(0.0, 0.0, 2.0), vec3(0.0, 0.0, -1.0), 0.8);
    let back = quad(vec3(-3.0, -3.0, -1.5), Vec3::X * 6.0, Vec3::Y * 6.0, 0);
    let floor = quad(vec3(-3.0, -1.2, -1.5), Vec3::X * 6.0, Vec3::Z * 5.0, 0);
    let front = quad(vec3(-3.0, -3.0, 3.5), Vec3::X * 6.0, Vec3::Y * 6.0, 0);
    let pixel = 2.0 * (0.4f32).tan() * 1.6 / 48.0;
    let places = (0..7).map(|i| -0.83 + 0.27 * i as f32);
    let mut meshes = vec![back, floor, front];
    meshes.extend(places.map(|x| quad(vec3(x, -1.1, 0.4), Vec3::X * pixel, Vec3::Y * 2.2, 0)));
    let lights = vec![point_light(vec3(0.5, 0.9, 2.6), 10.0)];
    (scene(meshes, vec![gray(0.7)], lights), camera)
}

/// Mean of |E − E'|/E' over the wires and the pixels beside them, E' without filters: below 0.1 where edges are told by
/// planes. With tiles pixels lack subsets there.
#[test]
fn wires_keep_their_light() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = wires();
    let mut renderer = software(&device, scene);
    let size = [64, 48];
    let aovs = [Aov::Irradiance, Aov::Depth];
    let mut render = |config: &RenderConfig| {
        let request = FrameRequest { aovs: &aovs, ..FrameRequest::default() };
        let mut config = config.clone();
        (config.vpl_shoot.vpls, config.vpl_shoot.bounces) = (180, Some(2));
        renderer.render(&config, &camera, &request).unwrap()
    };
    let canonical = render(&config(size, 1, 1));
    let depth = &canonical.aovs[1].1.data;
    let wire = |i: usize| (depth[i] - 1.6).abs() < 1e-3;
    let band: Vec<usize> = (1..depth.len() - 1).filter(|&i| wire(i - 1) || wire(i) || wire(i + 1)).collect();
    let on_wires = band.iter().filter(|&&i| wire(i)).count();
    assert!(on_wires > 200 && on_wires < 420, "{on_wires} pixels of wires");
    let mut errors = Vec::new();
    for config in all_filters(size, &[(4, 1), (4, 3)]) {
        let frame = render(&config);
        let error = |i: &usize| {
            let (got, expected) = (irradiance(&frame)[3 * i], irradiance(&canonical)[3 * i]);
            f64::from((got - expected).abs() / expected)
        };
        let error = band.iter().map(error).sum::<f64>() / band.len() as f64;
        println!("{:.1} %  {}", 100.0 * error, describe(&config.indirect));
        errors.push((config.indirect, error));
    }
    let of = |filter, upsample, m| {
        let fits = |c: &IndirectConfig| (c.filter, c.upsample, c.interleave) == (filter, upsample, m);
        errors.iter().filter(move |(c, _)| fits(c)).map(|(_, error)| *error).fold(0.0, f64::max)
    };
    let paper = [1, 3].map(|m| of(Filter::Paper, Upsample::Paper, m));
    let plane = [1, 3].map(|m| of(Filter::Paper, Upsample::Plane, m));
    let combined = [1, 3].map(|m| of(Filter::Combined, Upsample::Plane, m));
    assert!(plane[0] < 0.1 && combined[0] < 0.1 && paper[0] > 0.2, "{paper:?}, {plane:?}, {combined:?}");
    assert!(plane[1] < 0.6 * paper[1] && combined[1] < 0.85 * paper[1], "{paper:?}, {plane:?}, {combined:?}");
}

/// A speck a pixel wide before a wall, of which no sample knows, is gathered anew from all VPLs. So are others; their
/// number is that of the list, which names each once.
#[test]
fn pixels_without_samples_are_gathered_anew() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = clutter();
    let mut renderer = software(&device, scene);
    let size = [61, 47];
    let canonical = picture(&mut renderer, &config(size, 1, 1), &camera);
    for (filter, n, m) in
        [(Filter::Paper, 4, 1), (Filter::Paper, 4, 3), (Filter::Combined, 4, 1), (Filter::Combined, 3, 2)]
    {
        let mut config = config(size, n, m);
        (config.indirect.filter, config.indirect.upsample) = (filter, Upsample::Plane);
        let pass = if filter == Filter::Paper { "upsample" } else { "combined" };
        let taps = [format!("indirect/{pass}:list"), format!("indirect/{pass}:args")];
        let (frame, tapped) = tapped(&mut renderer, &config, &camera, &[&taps[0], &taps[1]]);
        let what = describe(&config.indirect);
        let ([list, args], [x, y]) = ([&tapped[0], &tapped[1]], size);
        let count = frame.regathered.unwrap();
        assert!((count > 0 || m > 1) && count < x * y / 4, "{what}: {count}");
        assert_eq!((args[3], args[0]), (count, count.div_ceil(4)), "{what}");
        let listed: BTreeSet<u32> = list.iter().take(count as usize).copied().collect();
        assert_eq!(listed.len(), count as usize, "{what}: a pixel is listed twice");
        for place in listed {
            let (px, py) = (place & 0xffff, place >> 16);
            assert!(px < x && py < y, "{what}: {px}, {py}");
            for c in 0..3 {
                let i = (3 * (py * x + px) + c) as usize;
                let (got, expected) = (irradiance(&frame)[i], irradiance(&canonical)[i]);
                assert!(
                    (got - expected).abs() <= 2e-6 * expected,
                    "{what}: {got}, not {expected} at {px}, {py}"
                );
            }
        }
    }
}

/// The more subsets must fit, the more pixels are gathered anew, those of less among them, and the less is wrong.
#[test]
fn pixels_that_few_subsets_fit_are_gathered_anew() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = clutter();
    let mut renderer = software(&device, scene);
    let size = [61, 47];
    let canonical = picture(&mut renderer, &config(size, 1, 1), &camera);
    let mut before: Option<(BTreeSet<u32>, f64)> = None;
    for least_fit in [0.0, 0.6, 1.0] {
        let mut config = config(size, 2, 3);
        (config.indirect.filter, config.indirect.upsample) = (Filter::Combined, Upsample::Plane);
        config.indirect.least_fit = least_fit;
        let (frame, tapped) = tapped(&mut renderer, &config, &camera, &["indirect/combined:list"]);
        let listed: BTreeSet<u32> =
            tapped[0].iter().take(frame.regathered.unwrap() as usize).copied().collect();
        let square = |(got, expected): (&f32, &f32)| f64::from(got - expected).powi(2);
        let wrong: f64 = irradiance(&frame).iter().zip(irradiance(&canonical)).map(square).sum();
        if let Some((fewer, more_wrong)) = before {
            assert!(fewer.is_subset(&listed) && listed.len() > fewer.len(), "{least_fit}: {}", listed.len());
            assert!(wrong < more_wrong, "{least_fit}: {wrong}, not less than {more_wrong}");
        }
        before = Some((listed, wrong));
    }
}

// ---- the list of VPLs ----

/// The list is that of the canonical path, by path and bounce, and each subset starts at a path of its own. Also where paths leave the open scene, and where there are fewer
/// paths than subsets.
#[test]
fn subsets_hold_whole_paths_in_order() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = clutter();
    let mut renderer = software(&device, scene);
    for (vpls, bounces) in [(90, 3), (300, 1), (12, 3), (1, 1), (1400, 2)] {
        let mut list = |interleave: u32| {
            let mut config = config([1, 1], 1, interleave);
            (config.vpl_shoot.vpls, config.vpl_shoot.bounces) = (vpls, Some(bounces));
            let (frame, taps) = tapped(
                &mut renderer,
                &config,
                &camera,
                &["vpl_shoot/compact:vpls", "vpl_shoot/compact:count"],
            );
            let count = frame.vpl_count.unwrap();
            assert_eq!(taps[1][0], count);
            let vpls: Vec<Vec<u32>> =
                taps[0].chunks(size_of::<Vpl>() / 4).take(count as usize).map(<[u32]>::to_vec).collect();
            (vpls, taps[1][1..].to_vec())
        };
        let (path, bounce) = (3, 7);
        let (canonical, starts) = list(1);
        assert_eq!(starts, [0, canonical.len() as u32]);
        assert!(canonical.is_sorted_by_key(|vpl| (vpl[path], vpl[bounce])));
        assert!(vpls < 10 || canonical.len() < vpls as usize, "no path leaves the scene");
        for m in [2, 3] {
            let (got, starts) = list(m);
            assert!(got == canonical, "{vpls} VPLs, {m}x");
            // As many paths in each, the rest one by one to the first.
            let (paths, subsets) = ((vpls / bounces).max(1), m * m);
            let first = |subset: u32| subset * (paths / subsets) + subset.min(paths % subsets);
            let start = |subset| canonical.partition_point(|vpl| vpl[path] < first(subset)) as u32;
            assert_eq!(starts, (0..=m * m).map(start).collect::<Vec<_>>(), "{vpls} VPLs, {m}x");
        }
    }
}
