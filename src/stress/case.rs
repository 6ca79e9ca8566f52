use super::data::{Row, Shown, Verdict};
use super::lab::{Lab, Measured};
use super::options::{Options, SIZE};
use super::picture;
use crate::config::{ConfigError, RenderConfig};
use crate::methods::{self, Method, REGISTRY};
use crate::renderer::Error;
use std::collections::BTreeMap;

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
    pub(super) measure: fn(&mut Lab<'_>, &RenderConfig) -> Result<Measured, Error>,
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

    pub(super) fn config(
        &self,
        variant: &Variant,
        options: &Options<'_>,
    ) -> Result<RenderConfig, ConfigError> {
        let mut config = RenderConfig {
            method: variant.method,
            size: options.size.unwrap_or(SIZE),
            seed: options.seed,
            ..RenderConfig::default()
        };
        config.apply_trial(self.settings, variant.settings.iter().copied())?;
        // Methods are compared at the same positions.
        methods::comparable(&mut config, None);
        config.validate()?;
        Ok(config)
    }

    pub(super) fn row(
        &self,
        variant: &Variant,
        measured: &Measured,
        images: &mut BTreeMap<String, String>,
    ) -> Row {
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
    pub(super) fn title(&self) -> String {
        std::iter::once(self.method.name).chain(self.settings.iter().copied()).collect::<Vec<_>>().join(" ")
    }
}
