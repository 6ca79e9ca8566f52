//! A scene made in code, rendered, its light moved, rendered again: the second frame rebuilds nothing but the
//! list of lights. `cargo run --release --example render`

use glam::{Affine3A, Vec3};
use parhelion::config::RenderConfig;
use parhelion::picture::{self, Origin};
use parhelion::renderer::{FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{Camera, Instance, Light, LightKind, Material, Mesh, Scene};
use parhelion::vk::{Device, DeviceOptions};
use std::error::Error;
use std::path::Path;

/// The inside or outside of an axis-aligned box.
fn cuboid(low: Vec3, high: Vec3, material: u32) -> Mesh {
    let corner = |i: u32| Vec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), high, low);
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<_> = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let materials = vec![material; triangles.len()];
    Mesh { positions: (0..8).map(corner).collect(), triangles, materials, ..Mesh::default() }
}

fn main() -> Result<(), Box<dyn Error>> {
    let lamp = |x: f32| Light {
        name: "lamp".into(),
        kind: LightKind::Point,
        position: Vec3::new(x, 2.2, 1.0),
        direction: Vec3::NEG_Y,
        intensity: Vec3::splat(10.0),
    };
    let mesh = |mesh| Instance { name: String::new(), mesh, transform: Affine3A::IDENTITY, moves: false };
    let scene = Scene {
        name: "room".into(),
        meshes: vec![
            cuboid(Vec3::new(-2.0, 0.0, -2.0), Vec3::new(2.0, 2.5, 3.0), 0).into(),
            cuboid(Vec3::new(-0.5, 0.001, -1.0), Vec3::new(0.5, 1.0, 0.0), 1).into(),
        ],
        instances: vec![mesh(0), mesh(1)],
        materials: vec![
            Material::diffuse("walls", Vec3::new(0.7, 0.7, 0.65)),
            Material::diffuse("block", Vec3::new(0.7, 0.2, 0.1)),
        ],
        lights: vec![lamp(-1.5)],
        ..Scene::default()
    };
    let camera = Camera::look_at("eye", Vec3::new(0.0, 1.4, 2.8), Vec3::new(0.0, 0.8, 0.0), 1.0);

    let device = Device::open(&DeviceOptions::default())?;
    let mut renderer = Renderer::new(&device, scene, &RendererOptions::default())?;
    let config = RenderConfig { size: [320, 240], ..RenderConfig::default() };
    for (file, x) in [("lamp_left.png", -1.5), ("lamp_right.png", 1.5)] {
        renderer.set_lights(vec![lamp(x)])?;
        let frame = renderer.render(&config, &camera, &FrameRequest::default())?;
        picture::write(Path::new(file), &Origin::of(&renderer, &camera), &config, &frame)?;
        let vpls = frame.vpl_count.unwrap_or_default();
        println!("{file}: {:.1} ms on {}, {vpls} VPLs", frame.wall_ms, device.info().name);
    }
    Ok(())
}
