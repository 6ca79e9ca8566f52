//! Scenes that provoke known failures, and a page of what each method makes of them.
//!
//! A case is a small scene, the number that shows a failure and the bound that a method must meet. Each method's trials
//! ([`Method::trials`](crate::methods::Method::trials)) say which settings are known to miss the bound and why. A remedy is one trial more.

mod case;
mod cases;
pub mod data;
mod lab;
mod options;
mod picture;
pub mod report;
mod scenes;

pub use case::{Case, Variant};
pub use options::{Options, SIZE};

use crate::renderer::{Error, Progress};
use crate::vk;
use data::{SCHEMA, Stress};
use lab::Lab;
use std::collections::BTreeMap;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::REGISTRY;

    #[test]
    fn trials_are_of_cases_that_there_are() {
        for method in REGISTRY {
            for trial in method.trials {
                assert!(cases().any(|case| case.name == trial.case), "{}: {}", method.name, trial.case);
            }
        }
    }
}
