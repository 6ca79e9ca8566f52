//! A picture drawn step by step: for two seconds, then with its lamp elsewhere for two more.
//! `cargo run --release --example steps -- [SCENE]`; `builtin:cornell` by default.

use glam::Vec3;
use parhelion::config::RenderConfig;
use parhelion::picture::{self, Origin};
use parhelion::renderer::{Renderer, RendererOptions, Stepper};
use parhelion::scene::{self, LoadOptions};
use parhelion::vk::{Device, DeviceOptions};
use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).unwrap_or_else(|| "builtin:cornell".into());
    let scene = scene::load(Path::new(&file), &LoadOptions::default())?;
    let camera = scene.cameras.first().cloned().unwrap_or_else(|| scene.frame_camera());
    let mut lights = scene.lights.clone();

    let device = Device::open(&DeviceOptions::default())?;
    let mut renderer = Renderer::new(&device, scene, &RendererOptions::default())?;
    let mut config = RenderConfig { size: [320, 240], ..RenderConfig::default() };
    config.apply_override("method=path")?;
    config.apply_override("path_trace.spp=65536")?;
    let mut stepper = Stepper::new(&mut renderer, &config, &camera, &[])?;
    for file in ["steps_before.png", "steps_after.png"] {
        let begun = Instant::now();
        // While a step is at work on the device, the next is prepared; an edit makes the next one begin anew.
        while begun.elapsed() < Duration::from_secs(2) && stepper.step(&mut renderer, 1)? > 0 {}
        let frame = stepper.picture(&mut renderer)?;
        picture::write(Path::new(file), &Origin::of(&renderer, &camera), &config, &frame)?;
        println!("{file}: {} samples a pixel", frame.samples.unwrap_or_default());
        if let Some(light) = lights.first_mut() {
            light.position += 0.25 * Vec3::X;
        }
        println!("moving the first light: {:?}", renderer.set_lights(lights.clone())?);
    }
    Ok(())
}
