//! How long passes took, from run to run and within one.

use crate::graph::planned::{Plan, PlannedPass};
use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

/// An unknown kernel starts with this many workgroups, few enough for any device, and each further band has at most
/// [`GROWTH`] times the one before until its speed is known for the whole grid.
pub(super) const PROBE: f64 = 4.0;
const GROWTH: f64 = 8.0;

/// A pass whose milliseconds a workgroup are known: path, kernel and workgroups.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct RateKey(String, Option<String>, Option<[u32; 3]>);

impl RateKey {
    pub(super) fn of(pass: &PlannedPass) -> Self {
        Self(pass.path.clone(), pass.shader.clone(), pass.groups)
    }
}

/// Milliseconds a workgroup of the passes that have run, shared by the runs of an executor.
#[derive(Clone, Debug, Default)]
pub(super) struct Rates(Arc<Mutex<HashMap<RateKey, f64>>>);

impl Rates {
    pub(super) fn known(&self, keys: &[RateKey]) -> Vec<Option<f64>> {
        let rates = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        keys.iter().map(|key| rates.get(key).copied()).collect()
    }

    pub(super) fn learn(&self, keys: &[RateKey], measured: &[Measured]) {
        let mut rates = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for (key, measured) in keys.iter().zip(measured) {
            let Some(rate) = measured.mean_rate() else { continue };
            match rates.get_mut(key) {
                Some(known) => *known = rate,
                None => drop(rates.insert(key.clone(), rate)),
            }
        }
    }
}

/// Workgroups of a pass; 1 where it is not split by them.
pub(super) fn groups_of(pass: &PlannedPass) -> f64 {
    pass.groups.map_or(1.0, |groups| groups.iter().map(|&g| f64::from(g)).product())
}

/// Share of each pass in the whole, by time where all are known.
pub(super) fn weights(plan: &Plan, rates: &[Option<f64>]) -> Vec<f64> {
    let ms = plan.passes.iter().zip(rates).map(|(pass, rate)| rate.map(|rate| rate * groups_of(pass)));
    let weights: Vec<f64> = ms.collect::<Option<_>>().unwrap_or_else(|| vec![1.0; plan.passes.len()]);
    let sum = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    weights.into_iter().map(|weight| weight / sum).collect()
}

/// What is known of a pass while it runs.
#[derive(Debug)]
pub(super) struct Measured {
    pub(super) ms: f64,
    /// Workgroups that have run, or 1 for the whole of a pass that is not split.
    pub(super) groups: f64,
    pub(super) bands: u32,
    /// Milliseconds a workgroup took last.
    pub(super) rate: Option<f64>,
    /// Most workgroups of the next band.
    pub(super) limit: f64,
}

impl Measured {
    pub(super) fn new(rate: Option<f64>) -> Self {
        Self { ms: 0.0, groups: 0.0, bands: 0, rate, limit: f64::INFINITY }
    }

    pub(super) fn add(&mut self, ms: f64, groups: f64) {
        if self.rate.is_none() || self.limit.is_finite() {
            self.limit = GROWTH * groups;
        }
        // A clock too coarse must not make a workgroup free.
        self.rate = Some(ms.max(1e-6) / groups);
        self.ms += ms;
        self.groups += groups;
    }

    fn mean_rate(&self) -> Option<f64> {
        (self.groups > 0.0).then(|| self.ms.max(1e-6) / self.groups)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_pass_grows_by_steps_until_it_has_run() {
        let mut unknown = Measured::new(None);
        unknown.add(1.0, 10.0);
        assert_eq!((unknown.rate, unknown.limit), (Some(0.1), 80.0));
        unknown.add(0.0, 80.0);
        assert!(unknown.rate.is_some_and(|rate| rate > 0.0));
        assert_eq!(unknown.limit, 640.0);
        let mut known = Measured::new(Some(0.5));
        known.add(1.0, 10.0);
        assert_eq!((known.rate, known.limit), (Some(0.1), f64::INFINITY));
        assert_eq!(known.mean_rate(), Some(0.1));
    }
}
