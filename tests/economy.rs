//! Specialisation saves time and changes no picture: what the pipeline that is specialised to a scene draws, the one
//! draws that models everything for nothing.

mod common;

use common::quad;

use glam::{Affine3A, Vec2, Vec3, Vec4};
use parhelion::config::RenderConfig;
use parhelion::methods::path;
use parhelion::renderer::{Aov, BackendChoice, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{
    AlphaMode, Camera, Clearcoat, Environment, Feature, Image, Instance, Light, LightKind, Material, Mesh,
    NormalMap, Sampler, Scene, TextureRef, TextureTransform, Volume, builtin,
};
use parhelion::techniques::path_trace::Estimator;
use parhelion::vk::{Backend, Device};
use std::sync::Arc;

// ---- scenes ----

/// A room 2 m wide, open to the camera, in which `things` stand; their materials follow the two walls'.
fn room(things: Vec<Mesh>, materials: Vec<Material>) -> (Scene, Camera) {
    let wall = Material::diffuse("wall", Vec3::new(0.7, 0.6, 0.5));
    let red = Material::diffuse("red", Vec3::new(0.7, 0.2, 0.1));
    let mut meshes = vec![
        quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 3.0, Vec3::X * 2.0, 0),
        quad(Vec3::new(-1.0, 2.0, -1.0), Vec3::X * 2.0, Vec3::Z * 3.0, 0),
        quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0, 0),
        quad(Vec3::new(-1.0, 0.0, 2.0), Vec3::NEG_Z * 3.0, Vec3::Y * 2.0, 1),
        quad(Vec3::new(1.0, 0.0, -1.0), Vec3::Z * 3.0, Vec3::Y * 2.0, 1),
    ];
    meshes.extend(things);
    let instance = |mesh| Instance { name: String::new(), mesh, transform: Affine3A::IDENTITY, moves: false };
    let lamp = Light {
        name: "lamp".into(),
        kind: LightKind::Point,
        position: Vec3::new(0.3, 1.7, 0.4),
        direction: Vec3::NEG_Y,
        intensity: Vec3::new(2.0, 1.8, 1.5),
    };
    let scene = Scene {
        name: "room".into(),
        instances: (0..meshes.len() as u32).map(instance).collect(),
        meshes: meshes.into_iter().map(Arc::new).collect(),
        materials: [wall, red].into_iter().chain(materials).collect(),
        lights: vec![lamp],
        ..Scene::default()
    };
    (scene, Camera::look_at("camera", Vec3::new(0.1, 1.1, 3.2), Vec3::new(0.0, 0.9, 0.0), 0.7))
}

/// An upright slab in the middle of the room; faces away from the camera, too.
fn slab(x: f32, material: u32) -> Mesh {
    let low = Vec3::new(x - 0.2, 0.1, -0.1);
    let (dx, dy, dz) = (Vec3::X * 0.4, Vec3::Y * 1.0, Vec3::Z * 0.2);
    let faces = [
        quad(low, dy, dx, material),
        quad(low + dz, dx, dy, material),
        quad(low, dz, dy, material),
        quad(low + dx, dy, dz, material),
        quad(low, dx, dz, material),
        quad(low + dy, dz, dx, material),
    ];
    let mut mesh = Mesh::default();
    for face in faces {
        let first = mesh.positions.len() as u32;
        mesh.triangles.extend(face.triangles.iter().map(|triangle| triangle.map(|v| v + first)));
        mesh.positions.extend(face.positions);
        mesh.materials.extend(face.materials);
    }
    mesh
}

fn texture_of_image_0() -> TextureRef {
    let (sampler, transform) = (Sampler::default(), TextureTransform::default());
    TextureRef { image: 0, uv_set: 0, sampler, transform }
}

fn mirrors_and_glass() -> (Scene, Camera) {
    let mirror =
        Material { roughness: 0.0, base_color: Vec4::new(0.9, 0.8, 0.6, 1.0), ..Material::default() };
    let plastic = Material { roughness: 0.05, ..Material::diffuse("plastic", Vec3::new(0.1, 0.4, 0.2)) };
    let plastic = Material { specular: 1.0, ..plastic };
    let volume = Some(Volume { attenuation_distance: 0.5, attenuation_color: Vec3::new(0.4, 0.8, 0.5) });
    let glass = Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, volume, ..Material::default() };
    room(vec![slab(-0.6, 2), slab(0.0, 3), slab(0.6, 4)], vec![mirror, glass, plastic])
}

/// Textured slabs, and one whose material has everything that an unlit one shows nothing of.
fn textured() -> (Scene, Camera) {
    let texel = |i: u32| [(i * 97 % 256) as u8, (i * 57 % 256) as u8, 255 - (i * 31 % 256) as u8, 255];
    let image = Image { name: "checks".into(), width: 4, height: 4, texels: (0..16).map(texel).collect() };
    let texture = texture_of_image_0();
    let printed = Material { base_color_texture: Some(texture), ..Material::diffuse("printed", Vec3::ONE) };
    let normal_map = Some(NormalMap { texture, scale: 1.0 });
    let unlit = Material {
        unlit: true,
        roughness: 0.0,
        transmission: 0.5,
        volume: Some(Volume { attenuation_distance: 0.1, attenuation_color: Vec3::splat(0.1) }),
        emission: Vec3::ONE,
        emission_texture: Some(texture),
        metallic_roughness_texture: Some(texture),
        clearcoat: Some(Clearcoat { factor: 1.0, normal_map, ..Clearcoat::default() }),
        normal_map,
        ..Material::diffuse("sign", Vec3::new(0.2, 0.3, 0.9))
    };
    // Metal where the texture says so, glass elsewhere.
    let pane = Material {
        transmission: 0.5,
        volume: Some(Volume { attenuation_distance: 0.5, attenuation_color: Vec3::new(0.9, 0.5, 0.5) }),
        metallic_roughness_texture: Some(texture),
        ..Material::default()
    };
    let uv = |mut mesh: Mesh| {
        mesh.uv0 = mesh.positions.iter().map(|p| Vec2::new(p.x + p.z, p.y) * 1.7).collect();
        mesh.tangents = vec![[Vec4::new(1.0, 0.0, 0.0, 1.0); 3]; mesh.triangles.len()];
        mesh
    };
    let (mut scene, camera) =
        room(vec![uv(slab(-0.5, 2)), uv(slab(0.4, 3)), uv(slab(-0.05, 4))], vec![printed, unlit, pane]);
    scene.images = vec![image.into()];
    (scene, camera)
}

/// Light by the ceiling's lamp and from outside, through leaves with holes; one of two slabs is the other's instance.
fn lamps_and_leaves() -> (Scene, Camera) {
    let lamp = Material { emission: Vec3::new(6.0, 5.0, 4.0), ..Material::diffuse("lamp", Vec3::splat(0.3)) };
    let texels = vec![[255, 255, 255, 255], [255, 255, 255, 0], [255, 255, 255, 0], [255, 255, 255, 255]];
    let image = Image { name: "holes".into(), width: 2, height: 2, texels };
    let base_color_texture = Some(texture_of_image_0());
    let alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    let leaf =
        Material { alpha_mode, base_color_texture, ..Material::diffuse("leaf", Vec3::new(0.2, 0.5, 0.1)) };
    let mut leaves = quad(Vec3::new(-0.9, 0.2, 0.6), Vec3::X * 0.8, Vec3::Y * 1.4, 3);
    leaves.uv0 = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let lamp_quad = quad(Vec3::new(-0.3, 1.99, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6, 2);
    let (mut scene, camera) = room(vec![lamp_quad, leaves, slab(0.2, 0)], vec![lamp, leaf]);
    let transform = Affine3A::from_translation(Vec3::new(0.5, 0.0, -0.4));
    scene.instances.push(Instance { name: "again".into(), mesh: 7, transform, moves: false });
    scene.images = vec![image.into()];
    scene.lights.clear();
    scene.environment = Some(Environment::constant(Vec3::new(0.2, 0.3, 0.5)).into());
    (scene, camera)
}

fn of_builtin(name: &str) -> (Scene, Camera) {
    let scene = builtin::by_name(name).unwrap();
    let camera = scene.cameras[0].clone();
    (scene, camera)
}

// ---- settings ----

fn preset(name: &str, size: [u32; 2]) -> RenderConfig {
    let mut config = RenderConfig { size, seed: 3, ..common::plain() };
    config.apply_preset(name).unwrap();
    config.vpl_shoot.vpls = 36;
    config
}

fn glossy(size: [u32; 2]) -> RenderConfig {
    let mut config = RenderConfig { size, seed: 3, ..common::plain() };
    config.vpl_shoot.vpls = 36;
    assert!(config.indirect.glossy);
    config
}

fn paths(size: [u32; 2], estimator: Estimator) -> RenderConfig {
    let mut config = RenderConfig { method: &path::METHOD, size, seed: 3, ..common::plain() };
    (config.path_trace.spp, config.path_trace.estimator) = (4, estimator);
    config
}

// ---- comparison ----

#[derive(Clone, Copy, Debug, PartialEq)]
enum Equal {
    Bits,
    /// Within 1e-6, of what is more: the value or the picture's mean, in 99.9 % of values:
    /// all, of so few.
    Nearly,
}

fn draw(
    renderer: &mut Renderer,
    config: &RenderConfig,
    camera: &Camera,
    modelled: &[Feature],
) -> Vec<Vec<f32>> {
    let aovs: &[Aov] = match config.method.name {
        "igi" => &[Aov::Albedo, Aov::N, Aov::Direct, Aov::Indirect, Aov::Specular, Aov::Glossy],
        _ => &[Aov::Albedo, Aov::N],
    };
    let request = FrameRequest { aovs, modelled, ..FrameRequest::default() };
    let frame = renderer.render(config, camera, &request).unwrap();
    let layers = frame.aovs.into_iter().map(|(_, layer)| layer.data);
    std::iter::once(frame.beauty.data).chain(layers).collect()
}

fn share_equal(a: &[f32], b: &[f32]) -> f64 {
    let mean = a.iter().map(|v| v.abs()).sum::<f32>() / a.len() as f32;
    let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-6 * a.abs().max(mean);
    let pixels = a.chunks(3).zip(b.chunks(3));
    pixels.filter(|(a, b)| a.iter().zip(*b).all(close)).count() as f64 / (a.len() / 3) as f64
}

/// Draws specialised and with `modelled`, and compares all layers.
fn compare(
    what: &str,
    renderer: &mut Renderer,
    config: &RenderConfig,
    camera: &Camera,
    modelled: &[Feature],
    equal: Equal,
) {
    let specialised = draw(renderer, config, camera, &[]);
    assert!(specialised[0].iter().any(|&v| v > 0.0), "{what}: black");
    let general = draw(renderer, config, camera, modelled);
    for (layer, (a, b)) in specialised.iter().zip(&general).enumerate() {
        let same = a.iter().zip(b).filter(|(a, b)| a.to_bits() == b.to_bits()).count();
        let nearly = share_equal(a, b);
        println!("{what}, layer {layer}: {same} of {} bits, {:.3} % nearly", a.len(), 100.0 * nearly);
        match equal {
            Equal::Bits => assert_eq!(same, a.len(), "{what}, layer {layer}: bits differ"),
            Equal::Nearly => assert!(nearly >= 0.999, "{what}, layer {layer}: {:.3} % equal", 100.0 * nearly),
        }
    }
}

fn renderer(device: &Device, scene: Scene, backend: Backend) -> Renderer {
    let options = RendererOptions { backend: BackendChoice::Force(backend), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

/// All that a picture of `config` does not need, for nothing.
fn compare_all(what: &str, renderer: &mut Renderer, config: &RenderConfig, camera: &Camera, equal: Equal) {
    let unneeded = renderer.unneeded(config);
    assert!(unneeded.len() > 5, "{what}: {unneeded:?}");
    compare(what, renderer, config, camera, &unneeded, equal);
}

const SIZE: [u32; 2] = [24, 18];

/// Where a scene has no lobes the specialised pipeline sums irradiance, the general one radiance: another order of
/// operations. The presets count no lobes.
#[test]
fn a_diffuse_box_is_the_same() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = of_builtin("closed-box");
    let mut renderer = renderer(&device, scene, Backend::Software);
    compare_all("canonical box", &mut renderer, &preset("paper-canonical", SIZE), &camera, Equal::Bits);
    compare_all("box", &mut renderer, &glossy(SIZE), &camera, Equal::Nearly);
    compare_all("paths in a box", &mut renderer, &paths(SIZE, Estimator::Naive), &camera, Equal::Bits);
}

#[test]
fn a_furnished_room_is_the_same() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = of_builtin("office");
    let mut renderer = renderer(&device, scene, Backend::Software);
    compare_all("fast office", &mut renderer, &preset("fast", SIZE), &camera, Equal::Bits);
    compare_all("paths in the office", &mut renderer, &paths(SIZE, Estimator::Mis), &camera, Equal::Bits);
}

#[test]
fn mirrors_and_glass_are_the_same() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = mirrors_and_glass();
    let mut renderer = renderer(&device, scene, Backend::Software);
    compare_all("fast mirrors", &mut renderer, &preset("fast", SIZE), &camera, Equal::Bits);
    compare_all("mirrors", &mut renderer, &glossy(SIZE), &camera, Equal::Bits);
    compare_all("paths by mirrors", &mut renderer, &paths(SIZE, Estimator::Mis), &camera, Equal::Bits);
}

#[test]
fn textures_and_what_an_unlit_surface_hides_are_the_same() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = textured();
    let mut renderer = renderer(&device, scene, Backend::Software);
    compare_all("fast textures", &mut renderer, &preset("fast", SIZE), &camera, Equal::Bits);
    compare_all("textures", &mut renderer, &glossy(SIZE), &camera, Equal::Nearly);
    compare_all("paths to textures", &mut renderer, &paths(SIZE, Estimator::Mis), &camera, Equal::Bits);
}

#[test]
fn lamps_sky_and_holes_are_the_same() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = lamps_and_leaves();
    let mut renderer = renderer(&device, scene, Backend::Software);
    compare_all("fast lamps", &mut renderer, &preset("fast", SIZE), &camera, Equal::Bits);
    compare_all("paths to lamps", &mut renderer, &paths(SIZE, Estimator::Mis), &camera, Equal::Bits);
}

/// One by one, so that two wrongs do not make a right.
#[test]
fn each_feature_alone_changes_nothing() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = mirrors_and_glass();
    let mut renderer = renderer(&device, scene, Backend::Software);
    let config = preset("paper-canonical", [12, 9]);
    for feature in renderer.unneeded(&config) {
        compare(feature.name(), &mut renderer, &config, &camera, &[feature], Equal::Bits);
    }
}

#[test]
fn ray_queries_see_the_same() {
    let Some((_guard, device)) = common::ray_query_device() else { return };
    let (scene, camera) = mirrors_and_glass();
    let mut renderer = renderer(&device, scene, Backend::RayQuery);
    let config = preset("fast", [12, 9]);
    let unneeded = renderer.unneeded(&config);
    assert!(unneeded.contains(&Feature::Instanced) && !unneeded.contains(&Feature::DeepStructure));
    compare("ray query", &mut renderer, &config, &camera, &unneeded, Equal::Bits);
}

#[test]
fn frames_beside_are_timed_and_leave_the_picture_alone() {
    let Some((_guard, device)) = common::device() else { return };
    let (scene, camera) = of_builtin("closed-box");
    let mut renderer = renderer(&device, scene, Backend::Software);
    let config = preset("paper-canonical", [12, 9]);
    let alone = renderer.render(&config, &camera, &FrameRequest::default()).unwrap();
    assert!(alone.beside_ms.is_empty());
    let all = renderer.unneeded(&config);
    for repeat in [0, 2] {
        let request = FrameRequest { beside: &[&all, &all[..1]], repeat, ..FrameRequest::default() };
        let frame = renderer.render(&config, &camera, &request).unwrap();
        assert_eq!(frame.beside_ms.len(), 2);
        assert!(frame.beside_ms.iter().all(|ms| *ms > 0.0), "{:?}", frame.beside_ms);
        assert_eq!((frame.beauty, frame.rays), (alone.beauty.clone(), alone.rays));
    }
}
