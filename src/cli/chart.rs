//! `parhelion chart`.

use super::args::Chart;
use super::failure::{Failure, input};
use super::print::print;
use super::progress::Reporter;
use super::report::folder;
use super::{interrupt, report, scene};
use crate::chart::choose::Front;
use crate::chart::sweep::FILES;
use crate::chart::{self, Reference, ReferenceRequest, Sweep, grid, reference};
use crate::config::{ConfigError, RenderConfig};
use crate::methods;
use crate::output;
use crate::renderer::{self, RendererOptions};
use crate::text;
use crate::vk::DeviceKind;
use std::fmt::Write as _;
use std::fs;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Repeats on devices that are no CPU.
const REPEAT: u32 = 5;

/// Where the reference is kept in the report's folder.
const REFERENCE: &str = "reference.exr";

pub(super) fn run(args: &Chart) -> Result<(), Failure> {
    let begun = Instant::now();
    let depth = args.reference_depth.unwrap_or(reference::DEPTH);
    let base = base(args, depth)?;
    let settings = grid::settings(&args.grid, &base).map_err(|error| input!("--grid: {error}"))?;
    let folder = folder(args.output.as_deref(), &args.common, "-chart", FILES)?;
    let given = args.reference.as_deref().map(|file| Reference::read(file, base.size));
    let given = given.transpose().map_err(|error| input!("--reference: {error}"))?;
    interrupt::listen()?;
    let reporter = Reporter::new(&args.machine);
    let name = scene::name(&args.common);
    let (scene, camera) = scene::load(&args.common, &reporter)?;

    let options = RendererOptions { backend: args.machine.backend.into(), ..RendererOptions::default() };
    let mut renderer = scene::renderer(scene, &args.common, &args.machine, &options, &reporter)?;
    fs::create_dir_all(&folder).map_err(|source| output::Error { file: folder.clone(), source })?;

    interrupt::heeded();
    let progress = |progress: renderer::Progress<'_>| reporter.progress(progress);
    let reference = match given {
        Some(reference) => reference,
        None => {
            reporter.stage("reference", &name);
            let request = ReferenceRequest {
                camera: &camera,
                size: base.size,
                spp: args.reference_spp,
                // Half of what there is, at most.
                time: args.time_limit.map_or(reference::TIME, |limit| reference::TIME.min(limit / 2)),
                depth,
                file: &folder.join(REFERENCE),
                cancel: Some(&interrupt::CANCEL),
                progress: Some(&progress),
            };
            reference::reference(&mut renderer, &request)?
        }
    };
    reporter.stage("chart", &name);
    let repeat =
        args.repeat.unwrap_or(if renderer.device().info().kind == DeviceKind::Cpu { 0 } else { REPEAT });
    let sweep = Sweep {
        settings: &settings,
        reference: &reference,
        camera: &camera,
        seeds: args.seeds,
        seed: base.seed,
        repeat,
        folder: &folder,
        deadline: args.time_limit.and_then(|limit| begun.checked_add(limit)),
        cancel: Some(&interrupt::CANCEL),
        progress: Some(&progress),
    };
    let chart = chart::run(&mut renderer, &sweep)?;
    // Settings are picked from it later; not from one that was measured against a picture of the user's own.
    let size = chart.size;
    if args.reference.is_none() && (chart.complete || Front::cached(&renderer, &camera, size).is_none()) {
        Front::of_chart(&chart, size).remember(&renderer, &camera, size);
    }
    drop(reporter);
    if interrupt::CANCEL.load(Ordering::SeqCst) {
        return Err(renderer::Error::Cancelled.into());
    }
    if args.machine.quiet {
        return Ok(());
    }
    let mut text = chart.table();
    if !chart.complete {
        let done: u32 = chart.points.iter().map(|point| point.seeds).sum();
        let all = settings.len() as u32 * args.seeds;
        let _ = writeln!(text, "\nnot complete: {done} of {all} measurements; run the same command to go on");
    }
    let _ = writeln!(text, "\n{}", text::path(&folder.join(FILES[2])));
    print(&text)
}

/// Paths begin at pixels' centres, as the other methods' do, and are as long as the reference's.
fn base(args: &Chart, depth: u32) -> Result<RenderConfig, Failure> {
    let mut base = report::base(&args.machine)?;
    methods::comparable(&mut base, Some(depth));
    base.validate().map_err(|error| match error {
        ConfigError::Value { problem, .. } => input!("--reference-depth: {problem}"),
        error => error.into(),
    })?;
    Ok(base)
}
