//! How far a picture is from its reference, on linear radiance: slices in, a number out.
//!
//! Slices hold pixels row by row, channels interleaved; every channel counts alike. A NaN in either slice
//! makes every result NaN.

/// Share of the largest terms that [`rel_mse_trimmed`] drops.
pub const TRIMMED_SHARE: f64 = 0.001;

/// Relative mean squared error: the mean over pixels and channels of (I − R)² / (R² + 0.01 R̄²), R̄ the mean
/// of `reference` over all of them. Few very bright pixels can dominate it: see [`rel_mse_trimmed`].
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn rel_mse(image: &[f32], reference: &[f32]) -> f64 {
    mean(terms(image, reference).into_iter())
}

/// [`rel_mse`] without the largest 0.1 % of its terms (rounded down): what is left when fireflies and edges
/// that fall into another pixel are put aside.
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn rel_mse_trimmed(image: &[f32], reference: &[f32]) -> f64 {
    let mut terms = terms(image, reference);
    if terms.iter().any(|term| term.is_nan()) {
        return f64::NAN;
    }
    let kept = terms.len() - (terms.len() as f64 * TRIMMED_SHARE) as usize;
    if kept < terms.len() {
        terms.select_nth_unstable_by(kept, f64::total_cmp);
        terms.truncate(kept);
    }
    mean(terms.into_iter())
}

/// Signed bias: mean(I) / mean(R) − 1; negative where light is lost.
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn signed_bias(image: &[f32], reference: &[f32]) -> f64 {
    assert_eq!(image.len(), reference.len(), "picture and reference differ in size");
    mean(image.iter().map(|&value| f64::from(value))) / mean(reference.iter().map(|&value| f64::from(value)))
        - 1.0
}

/// Averages blocks of `k` × `k` pixels; blocks cut off by the right or lower border average what they hold.
/// The result has ⌈width / k⌉ × ⌈height / k⌉ pixels.
///
/// # Panics
/// If `k`, `width` or `channels` is 0 or `image` is not whole rows.
#[must_use]
pub fn block_average(image: &[f32], width: usize, channels: usize, k: usize) -> Vec<f32> {
    assert_eq!(image.len() % (width * channels), 0, "not whole rows");
    let height = image.len() / (width * channels);
    let mut blocks = Vec::with_capacity(width.div_ceil(k) * height.div_ceil(k) * channels);
    for y in (0..height).step_by(k) {
        for x in (0..width).step_by(k) {
            for channel in 0..channels {
                let rows = y..height.min(y + k);
                let pixels =
                    rows.flat_map(|y| (x..width.min(x + k)).map(move |x| (y * width + x) * channels));
                blocks.push(mean(pixels.map(|pixel| f64::from(image[pixel + channel]))) as f32);
            }
        }
    }
    blocks
}

fn terms(image: &[f32], reference: &[f32]) -> Vec<f64> {
    assert_eq!(image.len(), reference.len(), "picture and reference differ in size");
    let average = mean(reference.iter().map(|&value| f64::from(value)));
    let floor = 0.01 * average * average;
    image
        .iter()
        .zip(reference)
        .map(|(&i, &r)| {
            let (i, r) = (f64::from(i), f64::from(r));
            // Two black pictures are equal.
            if i == r && floor == 0.0 { 0.0 } else { (i - r) * (i - r) / (r * r + floor) }
        })
        .collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0_usize, 0.0), |(count, sum), value| (count + 1, sum + value));
    sum / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_error_over_a_uniform_reference_has_a_closed_form() {
        // (1.1 R − R)² / (R² + 0.01 R²) = 0.01 / 1.01, whatever R.
        for level in [0.25, 1.0, 1000.0] {
            let reference = vec![level; 300];
            let image: Vec<f32> = reference.iter().map(|value| value * 1.1).collect();
            assert!((rel_mse(&image, &reference) - 0.01 / 1.01).abs() < 1e-7);
            assert!((rel_mse_trimmed(&image, &reference) - 0.01 / 1.01).abs() < 1e-7);
            assert!((signed_bias(&image, &reference) - 0.1).abs() < 1e-6);
        }
    }

    #[test]
    fn dark_pixels_weigh_by_the_mean_over_everything() {
        // R = (0, 2), R̄ = 1: an error of 0.1 on the black one counts 0.01 / 0.01, halved by the mean.
        assert!((rel_mse(&[0.1, 2.0], &[0.0, 2.0]) - 0.5).abs() < 1e-6);
        assert_eq!(signed_bias(&[1.0, 1.0], &[2.0, 2.0]), -0.5);
    }

    #[test]
    fn equal_pictures_have_no_error_even_black_ones() {
        let picture: Vec<f32> = (0..999).map(|value| value as f32).collect();
        assert_eq!(rel_mse(&picture, &picture), 0.0);
        assert_eq!(rel_mse(&[0.0; 9], &[0.0; 9]), 0.0);
        assert_eq!(rel_mse(&[1.0; 9], &[0.0; 9]), f64::INFINITY);
    }

    #[test]
    fn trimming_drops_a_thousandth_and_no_more() {
        let reference = vec![1.0; 4000];
        let mut image = reference.clone();
        image[17..21].fill(101.0);
        assert!((rel_mse(&image, &reference) - 4.0 * 1e4 / 1.01 / 4000.0).abs() < 1e-9);
        assert_eq!(rel_mse_trimmed(&image, &reference), 0.0);
        image[3999] = 2.0;
        assert!((rel_mse_trimmed(&image, &reference) - 1.0 / 1.01 / 3996.0).abs() < 1e-12);
    }

    #[test]
    fn nan_is_never_hidden() {
        let reference = vec![1.0; 2000];
        let mut image = reference.clone();
        image[5] = f32::NAN;
        assert!(rel_mse(&image, &reference).is_nan());
        assert!(rel_mse_trimmed(&image, &reference).is_nan());
        assert!(signed_bias(&image, &reference).is_nan());
    }

    #[test]
    fn blocks_average_each_channel_and_keep_the_mean() {
        // 4×2 pixels of two channels: x and 10·y.
        let image: Vec<f32> = (0..8).flat_map(|p| [(p % 4) as f32, 10.0 * (p / 4) as f32]).collect();
        assert_eq!(block_average(&image, 4, 2, 2), [0.5, 5.0, 2.5, 5.0]);
        assert_eq!(block_average(&image, 4, 2, 1), image);
        assert_eq!(block_average(&image, 4, 2, 3), [1.0, 5.0, 3.0, 5.0]);
    }
}
