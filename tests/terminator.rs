//! Facets that stand for curved surfaces: lit as those are, at the cost of nothing else.

mod common;

use common::{assert_close, gray, mean, quad};
use glam::{Affine3A, Quat, Vec3};
use parhelion::config::RenderConfig;
use parhelion::methods::path;
use parhelion::renderer::{Aov, BackendChoice, Frame, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{Camera, Environment, Instance, Light, LightKind, Material, Mesh, Scene, builtin};
use parhelion::techniques::path_trace::PixelFilter;
use parhelion::techniques::whitted::WhittedConfig;
use parhelion::vk::{Backend, Device};
use std::f32::consts::PI;

/// A geodesic sphere of radius 1 around the origin that faces outwards, its normals smooth: 20 triangles, 80, 320 …
fn ball(subdivisions: u32) -> Mesh {
    let mut mesh = Mesh::clone(&builtin::sphere(subdivisions, Vec3::ONE).meshes[0]);
    mesh.normals = mesh.positions.clone();
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh
}

/// Every triangle with corners of its own, whose normals are its own.
fn faceted(mesh: &Mesh) -> Mesh {
    let positions: Vec<Vec3> = mesh.triangles.iter().flatten().map(|&v| mesh.positions[v as usize]).collect();
    let own = |t: &[Vec3]| [(t[1] - t[0]).cross(t[2] - t[0]).normalize(); 3];
    let normals = positions.chunks_exact(3).flat_map(own).collect();
    let triangles = (0..mesh.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh { positions, normals, triangles, ..mesh.clone() }
}

fn scene(meshes: Vec<Mesh>, material: Material, lights: Vec<Light>) -> Scene {
    Scene { lights, ..common::scene(meshes, vec![material]) }
}

fn sun(towards: Vec3) -> Light {
    let direction = -towards.normalize();
    let (kind, intensity) = (LightKind::Directional, Vec3::splat(PI));
    Light { name: "sun".into(), kind, position: Vec3::ZERO, direction, intensity }
}

fn renderer(device: &Device, scene: Scene, backend: Backend) -> Renderer {
    let options = RendererOptions { backend: BackendChoice::Force(backend), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

fn software(device: &Device, scene: Scene) -> Renderer {
    renderer(device, scene, Backend::Software)
}

/// Either method, in a picture so wide and high; paths begin at pixels' centres, so many a pixel, and scatter once.
fn config(path: bool, side: u32, spp: u32) -> RenderConfig {
    let mut config = RenderConfig { size: [side, side], ..common::plain() };
    (config.path_trace.spp, config.path_trace.max_depth) = (spp, Some(2));
    config.path_trace.pixel_filter = PixelFilter::Center;
    if path {
        config.method = &path::METHOD;
    }
    config
}

/// Radiance by direct light alone, of a configuration that is [`config`]'s.
fn direct(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera) -> Vec<f32> {
    if config.method == &path::METHOD {
        return picture(renderer, config, camera, &[]).beauty.data;
    }
    picture(renderer, config, camera, &[Aov::Direct]).aovs[0].1.data.clone()
}

fn picture(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera, aovs: &[Aov]) -> Frame {
    renderer.render(config, camera, &FrameRequest { aovs, ..FrameRequest::default() }).unwrap()
}

fn front(distance: f32) -> Camera {
    Camera::look_at("front", Vec3::new(0.0, 0.0, distance), Vec3::ZERO, 2.2 / distance)
}

/// On a convex surface nothing but the surface's own side takes light: every pixel of a coarse one reflects ρ/π·E·(n·l)⁺ of
/// the interpolated normal n, wherever its facet faces, in either method and backend; merged, and placed so that it is
/// stretched and mirrored.
#[test]
fn a_coarse_sphere_has_no_black_facets() {
    let Some((_guard, device)) = common::device() else { return };
    let towards = Vec3::new(0.8, 0.6, -0.35);
    let icosahedron = scene(vec![ball(0)], gray(0.5), vec![sun(towards)]);
    let mut mirrored = scene(vec![ball(1)], gray(0.5), vec![sun(towards)]);
    mirrored.instances[0].transform = Affine3A::from_scale_rotation_translation(
        Vec3::new(-1.0, 0.6, 0.8),
        Quat::from_rotation_z(0.3),
        Vec3::ZERO,
    );
    // Out of sight and off the sun's way; what is there twice is not merged.
    let mut twice = mirrored.clone();
    let aside = Affine3A::from_translation(Vec3::new(0.0, 0.0, 9.0));
    twice.instances.push(Instance { transform: aside, ..mirrored.instances[0].clone() });
    let mut cases = vec![(icosahedron, Backend::Software), (mirrored, Backend::Software)];
    cases.push((twice.clone(), Backend::Software));
    if device.info().ray_query {
        cases.push((twice, Backend::RayQuery));
    }
    for (case, (scene, backend)) in cases.into_iter().enumerate() {
        let mut renderer = renderer(&device, scene, backend);
        let normals =
            picture(&mut renderer, &config(false, 48, 1), &front(4.0), &[Aov::N]).aovs[0].1.data.clone();
        for path in [false, true] {
            let got = direct(&mut renderer, &config(path, 48, 1), &front(4.0));
            let mut lit = 0;
            for (n, got) in normals.chunks_exact(3).zip(got.chunks_exact(3)) {
                let expected = 0.5 * Vec3::from_slice(n).dot(towards.normalize()).max(0.0);
                assert!((got[0] - expected).abs() < 1e-5, "{case}, path {path}: {}, not {expected}", got[0]);
                lit += u32::from(expected > 0.0);
            }
            assert!(lit > 200, "{lit}");
        }
    }
}

/// Under a low sun the picture comes nearer to a fine mesh's, as a whole and pixel by pixel.
#[test]
fn a_coarse_sphere_nears_a_fine_one() {
    let Some((_guard, device)) = common::device() else { return };
    let of = |subdivisions, on| {
        let low = sun(Vec3::new(1.0, 0.3, -0.35));
        let mut renderer = software(&device, scene(vec![ball(subdivisions)], gray(0.5), vec![low]));
        let config = RenderConfig { shadow_terminator: on, ..config(false, 64, 1) };
        direct(&mut renderer, &config, &front(4.0))
    };
    let (fine, on, off) = (of(4, true), of(1, true), of(1, false));
    let [all, with, without] = [&fine, &on, &off].map(|p| mean(p));
    println!("mean {without:.4} → {with:.4}, fine {all:.4}");
    assert!(without < with && with < all, "{without} {with} {all}");
    let apart = |p: &[f32]| p.iter().zip(&fine).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
    assert!(apart(&on) < 0.98 * apart(&off));
}

/// What is seen in a mirror is lit as what is seen at once, and a coarse mirror reflects as far as it is seen: both methods
/// show the same.
#[test]
fn mirrors_show_no_black_facets() {
    let Some((_guard, device)) = common::device() else { return };
    let placed = |radius: f32, center: Vec3, material| {
        let mut mesh = ball(1);
        mesh.positions.iter_mut().for_each(|p| *p = radius * *p + center);
        mesh.materials.fill(material);
        mesh
    };
    // Behind the camera, in front of it, and behind that one.
    let seen = placed(1.0, Vec3::new(0.0, 0.0, 5.0), 0);
    let shiny = placed(0.6, Vec3::new(0.8, 0.0, 0.0), 1);
    let glass = quad(Vec3::new(-4.0, -4.0, -1.5), Vec3::X * 8.0, Vec3::Y * 8.0, 1);
    let mut room = scene(vec![seen, shiny, glass], gray(0.5), vec![sun(Vec3::new(0.7, 1.0, -0.4))]);
    room.materials.push(Material { roughness: 0.0, ..Material::default() });
    let mut renderer = software(&device, room);
    let camera = Camera::look_at("between", Vec3::new(0.0, 0.9, 3.0), Vec3::ZERO, 0.6);
    let [igi, path] = [false, true].map(|path| {
        let mut config = config(path, 48, 1);
        config.path_trace.max_depth = Some(5);
        config.path_trace.roulette_depth = 9;
        config.whitted.specular_depth = 3;
        picture(&mut renderer, &config, &camera, &[]).beauty.data
    });
    let lit = path.iter().filter(|&&v| v > 0.0).count();
    let apart = igi.iter().zip(&path).filter(|(a, b)| (*a - *b).abs() > 1e-4).count();
    // Edges seen in curved mirrors may round to either side.
    assert!(lit > 150 && apart <= 6, "{lit} lit, {apart} apart");
}

/// In light of radiance 1 from everywhere a white sphere cannot be seen, from outside; nor one that is closed, emits ½ and
/// reflects ½, from within, where a hollow facet shades itself as it did.
#[test]
fn coarse_spheres_pass_the_furnace() {
    let Some((_guard, device)) = common::device() else { return };
    let mut outside = scene(vec![ball(1)], gray(1.0), vec![]);
    outside.environment = Some(Environment::constant(Vec3::ONE).into());
    let glow = Material { emission: Vec3::splat(0.5), double_sided: true, ..gray(0.5) };
    let inside = scene(vec![ball(1)], glow, vec![]);
    let within = Camera::look_at("within", Vec3::new(0.1, 0.05, 0.2), Vec3::Z, 1.2);
    let mut renderer = software(&device, outside);
    for path in [false, true] {
        // All of the picture is the ball.
        let camera = Camera::look_at("near", Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, 0.4);
        let on = config(path, 32, 64);
        let on = RenderConfig { whitted: WhittedConfig { light_samples: 64, ..on.whitted }, ..on };
        let white = direct(&mut renderer, &on, &camera);
        assert_close(&format!("outside, path {path}"), mean(&white), 1.0, 0.005);
        let off = RenderConfig { shadow_terminator: false, ..on };
        let gray = mean(&direct(&mut renderer, &off, &camera));
        assert!(gray < 0.997, "facets lose what is below them: {gray}");
    }
    let mut renderer = software(&device, inside);
    let mut deep = config(true, 32, 64);
    deep.path_trace.max_depth = Some(14);
    assert_close("inside", mean(&picture(&mut renderer, &deep, &within, &[]).beauty.data), 1.0, 0.005);
    let on = config(false, 32, 1);
    let off = RenderConfig { shadow_terminator: false, ..on.clone() };
    let [on, off] = [on, off].map(|config| picture(&mut renderer, &config, &within, &[]).beauty.data);
    assert!(on.iter().zip(&off).all(|(on, off)| (on - off).abs() < 1e-5));
}

/// What is closed stays dark inside.
#[test]
fn no_light_enters_a_closed_coarse_sphere() {
    let Some((_guard, device)) = common::device() else { return };
    let lights = [Vec3::new(1.0, 0.3, -0.35), Vec3::new(-0.2, 1.0, 0.3), Vec3::NEG_Z].map(sun).to_vec();
    let mut dark = scene(vec![ball(1)], gray(0.5), lights.clone());
    dark.environment = Some(Environment::constant(Vec3::ONE).into());
    let mut renderer = software(&device, dark);
    for direction in [Vec3::X, Vec3::NEG_X] {
        let camera = Camera::look_at("within", Vec3::new(0.1, 0.05, 0.2), direction, 2.6);
        for path in [false, true] {
            let frame = picture(&mut renderer, &config(path, 32, 1), &camera, &[]);
            assert!(frame.beauty.data.iter().all(|&v| v == 0.0), "path {path} towards {direction}");
        }
    }
}

/// Light from above a facet is what it was: also where shared normals would make a box a ball, what lies on it keeps its
/// shadow.
#[test]
fn light_from_above_a_facet_stays() {
    let Some((_guard, device)) = common::device() else { return };
    let corner = |i: u32| Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 }));
    let positions: Vec<Vec3> = (0..8).map(corner).collect();
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6u32]];
    let triangles: Vec<_> = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let normals = positions.iter().map(|p| p.normalize()).collect();
    let cube = Mesh { normals, materials: vec![0; 12], positions, triangles, ..Mesh::default() };
    let card = quad(Vec3::new(-0.4, 1.2, -0.4), Vec3::Z * 0.8, Vec3::X * 0.8, 0);
    let camera = Camera::look_at("above", Vec3::new(2.0, 3.0, 4.0), Vec3::ZERO, 0.7);
    let mut renderer = software(
        &device,
        scene(vec![cube.clone(), card.clone()], gray(0.5), vec![sun(Vec3::new(1.0, 1.0, -1.0))]),
    );
    for path in [false, true] {
        let mut of = |on| {
            let config = RenderConfig { shadow_terminator: on, ..config(path, 48, 1) };
            direct(&mut renderer, &config, &camera)
        };
        let (on, off) = (of(true), of(false));
        let places = &picture(&mut renderer, &config(path, 48, 1), &camera, &[Aov::P]).aovs[0].1.data;
        let mut shaded = 0;
        let top = |p: &[f32]| (p[1] - 1.0).abs() < 1e-3 && p[0].abs().max(p[2].abs()) < 0.99;
        for (i, p) in places.chunks_exact(3).enumerate().filter(|(_, p)| top(p)) {
            assert_eq!(on[3 * i], off[3 * i], "path {path}, at {p:?}");
            shaded += u32::from(on[3 * i] == 0.0);
        }
        assert!(shaded > 10, "{shaded}");
    }
}

/// Facets that stand for themselves keep their bits, whether their normals are written down or not.
#[test]
fn flat_facets_keep_their_bits() {
    let Some((_guard, device)) = common::device() else { return };
    let round = ball(1);
    let without = Mesh { normals: vec![], ..round.clone() };
    let mut beside = ball(0);
    beside.positions.iter_mut().for_each(|p| *p = 0.3 * *p + Vec3::new(30.0, 0.0, 0.0));
    for (meshes, curved) in [(vec![without], false), (vec![faceted(&round), beside], true)] {
        let mut of_flat = scene(meshes, gray(0.5), vec![sun(Vec3::new(1.0, 0.3, -0.35))]);
        of_flat.environment = Some(Environment::constant(Vec3::splat(0.3)).into());
        let mut renderer = software(&device, of_flat);
        assert_eq!(renderer.profile(0.1).curved, curved);
        for path in [false, true] {
            let mut of = |on| {
                let config = RenderConfig { shadow_terminator: on, ..config(path, 32, 1) };
                picture(&mut renderer, &config, &front(4.0), &[]).beauty.data
            };
            assert!(of(true) == of(false), "path {path}");
        }
    }
}
