//! Scenes of the cases, in code.

use crate::scene::builtin::{self, block, box_faces, glass, grid, look, scene};
use crate::scene::{Camera, Light, LightKind, Material, Mesh, Scene, View, Volume};
use glam::{Affine3A, Vec3, vec3};
use std::f32::consts::{FRAC_PI_3, FRAC_PI_4};

/// Side of [`cube`] (m).
pub(super) const CUBE_SIDE: f32 = 2.0;

/// How far [`pane`] is above the floor, and its light (m).
const PANE_HEIGHT: f32 = 1.0;
pub(super) const PANE_LIGHT: Vec3 = Vec3::new(0.0, 2.0, 0.0);
pub(super) const PANE_INDEX: f32 = 1.5;
/// Albedo of the floor under it: so dark that little comes back from the glass.
pub(super) const PANE_ALBEDO: f32 = 0.05;

fn wall(albedo: f32) -> Material {
    Material::diffuse("wall", Vec3::splat(albedo))
}

/// A point light of 1 W/sr.
pub(super) fn point(position: Vec3, intensity: f32) -> Light {
    Light {
        name: "light".into(),
        kind: LightKind::Point,
        position,
        direction: Vec3::NEG_Y,
        intensity: Vec3::splat(intensity),
    }
}

/// Numbers from 0 to 1 that look random.
fn unit(n: u32) -> f32 {
    (n.wrapping_mul(2_654_435_761).wrapping_add(12345).wrapping_mul(2_246_822_519) >> 8) as f32
        / (1 << 24) as f32
}

/// Two walls that meet at 35°, light and camera between them.
pub(super) fn crease() -> Scene {
    let mut mesh = Mesh { name: "crease".into(), ..Mesh::default() };
    let (sin, cos) = 35_f32.to_radians().sin_cos();
    let corner = Vec3::NEG_Z * 1.5;
    grid(&mut mesh, corner, Vec3::Z * 3.0, Vec3::X * 2.0, 1, 0);
    grid(&mut mesh, corner, vec3(2.0 * cos, 2.0 * sin, 0.0), Vec3::Z * 3.0, 1, 0);
    let middle = vec3(17.5_f32.to_radians().cos(), 17.5_f32.to_radians().sin(), 0.0);
    scene(mesh, vec![wall(0.8)], 0.5 * middle, look(2.2 * middle, 0.3 * middle))
}

/// A closed cube with the light in its centre, hence the same light on all its sides; its cameras see a side each.
pub(super) fn cube(albedo: f32) -> Scene {
    let mut scene = builtin::closed_box(Vec3::splat(CUBE_SIDE), Vec3::splat(albedo), 4);
    let centre = Vec3::splat(0.5 * CUBE_SIDE);
    scene.lights = vec![point(centre, 1.0)];
    let axes = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    let view = View::Orthographic { ymag: 0.5 * CUBE_SIDE };
    let camera = |axis: Vec3| Camera { view, ..Camera::look_at("side", centre, centre + axis, FRAC_PI_4) };
    scene.cameras = axes.map(camera).collect();
    scene
}

/// A room with a block in it.
pub(super) fn furnished() -> Scene {
    let mut scene = builtin::closed_box(vec3(2.0, 1.5, 2.5), Vec3::splat(0.6), 1);
    let mesh = scene.mesh_mut(0);
    block(mesh, vec3(0.75, 0.0, 0.5), vec3(1.25, 0.5, 1.0), 0);
    scene
}

/// The room with the floor a brushed metal.
pub(super) fn metal_floor() -> Scene {
    let mut scene = furnished();
    let metal = Material { roughness: 0.3, base_color: Vec3::splat(0.8).extend(1.0), ..Material::default() };
    scene.materials.push(metal);
    // The floor comes first.
    scene.mesh_mut(0).materials[..2].fill(1);
    scene
}

/// A room divided by slats at 45°; the light is on one side of them, what is seen on the other.
pub(super) fn blinds() -> Scene {
    let mut mesh = Mesh { name: "blinds".into(), ..Mesh::default() };
    box_faces(&mut mesh, Vec3::ZERO, vec3(3.0, 2.0, 2.0), [0; 6], 1);
    for i in 0..10 {
        let low = vec3(1.45, 0.05 + 0.2 * i as f32, 0.01);
        grid(&mut mesh, low, vec3(0.1, 0.1, 0.0), Vec3::Z * 1.98, 1, 0);
    }
    let camera = look(vec3(1.75, 1.0, 1.0), vec3(3.0, 0.8, 0.7));
    scene(mesh, vec![wall(0.7)], vec3(0.5, 1.0, 1.0), camera)
}

/// A cube room turned by 37° about the vertical.
pub(super) fn turned() -> Scene {
    let room = builtin::closed_box(Vec3::splat(2.0), Vec3::splat(0.5), 1);
    moved(room, Affine3A::from_rotation_y(37_f32.to_radians()))
}

/// `scene` with all of its geometry, lights and cameras elsewhere.
fn moved(mut scene: Scene, transform: Affine3A) -> Scene {
    for instance in &mut scene.instances {
        instance.transform = transform * instance.transform;
    }
    for light in &mut scene.lights {
        light.position = transform.transform_point3(light.position);
    }
    for camera in &mut scene.cameras {
        camera.transform = transform * camera.transform;
    }
    scene
}

/// The furnished room `scale` times as large; its light has what makes pictures equal. By a power of two nothing rounds
/// otherwise, so nothing left to chance falls otherwise.
fn scaled(scale: f32) -> Scene {
    let mut scene = furnished();
    scene.mesh_mut(0).positions.iter_mut().for_each(|position| *position *= scale);
    for light in &mut scene.lights {
        light.position *= scale;
        light.intensity *= scale * scale;
    }
    for camera in &mut scene.cameras {
        camera.transform.translation *= scale;
    }
    scene
}

pub(super) fn small() -> Scene {
    scaled(1.0 / 1024.0)
}

pub(super) fn large() -> Scene {
    scaled(16384.0)
}

/// The furnished room, so large that its corners, light and camera are at whole metres, far away, where positions are 1 m
/// apart.
pub(super) fn far() -> Scene {
    let mut scene = scaled(80.0);
    let offset = Vec3::splat(1e7);
    // Vertices, not the instance: that is how far geometry comes out of files.
    scene.mesh_mut(0).positions.iter_mut().for_each(|position| *position += offset);
    scene.lights[0].position += offset;
    scene.cameras[0].transform.translation += glam::Vec3A::from(offset);
    scene
}

/// The furnished room, every triangle of it twice.
pub(super) fn duplicated() -> Scene {
    let mut scene = furnished();
    let mesh = scene.mesh_mut(0);
    mesh.triangles.extend_from_within(..);
    mesh.materials.extend_from_within(..);
    scene
}

/// The furnished room with triangles that are a line or a point.
pub(super) fn degenerate() -> Scene {
    let mut scene = furnished();
    let mesh = scene.mesh_mut(0);
    for i in 0..200 {
        let first = mesh.positions.len() as u32;
        let place = |n: u32| vec3(2.0 * unit(3 * n), 1.5 * unit(3 * n + 1), 2.5 * unit(3 * n + 2));
        let (a, b) = (place(2 * i), place(2 * i + 1));
        mesh.positions.extend(if i % 2 == 0 { [a, b, a.midpoint(b)] } else { [a; 3] });
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.materials.push(0);
    }
    scene
}

/// The furnished room with a black floor where the floor is.
pub(super) fn coincident() -> Scene {
    let mut scene = furnished();
    scene.materials.push(Material::diffuse("black", Vec3::ZERO));
    grid(scene.mesh_mut(0), Vec3::ZERO, Vec3::Z * 2.5, Vec3::X * 2.0, 1, 1);
    scene
}

/// Two rooms open towards the camera, side by side; the wall between has no thickness and is seen edge on. The
/// light is in the left one.
pub(super) fn thin_wall() -> Scene {
    let mut mesh = Mesh { name: "rooms".into(), ..Mesh::default() };
    let low = vec3(-1.0, 0.0, -1.0);
    let [x, y, z] = [Vec3::X * 2.0, Vec3::Y, Vec3::Z * 2.0];
    let sides =
        [(low, z, x), (low + y, x, z), (low, x, y), (low, y, z), (low + x, z, y), (low + 0.5 * x, y, z)];
    for (corner, u, v) in sides {
        grid(&mut mesh, corner, u, v, 1, 0);
    }
    let camera = Camera::look_at("camera", vec3(0.0, 0.5, 3.2), vec3(0.0, 0.5, 0.0), FRAC_PI_4);
    scene(mesh, vec![wall(0.7)], vec3(-0.5, 0.6, 0.0), camera)
}

/// Posts as wide as a pixel in front of walls in a corner.
pub(super) fn wires() -> Scene {
    let mut scene = builtin::closed_box(vec3(4.0, 3.0, 4.0), Vec3::splat(0.6), 1);
    let mesh = scene.mesh_mut(0);
    for i in 0..9 {
        let low = vec3(0.6 + 0.35 * i as f32, 0.0, 1.0 + 0.1 * (i % 3) as f32);
        block(mesh, low, low + vec3(0.1, 2.6, 0.1), 0);
    }
    scene.lights = vec![point(vec3(0.6, 2.2, 3.0), 4.0)];
    scene.cameras = vec![look(vec3(2.2, 1.5, 3.7), vec3(2.0, 1.3, 0.0))];
    scene
}

/// A room with a wall of facets.
pub(super) fn bumpy() -> Scene {
    let mut scene = builtin::closed_box(vec3(2.0, 2.0, 2.5), Vec3::splat(0.7), 1);
    let mesh = scene.mesh_mut(0);
    let cells = 20;
    let place = |x: u32, y: u32| vec3(x as f32 / 10.0, y as f32 / 10.0, 0.05 + 0.1 * unit(x * 31 + y * 17));
    for cell in 0..cells * cells {
        let (x, y) = (cell % cells, cell / cells);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([place(x, y), place(x + 1, y), place(x + 1, y + 1), place(x, y + 1)]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        mesh.materials.extend([0; 2]);
    }
    scene.lights = vec![point(vec3(0.5, 1.5, 1.5), 1.0)];
    scene.cameras = vec![look(vec3(1.0, 1.0, 1.9), vec3(1.0, 1.0, 0.0))];
    scene
}

/// A room with pillars, behind which a light goes along.
pub(super) fn pillars() -> Scene {
    let mut scene = builtin::closed_box(vec3(4.0, 2.0, 3.0), Vec3::splat(0.6), 1);
    for i in 0..4 {
        let low = vec3(0.6 + 0.8 * i as f32, 0.0, 1.2);
        block(scene.mesh_mut(0), low, low + vec3(0.3, 2.0, 0.3), 0);
    }
    scene.lights = vec![point(vec3(0.4, 1.0, 0.6), 1.0)];
    scene.cameras = vec![look(vec3(2.0, 1.2, 2.9), vec3(2.0, 0.9, 0.0))];
    scene
}

/// A floor, lit through a thin pane of glass by a point light.
pub(super) fn pane() -> Scene {
    let mut mesh = Mesh { name: "floor and pane".into(), ..Mesh::default() };
    grid(&mut mesh, vec3(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, 1, 0);
    grid(&mut mesh, vec3(-9.0, PANE_HEIGHT, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, 1, 1);
    let camera = Camera::look_at("camera", vec3(0.0, 0.9, 0.9), Vec3::ZERO, 0.5 * FRAC_PI_3);
    scene(mesh, vec![wall(PANE_ALBEDO), glass("pane", PANE_INDEX, None)], PANE_LIGHT, camera)
}

/// The floor, lit through a body of glass by a square of 1 m².
pub(super) fn glass_and_lamp() -> Scene {
    let mut scene = pane();
    scene.lights.clear();
    let clear = Volume { attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE };
    scene.materials[1] = glass("body", PANE_INDEX, Some(clear));
    // The pane faces up and becomes the upper face.
    grid(scene.mesh_mut(0), vec3(-9.0, 0.95, -9.0), Vec3::X * 18.0, Vec3::Z * 18.0, 1, 1);
    scene.materials.push(Material { emission: Vec3::ONE, ..Material::diffuse("lamp", Vec3::ZERO) });
    grid(scene.mesh_mut(0), PANE_LIGHT - vec3(0.5, 0.0, 0.5), Vec3::X, Vec3::Z, 1, 2);
    scene
}

pub(super) fn ajar() -> Scene {
    builtin::keyhole(0.3)
}

/// Needles by the hundred thousand, each box inside the one before, seen so near that they fill the picture.
pub(super) fn slivers() -> Scene {
    let mut scene = builtin::slivers(100_000);
    let across = vec3(1.0, 1.0, -2.0).normalize();
    let centre = Vec3::splat(0.3);
    let camera = Camera::look_at("camera", centre + across, centre, FRAC_PI_4);
    scene.cameras = vec![Camera { view: View::Orthographic { ymag: 0.002 }, ..camera }];
    scene.lights = vec![point(centre + 2.0 * across, 4.0)];
    scene
}

/// The furnished room under 10 000 lights of unequal power.
pub(super) fn many_lights() -> Scene {
    let mut scene = furnished();
    let light = |i: u32| {
        let place = vec3(0.1 + 1.8 * unit(3 * i), 1.2 + 0.2 * unit(3 * i + 1), 0.1 + 2.3 * unit(3 * i + 2));
        point(place, 5e-4 * unit(7 * i).powi(4))
    };
    scene.lights = (0..10_000).map(light).collect();
    scene
}

/// The furnished room without any light.
pub(super) fn dark() -> Scene {
    Scene { lights: Vec::new(), ..furnished() }
}
