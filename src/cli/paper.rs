//! `parhelion paper`.

use super::args::Paper;
use super::failure::Failure;
use super::print::print;
use super::progress::Reporter;
use super::report::{base, folder};
use super::{interrupt, scene};
use crate::output;
use crate::paper::{self, AMPLIFICATION, APPROACHES, Experiment, Pictures, Report, Row};
use crate::renderer;
use crate::text;
use crate::vk::DeviceKind;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Repeats on devices that are no CPU.
const REPEAT: u32 = 10;

pub(super) fn run(args: &Paper) -> Result<(), Failure> {
    let base = base(&args.machine)?;
    let pictures = APPROACHES.iter().flat_map(|a| std::iter::once(a.picture()).chain(a.difference()));
    let files = ["paper.json", "paper.md"].map(String::from).into_iter().chain(pictures);
    let folder = folder(args.output.as_deref(), &args.common, "-paper", files)?;
    interrupt::listen()?;
    let reporter = Reporter::new(&args.machine);
    let name = scene::name(&args.common);
    let (scene, camera) = scene::load(&args.common, &reporter)?;

    let options = paper::renderer_options(args.machine.backend.into());
    let mut renderer = scene::renderer(scene, &args.common, &args.machine, &options, &reporter)?;

    interrupt::heeded();
    reporter.stage("render", &name);
    let progress = |progress: renderer::Progress<'_>| reporter.progress(progress);
    let repeat =
        args.repeat.unwrap_or(if renderer.device().info().kind == DeviceKind::Cpu { 0 } else { REPEAT });
    let experiment = Experiment {
        base: &base,
        camera: &camera,
        repeat,
        cancel: Some(&interrupt::CANCEL),
        progress: Some(&progress),
    };
    let report = paper::run(&mut renderer, &experiment, |report, pictures| write(&folder, report, pictures))?;
    drop(reporter);
    if args.machine.quiet {
        return Ok(());
    }
    let mut text = report.markdown();
    let _ = writeln!(text, "\n{}: paper.md, paper.json and pictures", text::path(&folder));
    print(&text)
}

/// Writes a row's pictures, then the report anew.
fn write(folder: &Path, report: &Report, pictures: Option<(&Row, Pictures<'_>)>) -> Result<(), Failure> {
    if !folder.is_dir() {
        fs::create_dir(folder).map_err(|source| output::Error { file: folder.into(), source })?;
    }
    if let Some((row, pictures)) = pictures {
        let [width, _] = report.base.size;
        let texts = |more: (&'static str, String)| {
            [
                ("Software", output::SOFTWARE.to_owned()),
                ("Approach", format!("{}, {} VPLs", row.approach, row.vpls)),
                ("Tone mapping", report.base.tone_map.operator.title().to_owned()),
                ("Exposure", format!("{:+.2} EV (that of {})", report.exposure_ev, APPROACHES[0].preset)),
                more,
            ]
        };
        if let Some(file) = &row.picture {
            let milliseconds = ("Milliseconds", format!("{:.2}", row.frame_ms));
            output::write_png(&folder.join(file), width, pictures.display, &texts(milliseconds))?;
        }
        if let (Some(file), Some(pixels)) = (&row.difference, pictures.difference) {
            let what =
                format!("|picture - {}| x {AMPLIFICATION}, of sRGB display values", APPROACHES[0].preset);
            output::write_png(&folder.join(file), width, pixels, &texts(("Difference", what)))?;
        }
    }
    let json = serde_json::to_string_pretty(report).map_err(std::io::Error::from)?;
    output::write_file(&folder.join("paper.json"), |out| writeln!(out, "{json}"))?;
    output::write_file(&folder.join("paper.md"), |out| out.write_all(report.markdown().as_bytes()))?;
    Ok(())
}
