//! The report for people.

use super::{AMPLIFICATION, APPROACHES, PictureError, Report, Row, VPLS};
use crate::text::markdown;
use std::fmt::Write;

impl Report {
    /// The report as Markdown: a table of times and one of errors, a line each for every row, then structures and
    /// pictures.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text =
            format!("# {}: the experiment of Marques and Santos (2010)\n\n", markdown(&self.scene.name));
        if !self.complete {
            let rows = VPLS.len() * APPROACHES.len();
            let _ = writeln!(text, "**Not complete**: {} of {rows} rows are there.\n", self.rows.len());
        }
        let [width, height] = self.base.size;
        let (scene, camera) = (&self.scene, markdown(&self.camera));
        let s = if scene.lights == 1 { "" } else { "s" };
        let how = match self.repeat {
            0 => "one render each, so that a busy machine shows".into(),
            repeat => format!("medians of {repeat} renders after warming up"),
        };
        let _ = writeln!(
            text,
            "- scene: {}, {} triangles, {} light{s}; camera {camera}",
            markdown(&scene.name),
            scene.triangles,
            scene.lights
        );
        let _ = writeln!(text, "- picture: {width}x{height}, one sample a pixel, seed {}", self.base.seed);
        let _ = writeln!(text, "- device: {} ({}), {}", self.device.name, self.driver, how);
        let _ = writeln!(text, "- rays: {} ({})\n", self.backend.name, self.backend.reason);
        self.times(&mut text);
        self.errors(&mut text);
        self.structures(&mut text);
        self.pictures(&mut text);
        text
    }

    fn times(&self, text: &mut String) {
        text.push_str("## Time\n\n");
        let published = self.published.is_some();
        let mut head = ["VPLs", "approach", "ms", "fps", "speed-up"].map(String::from).to_vec();
        let components = self.rows.first().map_or(&[][..], |row| &row.components[..]);
        head.extend(components.iter().map(|component| component.name.to_owned()));
        if published {
            head.extend(["paper: fps", "paper: speed-up"].map(String::from));
        }
        let line = |row: &Row| {
            let mut cells = vec![
                row.vpls.to_string(),
                row.label.to_owned(),
                format!("{:.2}", row.frame_ms),
                significant(row.fps),
                format!("{:.2}", row.speed_up),
            ];
            let share =
                |share: Option<f64>| share.map_or("-".into(), |share| format!("{:.1} %", 100.0 * share));
            cells.extend(row.components.iter().map(|component| share(component.share)));
            if published {
                let cell = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.2}"));
                cells.push(cell(row.published.map(|rate| rate.fps)));
                cells.push(cell(row.published.map(|rate| rate.speed_up)));
            }
            cells
        };
        table(text, head, self.rows.iter().map(line));
        text.push_str(
            "\nEach of the paper's approaches has all that the one above it has; `fast (ours)` has exact visibility, \
             4x4 and 3x3 with an edge-aware filter. Speed-up is over canonical with as many VPLs. The columns after it \
             are shares of the passes' time; `specular` holds the indirect light behind mirrors and glass, which \
             nothing accelerates but imperfect visibility.\n",
        );
        if let Some(source) = self.published {
            let _ = writeln!(
                text,
                "\n**The columns `paper` were not measured here.** They are {source}. Compare ratios, not rates."
            );
        }
        text.push('\n');
    }

    fn errors(&self, text: &mut String) {
        text.push_str("## Error\n\n");
        let mut head = vec!["VPLs".to_owned(), "approach".to_owned()];
        let reference = format!("{} VPLs", super::REFERENCE_VPLS);
        for other in [format!("canonical {}", VPLS[0]), reference] {
            head.extend([format!("{other}: relMSE"), "trimmed".to_owned(), "bias".to_owned()]);
        }
        let line = |row: &Row| {
            let mut cells = vec![row.vpls.to_string(), row.label.to_owned()];
            cells.extend(error(Some(row.error.canonical.beauty)));
            cells.extend(error(row.error.reference.map(|errors| errors.beauty)));
            cells
        };
        table(text, head, self.rows.iter().map(line));
        text.push_str(
            "\nOf the whole picture, on linear radiance; `paper.json` has indirect light by itself too. Trimmed: \
             without the largest 0.1 % of terms. Bias: negative where light is lost.",
        );
        if let Some(reference) = &self.reference {
            let _ = write!(
                text,
                " The reference is canonical with {} VPLs of seed {}. Light of VPLs is left out up to a distance of \
                 {:.3} m in the reference",
                reference.vpl_count, reference.seed, reference.min_distance,
            );
            for row in self.rows.iter().filter(|row| row.approach == APPROACHES[0].preset) {
                let _ = write!(text, ", {:.3} m at {} VPLs", row.min_distance, row.vpls);
            }
            text.push('.');
        }
        text.push_str("\n\n");
    }

    fn structures(&self, text: &mut String) {
        text.push_str("## Structures\n\n");
        let head = ["structure", "primitives", "MiB", "built in ms"].map(String::from).to_vec();
        let line = |structure: &crate::accel::StructureReport| {
            vec![
                structure.name.clone(),
                structure.primitives.to_string(),
                format!("{:.2}", structure.bytes as f64 / f64::from(1 << 20)),
                format!("{:.1}", structure.build_ms),
            ]
        };
        table(text, head, self.structures.iter().map(line));
        let (boxes, triangles): (Vec<_>, Vec<_>) =
            self.structures.iter().partition(|structure| structure.name.starts_with("boxes"));
        let sum = |structures: &[&crate::accel::StructureReport]| {
            structures.iter().fold((0.0, 0.0), |(mib, ms), structure| {
                (mib + structure.bytes as f64 / f64::from(1 << 20), ms + structure.build_ms)
            })
        };
        let ((mib, ms), (box_mib, box_ms)) = (sum(&triangles), sum(&boxes));
        let _ = writeln!(
            text,
            "\nImperfect visibility needs what begins with `boxes`: {box_mib:.2} MiB and {box_ms:.1} ms beside the \
             triangles' {mib:.2} MiB and {ms:.1} ms. No row's time holds the building.\n"
        );
    }

    fn pictures(&self, text: &mut String) {
        let _ = writeln!(
            text,
            "## Pictures\n\nAt {} VPLs, all under the canonical picture's exposure, {:+.2} EV. Differences are \
             |picture - canonical| x {AMPLIFICATION}, of sRGB display values.\n",
            VPLS[0], self.exposure_ev,
        );
        let image = |file: &Option<String>, what: &str| {
            file.as_ref().map_or(String::new(), |file| format!("![{what}]({file})"))
        };
        let head = ["approach", "picture", "difference"].map(String::from).to_vec();
        let pictured = self.rows.iter().filter(|row| row.picture.is_some());
        let line = |row: &Row| {
            vec![
                row.label.to_owned(),
                image(&row.picture, row.label),
                image(&row.difference, &format!("{}, difference", row.label)),
            ]
        };
        table(text, head, pictured.map(line));
    }
}

fn error(error: Option<PictureError>) -> [String; 3] {
    let Some(error) = error else { return ["-"; 3].map(String::from) };
    let bias = 100.0 * error.signed_bias;
    let bias = if bias.is_finite() { format!("{bias:+.2} %") } else { "-".into() };
    [significant(error.rel_mse), significant(error.rel_mse_trimmed), bias]
}

/// Three digits that count.
fn significant(value: f64) -> String {
    match value {
        _ if !value.is_finite() => "-".into(),
        0.0 => "0".into(),
        _ if value.abs() < 1e-4 => format!("{value:.2e}"),
        _ => format!("{value:.0$}", (2 - value.abs().log10().floor() as i32).clamp(0, 6) as usize),
    }
}

fn table(text: &mut String, head: Vec<String>, lines: impl Iterator<Item = Vec<String>>) {
    let lines: Vec<Vec<String>> = std::iter::once(head).chain(lines).collect();
    let columns = lines[0].len();
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    for (index, line) in lines.iter().enumerate() {
        for (cell, width) in line.iter().zip(&widths) {
            let _ = write!(text, "| {cell:<width$} ");
        }
        text.push_str("|\n");
        if index == 0 {
            for width in &widths {
                let _ = write!(text, "|{}", "-".repeat(width + 2));
            }
            text.push_str("|\n");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits() {
        for (value, shown) in [
            (0.0, "0"),
            (1234.5, "1234"),
            (7.634, "7.63"),
            (0.1234, "0.123"),
            (0.000_123_4, "0.000123"),
            (0.000_001_234, "1.23e-6"),
            (f64::NAN, "-"),
        ] {
            assert_eq!(significant(value), shown);
        }
    }

    #[test]
    fn cells_line_up() {
        let mut text = String::new();
        table(&mut text, vec!["a".into(), "long".into()], [vec!["wide".into(), "b".into()]].into_iter());
        assert_eq!(text, "| a    | long |\n|------|------|\n| wide | b    |\n");
    }
}
