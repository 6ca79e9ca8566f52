//! Structural similarity (Wang et al. 2004).

/// Pixels on each side of the window that structure is compared in.
pub const SSIM_WINDOW: usize = 11;

/// SSIM of Wang et al. 2004 in their form: a Gaussian window of 1.5 pixels' deviation, K = 0.01 and 0.03, the mean over
/// the windows that lie inside the picture and over channels. `range` is L, the range of values (see
/// [`peak`](super::peak)): what lies far below it counts little. 1 for equal pictures, else less. None where no
/// window fits.
///
/// # Panics
/// If the slices differ in length or are not whole rows.
#[must_use]
pub fn ssim(image: &[f32], reference: &[f32], width: usize, channels: usize, range: f64) -> Option<f64> {
    assert_eq!(image.len(), reference.len(), "picture and reference differ in size");
    assert_eq!(image.len() % (width * channels), 0, "not whole rows");
    let height = image.len() / (width * channels);
    if width < SSIM_WINDOW || height < SSIM_WINDOW {
        return None;
    }
    let taps: Vec<f64> = (0..SSIM_WINDOW)
        .map(|i| (-0.5 * ((i as f64 - (SSIM_WINDOW / 2) as f64) / 1.5).powi(2)).exp())
        .collect();
    let all: f64 = taps.iter().sum();
    let taps: Vec<f64> = taps.iter().map(|tap| tap / all).collect();
    let mean = |channel: usize, value: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        let plane: Vec<f64> = (channel..image.len())
            .step_by(channels)
            .map(|at| value(f64::from(image[at]), f64::from(reference[at])))
            .collect();
        within(&plane, width, &taps)
    };
    let (c1, c2) = ((0.01 * range).powi(2), (0.03 * range).powi(2));
    let channel = |channel: usize| {
        let (x, y) = (mean(channel, &|i, _| i), mean(channel, &|_, r| r));
        let (xx, yy) = (mean(channel, &|i, _| i * i), mean(channel, &|_, r| r * r));
        let xy = mean(channel, &|i, r| i * r);
        super::mean((0..x.len()).map(|w| {
            let (vx, vy, covariance) = (xx[w] - x[w] * x[w], yy[w] - y[w] * y[w], xy[w] - x[w] * y[w]);
            let luminance = (2.0 * x[w] * y[w] + c1) / (x[w] * x[w] + y[w] * y[w] + c1);
            luminance * (2.0 * covariance + c2) / (vx + vy + c2)
        }))
    };
    Some(super::mean((0..channels).map(channel)))
}

/// Weighted means over the windows inside the plane.
fn within(plane: &[f64], width: usize, taps: &[f64]) -> Vec<f64> {
    let weigh =
        |values: &mut dyn Iterator<Item = f64>| taps.iter().zip(values).map(|(t, v)| t * v).sum::<f64>();
    let inside = width - taps.len() + 1;
    let across: Vec<f64> = plane
        .chunks_exact(width)
        .flat_map(|row| row.windows(taps.len()))
        .map(|window| weigh(&mut window.iter().copied()))
        .collect();
    let windows = across.len() - (taps.len() - 1) * inside;
    (0..windows).map(|at| weigh(&mut across[at..].iter().step_by(inside).copied())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::tests::formula;

    #[test]
    fn it_agrees_with_scikit_image() {
        let (image, reference) = formula();
        for (range, expected) in [(2.0, 0.869_545_762_441), (8.0, 0.949_724_974_455)] {
            let found = ssim(&image, &reference, 48, 3, range).unwrap();
            assert!((found - expected).abs() < 1e-8, "{found}, not {expected}");
        }
        assert_eq!(ssim(&reference, &image, 48, 3, 2.0), ssim(&image, &reference, 48, 3, 2.0));
    }

    #[test]
    fn equal_pictures_have_one_and_flat_ones_a_closed_form() {
        let (image, _) = formula();
        assert_eq!(ssim(&image, &image, 48, 3, 1.0), Some(1.0));
        // Without structure luminance alone counts.
        let (a, b) = ([0.5; 144], [0.25; 144]);
        let expected = (2.0 * 0.5 * 0.25 + 1e-4) / (0.25 + 0.0625 + 1e-4);
        assert!((ssim(&a, &b, 12, 1, 1.0).unwrap() - expected).abs() < 1e-9);
        assert_eq!(ssim(&a, &b, 72, 1, 1.0), None, "two rows");
    }

    /// Contrast k times the reference's about the same mean: structure is 2 k v / (1 + k²) v, but for C₂.
    #[test]
    fn less_contrast_lowers_it_by_a_closed_form() {
        let wave = |contrast: f32| -> Vec<f32> {
            let sign = |p: usize| if (p % 24 + p / 24).is_multiple_of(2) { contrast } else { -contrast };
            (0..576).map(|p| 0.5 + sign(p)).collect()
        };
        let found = ssim(&wave(0.1), &wave(0.2), 24, 1, 1e-3).unwrap();
        assert!((found - 0.8).abs() < 1e-4, "{found}");
    }
}
