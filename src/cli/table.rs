//! Milliseconds by pass, for people.

use crate::renderer::{Frame, PassStats};
use std::fmt::Write;

/// One line a group of passes and one for each pass in it, repeats together, then their sum, and the frame where passes
/// overlap.
pub(super) fn table(frame: &Frame) -> String {
    let total = sum(&frame.passes.iter().collect::<Vec<_>>());
    let mut groups: Vec<(&str, Vec<&PassStats>)> = Vec::new();
    for pass in &frame.passes {
        let name = pass.path.split('/').next().unwrap_or_default();
        match groups.iter_mut().find(|(group, _)| *group == name) {
            Some((_, passes)) => passes.push(pass),
            None => groups.push((name, vec![pass])),
        }
    }
    let mut rows = vec![["pass", "ms", "share", "Mrays", "Mray/s"].map(String::from)];
    for (group, passes) in &groups {
        match passes[..] {
            [pass] => rows.push(row(&pass.path, pass.ms, pass.rays, total)),
            _ => {
                rows.push(row(group, sum(passes), rays(passes), total));
                let mut repeats: Vec<(&str, Vec<&PassStats>)> = Vec::new();
                for &pass in passes {
                    let path = pass.path.strip_prefix(group).unwrap_or(&pass.path);
                    let path = path.trim_start_matches('/');
                    let name = path.split('#').next().filter(|name| !name.is_empty()).unwrap_or(group);
                    match repeats.iter_mut().find(|(repeated, _)| *repeated == name) {
                        Some((_, repeats)) => repeats.push(pass),
                        None => repeats.push((name, vec![pass])),
                    }
                }
                for (name, passes) in &repeats {
                    let times = if passes.len() > 1 { format!(" x{}", passes.len()) } else { String::new() };
                    rows.push(row(&format!("  {name}{times}"), sum(passes), rays(passes), total));
                }
            }
        }
    }
    rows.push(row("total", total, Some(frame.rays), total));
    if let Some(ms) = frame.total_ms.filter(|ms| total.is_some_and(|total| *ms < 0.995 * total)) {
        rows.push(row("frame", Some(ms), Some(frame.rays), total));
    }

    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<_> = (0..5).map(width).collect();
    let mut text = String::new();
    for row in &rows {
        let _ = write!(text, "{:<1$}", row[0], widths[0]);
        for column in 1..5 {
            let _ = write!(text, "  {:>1$}", row[column], widths[column]);
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

/// `None` where a pass was not timed.
fn sum(passes: &[&PassStats]) -> Option<f64> {
    passes.iter().map(|pass| pass.ms).sum()
}

fn rays(passes: &[&PassStats]) -> Option<u64> {
    passes.iter().filter_map(|pass| pass.rays).reduce(|a, b| a + b)
}

fn row(name: &str, ms: Option<f64>, rays: Option<u64>, total: Option<f64>) -> [String; 5] {
    let show = |value: Option<f64>, digits: usize| value.map_or(String::new(), |v| format!("{v:.digits$}"));
    let rays = rays.map(|rays| rays as f64);
    let share = ms.zip(total).filter(|(_, total)| *total > 0.0).map(|(ms, total)| 100.0 * ms / total);
    let rate = rays.zip(ms).filter(|(_, ms)| *ms > 0.0).map(|(rays, ms)| rays / ms / 1e3);
    let share = share.map_or(String::new(), |share| format!("{share:.1} %"));
    let ms = ms.map_or("-".into(), |ms| format!("{ms:.2}"));
    [name.into(), ms, share, show(rays.map(|rays| rays / 1e6), 3), show(rate, 2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;

    fn frame(passes: &[(&str, Option<f64>, Option<u64>)]) -> Frame {
        let passes =
            passes.iter().map(|&(path, ms, rays)| PassStats { path: path.into(), ms, rays }).collect();
        Frame { passes, total_ms: Some(8.0), rays: 3_000_000, ..common::frame() }
    }

    fn cells(table: &str) -> Vec<Vec<&str>> {
        table.lines().map(|line| line.split_whitespace().collect()).collect()
    }

    #[test]
    fn groups_add_up_and_rates_follow() {
        let text = table(&frame(&[
            ("shoot", Some(1.0), Some(1_000_000)),
            ("indirect/gather", Some(4.0), Some(2_000_000)),
            ("compose", Some(1.0), None),
            ("indirect/upsample", Some(2.0), None),
        ]));
        assert_eq!(
            cells(&text)[1..],
            [
                vec!["shoot", "1.00", "12.5", "%", "1.000", "1000.00"],
                vec!["indirect", "6.00", "75.0", "%", "2.000", "333.33"],
                vec!["gather", "4.00", "50.0", "%", "2.000", "500.00"],
                vec!["upsample", "2.00", "25.0", "%"],
                vec!["compose", "1.00", "12.5", "%"],
                vec!["total", "8.00", "100.0", "%", "3.000", "375.00"],
            ]
        );
    }

    #[test]
    fn repeats_share_a_line() {
        let text = table(&frame(&[
            ("cache/ask", Some(1.0), Some(1_000_000)),
            ("cache/fill", Some(1.0), None),
            ("cache/ask#2", Some(3.0), Some(3_000_000)),
        ]));
        let cells = cells(&text);
        assert_eq!(cells[2], ["ask", "x2", "4.00", "80.0", "%", "4.000", "1000.00"]);
        assert_eq!(cells[3][0], "fill");
        assert_eq!(cells.len(), 5);
    }

    #[test]
    fn passes_without_a_time_have_none_and_columns_align() {
        let text = table(&frame(&[("a", None, Some(5)), ("b/c", Some(1.0), None)]));
        assert_eq!(cells(&text)[1][..2], ["a", "-"]);
        assert_eq!(cells(&text)[2][..2], ["b/c", "1.00"]);
        assert!(text.lines().all(|line| line.len() <= text.lines().next().unwrap().len()));
    }
}
