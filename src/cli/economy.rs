//! What things that a scene does not need would cost, had they not been left out: the table of `render --explain`.

use super::interrupt;
use crate::config::RenderConfig;
use crate::renderer::{Error, FrameRequest, Progress, Renderer};
use crate::scene::{Camera, Feature};
use crate::vk::DeviceKind;
use serde_json::{Value, json};
use std::fmt::Write;

/// Frames of each kind, on devices that are no CPU.
const REPEAT: u32 = 5;

/// Samples a pixel of progressive methods, at most.
const SAMPLES: u32 = 8;

/// Milliseconds of a frame.
pub(super) struct Economy {
    repeat: u32,
    /// Of progressive methods.
    samples: Option<u32>,
    cpu: bool,
    specialised: f64,
    general: f64,
    /// With one feature for nothing, the dearest first.
    features: Vec<(Feature, f64)>,
}

/// Renders further frames, by turns as the scene needs, with everything and with each thing that it does not need.
pub(super) fn measure(
    renderer: &mut Renderer,
    config: &RenderConfig,
    camera: &Camera,
    repeat: Option<u32>,
    progress: &dyn Fn(Progress<'_>),
) -> Result<Economy, Error> {
    let mut config = config.clone();
    if let Some(progressive) = config.method.progressive {
        let samples = (progressive.samples)(&config).min(SAMPLES);
        (progressive.set_samples)(&mut config, samples);
    }
    let cpu = renderer.device().info().kind == DeviceKind::Cpu;
    let repeat = repeat.unwrap_or(if cpu { 1 } else { REPEAT });
    let unneeded = renderer.unneeded(&config);
    let ways: Vec<&[Feature]> = std::iter::once(&unneeded[..]).chain(unneeded.chunks(1)).collect();
    let request = FrameRequest {
        repeat,
        beside: &ways,
        cancel: Some(&interrupt::CANCEL),
        progress: Some(progress),
        ..FrameRequest::default()
    };
    let frame = renderer.render(&config, camera, &request)?;
    let specialised = frame.total_ms.unwrap_or(frame.wall_ms);
    let mut times = frame.beside_ms.into_iter();
    let general = times.next().unwrap_or(specialised);
    let mut features: Vec<(Feature, f64)> = unneeded.iter().copied().zip(times).collect();
    features.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    Ok(Economy { repeat, samples: frame.samples, cpu, specialised, general, features })
}

impl Economy {
    /// A line for each thing, with its ratio to what the scene needs.
    pub(super) fn table(&self) -> String {
        let things = self.features.iter().map(|&(feature, ms)| (format!("  {}", feature.name()), ms));
        let rows: Vec<_> = std::iter::once(("everything".to_owned(), self.general)).chain(things).collect();
        let width = rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0).max(20);
        let mut text = format!("{:<width$}  {:>9}  ratio\n", "modelled, not needed", "ms");
        let _ = writeln!(text, "{:<width$}  {:>9.3}", "nothing", self.specialised);
        for (name, ms) in rows {
            let _ = writeln!(text, "{name:<width$}  {ms:>9.3}  {:>5.2}", ms / self.specialised);
        }
        let plural = if self.repeat == 1 { "" } else { "s" };
        let _ = write!(text, "(further frames, {} time{plural} each by turns", self.repeat);
        if let Some(samples) = self.samples {
            let _ = write!(text, ", of {samples} samples a pixel");
        }
        text.push_str(if self.cpu { "; on a CPU device mostly noise)\n" } else { ")\n" });
        text
    }

    /// As `docs/stats.schema.json` describes it.
    pub(super) fn json(&self) -> Value {
        let thing = |&(feature, ms): &(Feature, f64)| json!({ "name": feature.name(), "ms": ms });
        json!({
            "repeat": self.repeat,
            "samples": self.samples,
            "ms": self.specialised,
            "general_ms": self.general,
            "features": self.features.iter().map(thing).collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_to_what_the_scene_needs() {
        let features = vec![(Feature::Mirrors, 6.0), (Feature::Uv1, 4.1)];
        let economy =
            Economy { repeat: 5, samples: Some(8), cpu: true, specialised: 4.0, general: 9.0, features };
        let text = economy.table();
        let cells: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(cells[1], ["nothing", "4.000"]);
        assert_eq!(cells[2], ["everything", "9.000", "2.25"]);
        assert_eq!(cells[3], ["mirrors", "6.000", "1.50"]);
        assert_eq!(cells[4][3..], ["4.100", "1.02"]);
        assert!(text.contains("5 times each") && text.contains("8 samples") && text.contains("noise"));
        let columns: Vec<usize> = text.lines().skip(2).take(3).map(str::len).collect();
        assert!(columns.windows(2).all(|pair| pair[0] == pair[1]), "{text}");
        assert_eq!(economy.json()["features"][1]["ms"], 4.1);
    }
}
