//! How far a picture is from its reference, on linear radiance: slices in, a number out.
//!
//! Slices hold pixels row by row, channels interleaved; every channel counts alike. A NaN in either slice
//! makes every result NaN. Values of other programs that the tests compare with are those of scikit-image 0.26 and
//! flip-evaluator 1.7 (the authors' own), on a picture made by a formula.

mod errors;
mod flip;
mod seeds;
mod ssim;

pub use errors::{Errors, errors};
pub use flip::{FlipMap, PIXELS_PER_DEGREE, flip, flip_ldr};
pub use seeds::{ReferenceNoise, SeedError, SeedErrors, Seeds, median, without_noise};
pub use ssim::{SSIM_WINDOW, ssim};

/// Share of the largest terms that [`rel_mse_trimmed`] drops.
pub const TRIMMED_SHARE: f64 = 0.001;

/// Side of the blocks of [`rel_mse_blocks`] (pixels).
pub const BLOCK: usize = 32;

/// Relative error of each pixel, row by row: the mean over its channels of the roots of [`rel_mse`]'s terms.
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn relative_errors(image: &[f32], reference: &[f32], channels: usize) -> Vec<f32> {
    let pixels = terms(image, reference);
    pixels.chunks(channels).map(|pixel| mean(pixel.iter().map(|term| term.sqrt())) as f32).collect()
}

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

/// [`rel_mse`] of the means of blocks of [`BLOCK`] × [`BLOCK`] pixels: grain averages out, light that is missing over an
/// area or lies beside its place does not.
///
/// # Panics
/// If the slices differ in length or are not whole rows.
#[must_use]
pub fn rel_mse_blocks(image: &[f32], reference: &[f32], width: usize, channels: usize) -> f64 {
    let blocks = |picture| block_average(picture, width, channels, BLOCK);
    rel_mse(&blocks(image), &blocks(reference))
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

/// Mean absolute error in proportion: the mean of the roots of [`rel_mse`]'s terms, so never above the root of relMSE.
/// The usual |I − R| / R has no bound where the reference is black.
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn mape(image: &[f32], reference: &[f32]) -> f64 {
    mean(terms(image, reference).into_iter().map(f64::sqrt))
}

/// Symmetric form of it: the mean of |I − R| over the mean of |I| and |R|, 0 … 2; 0 where both are 0.
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn smape(image: &[f32], reference: &[f32]) -> f64 {
    let terms = pairs(image, reference).map(|(i, r)| {
        let sum = i.abs() + r.abs();
        if sum == 0.0 { 0.0 } else { 2.0 * (i - r).abs() / sum }
    });
    mean(terms)
}

/// Mean squared error, in the square of the pictures' unit.
///
/// # Panics
/// If the slices differ in length.
#[must_use]
pub fn mse(image: &[f32], reference: &[f32]) -> f64 {
    mean(pairs(image, reference).map(|(i, r)| (i - r) * (i - r)))
}

/// Peak signal-to-noise ratio of a mean squared error (dB); infinite where there is no error.
#[must_use]
pub fn psnr(mse: f64, peak: f64) -> f64 {
    10.0 * (peak * peak / mse).log10()
}

/// The peak for [`psnr`] and [`ssim`]: the largest value but for 0.1 % (rounded down) of them, so that no lamp in view
/// sets it.
#[must_use]
pub fn peak(reference: &[f32]) -> f64 {
    let mut values = reference.to_vec();
    let index = values.len().saturating_sub(1) - (values.len() as f64 * TRIMMED_SHARE) as usize;
    if values.iter().any(|value| value.is_nan()) {
        return f64::NAN;
    }
    values.sort_unstable_by(f32::total_cmp);
    values.get(index).map_or(f64::NAN, |&value| f64::from(value))
}

/// Share of the squared error that lies at a frequency (cycles a pixel, along x and y) and at its negative: all
/// frequencies of a picture's own grid, kx/width and ky/height, together make 1. White noise has the same small share at
/// each of them; a pattern that repeats every n pixels has large ones at multiples of 1/n. 0 for equal pictures.
///
/// # Panics
/// If the slices differ in length or are not whole rows.
#[must_use]
pub fn error_spectrum(
    image: &[f32],
    reference: &[f32],
    width: usize,
    channels: usize,
    frequency: [f64; 2],
) -> f64 {
    assert_eq!(image.len() % (width * channels), 0, "not whole rows");
    let mut sums = vec![[0.0; 2]; channels];
    let mut energy = 0.0;
    for (index, (i, r)) in pairs(image, reference).enumerate() {
        let pixel = index / channels;
        let at = [(pixel % width) as f64, (pixel / width) as f64];
        let turns = frequency[0] * at[0] + frequency[1] * at[1];
        let (sin, cos) = (std::f64::consts::TAU * turns.fract()).sin_cos();
        let sum = &mut sums[index % channels];
        *sum = [sum[0] + (i - r) * cos, sum[1] - (i - r) * sin];
        energy += (i - r) * (i - r);
    }
    // A frequency that is its own negative stands alone.
    let halves = if frequency.iter().all(|f| (2.0 * f).fract() == 0.0) { 1.0 } else { 2.0 };
    let power: f64 = sums.iter().map(|[re, im]| re * re + im * im).sum();
    if energy == 0.0 { 0.0 } else { halves * power * channels as f64 / (image.len() as f64 * energy) }
}

/// Flicker of a sequence: relMSE of its changes from frame to frame against the reference's own, the mean over pixels,
/// channels and changes of (ΔI − ΔR)² / (R² + 0.01 R̄²), R the later frame and R̄ the mean over all of them. An error
/// that stands still is none.
///
/// # Panics
/// If the sequences or frames differ in length, or there are fewer than two frames.
#[must_use]
pub fn flicker(frames: &[&[f32]], references: &[&[f32]]) -> f64 {
    assert!(frames.len() == references.len() && frames.len() > 1, "no two frames, or not as many references");
    let average = mean(references.iter().flat_map(|frame| frame.iter().map(|&value| f64::from(value))));
    let floor = 0.01 * average * average;
    let changes = (1..frames.len()).map(|t| {
        let now = pairs(frames[t], references[t]);
        let before = pairs(frames[t - 1], references[t - 1]);
        mean(now.zip(before).map(|((i, r), (i0, r0))| relative((i - i0) - (r - r0), r, floor)))
    });
    mean(changes)
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

fn pairs(image: &[f32], reference: &[f32]) -> impl Iterator<Item = (f64, f64)> {
    assert_eq!(image.len(), reference.len(), "picture and reference differ in size");
    image.iter().zip(reference).map(|(&i, &r)| (f64::from(i), f64::from(r)))
}

fn terms(image: &[f32], reference: &[f32]) -> Vec<f64> {
    let average = mean(reference.iter().map(|&value| f64::from(value)));
    let floor = 0.01 * average * average;
    pairs(image, reference).map(|(i, r)| relative(i - r, r, floor)).collect()
}

fn relative(error: f64, reference: f64, floor: f64) -> f64 {
    // Two black pictures are equal.
    if error == 0.0 && floor == 0.0 { 0.0 } else { error * error / (reference * reference + floor) }
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

    /// 48×32 pixels of three channels and a reference: noise, a darker stripe, tiles and a lamp.
    pub(super) fn formula() -> (Vec<f32>, Vec<f32>) {
        let (mut image, mut reference) = (Vec::new(), Vec::new());
        for (y, x, c) in (0_u32..32).flat_map(|y| (0..48).flat_map(move |x| (0..3).map(move |c| (y, x, c)))) {
            let (fx, fy) = (f64::from(x), f64::from(y));
            let mut r = 0.1 + fx / 48.0 * 0.5 * f64::from(c + 1) / 3.0 + (fy / 32.0) * (fy / 32.0);
            r += if (30..36).contains(&x) && (4..8).contains(&y) { 8.0 } else { 0.0 };
            r *= if (x / 6 + y / 6).is_multiple_of(2) { 0.6 } else { 1.0 };
            let of = |n: u32, factor: u64| u64::from(n) * factor;
            let hash = (of(x, 73_856_093) ^ of(y, 19_349_663) ^ of(c, 83_492_791)) & 0xffff;
            let i = r * (1.0 + 0.5 * (hash as f64 / 65535.0 - 0.5));
            reference.push(r as f32);
            image.push(if x < 10 { 0.8 * i } else { i } as f32);
        }
        (image, reference)
    }

    #[test]
    fn numbers_agree_with_numpys() {
        let (image, reference) = formula();
        let spectrum = |fx, fy| error_spectrum(&image, &reference, 48, 3, [fx, fy]);
        for (what, found, expected) in [
            ("relMSE", rel_mse(&image, &reference), 0.026_026_349_324),
            ("trimmed", rel_mse_trimmed(&image, &reference), 0.025_913_694_652),
            ("MAPE", mape(&image, &reference), 0.136_942_352_487),
            ("SMAPE", smape(&image, &reference), 0.148_059_734_543),
            ("bias", signed_bias(&image, &reference), -0.029_017_425_514),
            ("PSNR", psnr(mse(&image, &reference), 2.0), 22.986_009_233_676),
            ("mean", spectrum(0.0, 0.0), 0.014_019_607_296),
            ("4 pixels", spectrum(0.25, 0.0), 0.000_804_759_348),
            ("aslant", spectrum(1.0 / 3.0, 0.25), 0.000_996_427_409),
        ] {
            assert!((found / expected - 1.0).abs() < 1e-6, "{what}: {found}, not {expected}");
        }
        assert!(mape(&image, &reference).powi(2) < rel_mse(&image, &reference));
    }

    #[test]
    fn proportional_errors_have_closed_forms() {
        let reference = vec![2.0; 300];
        let image = vec![3.0; 300];
        assert!((mape(&image, &reference) - (0.25_f64 / 1.01).sqrt()).abs() < 1e-12);
        assert!((smape(&image, &reference) - 0.4).abs() < 1e-12);
        assert_eq!(smape(&reference, &image), smape(&image, &reference));
        assert_eq!((smape(&[0.0, 5.0], &[0.0, 0.0]), smape(&[-1.0], &[1.0])), (1.0, 2.0));
        assert_eq!(mse(&image, &reference), 1.0);
        assert!((psnr(0.01, 1.0) - 20.0).abs() < 1e-12 && psnr(0.0, 1.0) == f64::INFINITY);
    }

    #[test]
    fn a_lamp_in_view_is_no_peak() {
        let mut reference = vec![1.0; 2000];
        reference[7] = 500.0;
        reference[9] = 400.0;
        assert_eq!(peak(&reference), 1.0);
        reference[11] = 3.0;
        assert_eq!(peak(&reference), 3.0);
        assert_eq!(peak(&[1.0, 4.0]), 4.0);
    }

    #[test]
    fn an_error_of_one_frequency_lies_there_and_all_shares_make_one() {
        let (width, height) = (12, 8);
        let reference = vec![1.0; width * height];
        let wave = |fx: f64, fy: f64| -> Vec<f32> {
            let at = |p: usize| fx * (p % width) as f64 + fy * (p / width) as f64;
            (0..width * height).map(|p| 1.0 + (std::f64::consts::TAU * at(p) + 0.3).cos() as f32).collect()
        };
        let share = |image: &[f32], f| error_spectrum(image, &reference, width, 1, f);
        let image = wave(1.0 / 3.0, 0.0);
        assert!((share(&image, [1.0 / 3.0, 0.0]) - 1.0).abs() < 1e-6);
        assert!((share(&image, [-1.0 / 3.0, 0.0]) - 1.0).abs() < 1e-6);
        assert!(share(&image, [0.25, 0.0]) < 1e-12 && share(&image, [1.0 / 3.0, 0.25]) < 1e-12);
        let image = wave(0.5, 0.0);
        assert!((share(&image, [0.5, 0.0]) - 1.0).abs() < 1e-6);
        let (image, reference) = formula();
        let mut sum = 0.0;
        for (kx, ky) in (0..48).flat_map(|kx| (0..32).map(move |ky| (kx, ky))) {
            let f = [f64::from(kx) / 48.0, f64::from(ky) / 32.0];
            let alone = kx % 24 == 0 && ky % 16 == 0;
            // Each pair of opposite frequencies comes twice.
            sum += error_spectrum(&image, &reference, 48, 3, f) * if alone { 1.0 } else { 0.5 };
        }
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        assert_eq!(error_spectrum(&reference, &reference, 48, 3, [0.1, 0.2]), 0.0);
    }

    #[test]
    fn flicker_is_what_changes_otherwise_than_the_reference() {
        let flat = |level: f32| vec![level; 60];
        let (a, b, c) = (flat(1.0), flat(2.0), flat(3.0));
        // A constant error, under a reference that changes, does not flicker.
        assert_eq!(flicker(&[&b, &c], &[&a, &b]), 0.0);
        // ±½ about a still reference: every change is 1, R = R̄ = 1.
        let (low, high) = (flat(0.5), flat(1.5));
        assert!((flicker(&[&low, &high, &low], &[&a, &a, &a]) - 1.0 / 1.01).abs() < 1e-12);
        // A picture that does not follow its reference from 1 to 3: 4 / (9 + 0.01 · 4).
        assert!((flicker(&[&a, &a], &[&a, &c]) - 4.0 / 9.04).abs() < 1e-12);
    }

    #[test]
    fn nan_is_nowhere_hidden() {
        let (image, reference) = formula();
        for index in [0, 700, image.len() - 1] {
            let mut broken = image.clone();
            broken[index] = f32::NAN;
            for (i, r) in [(&broken, &reference), (&reference, &broken)] {
                let values = [
                    mape(i, r),
                    smape(i, r),
                    mse(i, r),
                    flip(i, r, 48).mean(),
                    flip_ldr(i, r, 48).mean(),
                    ssim(i, r, 48, 3, 1.0).unwrap(),
                    error_spectrum(i, r, 48, 3, [0.25, 0.0]),
                    flicker(&[i, i], &[r, r]),
                ];
                assert!(values.iter().all(|value| value.is_nan()), "{index}: {values:?}");
            }
            assert!(peak(&broken).is_nan());
        }
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
