//! Small pictures for the page.

use super::lab::Plate;
use crate::page;
use crate::renderer::Layer;

/// What to multiply radiance with: the mean of the last picture, which is the reference where there is one, becomes
/// middle grey.
pub(super) fn scale(plates: &[Plate]) -> f32 {
    let Some(Plate { layer, .. }) = plates.last() else { return 1.0 };
    let mean = layer.data.iter().sum::<f32>() / layer.data.len() as f32;
    if mean > 0.0 && mean.is_finite() { 0.18 / mean } else { 1.0 }
}

/// A PNG of a layer of three channels, what is above 1 cut off.
pub(super) fn data_url(layer: &Layer, scale: f32) -> String {
    let encode = |value: f32| {
        let value = (value * scale).clamp(0.0, 1.0);
        let coded = if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
        (255.0 * coded + 0.5) as u8
    };
    let pixels: Vec<u8> = layer.data.iter().map(|&value| encode(value)).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, layer.width, layer.height);
    encoder.set_color(png::ColorType::Rgb);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&pixels));
    written.expect("whole rows of three channels, into memory");
    page::data_url("image/png", &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_picture_sets_the_exposure() {
        let plate = |value: f32| Plate {
            label: String::new(),
            layer: Layer { width: 2, height: 1, channels: 3, data: vec![value; 6] },
        };
        assert_eq!(scale(&[plate(7.0), plate(2.0)]), 0.09);
        assert_eq!(scale(&[plate(7.0), plate(0.0)]), 1.0);
        assert_eq!(scale(&[]), 1.0);
        let grey = data_url(&plate(2.0).layer, 0.09);
        let black = data_url(&plate(0.0).layer, 0.09);
        assert!(grey.starts_with("data:image/png;base64,") && grey != black);
    }
}
