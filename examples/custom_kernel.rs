//! A kernel of one's own, compiled at run time against `trace.glsl` and run on any scene:
//! `cargo run --release --features compile --example custom_kernel -- [SCENE] [FILE.png]`

use parhelion::config::RenderConfig;
use parhelion::graph::{Graph, Grid, ImageDesc, ParamValue, RuntimeKernel};
use parhelion::renderer::{Renderer, RendererOptions};
use parhelion::scene::{self, LoadOptions};
use parhelion::vk::{Device, DeviceOptions, Format};
use std::error::Error;
use std::path::Path;

const GLSL: &str = include_str!("ambient_occlusion.comp");

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().unwrap_or_else(|| format!("builtin:{}", scene::builtin::DEFAULT));
    let file = arguments.next().unwrap_or_else(|| "ambient_occlusion.png".into());

    let device = Device::open(&DeviceOptions::default())?;
    let scene = scene::load(Path::new(&scene), &LoadOptions::default())?;
    let camera = scene.cameras[0].clone();
    let mut renderer = Renderer::new(&device, scene, &RendererOptions::default())?;
    let kernel = RuntimeKernel::from_glsl(&renderer, "ambient_occlusion.comp", GLSL)?;

    let config = RenderConfig { size: [640, 480], ..RenderConfig::default() };
    let mut g = Graph::new();
    let ao = g.image("ao", ImageDesc::new(config.size, Format::Rgba32Float));
    let params = [("radius", ParamValue::from(0.5f32)), ("samples", ParamValue::from(64u32))];
    g.pass_named("ambient_occlusion", &kernel, &[("out_ao", ao.into())], &params, Grid::Over(ao))?;
    let ticket = g.read_image::<[f32; 4]>(ao);
    let mut run = renderer.run(g, &config, &camera)?;

    let gray: Vec<u8> = run.take(ticket).iter().map(|texel| (texel[0].sqrt() * 255.0) as u8).collect();
    image::save_buffer(&file, &gray, config.size[0], config.size[1], image::ColorType::L8)?;
    println!("{file} on {} ({})", device.info().name, renderer.backend().0.name());
    Ok(())
}
