//! What motion costs a frame, at 800x600 by `fast`: `cargo bench --bench motion [-- SCENE...]`; the scenes of our own that
//! move by default.
//!
//! The same loop draws a still scene with nothing to move, then with what is to move a level of its own, then with an edit
//! before every frame: a light, an instance, a pose of all clips. Medians of milliseconds: the edit by the host's clock, the
//! frame on the device.

use anyhow::Context;
use parhelion::accel::Rebuild;
use parhelion::config::RenderConfig;
use parhelion::renderer::{FrameRequest, Redone, Renderer, RendererOptions};
use parhelion::scene::{self, LoadOptions, Scene};
use parhelion::vk::{Device, DeviceKind, DeviceOptions};
use std::path::Path;
use std::time::Instant;

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

struct Bench<'a> {
    renderer: Renderer,
    config: &'a RenderConfig,
    frames: usize,
}

impl Bench<'_> {
    /// One line: frames with an edit before each, which says what it redid.
    fn row(
        &mut self,
        what: &str,
        mut edit: impl FnMut(&mut Renderer, usize) -> anyhow::Result<Redone>,
    ) -> anyhow::Result<()> {
        let (mut edits, mut frames, mut redone) = (Vec::new(), Vec::new(), Redone::Nothing);
        // The first tenth warms up.
        let warm_up = self.frames.div_ceil(10);
        for number in 0..warm_up + self.frames {
            let begun = Instant::now();
            redone = edit(&mut self.renderer, number)?;
            let taken = begun.elapsed().as_secs_f64() * 1e3;
            let camera = self.renderer.scene().cameras[0].clone();
            let frame = self.renderer.render(self.config, &camera, &FrameRequest::default())?;
            if number >= warm_up {
                edits.push(taken);
                frames.push(frame.total_ms.unwrap_or(frame.wall_ms));
            }
        }
        println!("| {what} | {redone:?} | {:.2} | {:.2} |", median(edits), median(frames));
        Ok(())
    }
}

fn main() -> anyhow::Result<()> {
    let names: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let own = ["conference-walk", "office-moving", "cornell-moving"];
    let names = if names.is_empty() { own.map(|name| format!("scenes/{name}.glb")).to_vec() } else { names };
    let device = Device::open(&DeviceOptions::default())?;
    let cpu = device.info().kind == DeviceKind::Cpu;
    println!("{}, {}", device.info().name, device.info().driver());
    let mut config =
        RenderConfig { size: if cpu { [160, 120] } else { [800, 600] }, ..RenderConfig::default() };
    config.apply_preset("fast")?;
    let frames = if cpu { 5 } else { 100 };
    for name in names {
        let options = LoadOptions { motion: true, ..LoadOptions::default() };
        let scene = scene::load(Path::new(&name), &options)?;
        let bench = |scene: Scene| -> anyhow::Result<_> {
            let renderer = Renderer::new(&device, scene, &RendererOptions::default())?;
            Ok(Bench { renderer, config: &config, frames })
        };
        println!("\n{name}: {} triangles", scene.world_triangles().count());
        println!("| | redone | edit ms | frame ms |\n|---|---|---|---|");
        let mut still = scene.clone();
        still.instances.iter_mut().for_each(|instance| instance.moves = false);
        bench(still)?.row("still, nothing to move", |_, _| Ok(Redone::Nothing))?;
        let mut bench = bench(scene.clone())?;
        bench.row("still", |_, _| Ok(Redone::Nothing))?;
        bench.row("a light moves", |renderer, number| {
            let by = if number % 2 == 0 { 0.01 } else { -0.01 };
            Ok(renderer
                .edit(|scene| scene.lights.iter_mut().take(1).for_each(|l| l.position.x += by))?
                .structures)
        })?;
        bench.row("instances move", |renderer, number| {
            let by = if number % 2 == 0 { 0.01 } else { -0.01 };
            let edit = |scene: &mut Scene| {
                let moving = scene.instances.iter_mut().filter(|instance| instance.moves);
                moving.for_each(|instance| instance.transform.translation.x += by);
            };
            Ok(renderer.edit(edit)?.structures)
        })?;
        let clips = scene.clips_together();
        let end = clips.iter().map(|&clip| scene.clips()[clip].end()).fold(0.0, f64::max);
        let time = |number: usize| end * (number as f64 / frames as f64) % end;
        let lazy = |number| scene.pose_lazily(&clips, time(number)).context("a pose");
        bench.row("all clips play", |renderer, number| Ok(renderer.set_scene(lazy(number)?)?.structures))?;
        if lazy(1)?.deformations.is_empty() {
            continue;
        }
        for (what, rebuild) in
            [("nodes are fitted", Rebuild::Never), ("nodes are built anew", Rebuild::Always)]
        {
            let options = RendererOptions { rebuild, ..RendererOptions::default() };
            let renderer = Renderer::new(&device, lazy(0)?, &options)?;
            let mut bench = Bench { renderer, config: &config, frames };
            let (mut refit, mut anew) = (Vec::new(), Vec::new());
            bench.row(&format!("all clips play, {what}"), |renderer, number| {
                let redone = renderer.set_scene(lazy(number)?)?.structures;
                for structure in renderer.structures() {
                    match &*structure.name {
                        "refit" => refit.push(structure.build_ms),
                        "rebuild" => anew.push(structure.build_ms),
                        _ => {}
                    }
                }
                Ok(redone)
            })?;
            let anew =
                if anew.is_empty() { String::new() } else { format!(", to build anew {:.3}", median(anew)) };
            println!("\nms on the device to bring into shape and fit {:.3}{anew}\n", median(refit));
        }
        let renderer = Renderer::new(&device, scene.clone(), &RendererOptions::default())?;
        let mut bench = Bench { renderer, config: &config, frames: frames.div_ceil(10) };
        bench.row("all clips play, all is built on the host", |renderer, number| {
            Ok(renderer.set_scene(scene.pose(&clips, time(10 * number))?)?.structures)
        })?;
    }
    Ok(())
}
