//! Pixels that are no numbers, or infinite, and the pass that makes them: what no picture can show is never passed over.

use super::error::Error;
use super::frame::Frame;
use super::plan::plan;
use super::request::FrameRequest;
use super::submit::Renderer;
use crate::config::RenderConfig;
use crate::graph::{Desc, Typical};
use crate::layer::Layer;
use crate::scene::Camera;
use crate::vk::Format;
use std::sync::atomic::AtomicBool;

/// Pixels of a picture that are not finite.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct NotFinite {
    /// The layer that they are counted in.
    pub layer: &'static str,
    /// How many.
    pub pixels: u64,
    /// Column and row in the whole picture of the first, row by row from the top left.
    pub first: [u32; 2],
    /// The first pass that is not finite there, and its variable: `whitted/light:out_direct`. None where this pixel drawn
    /// by itself is finite, as adaptive samples may be.
    pub pass: Option<String>,
}

impl NotFinite {
    /// What of a frame that was drawn with `config` is not finite: of beauty, else of the first layer that has such pixels.
    /// The pass is not known yet.
    #[must_use]
    pub fn of(config: &RenderConfig, frame: &Frame) -> Option<Self> {
        let layers = frame.aovs.iter().map(|(aov, layer)| (aov.name(), layer));
        let mut layers = std::iter::once(("beauty", &frame.beauty)).chain(layers);
        let (layer, (pixels, first)) = layers.find_map(|(name, layer)| Some((name, odd_pixels(layer)?)))?;
        let ([x, y, ..], width) = (config.window(), frame.beauty.width);
        Some(Self { layer, pixels, first: [x + first % width, y + first / width], pass: None })
    }

    /// In words.
    #[must_use]
    pub fn line(&self) -> String {
        let Self { layer, pixels, first: [x, y], pass } = self;
        let pixels = match pixels {
            1 => "pixel".to_owned(),
            _ => format!("{pixels} pixels, the first"),
        };
        let by = pass.as_ref().map_or(String::new(), |pass| format!(", by pass {pass}"));
        format!("{layer} is not finite at {pixels} ({x}, {y}){by}")
    }
}

impl Renderer {
    /// The first pass whose image is not finite at a pixel of a frame, which is drawn again by itself.
    ///
    /// # Errors
    /// [`Error::Cancelled`], or the device's failure.
    pub fn pass_not_finite(
        &mut self,
        config: &RenderConfig,
        camera: &Camera,
        frame: &Frame,
        [x, y]: [u32; 2],
        cancel: Option<&AtomicBool>,
    ) -> Result<Option<String>, Error> {
        let mut config = RenderConfig { crop: Some([x, y, x + 1, y + 1]), ..config.clone() };
        if let (Some(progressive), Some(samples)) = (&config.method.progressive, frame.samples) {
            (progressive.set_samples)(&mut config, samples);
        }
        let aovs: Vec<_> = frame.aovs.iter().map(|&(aov, _)| aov).collect();
        let plan = plan(self.scene(), &config, &aovs, &Typical)?;
        let is_float = |resource: usize| match &plan.resources[resource].desc {
            Desc::Image(desc) => matches!(desc.format, Format::Rgba32Float | Format::Rgba16Float),
            _ => false,
        };
        let mut taps = Vec::new();
        for pass in plan.passes.iter().filter(|pass| pass.kind == "kernel") {
            let written = pass.accesses.iter().filter(|access| access.writes && is_float(access.resource));
            taps.extend(written.map(|access| format!("{}:{}", pass.path, access.variable)));
        }
        let request = FrameRequest { aovs: &aovs, taps: &taps, cancel, ..FrameRequest::default() };
        let drawn = self.render(&config, camera, &request)?;
        let odd = drawn.taps.into_iter().find(|(_, layer)| odd_pixels(layer).is_some());
        Ok(odd.map(|(pass, _)| pass))
    }
}

/// How many pixels are not finite, and the index of the first.
fn odd_pixels(layer: &Layer) -> Option<(u64, u32)> {
    // Sums keep what is not finite, and run faster than questions.
    if layer.data.iter().map(|value| value * 0.0).sum::<f32>() == 0.0 {
        return None;
    }
    let mut odd = layer
        .data
        .chunks_exact(layer.channels)
        .enumerate()
        .filter(|(_, pixel)| pixel.iter().any(|value| !value.is_finite()));
    let (first, _) = odd.next()?;
    Some((1 + odd.count() as u64, first as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_pixels_are_counted_from_the_first() {
        let mut layer = Layer { width: 3, height: 2, channels: 3, data: vec![f32::MAX; 18] };
        assert_eq!(odd_pixels(&layer), None);
        (layer.data[7], layer.data[8], layer.data[15]) = (f32::NAN, f32::NEG_INFINITY, f32::INFINITY);
        assert_eq!(odd_pixels(&layer), Some((2, 2)));
    }
}
