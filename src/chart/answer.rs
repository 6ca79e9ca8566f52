//! What to use, by what was measured.

use super::data::{Answer, Chart, Point};
use super::front::front;

/// Times that every chart answers for (ms).
pub const TIMES: [f64; 5] = [1.0, 5.0, 16.0, 33.0, 100.0];

/// Indices of the ranked points that no other beats in both time and the error by `metric`, fastest first. One that is
/// not ranked beats slower ones as others do: how small its error is remains open, not that it is smaller.
#[must_use]
pub fn front_of(points: &[Point], metric: &str) -> Vec<usize> {
    let pair = |point: &Point| {
        let error = point.metrics.get(metric);
        (point.ms.median, error.map_or(f64::NAN, |error| error.median.abs()))
    };
    let mut front = front(&points.iter().map(pair).collect::<Vec<_>>());
    front.retain(|&index| points[index].ranked);
    front
}

/// The point's relMSE, and whether that is known. Of points that are not ranked it is a guess, and the reference's noise
/// at least; still they are better than ranked ones, all of which are above ten times that noise.
#[must_use]
pub fn error_of(point: &Point, noise: Option<f64>) -> Option<(f64, bool)> {
    let error = point.metrics.get("rel_mse")?.median;
    Some(if point.ranked { (error, true) } else { (error.max(noise.unwrap_or(0.0)), false) })
}

/// For each of [`TIMES`] what leaves the least relMSE within it. `noise` is the reference's own.
#[must_use]
pub fn answers(points: &[Point], noise: Option<f64>) -> Vec<Answer> {
    let error = |point: &&Point| error_of(point, noise).map_or(f64::INFINITY, |(error, _)| error);
    let time = |point: &&Point| point.ms.median;
    let fastest = points.iter().min_by(|a, b| time(a).total_cmp(&time(b)));
    let mut before: Option<(f64, &str)> = None;
    let answer = |ms: f64| {
        let fitting = points.iter().filter(|point| point.ms.median <= ms);
        let best = fitting.min_by(|a, b| error(a).total_cmp(&error(b)).then(time(a).total_cmp(&time(b))));
        let sentence = match (best, fastest) {
            (Some(best), _) if before.is_some_and(|(_, same)| same == best.id) => {
                format!("In {ms} ms: the same as in {} ms.", before.map_or(ms, |(ms, _)| ms))
            }
            (Some(best), _) => format!("In {ms} ms: {}.", said(best, noise)),
            (None, Some(first)) => format!("In {ms} ms: nothing; the fastest is {}.", said(first, noise)),
            (None, None) => format!("In {ms} ms: nothing that was measured."),
        };
        if let Some(best) = best {
            before = before.filter(|(_, same)| *same == best.id).or(Some((ms, &best.id)));
        }
        Answer { ms, point: best.map(|best| best.id.clone()), sentence }
    };
    TIMES.map(answer).into()
}

fn said(point: &Point, noise: Option<f64>) -> String {
    let (error, known) = error_of(point, noise).unwrap_or((f64::NAN, false));
    format!(
        "{}, {} ms, relMSE {}{}, bias {}",
        point.label,
        significant(point.ms.median),
        if known { "" } else { "about " },
        significant(error),
        bias_of(point).unwrap_or_else(|| "-".into())
    )
}

/// The point's mean bias and its standard error, as text; the median of what no more is known of.
pub(crate) fn bias_of(point: &Point) -> Option<String> {
    let median = point.metrics.get("signed_bias").map(|bias| (bias.median, None));
    let (bias, se) = point.over_seeds.map(|errors| (errors.bias, errors.bias_se)).or(median)?;
    Some(match se {
        Some(se) => format!("{:+.2} ± {:.2} %", 100.0 * bias, 100.0 * se),
        None => format!("{:+.1} %", 100.0 * bias),
    })
}

/// Three digits that count.
pub(crate) fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = 2 - value.abs().log10().floor() as i32;
    format!("{value:.0$}", usize::try_from(digits).unwrap_or(0))
}

impl Chart {
    /// The front, what the reference cannot rank, and what to use, as text.
    #[must_use]
    pub fn table(&self) -> String {
        let head = ["setting", "ms", "relMSE", "worst", "bias", "systematic", "blocks", "FLIP", "Mrays"];
        let mut rows = vec![head.map(String::from)];
        let unranked: Vec<usize> = (0..self.points.len()).filter(|&i| !self.points[i].ranked).collect();
        for &index in front_of(&self.points, "rel_mse").iter().chain(&unranked) {
            let point = &self.points[index];
            let error = |key: &str| point.metrics.get(key).map(|error| error.median);
            let show = |value: Option<f64>| value.map_or("-".into(), significant);
            rows.push([
                point.label.clone(),
                significant(point.ms.median),
                match error_of(point, self.reference.noise) {
                    Some((error, known)) => {
                        format!("{}{}", if known { "" } else { "about " }, significant(error))
                    }
                    None => "-".into(),
                },
                show(point.over_seeds.map(|errors| errors.rel_mse_worst)),
                bias_of(point).unwrap_or_else(|| "-".into()),
                show(point.over_seeds.and_then(|errors| errors.systematic)),
                show(error("rel_mse_blocks")),
                show(error("flip")),
                significant(point.rays as f64 / 1e6),
            ]);
        }
        let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<_> = (0..head.len()).map(width).collect();
        let mut text = String::new();
        for row in &rows {
            let mut line = format!("{:<1$}", row[0], widths[0]);
            for column in 1..head.len() {
                line += &format!("  {:>1$}", row[column], widths[column]);
            }
            text += line.trim_end();
            text.push('\n');
        }
        if let Some(seeds) = self.points.iter().map(|point| point.seeds).max() {
            text += &format!(
                "Errors are medians over {seeds} seeds, but for worst; bias is their mean ± its standard error; systematic is \
                 what no number of seeds takes away; blocks: relMSE of means of 32x32 pixels.\n"
            );
        }
        if let Some(noise) = self.reference.noise.filter(|_| !unranked.is_empty()) {
            text += &format!(
                "{} of {} settings are too near the reference's own noise, relMSE {}, to be ranked: a reference of more \
                 samples (--reference-spp) tells them apart.\n",
                unranked.len(),
                self.points.len(),
                significant(noise)
            );
        }
        text.push('\n');
        for answer in &self.answers {
            text += &answer.sentence;
            text.push('\n');
        }
        for failure in &self.failures {
            text += &format!("failed: {}: {}\n", failure.label, failure.error);
        }
        text
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::chart::data::Spread;
    use std::collections::BTreeMap;

    pub(in crate::chart) fn point(id: &str, ms: f64, rel_mse: f64) -> Point {
        let spread = |value: f64| Spread { median: value, min: value, max: value };
        let metrics = [("rel_mse", rel_mse), ("signed_bias", -0.5)];
        Point {
            id: id.into(),
            method: "igi".into(),
            label: format!("igi {id}"),
            settings: BTreeMap::from([("method".into(), "igi".into())]),
            seeds: 3,
            ms: spread(ms),
            passes: Vec::new(),
            rays: 1000,
            device_bytes: 0,
            metrics: metrics.map(|(key, value)| (key.to_owned(), spread(value))).into(),
            over_seeds: None,
            ranked: true,
            general_ms: None,
            image: String::new(),
            error_image: String::new(),
            exr: None,
        }
    }

    #[test]
    fn an_answer_is_the_least_error_in_time() {
        let points = [point("slow", 20.0, 0.01), point("fast", 2.0, 0.5), point("bad", 3.0, 0.6)];
        let answers = answers(&points, None);
        let found: Vec<_> = answers.iter().map(|answer| answer.point.as_deref()).collect();
        assert_eq!(found, [None, Some("fast"), Some("fast"), Some("slow"), Some("slow")]);
        let sentence = |index: usize| answers[index].sentence.as_str();
        assert!(sentence(0).contains("nothing; the fastest is igi fast, 2.00 ms, relMSE 0.500"));
        assert!(sentence(1).contains("igi fast") && sentence(1).contains("bias -50.0 %"));
        assert_eq!(sentence(2), "In 16 ms: the same as in 5 ms.");
        assert_eq!(sentence(4), "In 100 ms: the same as in 33 ms.");
    }

    /// What is better than the reference can tell is not on the front, keeps slower ones off it, and is an answer that
    /// says so.
    #[test]
    fn unranked_points_are_not_on_the_front() {
        let lucky = Point { ranked: false, ..point("lucky", 1.0, 0.001) };
        let points = [lucky, point("honest", 0.9, 0.1), point("late", 2.0, 0.01)];
        assert_eq!(front_of(&points, "rel_mse"), [1]);
        assert!(front_of(&points, "unheard of").is_empty());
        let answer = &answers(&points, Some(0.005))[0];
        assert_eq!(answer.point.as_deref(), Some("lucky"));
        assert!(answer.sentence.contains("relMSE about 0.00500"), "{}", answer.sentence);
        assert_eq!(answers(&[], None)[0].point, None);
    }

    #[test]
    fn three_digits_count() {
        for (value, text) in
            [(0.012_345, "0.0123"), (1.0, "1.00"), (123.4, "123"), (56_789.0, "56789"), (0.0, "0")]
        {
            assert_eq!(significant(value), text);
        }
    }
}
