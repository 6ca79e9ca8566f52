//! Times of pictures.

use super::frame::PassStats;
use crate::graph::{PassTime, Run};
use std::collections::HashMap;

/// What the runs of one picture came to.
#[derive(Debug)]
pub(super) struct Tally {
    pub(super) times: Vec<PassTime>,
    /// Milliseconds on the device.
    pub(super) total: Option<f64>,
    /// Milliseconds of the host's own work.
    pub(super) host_ms: f64,
}

impl Default for Tally {
    fn default() -> Self {
        Self { times: Vec::new(), total: Some(0.0), host_ms: 0.0 }
    }
}

impl Tally {
    /// Adds one graph's times.
    pub(super) fn add(&mut self, run: &Run, host_ms: f64) {
        add_times(&mut self.times, &run.passes);
        self.total = self.total.zip(run.device_ms).map(|(sum, ms): (f64, f64)| sum + ms);
        self.host_ms += host_ms;
    }
}

/// Adds one sample's times to those of the samples before. Downloads are not part of a frame's time.
fn add_times(sums: &mut Vec<PassTime>, passes: &[PassTime]) {
    let work =
        passes.iter().filter(|pass| !pass.path.starts_with("readback") && !pass.path.starts_with("tap/"));
    for pass in work {
        match sums.iter_mut().find(|sum| sum.path == pass.path) {
            Some(sum) => {
                sum.ms = sum.ms.zip(pass.ms).map(|(a, b)| a + b);
                sum.bands += pass.bands;
            }
            None => sums.push(pass.clone()),
        }
    }
}

pub(super) fn summarise(timed: &[Tally], rays: &HashMap<&'static str, u64>) -> Vec<PassStats> {
    let Some(first) = timed.first() else { return Vec::new() };
    let stats = first.times.iter().map(|pass| PassStats {
        path: pass.path.clone(),
        ms: median(
            timed.iter().map(|t| t.times.iter().find(|p| p.path == pass.path).and_then(|p| p.ms)).collect(),
        ),
        rays: rays.get(pass.path.as_str()).copied(),
    });
    stats.collect()
}

/// `None` where any is missing.
pub(super) fn median(values: Vec<Option<f64>>) -> Option<f64> {
    let mut values = values.into_iter().collect::<Option<Vec<f64>>>()?;
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[middle]),
        _ => Some(0.5 * (values[middle - 1] + values[middle])),
    }
}
