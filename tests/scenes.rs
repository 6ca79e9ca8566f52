//! The scenes that come with the project are what their program makes, and fit to be lit.

#[path = "../scenes/make/mod.rs"]
mod make;

use glam::{Mat4, Vec3};
use gltf::Gltf;
use parhelion::scene::{self, LoadOptions, Scene};
use std::collections::BTreeMap;

/// Triangles in the world with the name of their node, and the file's lights and cameras.
struct Room {
    triangles: Vec<(String, [Vec3; 3])>,
    /// Normals where the file has them.
    normals: Vec<Option<[Vec3; 3]>>,
    lights: Vec<Vec3>,
    cameras: Vec<(String, Vec3)>,
}

fn read(name: &str) -> Room {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let gltf = Gltf::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let blob = gltf.blob.as_deref().unwrap();
    let mut room =
        Room { triangles: Vec::new(), normals: Vec::new(), lights: Vec::new(), cameras: Vec::new() };
    for node in gltf.nodes() {
        let name = node.name().unwrap().to_owned();
        let world = Mat4::from_cols_array_2d(&node.transform().matrix());
        if node.light().is_some() {
            room.lights.push(world.transform_point3(Vec3::ZERO));
        }
        if node.camera().is_some() {
            room.cameras.push((name.clone(), world.transform_point3(Vec3::ZERO)));
        }
        for primitive in node.mesh().iter().flat_map(|mesh| mesh.primitives()) {
            let reader = primitive.reader(|_| Some(blob));
            let positions: Vec<_> = reader.read_positions().unwrap().map(Vec3::from).collect();
            let normals: Option<Vec<_>> = reader.read_normals().map(|n| n.map(Vec3::from).collect());
            let indices: Vec<_> = reader.read_indices().unwrap().into_u32().collect();
            for t in indices.chunks_exact(3) {
                let pick = |from: &[Vec3]| [t[0], t[1], t[2]].map(|i| from[i as usize]);
                let corners = pick(&positions).map(|p| world.transform_point3(p));
                room.triangles.push((name.clone(), corners));
                room.normals.push(normals.as_deref().map(|n| pick(n).map(|n| world.transform_vector3(n))));
            }
        }
    }
    room
}

fn distance_to_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let to_segment = |a: Vec3, b: Vec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance(a.lerp(b, t))
    };
    let n = (b - a).cross(c - a).normalize();
    let above = |a: Vec3, b: Vec3| n.cross(b - a).dot(p - a) >= 0.0;
    if above(a, b) && above(b, c) && above(c, a) {
        return (p - a).dot(n).abs();
    }
    to_segment(a, b).min(to_segment(b, c)).min(to_segment(c, a))
}

#[test]
fn files_are_what_the_program_makes() {
    for (name, bytes) in make::files() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        assert!(std::fs::read(path).unwrap() == bytes, "{name}: run `cargo run --example make_scenes`");
        assert!(bytes.len() < 3_000_000, "{name}: {} bytes", bytes.len());
    }
}

#[test]
fn rooms_have_the_size_they_are_for() {
    for (name, triangles, lights) in [
        ("cornell.glb", 30..=32, 1),
        ("office.glb", 20_000..=22_000, 2),
        ("conference.glb", 185_000..=195_000, 4),
    ] {
        let room = read(name);
        assert!(triangles.contains(&room.triangles.len()), "{name}: {} triangles", room.triangles.len());
        assert_eq!(room.lights.len(), lights, "{name}");
        assert!(room.cameras.len() >= 2, "{name}");
    }
}

#[test]
fn shells_are_closed() {
    for name in ["office.glb", "conference.glb"] {
        let mut edges = BTreeMap::new();
        let mut volume = 0.0;
        for (_, t) in read(name).triangles.iter().filter(|(node, _)| node == "shell") {
            let bits = t.map(|p| p.to_array().map(|c| (c + 0.0).to_bits()));
            for i in 0..3 {
                *edges.entry((bits[i], bits[(i + 1) % 3])).or_insert(0) += 1;
                *edges.entry((bits[(i + 1) % 3], bits[i])).or_insert(0) -= 1;
            }
            volume += t[0].dot(t[1].cross(t[2])) / 6.0;
        }
        assert!(!edges.is_empty() && edges.values().all(|&count| count == 0), "{name}: the shell has a gap");
        assert!(volume < -10.0, "{name}: the shell faces outwards");
    }
}

#[test]
fn everything_is_inside_the_shell_and_lights_are_clear_of_it() {
    for name in ["office.glb", "conference.glb"] {
        let room = read(name);
        let shell = room.triangles.iter().filter(|(node, _)| node == "shell").flat_map(|(_, t)| *t);
        let (low, high) = shell.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        for (node, t) in &room.triangles {
            assert!(t.iter().all(|p| p.cmpge(low).all() && p.cmple(high).all()), "{name}: {node} sticks out");
            for light in &room.lights {
                assert!(distance_to_triangle(*light, *t) > 0.15, "{name}: a light touches {node}");
            }
        }
        for (camera, eye) in &room.cameras {
            let nearest = room
                .triangles
                .iter()
                .map(|(_, t)| distance_to_triangle(*eye, *t))
                .fold(f32::INFINITY, f32::min);
            assert!(nearest > 0.05, "{name}: camera {camera} is {nearest} m from a surface");
        }
    }
}

#[test]
fn normals_agree_with_windings() {
    for name in ["cornell.glb", "office.glb", "conference.glb"] {
        let room = read(name);
        for ((node, [a, b, c]), normals) in room.triangles.iter().zip(&room.normals) {
            let face = (b - a).cross(c - a);
            assert!(face.length() > 1e-9, "{name}: {node} has a triangle without area");
            for normal in normals.iter().flatten() {
                assert!((normal.length() - 1.0).abs() < 1e-4, "{name}: {node}: normal {normal}");
                assert!(
                    normal.dot(face.normalize()) > 0.1,
                    "{name}: {node}: a normal off by {}",
                    normal.dot(face.normalize())
                );
            }
        }
    }
}

/// At a time of all clips, with the names of its instances.
fn posed(name: &str, share: f64) -> Scene {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let scene = scene::load(&path, &LoadOptions { motion: true, strict: true, ..LoadOptions::default() });
    let scene = scene.unwrap_or_else(|error| panic!("{error}"));
    let clips = scene.clips_together();
    assert_eq!(clips.len(), scene.clips().len(), "{name}: clips move different things");
    let end = scene.clips().iter().map(|clip| clip.end()).fold(0.0, f64::max);
    scene.pose(&clips, share * end).unwrap_or_else(|error| panic!("{error}"))
}

/// World triangles of the instance of this name.
fn of<'a>(scene: &'a Scene, name: &str) -> impl Iterator<Item = [Vec3; 3]> + 'a {
    let instance = scene.instances.iter().find(|instance| instance.name == name).unwrap();
    let mesh = &scene.meshes[instance.mesh as usize];
    mesh.triangles.iter().map(|t| t.map(|v| instance.transform.transform_point3(mesh.positions[v as usize])))
}

#[test]
fn what_moves_stays_in_its_room() {
    for name in ["cornell-moving.glb", "office-moving.glb", "conference-walk.glb"] {
        let mut seen = Vec::new();
        let shell = if name.starts_with("cornell") { "room" } else { "shell" };
        for share in [0.0, 0.13, 0.31, 0.5, 0.62, 0.87, 1.0] {
            let scene = posed(name, share);
            let walls = of(&scene, shell).flatten();
            let (low, high) =
                walls.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
            let (low, high) = (low - 1e-4, high + 1e-4);
            assert!(
                scene.world_triangles().flatten().all(|p| p.cmpge(low).all() && p.cmple(high).all()),
                "{name} at {share}"
            );
            for light in &scene.lights {
                let near = scene.world_triangles().map(|t| distance_to_triangle(light.position, t));
                assert!(
                    near.fold(f32::INFINITY, f32::min) > 0.12,
                    "{name} at {share}: {} touches",
                    light.name
                );
            }
            seen.push(scene.fingerprint(&scene.cameras[0]));
        }
        seen.sort_unstable();
        seen.dedup();
        assert!(seen.len() >= 6, "{name} moves");
    }
}

/// Of about 20 000 triangles, its soles on the floor wherever it is, both feet never far from it.
#[test]
fn the_figure_walks_on_the_floor() {
    let mut along = Vec::new();
    for step in 0..16 {
        let scene = posed("conference-walk.glb", f64::from(step) / 15.0);
        let corners: Vec<Vec3> = of(&scene, "figure").flatten().collect();
        assert!((18_000..22_000).contains(&(corners.len() / 3)), "{}", corners.len() / 3);
        let lowest = corners.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
        let highest = corners.iter().map(|p| p.y).fold(0.0, f32::max);
        assert!(
            (0.0..0.012).contains(&lowest) && (1.6..1.9).contains(&highest),
            "{step}: {lowest} to {highest}"
        );
        along.push(corners.iter().map(|p| p.x).sum::<f32>() / corners.len() as f32);
    }
    assert!(along.is_sorted_by(|a, b| a > b) && along[0] - along[15] > 5.0, "{along:?}");
}
