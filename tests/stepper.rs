//! Pictures drawn step by step, edits between steps, and scenes that renderers share.

mod common;

use glam::Vec3;
use parhelion::config::RenderConfig;
use parhelion::renderer::{Aov, Error, Frame, FrameRequest, Redone, Renderer, RendererOptions, Stepper};
use parhelion::scene::{Camera, Light, LightKind, Scene, builtin};
use parhelion::vk::{self, Device, MemoryKind};
use std::sync::Arc;

fn cornell() -> (Scene, Camera) {
    let scene = builtin::by_name("cornell").unwrap();
    let camera = scene.cameras[0].clone();
    (scene, camera)
}

fn renderer(device: &Device) -> (Renderer, Camera) {
    let (scene, camera) = cornell();
    (Renderer::new(device, scene, &RendererOptions::default()).unwrap(), camera)
}

fn config(assignments: &[&str]) -> RenderConfig {
    let mut config = RenderConfig { size: [24, 18], ..common::plain() };
    assignments.iter().for_each(|assignment| config.apply_override(assignment).unwrap());
    config
}

fn lamp(x: f32, kind: LightKind) -> Light {
    let position = Vec3::new(x, 0.4, 0.1);
    Light { name: "lamp".into(), kind, position, direction: Vec3::NEG_Y, intensity: Vec3::splat(0.5) }
}

fn render(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera, aovs: &[Aov]) -> Frame {
    renderer.render(config, camera, &FrameRequest { aovs, ..FrameRequest::default() }).unwrap()
}

fn assert_same(what: &str, a: &Frame, b: &Frame) {
    assert!(a.beauty == b.beauty && a.display == b.display && a.aovs == b.aovs, "{what}");
}

const PATH: &[&str] = &["method=path", "path_trace.spp=7"];

#[test]
fn steps_of_any_size_come_to_the_same_picture() {
    let Some((_guard, device)) = common::device() else { return };
    let (mut renderer, camera) = renderer(&device);
    for assignments in [
        PATH,
        &["method=path", "path_trace.spp=40", "path_trace.adaptive=true"],
        &["pixel_samples=5"],
        &["pixel_samples=1"],
        &["crop=[3,2,17,12]", "indirect.downsample=2"],
    ] {
        let config = config(assignments);
        let aovs = [Aov::Albedo, Aov::Depth];
        let expected = render(&mut renderer, &config, &camera, &aovs);
        for size in [1, 2, 100] {
            let mut stepper = Stepper::new(&mut renderer, &config, &camera, &aovs).unwrap();
            let mut looked = false;
            while stepper.samples() < stepper.target() {
                assert!(stepper.step(&mut renderer, size).unwrap() > 0);
                // A look on the way changes nothing of what comes.
                if !std::mem::replace(&mut looked, true) {
                    let frame = stepper.picture(&mut renderer).unwrap();
                    assert!(frame.beauty.data.iter().all(|v| v.is_finite()));
                }
            }
            assert_eq!(stepper.step(&mut renderer, size).unwrap(), 0);
            let frame = stepper.picture(&mut renderer).unwrap();
            assert_same(&format!("{assignments:?} by {size}"), &frame, &expected);
            assert_eq!(frame.samples, expected.samples);
        }
    }
}

#[test]
fn edits_say_what_they_invalidate_and_begin_the_picture_anew() {
    let Some((_guard, device)) = common::device() else { return };
    let (mut renderer, camera) = renderer(&device);
    let config = config(PATH);
    renderer.set_lights(vec![lamp(0.0, LightKind::Point)]).unwrap();
    render(&mut renderer, &config, &camera, &[]);
    let structures = renderer.structures().to_vec();
    let mut stepper = Stepper::new(&mut renderer, &config, &camera, &[]).unwrap();
    stepper.step(&mut renderer, 3).unwrap();
    // The step is still under way.
    let moved = renderer.set_lights(vec![lamp(0.2, LightKind::Point)]).unwrap();
    assert_eq!((moved.pictures, moved.pipelines, moved.structures), (true, false, Redone::Nothing));
    assert_eq!(stepper.step(&mut renderer, 2).unwrap(), 2);
    assert_eq!(stepper.samples(), 2, "the samples under the old light are gone");
    while stepper.step(&mut renderer, 4).unwrap() > 0 {}
    let expected = render(&mut renderer, &config, &camera, &[]);
    assert_same("moved", &stepper.picture(&mut renderer).unwrap(), &expected);

    let cone = LightKind::Spot { inner: 0.2, outer: 0.6 };
    let turned = renderer.set_lights(vec![lamp(0.2, cone)]).unwrap();
    assert_eq!((turned.pictures, turned.pipelines, turned.structures), (true, true, Redone::Nothing));
    assert_eq!(renderer.structures(), structures);
    let mut scene = cornell().0;
    scene.lights = vec![lamp(0.2, cone)];
    let mut fresh = Renderer::new(&device, scene, &RendererOptions::default()).unwrap();
    let expected = render(&mut fresh, &config, &camera, &[]);
    while stepper.step(&mut renderer, 4).unwrap() > 0 {}
    assert_same("spot", &stepper.picture(&mut renderer).unwrap(), &expected);

    let nan = Light { intensity: Vec3::splat(f32::NAN), ..lamp(0.0, LightKind::Point) };
    assert!(matches!(renderer.set_lights(vec![nan]), Err(Error::Scene(_))));
    assert_same("refused", &render(&mut renderer, &config, &camera, &[]), &expected);
}

#[test]
fn another_view_is_another_picture() {
    let Some((_guard, device)) = common::device() else { return };
    let (mut renderer, camera) = renderer(&device);
    let nearer = Camera::look_at("nearer", Vec3::new(0.1, 0.2, 1.0), Vec3::ZERO, 0.8);
    let config = config(PATH);
    let mut stepper = Stepper::new(&mut renderer, &config, &camera, &[]).unwrap();
    stepper.step(&mut renderer, 3).unwrap();
    stepper.set_camera(&camera);
    assert_eq!(stepper.samples(), 3);
    stepper.set_camera(&nearer);
    assert_eq!(stepper.samples(), 0);
    while stepper.step(&mut renderer, 3).unwrap() > 0 {}
    let expected = render(&mut renderer, &config, &nearer, &[]);
    assert_same("nearer", &stepper.picture(&mut renderer).unwrap(), &expected);
}

/// Two renderers of one prepared scene: neither sees the other's edits, and what is shared is not uploaded twice.
#[test]
fn renderers_share_a_scene_and_not_their_edits() {
    let Some((_guard, device)) = common::device() else { return };
    let (mut first, camera) = renderer(&device);
    let config = config(PATH);
    let expected = render(&mut first, &config, &camera, &[]);
    let bytes = |name: &str| device.memory().by_name.get(name).copied().unwrap_or_default();
    let before = ["scene.positions", "bvh.nodes"].map(bytes);
    let mut second = Renderer::of(Arc::clone(first.prepared())).unwrap();
    let mut steps = Stepper::new(&mut first, &config, &camera, &[]).unwrap();
    steps.step(&mut first, 3).unwrap();
    second.set_lights(vec![lamp(0.0, LightKind::Point)]).unwrap();
    let other = render(&mut second, &config, &camera, &[]);
    assert!(other.beauty != expected.beauty);
    while steps.step(&mut first, 3).unwrap() > 0 {}
    assert_same("the first renderer's", &steps.picture(&mut first).unwrap(), &expected);
    assert_eq!(["scene.positions", "bvh.nodes"].map(bytes), before);
}

#[test]
fn lights_stay_whole_where_memory_runs_out() {
    let Some((_guard, device)) = common::device() else { return };
    let (mut renderer, camera) = renderer(&device);
    let config = config(&[]);
    let expected = render(&mut renderer, &config, &camera, &[]);
    // Takes all there is; untouched pages cost the machine nothing.
    let mut hogs = Vec::new();
    let mut size = 1 << 30;
    while size >= 1 << 12 {
        match device.buffer("hog", size, MemoryKind::Device) {
            Ok(hog) => hogs.push(hog),
            Err(vk::Error::OutOfDeviceMemory { .. }) => size /= 2,
            Err(error) => panic!("{error}"),
        }
    }
    let many = vec![lamp(0.0, LightKind::Point); 20_000];
    let refused = renderer.set_lights(many);
    drop(hogs);
    assert!(matches!(refused, Err(Error::Vulkan(vk::Error::OutOfDeviceMemory { .. }))), "{refused:?}");
    assert_same("as before", &render(&mut renderer, &config, &camera, &[]), &expected);
}
