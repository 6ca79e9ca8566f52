//! Scenes that need no file: the project's rooms, and analytic scenes whose light is known in closed form.
//!
//! Every analytic scene has one point light of 1 W/sr per channel, hence a flux of 4π W, unless it says
//! otherwise, Lambertian surfaces and a camera called `camera`.

use super::{
    Camera, Instance, Light, LightKind, LoadOptions, Material, Mesh, Scene, SceneError, Volume, gltf,
};
use glam::{Affine3A, Mat3, Vec2, Vec3, Vec4};
use std::collections::BTreeMap;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_3, TAU};
use std::path::Path;

/// The room that is rendered where no scene is named.
pub const DEFAULT: &str = "office";

const NAMES: [&str; 14] = [
    "office",
    "conference",
    "cornell",
    "closed-box",
    "two-albedo",
    "sphere",
    "plane",
    "mirror-box",
    "pane",
    "prism",
    "keyhole",
    "slivers",
    "triangle",
    "empty",
];

/// What [`by_name`] knows.
#[must_use]
pub fn names() -> &'static [&'static str] {
    &NAMES
}

/// The scene called `name`, as `builtin:NAME` on the command line; analytic ones with default parameters.
///
/// # Errors
/// An unknown name; the error lists those there are.
pub fn by_name(name: &str) -> Result<Scene, SceneError> {
    let room_size = Vec3::new(2.0, 1.5, 2.5);
    let half = Vec3::splat(0.5);
    let mut scene = match name {
        "office" => room(name, include_bytes!("../../scenes/office.glb"))?,
        "conference" => room(name, include_bytes!("../../scenes/conference.glb"))?,
        "cornell" => room(name, include_bytes!("../../scenes/cornell.glb"))?,
        "closed-box" => closed_box(room_size, half, 4),
        "two-albedo" => two_albedo(room_size, Vec3::splat(0.8), Vec3::splat(0.3), 4),
        "sphere" => sphere(4, half),
        "plane" => plane(100.0, 1.0, half),
        "mirror-box" => mirror_box(room_size, half, 4),
        "pane" => pane(1.5, half),
        "prism" => prism(FRAC_PI_3, 1.5),
        "keyhole" => keyhole(0.14),
        "slivers" => slivers(100_000),
        "triangle" => triangle(),
        "empty" => empty(),
        _ => {
            let problem = format!("no such scene; there are {}", NAMES.join(", "));
            return Err(SceneError::new(Path::new(&format!("builtin:{name}")), "name", problem));
        }
    };
    scene.name = name.to_owned();
    Ok(scene)
}

fn room(name: &str, bytes: &[u8]) -> Result<Scene, SceneError> {
    gltf::load_bytes(bytes, &format!("builtin:{name}"), &LoadOptions::default())
}

/// A room [0, `size`] (m) closed on six sides, all of albedo `albedo`, each side a grid of `cells` × `cells`
/// quads. Mean irradiance is Φ/(A(1 − ρ)).
#[must_use]
pub fn closed_box(size: Vec3, albedo: Vec3, cells: u32) -> Scene {
    box_room(size, vec![Material::diffuse("wall", albedo)], [0; 6], cells)
}

/// [`closed_box`] with a floor of albedo `floor`, all else `walls`: Σ (1 − ρ) ∫ E dA = Φ.
#[must_use]
pub fn two_albedo(size: Vec3, floor: Vec3, walls: Vec3, cells: u32) -> Scene {
    let materials = vec![Material::diffuse("floor", floor), Material::diffuse("wall", walls)];
    box_room(size, materials, [0, 1, 1, 1, 1, 1], cells)
}

/// [`closed_box`] whose wall at z = 0 is a perfect mirror; the camera faces it.
#[must_use]
pub fn mirror_box(size: Vec3, albedo: Vec3, cells: u32) -> Scene {
    let mirror = Material { name: "mirror".into(), roughness: 0.0, ..Material::default() };
    box_room(size, vec![Material::diffuse("wall", albedo), mirror], [0, 0, 1, 0, 0, 0], cells)
}

/// The inside of a sphere of radius 1 m about the origin: an icosahedron, every triangle split in four
/// `subdivisions` times, faces flat. The light stands off centre; indirect irradiance is uniform all the same.
#[must_use]
pub fn sphere(subdivisions: u32, albedo: Vec3) -> Scene {
    let golden = 0.5 * (1.0 + 5.0f32.sqrt());
    let mut positions: Vec<Vec3> = Vec::new();
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        let corner = Vec3::new(a, b, 0.0).normalize();
        positions.extend([
            corner,
            Vec3::new(corner.z, corner.x, corner.y),
            Vec3::new(corner.y, corner.z, corner.x),
        ]);
    }
    // The twenty faces are the triples of corners at one edge length from each other.
    let near = |a: usize, b: usize| positions[a].distance(positions[b]) < 1.1;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in (b + 1..12).filter(|&c| near(a, b) && near(b, c) && near(a, c)) {
                let [p, q, r] = [a, b, c].map(|i| positions[i]);
                let inward = (q - p).cross(r - p).dot(p) < 0.0;
                triangles.push(if inward { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
            }
        }
    }
    for _ in 0..subdivisions {
        let mut middles = BTreeMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    positions.push((positions[a as usize] + positions[b as usize]).normalize());
                    (positions.len() - 1) as u32
                })
            };
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let materials = vec![0; triangles.len()];
    let mesh = Mesh { name: "sphere".into(), positions, triangles, materials, ..Mesh::default() };
    let light = Vec3::new(0.3, 0.2, -0.1);
    scene(mesh, vec![Material::diffuse("wall", albedo)], light, look(Vec3::new(0.0, 0.0, 0.8), Vec3::ZERO))
}

/// A square of side 2 `extent` (m) on y = 0, its light at (0, `height`, 0): E(r) = I h / (h² + r²)^{3/2}. The
/// camera looks straight down from where the light is.
#[must_use]
pub fn plane(extent: f32, height: f32, albedo: Vec3) -> Scene {
    let mut mesh = Mesh { name: "plane".into(), ..Mesh::default() };
    grid(
        &mut mesh,
        Vec3::new(-extent, 0.0, -extent),
        Vec3::Z * (2.0 * extent),
        Vec3::X * (2.0 * extent),
        1,
        0,
    );
    let eye = Vec3::Y * height;
    scene(mesh, vec![Material::diffuse("plane", albedo)], eye, look(eye, Vec3::ZERO))
}

/// A wall of albedo `albedo` on z = 0 behind a thin pane of glass of index `ior` on z = 1 m, light between
/// them, camera in front on the axis: seen at normal incidence the wall's radiance is 1 − 2R/(1 + R) of its
/// own, R = ((n − 1)/(n + 1))².
#[must_use]
pub fn pane(ior: f32, albedo: Vec3) -> Scene {
    let mut mesh = Mesh { name: "wall and pane".into(), ..Mesh::default() };
    let corner = Vec3::new(-4.0, -4.0, 0.0);
    grid(&mut mesh, corner, Vec3::X * 8.0, Vec3::Y * 8.0, 1, 0);
    grid(&mut mesh, corner + Vec3::Z, Vec3::X * 8.0, Vec3::Y * 8.0, 1, 1);
    let materials = vec![Material::diffuse("wall", albedo), glass("pane", ior, None)];
    scene(mesh, materials, Vec3::new(0.5, 0.5, 0.5), look(Vec3::Z * 3.0, Vec3::ZERO))
}

/// A solid glass prism of refractive index `ior`, standing along Y: an isosceles triangle of apex angle `apex`
/// (radians) and legs of 1 m, its apex on the Y axis, its base towards +X, symmetric about z = 0. It stands
/// in a room 8 × 4 × 8 m about the origin whose wall colour tells the place: albedo
/// 0.1 + 0.8 ((x, y, z) − room minimum)/size in red, green and blue. The light stands high in the corner
/// behind the camera.
#[must_use]
pub fn prism(apex: f32, ior: f32) -> Scene {
    let (low, size) = (Vec3::new(-4.0, -2.0, -4.0), Vec3::new(8.0, 4.0, 8.0));
    let mut mesh = Mesh { name: "prism in a room".into(), ..Mesh::default() };
    box_faces(&mut mesh, low, size, [0; 6], 1);
    mesh.colors = mesh.positions.iter().map(|&p| (0.1 + 0.8 * (p - low) / size).extend(1.0)).collect();
    let (sin, cos) = (0.5 * apex).sin_cos();
    let outline = [Vec2::ZERO, Vec2::new(cos, -sin), Vec2::new(cos, sin)];
    let at = |i: usize, y: f32| Vec3::new(outline[i % 3].x, y, outline[i % 3].y);
    for i in 0..3 {
        let (a, b) = (at(i, -0.5), at(i + 1, -0.5));
        grid(&mut mesh, a, Vec3::Y, b - a, 1, 1);
    }
    triangle_of(&mut mesh, [at(0, -0.5), at(1, -0.5), at(2, -0.5)], 1);
    triangle_of(&mut mesh, [at(0, 0.5), at(2, 0.5), at(1, 0.5)], 1);
    mesh.colors.resize(mesh.positions.len(), Vec4::ONE);
    let volume = Volume { attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE };
    let materials = vec![Material::diffuse("wall", Vec3::ONE), glass("prism", ior, Some(volume))];
    scene(
        mesh,
        materials,
        Vec3::new(-3.0, 1.5, 3.0),
        look(Vec3::new(0.4, 0.3, 3.5), Vec3::new(0.4, 0.0, 0.0)),
    )
}

/// Two rooms of 3 × 2.5 × 3 m side by side along X, the door between them ajar by `angle` (radians, up to
/// π/2); the light is in the one, the camera in the other.
#[must_use]
pub fn keyhole(angle: f32) -> Scene {
    let mut mesh = Mesh { name: "rooms".into(), ..Mesh::default() };
    box_faces(&mut mesh, Vec3::ZERO, Vec3::new(6.1, 2.5, 3.0), [0; 6], 1);
    // The partition runs on beyond the room's sides, so that no two faces coincide.
    let (low, high) = (Vec3::new(3.0, -0.1, -0.1), Vec3::new(3.1, 2.6, 3.1));
    block(&mut mesh, low, Vec3::new(high.x, high.y, 1.0), 0);
    block(&mut mesh, Vec3::new(low.x, low.y, 1.9), high, 0);
    block(&mut mesh, Vec3::new(low.x, 2.0, 1.0), Vec3::new(high.x, high.y, 1.9), 0);
    let first = mesh.positions.len();
    block(&mut mesh, Vec3::new(0.0, 0.002, 0.002), Vec3::new(0.04, 1.998, 0.898), 1);
    let turn = Mat3::from_rotation_y(angle.clamp(0.0, FRAC_PI_2));
    for p in &mut mesh.positions[first..] {
        *p = turn * *p + Vec3::new(3.06, 0.0, 1.0);
    }
    let materials =
        vec![Material::diffuse("wall", Vec3::splat(0.7)), Material::diffuse("door", Vec3::splat(0.5))];
    let mut scene = scene(
        mesh,
        materials,
        Vec3::new(5.0, 1.8, 1.5),
        look(Vec3::new(0.4, 1.5, 2.6), Vec3::new(3.0, 1.0, 1.3)),
    );
    scene.lights[0].intensity = Vec3::splat(20.0);
    scene
}

/// `count` needles along one diagonal, each box inside the one before, turned against each other about it.
#[must_use]
pub fn slivers(count: u32) -> Scene {
    let mut mesh = Mesh { name: "slivers".into(), ..Mesh::default() };
    let (along, across) = (Vec3::ONE, Vec3::new(1.0, -1.0, 0.0).normalize());
    let other = along.normalize().cross(across);
    for i in 0..count {
        let scale = 1.0 - 0.999 * i as f32 / count as f32;
        let (sin, cos) = (2.399_963 * i as f32 % TAU).sin_cos();
        let width = 2e-3 * (cos * across + sin * other);
        triangle_of(&mut mesh, [-along, along - width, along + width].map(|p| scale * p), 0);
    }
    let view = look(Vec3::new(3.0, 0.5, -1.0), Vec3::ZERO);
    scene(mesh, vec![Material::diffuse("needle", Vec3::splat(0.5))], Vec3::new(2.0, 2.0, -2.0), view)
}

/// One triangle: (0, 0, 0), (1, 0, 0), (0, 1, 0), seen from +Z.
#[must_use]
pub fn triangle() -> Scene {
    let mut mesh = Mesh { name: "triangle".into(), ..Mesh::default() };
    triangle_of(&mut mesh, [Vec3::ZERO, Vec3::X, Vec3::Y], 0);
    let (light, view) = (Vec3::new(0.3, 0.3, 1.0), look(Vec3::new(0.4, 0.4, 2.0), Vec3::new(0.4, 0.4, 0.0)));
    scene(mesh, vec![Material::diffuse("triangle", Vec3::splat(0.5))], light, view)
}

/// A light and a camera, and nothing to see.
#[must_use]
pub fn empty() -> Scene {
    Scene {
        meshes: Vec::new(),
        instances: Vec::new(),
        ..scene(Mesh::default(), Vec::new(), Vec3::Y, look(Vec3::Z, Vec3::ZERO))
    }
}

/// The light is above the middle, the camera near the corner (max x, max z).
fn box_room(size: Vec3, materials: Vec<Material>, sides: [u32; 6], cells: u32) -> Scene {
    let mut mesh = Mesh { name: "room".into(), ..Mesh::default() };
    box_faces(&mut mesh, Vec3::ZERO, size, sides, cells);
    let view = look(size * Vec3::new(0.85, 0.6, 0.95), size * Vec3::new(0.4, 0.45, 0.0));
    scene(mesh, materials, size * Vec3::new(0.5, 0.6, 0.5), view)
}

pub(crate) fn look(eye: Vec3, target: Vec3) -> Camera {
    Camera::look_at("camera", eye, target, FRAC_PI_3)
}

pub(crate) fn glass(name: &str, ior: f32, volume: Option<Volume>) -> Material {
    Material {
        name: name.into(),
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        ior,
        volume,
        double_sided: true,
        ..Material::default()
    }
}

pub(crate) fn scene(mesh: Mesh, materials: Vec<Material>, light: Vec3, camera: Camera) -> Scene {
    Scene {
        instances: vec![Instance {
            name: mesh.name.clone(),
            mesh: 0,
            transform: Affine3A::IDENTITY,
            moves: false,
        }],
        meshes: vec![mesh.into()],
        materials,
        lights: vec![Light {
            name: "light".into(),
            kind: LightKind::Point,
            position: light,
            direction: Vec3::NEG_Y,
            intensity: Vec3::ONE,
        }],
        cameras: vec![camera],
        ..Scene::default()
    }
}

pub(crate) fn triangle_of(mesh: &mut Mesh, corners: [Vec3; 3], material: u32) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(corners);
    mesh.triangles.push([first, first + 1, first + 2]);
    mesh.materials.push(material);
}

/// A parallelogram of `cells` × `cells` quads, its front along `u` × `v`.
pub(crate) fn grid(mesh: &mut Mesh, origin: Vec3, u: Vec3, v: Vec3, cells: u32, material: u32) {
    let first = mesh.positions.len() as u32;
    let row = cells + 1;
    for j in 0..row {
        for i in 0..row {
            mesh.positions.push(origin + u * (i as f32 / cells as f32) + v * (j as f32 / cells as f32));
        }
    }
    for j in 0..cells {
        for i in 0..cells {
            let a = first + j * row + i;
            mesh.triangles.extend([[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]);
            mesh.materials.extend([material; 2]);
        }
    }
}

/// The six sides of a box seen from inside: floor, ceiling, low z, high z, low x, high x.
pub(crate) fn box_faces(mesh: &mut Mesh, low: Vec3, size: Vec3, materials: [u32; 6], cells: u32) {
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * size);
    for ((origin, u, v), material) in
        [(low, z, x), (low + y, x, z), (low, x, y), (low + z, y, x), (low, y, z), (low + x, z, y)]
            .into_iter()
            .zip(materials)
    {
        grid(mesh, origin, u, v, cells, material);
    }
}

/// A solid box seen from outside.
pub(crate) fn block(mesh: &mut Mesh, low: Vec3, high: Vec3, material: u32) {
    let first = mesh.triangles.len();
    box_faces(mesh, low, high - low, [material; 6], 1);
    for triangle in &mut mesh.triangles[first..] {
        triangle.swap(1, 2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn analytic() -> impl Iterator<Item = Scene> {
        let rooms = ["office", "conference", "cornell"];
        names().iter().filter(move |name| !rooms.contains(name)).map(|name| by_name(name).unwrap())
    }

    fn corners(mesh: &Mesh) -> impl Iterator<Item = [Vec3; 3]> {
        mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize]))
    }

    /// Sum of a·(b × c)/6: the volume enclosed, positive if fronts look outward.
    fn signed_volume(mesh: &Mesh) -> f64 {
        corners(mesh).map(|[a, b, c]| f64::from(a.dot(b.cross(c))) / 6.0).sum()
    }

    fn assert_closed(mesh: &Mesh) {
        let mut edges = BTreeMap::new();
        for t in corners(mesh) {
            let bits = t.map(|p| (p + Vec3::splat(0.0)).to_array().map(f32::to_bits));
            for i in 0..3 {
                *edges.entry((bits[i], bits[(i + 1) % 3])).or_insert(0) += 1;
                *edges.entry((bits[(i + 1) % 3], bits[i])).or_insert(0) -= 1;
            }
        }
        assert!(edges.values().all(|&count| count == 0), "{}: an edge without its twin", mesh.name);
    }

    #[test]
    fn parts_fit_together() {
        for scene in analytic() {
            assert_eq!(scene.lights.len(), 1, "{}", scene.name);
            assert_eq!(scene.cameras.len(), 1, "{}", scene.name);
            for mesh in &scene.meshes {
                assert_eq!(mesh.triangles.len(), mesh.materials.len());
                assert!(mesh.materials.iter().all(|&m| (m as usize) < scene.materials.len()));
                assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
                assert!(mesh.colors.is_empty() || mesh.colors.len() == mesh.positions.len());
                assert!(corners(mesh).all(|[a, b, c]| (b - a).cross(c - a).length() > 0.0), "{}", scene.name);
            }
        }
    }

    #[test]
    fn rooms_are_closed_and_seen_from_inside() {
        for cells in [1, 3, 7] {
            let size = Vec3::new(1.1, 0.7, 2.3);
            let mesh = &closed_box(size, Vec3::splat(0.5), cells).meshes[0];
            assert_closed(mesh);
            assert_eq!(mesh.triangles.len(), 12 * (cells * cells) as usize);
            assert!((signed_volume(mesh) + f64::from(size.element_product())).abs() < 1e-5);
        }
        assert_closed(&by_name("keyhole").unwrap().meshes[0]);
    }

    #[test]
    fn sphere_tends_to_the_sphere() {
        let volume = 4.0 / 3.0 * std::f64::consts::PI;
        let error = |subdivisions| {
            let mesh = &sphere(subdivisions, Vec3::splat(0.5)).meshes[0];
            assert_closed(mesh);
            assert_eq!(mesh.triangles.len(), 20 << (2 * subdivisions));
            assert!(mesh.positions.iter().all(|p| (p.length() - 1.0).abs() < 1e-6));
            signed_volume(mesh) + volume
        };
        // Second order: each subdivision takes three quarters of the missing volume.
        let ratio = error(2) / error(3);
        assert!((3.8..4.2).contains(&ratio), "{ratio}");
    }

    #[test]
    fn prism_is_a_solid_of_its_apex_angle() {
        for apex in [0.5f32, FRAC_PI_3, FRAC_PI_2] {
            let mut mesh = Mesh::clone(&prism(apex, 1.5).meshes[0]);
            let kept: Vec<_> = (0..mesh.triangles.len()).filter(|&i| mesh.materials[i] == 1).collect();
            mesh.triangles = kept.into_iter().map(|i| mesh.triangles[i]).collect();
            assert_closed(&mesh);
            assert!((signed_volume(&mesh) - f64::from(0.5 * apex.sin())).abs() < 1e-6);
        }
    }

    #[test]
    fn slivers_are_nested() {
        let scene = slivers(1000);
        let boxes: Vec<_> =
            corners(&scene.meshes[0]).map(|t| (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]))).collect();
        let inside =
            |i: usize, j: usize| boxes[i].0.cmple(boxes[j].0).all() && boxes[j].1.cmple(boxes[i].1).all();
        assert!((0..990).all(|i| inside(i, i + 10)));
    }

    #[test]
    fn unknown_names_are_answered_with_the_known_ones() {
        let message = by_name("ofice").unwrap_err().to_string();
        assert!(
            message.contains("builtin:ofice") && names().iter().all(|name| message.contains(name)),
            "{message}"
        );
        assert!(names().contains(&DEFAULT));
    }
}
