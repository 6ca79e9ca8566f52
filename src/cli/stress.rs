//! `parhelion stress`.

use super::args::Stress;
use super::failure::Failure;
use super::interrupt;
use super::print::print;
use super::progress::Reporter;
use super::report::{base, check_folder};
use crate::ErrorClass;
use crate::output;
use crate::renderer::Progress;
use crate::stress::data::{self, Row, Verdict};
use crate::stress::{self, Options, report};
use crate::text;
use crate::vk::{self, DeviceOptions};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

const PAGE: &str = "index.html";
const NUMBERS: &str = "stress.json";

pub(super) fn run(args: &Stress) -> Result<(), Failure> {
    base(&args.machine)?;
    if let Some(folder) = &args.output {
        check_folder(folder, "page", [PAGE, NUMBERS])?;
    }
    interrupt::listen()?;
    let reporter = Reporter::new(&args.machine);
    let select = args.machine.device.clone();
    let device = vk::Device::open(&DeviceOptions { select, ..DeviceOptions::default() })?;
    interrupt::heeded();
    reporter.stage("stress", args.only.as_deref().unwrap_or("all scenes"));
    let progress = |progress: Progress<'_>| reporter.progress(progress);
    let options = Options {
        only: args.only.as_deref(),
        backend: args.machine.backend.into(),
        size: args.machine.size,
        seed: args.machine.seed.unwrap_or_default(),
        cancel: Some(&interrupt::CANCEL),
        progress: Some(&progress),
    };
    let stress = stress::run(&device, &options)?;
    drop(reporter);
    if let Some(folder) = &args.output {
        write(folder, &stress)?;
    }
    if !args.machine.quiet {
        let mut text = table(&stress.rows);
        if let Some(folder) = &args.output {
            let _ = writeln!(text, "\n{}: {PAGE} and {NUMBERS}", text::path(folder));
        }
        print(&text)?;
    }
    match stress.rows.iter().filter(|row| row.verdict == Verdict::Fails).count() {
        0 => Ok(()),
        failed => {
            let all = stress.rows.len();
            Err(Failure {
                class: ErrorClass::Other,
                error: anyhow::anyhow!("{failed} of {all} results fail unexpectedly"),
            })
        }
    }
}

fn write(folder: &Path, stress: &data::Stress) -> Result<(), Failure> {
    if !folder.is_dir() {
        fs::create_dir(folder).map_err(|source| output::Error { file: folder.into(), source })?;
    }
    let page = report::html(stress);
    output::write_file(&folder.join(PAGE), |out| out.write_all(page.as_bytes()))?;
    let numbers = data::Stress { images: Default::default(), ..stress.clone() };
    let json = serde_json::to_string_pretty(&numbers).map_err(std::io::Error::from)?;
    Ok(output::write_file(&folder.join(NUMBERS), |out| writeln!(out, "{json}"))?)
}

/// A line for each method under its scene, then how many there are of each verdict.
fn table(rows: &[Row]) -> String {
    let title = |row: &Row| format!("{} {}", row.method, row.setting).trim_end().to_owned();
    let width = rows.iter().map(|row| title(row).chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    let mut scene = "";
    for row in rows {
        if row.scene != scene {
            let gap = if scene.is_empty() { "" } else { "\n" };
            let _ = writeln!(text, "{gap}{}: {} ({})\n  {}", row.scene, row.number, row.bound, row.mechanism);
            scene = &row.scene;
        }
        let value = row.value.map_or("-".into(), |value| format!("{value:.3e}"));
        let _ = write!(text, "  {:<width$}  {value:>10}  {}", title(row), row.said());
        let known = row.known.as_ref().map_or(String::new(), |known| format!(": {known}"));
        let _ = writeln!(text, "{known}");
    }
    let count = |verdict| rows.iter().filter(|row| row.verdict == verdict).count();
    let _ = writeln!(
        text,
        "\n{} hold, {} fail as known, {} fail",
        count(Verdict::Holds),
        count(Verdict::FailsAsKnown),
        count(Verdict::Fails)
    );
    text
}
