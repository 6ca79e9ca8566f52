//! Small pictures for the page.

use super::lab::Plate;
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
    format!("data:image/png;base64,{}", base64(&bytes))
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = (0..3).fold(0_u32, |word, i| word << 8 | u32::from(chunk.get(i).copied().unwrap_or(0)));
        for digit in 0..4 {
            let shown = digit <= chunk.len();
            text.push(if shown { DIGITS[(word >> (18 - 6 * digit)) as usize & 63].into() } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test vectors of RFC 4648.
    #[test]
    fn base64_is_the_standards() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xfb, 0xff, 0xbf]), "+/+/");
    }

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
