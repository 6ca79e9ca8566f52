//! Pictures as a page holds them.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use std::io;

/// The exposure (stops) that a picture of linear RGB gets where none is given: to rounding the device's.
#[must_use]
pub fn exposure(radiance: &[f32]) -> f32 {
    let luminance = radiance.chunks_exact(3).map(|c| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]);
    let (sum, count) = luminance
        .filter(|luminance| *luminance > 0.0)
        .fold((0.0, 0.0), |(sum, count), luminance| (sum + f64::from(luminance).log2(), count + 1.0));
    if count > 0.0 { (0.18_f64.log2() - sum / count) as f32 } else { 0.0 }
}

/// Linear RGB as sRGB of 8 bits, exposed by `stops`, under the default operator: to one step what the device draws.
#[must_use]
pub fn display(radiance: &[f32], stops: f32) -> Vec<u8> {
    let gain = stops.exp2();
    let srgb = |c: f32| {
        let c = c.clamp(0.0, 1.0);
        let c = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        (255.0 * c).round() as u8
    };
    radiance
        .chunks_exact(3)
        .flat_map(|c| neutral([c[0] * gain, c[1] * gain, c[2] * gain]).map(srgb))
        .collect()
}

fn neutral(color: [f32; 3]) -> [f32; 3] {
    const START: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    let [r, g, b] = color;
    let x = r.min(g).min(b);
    let offset = if x < 0.08 { x - 6.25 * x * x } else { 0.04 };
    let color = color.map(|c| c - offset);
    let peak = color[0].max(color[1]).max(color[2]);
    if peak < START {
        return color;
    }
    let d = 1.0 - START;
    let new_peak = 1.0 - d * d / (peak + d - START);
    let g = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    color.map(|c| c * (new_peak / peak) * (1.0 - g) + new_peak * g)
}

/// A JPEG of sRGB pixels in rows of `width`.
pub(crate) fn jpeg(pixels: &[u8], width: u32) -> io::Result<Vec<u8>> {
    let height = u32::try_from(pixels.len() / 3 / width.max(1) as usize).map_err(io::Error::other)?;
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 90)
        .encode(pixels, width, height, ExtendedColorType::Rgb8)
        .map_err(io::Error::other)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jpeg_shows_its_pixels() {
        let pixels: Vec<u8> = (0..32 * 16).flat_map(|_| [200, 100, 50]).collect();
        let bytes = jpeg(&pixels, 32).unwrap();
        let read = image::load_from_memory(&bytes).unwrap().to_rgb8();
        assert_eq!(read.dimensions(), (32, 16));
        assert!(read.iter().zip(&pixels).all(|(a, b)| a.abs_diff(*b) <= 3));
        assert!(crate::page::data_url("image/jpeg", &bytes).starts_with("data:image/jpeg;base64,/9j/"));
    }
}
