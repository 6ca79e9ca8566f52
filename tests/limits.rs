//! Pictures and lists that are larger than what a device binds, dispatches or should be asked to keep.

mod common;

use common::device;
use glam::{Vec3, vec3};
use parhelion::ErrorClass;
use parhelion::config::RenderConfig;
use parhelion::graph::Typical;
use parhelion::renderer::{self, Aov, BackendChoice, Frame, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{Camera, Scene, builtin};
use parhelion::shaders::Vpl;
use parhelion::techniques::indirect::Upsample;
use parhelion::vk::{Backend, Device};

fn scene(name: &str) -> (Scene, Camera) {
    let scene = builtin::by_name(name).unwrap();
    let camera = scene.cameras[0].clone();
    (scene, camera)
}

fn software(device: &Device, scene: Scene) -> Renderer {
    let options =
        RendererOptions { backend: BackendChoice::Force(Backend::Software), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

fn config(size: [u32; 2], vpls: u32) -> RenderConfig {
    let mut config = RenderConfig { size, ..common::plain() };
    config.vpl_shoot.vpls = vpls;
    config.vpl_shoot.bounces = Some(1);
    config
}

fn picture(renderer: &mut Renderer, config: &RenderConfig, camera: &Camera, aovs: &[Aov]) -> Frame {
    renderer.render(config, camera, &FrameRequest { aovs, ..FrameRequest::default() }).unwrap()
}

/// Two lists of VPLs, with and without gaps, and not an image more for each range that is gathered. A plane lights no
/// plane.
#[test]
fn a_million_vpls_take_two_lists() {
    let Some((_guard, device)) = device() else { return };
    let (scene, camera) = scene("plane");
    let mut renderer = software(&device, scene);
    let vpls = 1 << 20;
    device.reset_peak();
    let before = device.memory().current;
    let frame = picture(&mut renderer, &config([64, 48], vpls), &camera, &[Aov::Irradiance]);
    let lists = 2 * u64::from(vpls) * size_of::<Vpl>() as u64;
    let bytes = frame.peak_device_bytes - before;
    assert!(bytes > lists && bytes < lists + (4 << 20), "{bytes} bytes, {lists} of lists");
    assert!(frame.vpl_count > Some(vpls / 4), "{:?}", frame.vpl_count);
    assert!(frame.beauty.data.iter().any(|&v| v > 0.0));
    assert!(frame.aovs[0].1.data.iter().all(|&v| v == 0.0));
}

/// What no device of the common kind binds is refused in a sentence that names it.
#[test]
fn more_vpls_than_a_buffer_holds_are_refused() {
    let (scene, _) = scene("plane");
    let mut config = config([64, 48], 1 << 24);
    config.vpl_shoot.bounces = Some(32);
    let error = renderer::plan(&scene, &config, &[], &Typical).unwrap_err();
    assert_eq!(error.class(), ErrorClass::Input);
    let (text, bytes) = (error.to_string(), format!("{} bytes", size_of::<Vpl>() << 24));
    assert!(text.contains("`slots`") && text.contains(&bytes), "{text}");
}

/// Points behind mirrors are listed strip by strip: the picture is that of its parts.
#[test]
fn large_pictures_of_mirrors_are_drawn_in_strips() {
    let Some((_guard, device)) = device() else { return };
    // A mirror fills the view.
    let scene = builtin::mirror_box(vec3(4.0, 3.0, 5.0), Vec3::splat(0.5), 4);
    let camera = Camera::look_at("camera", vec3(2.0, 1.5, 1.0), vec3(2.0, 1.5, 0.0), 1.0);
    let mut renderer = software(&device, scene);
    let mut config = config([2048, 1536], 2);
    let whole = picture(&mut renderer, &config, &camera, &[Aov::Specular]);
    // Over the first border between strips.
    let [x0, y0, x1, y1] = [512, 500, 640, 524];
    config.crop = Some([x0, y0, x1, y1]);
    let part = picture(&mut renderer, &config, &camera, &[Aov::Specular]);
    let rows = part.aovs[0].1.data.chunks_exact(3 * (x1 - x0) as usize);
    assert!(part.aovs[0].1.data.iter().all(|&v| v > 0.0));
    for (y, row) in (y0..y1).zip(rows) {
        let start = 3 * (y * 2048 + x0) as usize;
        assert_eq!(&whole.aovs[0].1.data[start..start + row.len()], row, "row {y}");
    }
    assert!(whole.aovs[0].1.data.iter().all(|&v| v > 0.0));
}

/// More pixels than one row of workgroups takes are gathered by themselves: none is forgotten.
#[test]
fn long_lists_are_dispatched_in_rows() {
    let Some((_guard, device)) = device() else { return };
    let (scene, camera) = scene("sphere");
    let mut renderer = software(&device, scene);
    let mut config = config([768, 512], 1);
    config.indirect.min_distance = Some(0.0);
    let full = picture(&mut renderer, &config, &camera, &[Aov::Irradiance]);
    config.indirect.downsample = 2;
    config.indirect.upsample = Upsample::Plane;
    config.indirect.plane_threshold = 1e-30; // nothing but a pixel's own sample fits it
    let listed = picture(&mut renderer, &config, &camera, &[Aov::Irradiance]);
    let regathered = listed.regathered.unwrap();
    assert!(regathered > 4 * 65535, "{regathered}");
    let pixels = || full.aovs[0].1.data.chunks_exact(3).zip(listed.aovs[0].1.data.chunks_exact(3));
    assert!(pixels().all(|(full, listed)| (full[0] > 0.0) == (listed[0] > 0.0)));
    assert!(pixels().filter(|(full, listed)| full == listed).count() as u32 >= regathered);
}
