//! Scenes that provoke known failures, and a page of what each method makes of them.
//!
//! A case is a small scene, the number that shows a failure and the bound that a method must meet. Each method's trials
//! ([`Method::trials`]) say which settings are known to miss the bound and why. A remedy is one trial more.

mod cases;
pub mod data;
mod lab;
mod picture;
pub mod report;
mod scenes;

use crate::config::{ConfigError, RenderConfig};
use crate::methods::{self, Method, REGISTRY};
use crate::renderer::{BackendChoice, Error, Progress};
use crate::vk;
use data::{Row, SCHEMA, Shown, Stress, Verdict};
use lab::{Lab, Measured};
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

/// Width and height of pictures unless others are asked for; what is known to fail is known at this size.
pub const SIZE: [u32; 2] = [32, 24];

/// A scene and what is measured in it.
pub struct Case {
    /// Its name.
    pub name: &'static str,
    /// What makes methods fail there, in a sentence.
    pub mechanism: &'static str,
    /// What is measured; less is better.
    pub number: &'static str,
    /// The most that it may be.
    pub limit: f64,
    /// Settings of all variants, as for [`RenderConfig::apply_override`].
    pub settings: &'static [&'static str],
    measure: fn(&mut Lab<'_>, &RenderConfig) -> Result<Measured, Error>,
}

/// A method with settings.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    /// The method.
    pub method: &'static Method,
    /// As for [`RenderConfig::apply_override`]; none are the defaults.
    pub settings: &'static [&'static str],
    /// Why it misses the bound, if it is known to.
    pub known: Option<&'static str>,
}

/// How the cases are run.
#[derive(Clone, Copy, Default)]
pub struct Options<'a> {
    /// The name of the only case to run; all are run otherwise.
    pub only: Option<&'a str>,
    /// Which backend to trace rays with.
    pub backend: BackendChoice,
    /// Width and height (pixels) in place of [`SIZE`].
    pub size: Option<[u32; 2]>,
    /// Which of the equally good sample sets.
    pub seed: u32,
    /// Set to stop.
    pub cancel: Option<&'a AtomicBool>,
    /// Told what is being done.
    pub progress: Option<&'a dyn Fn(Progress<'_>)>,
}

/// Every case there is.
pub fn cases() -> impl Iterator<Item = &'static Case> {
    cases::ALL.iter().copied().flatten()
}

/// Runs the cases on a device. No scene that only [`Options::only`] could name gives no rows.
///
/// # Errors
/// [`Error::Cancelled`], a bad size, or the device's failure: what a method makes of a scene is none.
pub fn run(device: &vk::Device, options: &Options<'_>) -> Result<Stress, Error> {
    let chosen: Vec<_> = cases().filter(|case| options.only.is_none_or(|name| name == case.name)).collect();
    let all = chosen.iter().map(|case| case.variants().len()).sum::<usize>();
    let (mut rows, mut images, mut backend) = (Vec::new(), BTreeMap::new(), "");
    for case in chosen {
        let mut lab = Lab::new(device, options);
        for variant in &case.variants() {
            if let Some(report) = options.progress {
                let done = rows.len() as f64 / all as f64;
                report(Progress { pass: &format!("{}: {}", case.name, variant.title()), done });
            }
            let measured = (case.measure)(&mut lab, &case.config(variant, options)?)?;
            rows.push(case.row(variant, &measured, &mut images));
        }
        backend = lab.backend().map_or(backend, vk::Backend::name);
    }
    Ok(Stress {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION").into(),
        device: device.info().name.clone(),
        driver: device.info().driver(),
        backend: backend.into(),
        size: options.size.unwrap_or(SIZE),
        rows,
        images,
    })
}

impl Case {
    /// What is run: every method of the registry, by its trials.
    #[must_use]
    pub fn variants(&self) -> Vec<Variant> {
        let of = |&method: &&'static Method| {
            let named = method.trials.iter().filter(|trial| trial.case == self.name);
            let mut variants: Vec<_> =
                named.map(|trial| Variant { method, settings: trial.settings, known: trial.known }).collect();
            if variants.is_empty() {
                variants.push(Variant { method, settings: &[], known: None });
            }
            variants
        };
        REGISTRY.iter().flat_map(of).collect()
    }

    fn config(&self, variant: &Variant, options: &Options<'_>) -> Result<RenderConfig, ConfigError> {
        let mut config = RenderConfig {
            method: variant.method,
            size: options.size.unwrap_or(SIZE),
            seed: options.seed,
            ..RenderConfig::default()
        };
        // Methods are compared at the same positions.
        methods::comparable(&mut config, None);
        let settings = self.settings.iter().chain(variant.settings);
        settings.into_iter().try_for_each(|assignment| config.apply_override(assignment))?;
        config.validate()?;
        Ok(config)
    }

    fn row(&self, variant: &Variant, measured: &Measured, images: &mut BTreeMap<String, String>) -> Row {
        let scale = picture::scale(&measured.plates);
        let shown = measured.plates.iter().map(|plate| {
            let key = format!("{} {} {}", self.name, variant.title(), plate.label);
            images.insert(key.clone(), picture::data_url(&plate.layer, scale));
            Shown { label: plate.label.clone(), key }
        });
        let finite = measured.plates.iter().all(|plate| plate.layer.data.iter().all(|v| v.is_finite()));
        Row {
            scene: self.name.into(),
            mechanism: self.mechanism.into(),
            method: variant.method.name.into(),
            setting: variant.settings.join(" "),
            number: self.number.into(),
            value: measured.value.is_finite().then_some(measured.value),
            bound: if self.limit == 0.0 { "exactly 0".into() } else { format!("at most {}", self.limit) },
            // Whatever is measured, a picture with a NaN is none.
            verdict: match (finite && measured.value <= self.limit, variant.known) {
                (true, _) => Verdict::Holds,
                (false, Some(_)) => Verdict::FailsAsKnown,
                (false, None) => Verdict::Fails,
            },
            known: variant.known.map(String::from),
            images: shown.collect(),
        }
    }
}

impl Variant {
    /// Method and settings in few words.
    fn title(&self) -> String {
        std::iter::once(self.method.name).chain(self.settings.iter().copied()).collect::<Vec<_>>().join(" ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trials_are_of_cases_that_there_are() {
        for method in REGISTRY {
            for trial in method.trials {
                assert!(cases().any(|case| case.name == trial.case), "{}: {}", method.name, trial.case);
            }
        }
    }
}
