//! `parhelion render --budget` and `--error`.

use super::args::Render;
use super::failure::{Failure, input};
use super::interrupt;
use super::progress::Reporter;
use crate::chart::choose::{Candidate, Front, Probe, Wish, choose, probe};
use crate::chart::data::{Chart, SCHEMA};
use crate::chart::{grid, reference};
use crate::config::RenderConfig;
use crate::metrics;
use crate::read;
use crate::renderer::{Frame, Progress, Renderer};
use crate::scene::Camera;
use std::path::Path;

/// What was picked, and why.
pub(super) struct Chosen {
    pub(super) config: RenderConfig,
    pub(super) report: String,
    candidate: Candidate,
}

/// What the user wants, if settings are to be picked.
pub(super) fn wish(args: &Render) -> Result<Option<Wish>, Failure> {
    let budget = args.budget.map(|budget| Wish::Ms(1e3 * budget.as_secs_f64()));
    let wish = budget.or(args.error.map(Wish::RelMse));
    if wish.is_none() && args.front.is_some() {
        return Err(input!("--front: needs --budget or --error"));
    }
    Ok(wish)
}

/// Picks settings from the front that is given, there, or found by a probe.
pub(super) fn chosen(
    args: &Render,
    wish: Wish,
    config: &RenderConfig,
    renderer: &mut Renderer,
    camera: &Camera,
    reporter: &Reporter,
) -> Result<Chosen, Failure> {
    let size = config.size;
    let front = match &args.front {
        Some(file) => given(file, size, renderer, camera, reporter)?,
        None => match Front::cached(renderer, camera, size) {
            Some(front) => front,
            None => {
                interrupt::heeded();
                reporter.stage("probe", "methods and settings");
                let progress = |progress: Progress<'_>| reporter.progress(progress);
                let request =
                    Probe { camera, size, cancel: Some(&interrupt::CANCEL), progress: Some(&progress) };
                let front = probe(renderer, &request)?;
                front.remember(renderer, camera, size);
                front
            }
        },
    };
    let Some(choice) = choose(&front.candidates, wish) else {
        return Err(input!("--front: {}: no point to pick", front.about));
    };
    let Candidate { label, settings, ms, rel_mse } = choice.candidate;
    let asked = match wish {
        Wish::Ms(ms) => format!("budget {ms} ms"),
        Wish::RelMse(error) => format!("error {error}"),
    };
    let nearest = if choice.fulfils { "" } else { " (nothing fulfils it; this is the nearest)" };
    let report = format!(
        "picked for {asked}{nearest}: {label}\npredicted: {ms:.2} ms, relMSE {rel_mse:.4}, by {}\n",
        front.about
    );
    Ok(Chosen { config: grid::config(settings, config)?, report, candidate: choice.candidate.clone() })
}

fn given(
    file: &Path,
    size: [u32; 2],
    renderer: &Renderer,
    camera: &Camera,
    reporter: &Reporter,
) -> Result<Front, Failure> {
    let name = file.display();
    let text = read::at_most(file, read::RESULTS).map_err(|error| input!("--front: {name}: {error}"))?;
    let chart: Chart = serde_json::from_slice(read::without_mark(&text))
        .map_err(|error| input!("--front: {name}: {error}"))?;
    if chart.schema != SCHEMA {
        return Err(input!("--front: {name}: its schema is {}, not {SCHEMA}", chart.schema));
    }
    let fingerprint = format!("{:016x}", renderer.scene().fingerprint(camera));
    let device = &renderer.device().info().name;
    let backend = renderer.backend().0.name();
    for (what, there, here) in [
        ("scene or camera", &chart.fingerprint, &fingerprint),
        ("device", &chart.device, device),
        ("backend", &chart.backend, &backend.to_owned()),
    ] {
        if there != here {
            reporter.note(&format!("--front: {name} is of another {what}: {there}, not {here}"));
        }
    }
    Ok(Front::of_chart(&chart, size))
}

impl Chosen {
    /// What came of it.
    pub(super) fn outcome(&self, frame: &Frame, renderer: &Renderer, camera: &Camera) -> String {
        let ms = frame.total_ms.unwrap_or(frame.wall_ms);
        let against = |got: f64, predicted: f64| format!("{:+.0} %", 100.0 * (got / predicted - 1.0));
        let mut text = format!("got: {ms:.2} ms ({})", against(ms, self.candidate.ms));
        let reference = reference::cached(renderer, camera, self.config.size);
        text += &match reference {
            Some(reference) => {
                let error = metrics::rel_mse(&frame.beauty.data, &reference.layer.data);
                let error = (error - reference.noise(metrics::rel_mse).unwrap_or(0.0)).max(0.1 * error);
                format!(", relMSE {error:.4} ({})\n", against(error, self.candidate.rel_mse))
            }
            None => "; its error is known once `parhelion chart` has made a reference\n".into(),
        };
        text
    }
}
