//! What rays bring that ask the radiance cache: bits whatever part of the picture is drawn, and light against path tracing.

mod common;

use common::mean;
use parhelion::config::RenderConfig;
use parhelion::renderer::{BackendChoice, Frame, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::builtin;
use parhelion::vk::Backend;

fn configuration(assignments: &[&str]) -> RenderConfig {
    let mut config = common::plain();
    assignments.iter().for_each(|assignment| config.apply_override(assignment).unwrap());
    config
}

fn renderer(device: &parhelion::vk::Device, scene: &str) -> Renderer {
    let options =
        RendererOptions { backend: BackendChoice::Force(Backend::Software), ..RendererOptions::default() };
    Renderer::new(device, builtin::by_name(scene).unwrap(), &options).unwrap()
}

fn draw(renderer: &mut Renderer, config: &RenderConfig) -> Frame {
    let camera = renderer.scene().cameras[0].clone();
    renderer.render(config, &camera, &FrameRequest::default()).unwrap()
}

const ALL: [&str; 4] =
    ["indirect.compensation=4", "vpl_shoot.vpls=180", "indirect.interleave=3", "indirect.filter=combined"];

/// The Office has mirrors, glass and glossy lobes.
#[test]
fn a_part_has_the_bits_of_the_whole() {
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = renderer(&device, "office");
    let mut config = configuration(&ALL);
    config.size = [32, 24];
    let whole = draw(&mut renderer, &config);
    assert!(whole.beauty.data == draw(&mut renderer, &config).beauty.data, "two frames differ");
    for [x0, y0, x1, y1] in [[0, 0, 32, 9], [5, 7, 18, 20], [31, 23, 32, 24]] {
        config.crop = Some([x0, y0, x1, y1]);
        let part = draw(&mut renderer, &config);
        for y in y0..y1 {
            let row = |width: u32, x: u32, y: u32| 3 * (y * width + x) as usize;
            let (of_whole, of_part) = (row(32, x0, y), row(x1 - x0, 0, y - y0));
            let length = 3 * (x1 - x0) as usize;
            let [whole, part] = [&whole.beauty.data[of_whole..], &part.beauty.data[of_part..]];
            assert!(whole[..length] == part[..length], "row {y} of {:?}", config.crop);
        }
    }
}

/// Mean light of a room over seeds, beside path tracing's: with rays it is all there whatever bounds VPLs, without them it
/// is not.
#[test]
fn rays_bring_what_bounding_takes() {
    let Some((_guard, device)) = common::device() else { return };
    let mut renderer = renderer(&device, "two-albedo");
    let mut over_seeds = |assignments: &[&str], seeds: u32| {
        let mut sum = 0.0;
        for seed in 1..=seeds {
            let mut config = configuration(assignments);
            (config.size, config.seed) = ([24, 18], seed);
            sum += mean(&draw(&mut renderer, &config).beauty.data);
        }
        sum / f64::from(seeds)
    };
    let truth = over_seeds(&["method=path", "path_trace.spp=512", "path_trace.pixel_filter=center"], 1);
    let vpls = "vpl_shoot.vpls=900";
    for distance in ["indirect.min_distance=1", "indirect.min_distance=100"] {
        let with = over_seeds(&[vpls, distance, "indirect.compensation=8"], 6) / truth;
        assert!((with - 1.0).abs() < 0.03, "{distance}: {with}");
        let without = over_seeds(&[vpls, distance], 2) / truth;
        assert!(without < 0.95, "{distance}: {without} without rays");
    }
}
