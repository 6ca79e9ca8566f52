//! What a frame's time and picture are measured by.

use crate::metrics;
use crate::renderer::{Aov, Frame, PassStats};
use std::f32::consts::PI;

/// A part of a frame's work, as the paper divides it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Component {
    /// `direct` (primary hits and their direct light), `specular` (all behind mirrors and glass, its indirect light
    /// included), `shooting`, `gather`, `filters` (with the geometry that only they read) or `compose` (with tone
    /// mapping).
    pub name: &'static str,
    /// Milliseconds of its passes, each by itself; absent where the device has no timestamps.
    pub ms: Option<f64>,
    /// Its share of all components' time.
    pub share: Option<f64>,
}

/// Names of components, in the order of a frame.
const NAMES: [&str; 6] = ["direct", "specular", "shooting", "gather", "filters", "compose"];

fn component(pass: &str) -> &'static str {
    let (group, rest) = pass.split_once('/').unwrap_or((pass, ""));
    match (group, rest) {
        ("vpl_shoot", _) => "shooting",
        ("gbuffer", "geometry") => "filters",
        ("gbuffer", _) | ("whitted", "direct") => "direct",
        ("whitted", _) => "specular",
        ("indirect", rest) if rest.starts_with("gather") || rest.starts_with("regather") => "gather",
        ("indirect", _) => "filters",
        _ => "compose",
    }
}

pub(super) fn components(passes: &[PassStats]) -> Vec<Component> {
    let sum = |name: Option<&str>| -> Option<f64> {
        let of = passes.iter().filter(|pass| name.is_none_or(|name| component(&pass.path) == name));
        of.map(|pass| pass.ms).try_fold(0.0, |sum, ms| Some(sum + ms?))
    };
    let all = sum(None).filter(|all| *all > 0.0);
    let component = |name| {
        let ms = sum(Some(name));
        Component { name, ms, share: ms.zip(all).map(|(ms, all)| ms / all) }
    };
    NAMES.map(component).into()
}

/// How far one picture is from another, on linear radiance. Infinite or NaN where the other is black.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PictureError {
    /// [`metrics::rel_mse`].
    pub rel_mse: f64,
    /// [`metrics::rel_mse_trimmed`].
    pub rel_mse_trimmed: f64,
    /// [`metrics::signed_bias`].
    pub signed_bias: f64,
}

/// [`PictureError`] of the whole picture and of its indirect light alone.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LayerErrors {
    /// Of all light.
    pub beauty: PictureError,
    /// Of indirect light at primary hits.
    pub indirect: PictureError,
}

/// What errors are measured on: radiance, three channels a pixel.
#[derive(Clone)]
pub(super) struct Layers {
    beauty: Vec<f32>,
    indirect: Vec<f32>,
}

impl Layers {
    /// From a frame with albedo and irradiance.
    pub(super) fn of(frame: &Frame) -> Self {
        let layer = |wanted| {
            let found = frame.aovs.iter().find(|(aov, _)| *aov == wanted);
            found.map_or(&[][..], |(_, layer)| &layer.data[..])
        };
        let pairs = layer(Aov::Albedo).iter().zip(layer(Aov::Irradiance));
        let indirect = pairs.map(|(albedo, irradiance)| albedo * irradiance / PI).collect();
        Self { beauty: frame.beauty.data.clone(), indirect }
    }

    pub(super) fn errors(&self, other: &Self) -> LayerErrors {
        let error = |image: &[f32], reference: &[f32]| PictureError {
            rel_mse: metrics::rel_mse(image, reference),
            rel_mse_trimmed: metrics::rel_mse_trimmed(image, reference),
            signed_bias: metrics::signed_bias(image, reference),
        };
        LayerErrors {
            beauty: error(&self.beauty, &other.beauty),
            indirect: error(&self.indirect, &other.indirect),
        }
    }
}

/// What differences between pictures are multiplied with.
pub const AMPLIFICATION: u8 = 8;

/// |a − b| · [`AMPLIFICATION`], channel by channel, of sRGB display values; opaque.
#[must_use]
pub fn difference(a: &[u8], b: &[u8]) -> Vec<u8> {
    let amplified = |a: &u8, b: &u8| a.abs_diff(*b).saturating_mul(AMPLIFICATION);
    let mut pixels: Vec<u8> = a.iter().zip(b).map(|(a, b)| amplified(a, b)).collect();
    pixels.iter_mut().skip(3).step_by(4).for_each(|alpha| *alpha = u8::MAX);
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::RenderConfig;
    use crate::graph::Typical;
    use crate::scene::builtin;

    fn pass(path: &str, ms: Option<f64>) -> PassStats {
        PassStats { path: path.into(), ms, rays: None }
    }

    #[test]
    fn components_sum_their_passes_and_share_the_whole() {
        let passes = [("gbuffer/primary", 1.0), ("gbuffer/geometry", 0.5), ("indirect/gather", 4.0)];
        let passes: Vec<_> = passes.map(|(path, ms)| pass(path, Some(ms))).into();
        let found = components(&passes);
        let ms: Vec<_> = found.iter().map(|component| component.ms.unwrap()).collect();
        assert_eq!(ms, [1.0, 0.0, 0.0, 4.0, 0.5, 0.0]);
        assert!((found.iter().map(|component| component.share.unwrap()).sum::<f64>() - 1.0).abs() < 1e-12);
        let untimed = components(&[pass("gbuffer/primary", None), pass("indirect/gather", None)]);
        assert!(untimed[3].ms.is_none() && untimed.iter().all(|component| component.share.is_none()));
    }

    /// What falls under `compose` for want of a better place is composition.
    #[test]
    fn every_pass_has_its_component() {
        let scene = builtin::by_name("office").unwrap();
        for preset in crate::paper::APPROACHES {
            let mut config = RenderConfig::default();
            config.apply_preset(preset.preset).unwrap();
            let plan = crate::renderer::plan(&scene, &config, &[], &Typical).unwrap();
            let work = plan.passes.iter().map(|pass| &pass.path).filter(|path| !path.starts_with("readback"));
            let mut used: Vec<_> = work
                .map(|path| {
                    let name = component(path);
                    let composed = path.starts_with("compose/") || path.starts_with("tone_map/");
                    assert_eq!(name == "compose", composed, "{path}");
                    name
                })
                .collect();
            used.sort_unstable();
            used.dedup();
            let filters = config.indirect.filtered();
            assert_eq!(used.contains(&"filters"), filters, "{used:?}");
            for name in ["direct", "shooting", "gather", "compose"] {
                assert!(used.contains(&name), "{}: {used:?}", preset.preset);
            }
        }
    }

    #[test]
    fn differences_are_amplified_and_end_at_white() {
        let found = difference(&[10, 5, 0, 255, 200, 0, 7, 255], &[12, 5, 31, 255, 0, 200, 7, 255]);
        assert_eq!(found, [16, 0, 248, 255, 255, 255, 0, 255]);
    }
}
