//! Meshes that a device brings into shape: lazy poses are poses, whatever came before.

mod common;

use common::asset::{Asset, F32, U32};
use glam::{Vec3, vec3};
use parhelion::accel::Rebuild;
use parhelion::config::RenderConfig;
use parhelion::renderer::{BackendChoice, Frame, FrameRequest, Redone, Renderer, RendererOptions};
use parhelion::scene::{self, Environment, LoadOptions, Scene};
use parhelion::vk::{Backend, Device};
use serde_json::json;
use std::path::Path;

fn moving() -> LoadOptions {
    LoadOptions { motion: true, ..LoadOptions::default() }
}

fn own(name: &str) -> Scene {
    scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name), &moving()).unwrap()
}

fn end(scene: &Scene) -> f64 {
    scene.clips().iter().map(|clip| clip.end()).fold(0.0, f64::max)
}

fn print(scene: &Scene) -> u64 {
    scene.fingerprint(&scene.frame_camera())
}

/// A lazy pose whose shapes are made is the pose itself, and its bounds hold it.
fn check_poses(scene: &Scene, what: &str) -> usize {
    let mut most = 0;
    for clips in [scene.clips_together()].into_iter().chain((0..scene.clips().len()).map(|clip| vec![clip])) {
        for share in [0.0, 0.17, 0.5, 0.83, 1.0] {
            let time = share * end(scene);
            let (pose, lazy) = (scene.pose(&clips, time).unwrap(), scene.pose_lazily(&clips, time).unwrap());
            lazy.validate().unwrap();
            let shaped = lazy.shaped().unwrap();
            assert_eq!(print(&shaped), print(&pose), "{what}: {clips:?} at {time}");
            if let (Some((low, high)), Some((a, b))) = (pose.bounds(), lazy.bounds()) {
                assert!(a.cmple(low).all() && b.cmpge(high).all(), "{what}: {clips:?} at {time}");
            }
            most = most.max(lazy.deformations.len());
        }
    }
    most
}

#[test]
fn lazy_poses_are_poses() {
    for (name, deformed) in [("conference-walk.glb", 1), ("cornell-moving.glb", 1), ("office-moving.glb", 0)]
    {
        assert_eq!(check_poses(&own(name), name), deformed, "{name}");
    }
    assert_eq!(check_poses(&shuffled(64).load_as(&moving()).unwrap(), "shuffled"), 1);
}

#[test]
fn lazy_poses_of_samples_are_poses() {
    let Some(samples) = common::shared("gltf-samples") else { return };
    let mut deformed = 0;
    let mut folders = vec![samples];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "glb" || e == "gltf") {
                let Ok(scene) = scene::load(&path, &moving()) else { continue };
                if !scene.clips().is_empty() && scene.clips().len() < 20 {
                    deformed += usize::from(check_poses(&scene, &path.display().to_string()) > 0);
                }
            }
        }
    }
    assert!(deformed > 0);
}

/// A grid of so many squares, all of which a morph target takes elsewhere, each to another's place.
fn shuffled(count: u32) -> Asset {
    let mut asset = Asset::empty();
    let side = f64::from(count).sqrt().ceil() as u32;
    let place = |i: u32| vec3((i % side) as f32, (i / side) as f32, 0.1 * (i % 3) as f32) / side as f32;
    let corners = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y].map(|corner| corner * 0.8 / side as f32);
    let (mut positions, mut deltas, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..count {
        let other = place((u64::from(i) * 2_654_435_761 % u64::from(count)) as u32);
        for corner in corners {
            positions.push(place(i) + corner);
            deltas.push(other - place(i));
        }
        indices.extend([0, 1, 2, 0, 2, 3].map(|corner: u32| 4 * i + corner));
    }
    let [positions, deltas] = [positions, deltas].map(|values| asset.positions(&values));
    let indices = asset.accessor(bytemuck::cast_slice(&indices), U32, "SCALAR", indices.len());
    let shown = asset.show(json!({"attributes": {"POSITION": positions}, "indices": indices,
        "targets": [{"POSITION": deltas}]}));
    let times = asset.accessor(bytemuck::cast_slice(&[0.0_f32, 1.0]), F32, "SCALAR", 2);
    let weights = asset.accessor(bytemuck::cast_slice(&[0.0_f32, 1.0]), F32, "SCALAR", 2);
    let channel = json!({"sampler": 0, "target": {"node": shown, "path": "weights"}});
    asset.push(
        "animations",
        json!({"channels": [channel], "samplers": [{"input": times, "output": weights}]}),
    );
    asset.push("scenes", json!({"nodes": [shown]}));
    asset
}

fn shone(asset: Asset) -> Scene {
    let mut scene = asset.load_as(&moving()).unwrap();
    scene.environment = Some(Environment::constant(Vec3::ONE).into());
    scene
}

fn options(backend: Backend) -> RendererOptions {
    RendererOptions { backend: BackendChoice::Force(backend), ..RendererOptions::default() }
}

fn renderer(device: &Device, scene: Scene) -> Renderer {
    Renderer::new(device, scene, &options(Backend::Software)).unwrap()
}

fn config() -> RenderConfig {
    let mut config = RenderConfig { size: [32, 24], ..common::plain() };
    for setting in ["method=path", "path_trace.spp=2", "path_trace.max_depth=3"] {
        config.apply_override(setting).unwrap();
    }
    config
}

fn picture(renderer: &mut Renderer) -> Frame {
    let camera = renderer.scene().cameras[0].clone();
    renderer.render(&config(), &camera, &FrameRequest::default()).unwrap()
}

fn structures(renderer: &Renderer) -> Vec<&str> {
    renderer.structures().iter().map(|structure| &*structure.name).collect()
}

/// Share of values that differ by more than a hundredth.
fn unlike(a: &Frame, b: &Frame) -> f64 {
    let off = |(a, b): (&f32, &f32)| (a - b).abs() > 0.01 * (a.abs() + b.abs());
    let count = a.beauty.data.iter().zip(&b.beauty.data).filter(|&pair| off(pair)).count();
    count as f64 / a.beauty.data.len() as f64
}

/// However a shape was come by, and however nodes were built on the way, its picture is that of a renderer made for it, and
/// but for rounding that of the host's shape; the passes that make it are the frame's.
#[test]
fn pictures_tell_no_history() {
    let Some((_guard, device)) = common::device() else { return };
    let quilt = shone(shuffled(300));
    let [figure, morph] = ["conference-walk.glb", "cornell-moving.glb"].map(own);
    for (name, base) in [("figure", figure), ("morph", morph), ("quilt", quilt)] {
        let clips = base.clips_together();
        let pose = |share: f64| base.pose_lazily(&clips, share * end(&base)).unwrap();
        let mut moved = renderer(&device, pose(0.0));
        let first = picture(&mut moved);
        let mut rebuilt = 0;
        for share in [0.4, 0.9, 0.55] {
            let done = moved.set_scene(pose(share)).unwrap();
            assert_eq!((done.structures, done.pictures), (Redone::Shapes, true), "{name}");
            let here = picture(&mut moved);
            for path in ["deform/vertices", "deform/triangles", "deform/nodes"] {
                assert!(here.passes.iter().any(|pass| pass.path.starts_with(path)), "{name}: {path}");
            }
            assert!(here.passes.iter().all(|pass| pass.path != "deform/vertices" || pass.rays.is_none()));
            assert!(structures(&moved).contains(&"refit"), "{name}");
            rebuilt += usize::from(structures(&moved).contains(&"rebuild"));
            let again = picture(&mut moved);
            assert!(!again.passes.iter().any(|pass| pass.path.starts_with("deform")), "{name}");
            let alone = picture(&mut renderer(&device, pose(share)));
            assert!(here.beauty == alone.beauty && here.beauty == again.beauty, "{name} at {share}");
            let anew = RendererOptions { rebuild: Rebuild::Always, ..options(Backend::Software) };
            let mut anew = Renderer::new(&device, pose(share), &anew).unwrap();
            assert!(
                structures(&anew).contains(&"rebuild") && picture(&mut anew).beauty == here.beauty,
                "{name}"
            );
            assert!(here.beauty != first.beauty, "{name} at {share}");
            let host = picture(&mut renderer(&device, pose(share).shaped().unwrap().into_owned()));
            let unlike = unlike(&here, &host);
            assert!(unlike < 0.03, "{name} at {share}: {unlike}");
        }
        assert_eq!(rebuilt > 0, name == "quilt", "{name}");
        // A light beside it moves nothing.
        let lit = moved.edit(|scene| scene.environment = None).unwrap();
        assert_eq!(lit.structures, if name == "quilt" { Redone::All } else { Redone::Nothing }, "{name}");
    }
}

/// What has one level alone, or a driver's structure, is made of what the host has brought into shape.
#[test]
fn other_structures_follow() {
    let Some((_guard, device)) = common::device() else { return };
    let base = own("cornell-moving.glb");
    let clips = base.clips_together();
    let pose = |share: f64| base.pose_lazily(&clips, share * end(&base)).unwrap();
    let mut boxes = RenderConfig { size: [16, 12], ..common::plain() };
    boxes.apply_preset("fast").unwrap();
    for visibility in ["boxes", "boxes-inline"] {
        boxes.apply_override(&format!("indirect.visibility={visibility}")).unwrap();
        let drawn = |renderer: &mut Renderer| {
            let camera = renderer.scene().cameras[0].clone();
            renderer.render(&boxes, &camera, &FrameRequest::default()).unwrap().beauty
        };
        let mut moved = renderer(&device, pose(0.2));
        drawn(&mut moved);
        moved.set_scene(pose(0.7)).unwrap();
        assert!(drawn(&mut moved) == drawn(&mut renderer(&device, pose(0.7))), "{visibility}");
    }
}

/// On a driver's structures, updated or built anew, shapes are those of our own.
#[test]
fn drivers_structures_follow() {
    let Some((_guard, device)) = common::ray_query_device() else { return };
    for (name, base) in [("figure", own("conference-walk.glb")), ("quilt", shone(shuffled(300)))] {
        let clips = base.clips_together();
        let pose = |share: f64| base.pose_lazily(&clips, share * end(&base)).unwrap();
        let options = options(Backend::RayQuery);
        let mut moved = Renderer::new(&device, pose(0.0), &options).unwrap();
        let mut rebuilt = 0;
        for share in [0.9, 0.45] {
            let done = moved.set_scene(pose(share)).unwrap();
            assert_eq!(done.structures, Redone::Shapes, "{name}");
            rebuilt += usize::from(structures(&moved).contains(&"rebuild"));
            let here = picture(&mut moved);
            assert!(here.passes.iter().any(|pass| pass.path.starts_with("deform/blas")), "{name}");
            let ours = picture(&mut renderer(&device, pose(share)));
            let unlike = unlike(&here, &ours);
            assert!(unlike < 0.03, "{name} at {share}: {unlike}");
        }
        assert_eq!(rebuilt > 0, name == "quilt", "{name}");
    }
}
