use super::{mean, rel_mse, rel_mse_blocks, signed_bias};

/// How a method's error is stated: over pictures of the same thing that differ in their seeds alone.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SeedErrors {
    /// Median of [`rel_mse`].
    pub rel_mse: f64,
    /// The largest of them.
    pub rel_mse_worst: f64,
    /// Mean of [`signed_bias`], which is that of the mean picture.
    pub bias: f64,
    /// Its standard error, by how seeds differ; absent with one of them.
    pub bias_se: Option<f64>,
    /// [`rel_mse`] of the mean picture: the systematic part, and what noise n seeds leave. Absent where there is no such
    /// picture.
    pub rel_mse_of_mean: Option<f64>,
    /// The systematic part, estimated without bias: (n · relMSE of the mean − mean of relMSE) / (n − 1), which is
    /// relMSE of the mean less the variance that is left in it. Below 0 where none shows; absent with one seed.
    pub systematic: Option<f64>,
    /// Median of [`rel_mse_blocks`].
    pub rel_mse_blocks: f64,
}

/// What one picture adds to [`SeedErrors`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeedError {
    /// [`rel_mse`].
    pub rel_mse: f64,
    /// [`signed_bias`].
    pub signed_bias: f64,
    /// [`rel_mse_blocks`].
    pub rel_mse_blocks: f64,
}

/// What the reference's own noise adds to errors against it; 0 of one that has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct ReferenceNoise {
    /// To [`rel_mse`] of any picture, the mean of many included.
    pub rel_mse: f64,
    /// To [`rel_mse_blocks`].
    pub rel_mse_blocks: f64,
    /// Standard error of every [`signed_bias`], the same for all pictures.
    pub bias_se: f64,
}

impl ReferenceNoise {
    /// By one of two independent halves that `reference` is the mean of: a quarter of the squares of their difference.
    /// For the bias pixels count as independent.
    ///
    /// # Panics
    /// If the slices differ in length or are not whole rows.
    #[must_use]
    pub fn of(half: &[f32], reference: &[f32], width: usize, channels: usize) -> Self {
        let pixels = half.chunks(channels).zip(reference.chunks(channels));
        let error = |(a, r): (&[f32], &[f32])| {
            a.iter().zip(r).map(|(&a, &r)| f64::from(a) - f64::from(r)).sum::<f64>()
        };
        let variance: f64 = pixels.map(|pixel| error(pixel).powi(2)).sum();
        let light: f64 = reference.iter().map(|&value| f64::from(value)).sum();
        Self {
            rel_mse: rel_mse(half, reference),
            rel_mse_blocks: rel_mse_blocks(half, reference, width, channels),
            bias_se: variance.sqrt() / light,
        }
    }
}

/// A squared error without the reference's noise: what is lower than a tenth of it says nothing.
#[must_use]
pub fn without_noise(square: f64, noise: f64) -> f64 {
    (square - noise).max(0.1 * square)
}

impl SeedErrors {
    /// Of each picture's errors and [`rel_mse`] of the mean of just these pictures, where known. The noise of the
    /// reference is taken off all squared errors, whole off [`Self::systematic`] and by [`without_noise`] off the others.
    /// Of no pictures there are none.
    #[must_use]
    pub fn of(errors: &[SeedError], rel_mse_of_mean: Option<f64>, noise: &ReferenceNoise) -> Option<Self> {
        let count = errors.len() as f64;
        let several = errors.len() > 1;
        let squares = |of: &dyn Fn(&SeedError) -> f64, noise| {
            errors.iter().map(|error| without_noise(of(error), noise)).collect::<Vec<_>>()
        };
        let rel_mse = squares(&|error| error.rel_mse, noise.rel_mse);
        let blocks = squares(&|error| error.rel_mse_blocks, noise.rel_mse_blocks);
        let bias = mean(errors.iter().map(|error| error.signed_bias));
        let variance =
            errors.iter().map(|error| (error.signed_bias - bias).powi(2)).sum::<f64>() / (count - 1.0);
        let average = mean(errors.iter().map(|error| error.rel_mse));
        let systematic = |of_mean| (count * of_mean - average) / (count - 1.0) - noise.rel_mse;
        Some(Self {
            rel_mse: median(rel_mse.clone())?,
            rel_mse_worst: rel_mse.into_iter().reduce(|a, b| if a >= b || a.is_nan() { a } else { b })?,
            bias,
            bias_se: several.then(|| (variance / count).sqrt()),
            rel_mse_of_mean: rel_mse_of_mean.map(|square| without_noise(square, noise.rel_mse)),
            systematic: rel_mse_of_mean.filter(|_| several).map(systematic),
            rel_mse_blocks: median(blocks)?,
        })
    }
}

/// The middle one, or the mean of the two in the middle; NaN if one is.
#[must_use]
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.iter().any(|value| value.is_nan()) {
        return Some(f64::NAN);
    }
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    let upper = *values.get(middle)?;
    Some(if values.len() % 2 == 1 { upper } else { 0.5 * (values[middle - 1] + upper) })
}

/// Takes pictures one by one, and keeps their mean in double precision and a few numbers of each.
#[derive(Clone, Debug)]
pub struct Seeds<'a> {
    reference: &'a [f32],
    width: usize,
    channels: usize,
    sum: Vec<f64>,
    errors: Vec<SeedError>,
}

impl<'a> Seeds<'a> {
    /// No pictures yet, of `width` pixels a row.
    #[must_use]
    pub fn new(reference: &'a [f32], width: usize, channels: usize) -> Self {
        Self { reference, width, channels, sum: vec![0.0; reference.len()], errors: Vec::new() }
    }

    /// One picture more.
    ///
    /// # Panics
    /// If it differs from the reference in length, or is not whole rows.
    pub fn add(&mut self, image: &[f32]) {
        self.errors.push(SeedError {
            rel_mse: rel_mse(image, self.reference),
            signed_bias: signed_bias(image, self.reference),
            rel_mse_blocks: rel_mse_blocks(image, self.reference, self.width, self.channels),
        });
        self.sum.iter_mut().zip(image).for_each(|(sum, &value)| *sum += f64::from(value));
    }

    /// The mean of all pictures so far; NaN of none.
    #[must_use]
    pub fn mean(&self) -> Vec<f32> {
        self.sum.iter().map(|sum| (sum / self.errors.len() as f64) as f32).collect()
    }

    /// Errors of each, as they came.
    #[must_use]
    pub fn each(&self) -> &[SeedError] {
        &self.errors
    }

    /// How the error is stated; of no pictures there is none.
    #[must_use]
    pub fn errors(&self, noise: &ReferenceNoise) -> Option<SeedErrors> {
        SeedErrors::of(&self.errors, Some(rel_mse(&self.mean(), self.reference)), noise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::BLOCK;

    const WIDTH: usize = 96;
    const COUNT: usize = 3 * WIDTH * 64;
    const NONE: ReferenceNoise = ReferenceNoise { rel_mse: 0.0, rel_mse_blocks: 0.0, bias_se: 0.0 };

    /// Uniform numbers of variance 1 and mean 0, independent by index and salt.
    fn noise(index: usize, salt: u64) -> f64 {
        let mut h =
            (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ salt.wrapping_mul(0xd6e8_feb8_6659_fd93);
        h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        12_f64.sqrt() * ((h >> 40) as f64 / f64::from(1 << 24) - 0.5)
    }

    /// `count` pictures of `level` with noise of deviation `sigma`, against a reference of level 1.
    fn stated(level: f64, sigma: f64, count: u64, reference: &[f32], own: &ReferenceNoise) -> SeedErrors {
        let mut seeds = Seeds::new(reference, WIDTH, 3);
        for seed in 1..=count {
            let image: Vec<f32> = (0..COUNT).map(|i| (level + sigma * noise(i, seed)) as f32).collect();
            seeds.add(&image);
        }
        assert_eq!(seeds.each().len() as u64, count);
        seeds.errors(own).unwrap()
    }

    fn near(found: f64, expected: f64, share: f64) {
        assert!((found - expected).abs() <= share * expected.abs(), "{found}, not {expected}");
    }

    #[test]
    fn what_is_wrong_alike_with_all_seeds_is_all_systematic() {
        let errors = stated(0.9, 0.0, 4, &[1.0; COUNT], &NONE);
        let lost = 0.01 / 1.01;
        for found in [errors.rel_mse, errors.rel_mse_worst, errors.rel_mse_of_mean.unwrap()] {
            near(found, lost, 1e-6);
        }
        near(errors.systematic.unwrap(), lost, 1e-6);
        near(errors.rel_mse_blocks, lost, 1e-6);
        near(errors.bias, -0.1, 1e-6);
        assert!(errors.bias_se.unwrap() < 1e-9);
    }

    #[test]
    fn noise_falls_in_the_mean_and_leaves_no_systematic_part() {
        let (sigma, count) = (0.3, 8);
        let errors = stated(1.0, sigma, count, &[1.0; COUNT], &NONE);
        let variance = sigma * sigma / 1.01;
        near(errors.rel_mse, variance, 0.02);
        assert!(errors.rel_mse_worst >= errors.rel_mse);
        near(errors.rel_mse_of_mean.unwrap(), variance / count as f64, 0.05);
        // Its deviation is variance · √(2 / (n (n − 1) pixels)), here 1.4e-3 of the variance.
        assert!(errors.systematic.unwrap().abs() < 0.01 * variance, "{errors:?}");
        // A block holds 1024 pixels of each channel.
        near(errors.rel_mse_blocks, variance / (BLOCK * BLOCK) as f64, 0.6);
        // So many numbers of deviation sigma, in n pictures.
        let se = sigma / (COUNT as f64 * count as f64).sqrt();
        assert!(errors.bias.abs() < 5.0 * se);
        assert!((0.4 * se..2.0 * se).contains(&errors.bias_se.unwrap()), "{errors:?} {se}");
    }

    #[test]
    fn both_together_are_told_apart_and_few_seeds_estimate_the_same() {
        let lost = 0.04 / 1.01;
        for count in [2, 3, 8] {
            let errors = stated(0.8, 0.5, count, &[1.0; COUNT], &NONE);
            near(errors.systematic.unwrap(), lost, 0.15);
            near(errors.rel_mse_of_mean.unwrap(), lost + 0.25 / 1.01 / count as f64, 0.05);
        }
    }

    #[test]
    fn the_references_own_noise_is_no_error_of_the_method() {
        let half = |salt| (0..COUNT).map(|i| (1.0 + 0.05 * noise(i, salt)) as f32).collect::<Vec<f32>>();
        let (a, b) = (half(101), half(102));
        let reference: Vec<f32> = a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).collect();
        let own = ReferenceNoise::of(&a, &reference, WIDTH, 3);
        // The mean of halves of deviation 0.05.
        let variance = 0.5 * 0.05 * 0.05;
        near(own.rel_mse, variance / 1.01, 0.03);
        near(own.rel_mse_blocks, variance / 1.01 / 1024.0, 0.6);
        near(own.bias_se, (variance / COUNT as f64).sqrt(), 0.05);
        // A third of what does not differ by seed is the reference's; in the denominator its noise is of second order.
        let errors = stated(1.05, 0.1, 4, &reference, &own);
        near(errors.systematic.unwrap(), 0.0025 / 1.01, 0.25);
        near(errors.rel_mse, 0.0125 / 1.01, 0.05);
        near(errors.rel_mse_blocks, 0.0025 / 1.01, 0.05);
        near(errors.bias, 0.05, 0.03);
        let raw = stated(1.05, 0.1, 4, &reference, &NONE);
        near(raw.systematic.unwrap() - errors.systematic.unwrap(), own.rel_mse, 1e-9);
        // Of a picture that is the truth no more is known than a tenth.
        near(stated(1.0, 0.0, 1, &reference, &own).rel_mse, 0.1 * own.rel_mse, 0.05);
    }

    #[test]
    fn the_middle_and_the_worst_are_of_the_seeds() {
        let reference = [1.0_f32; 12];
        let mut seeds = Seeds::new(&reference, 4, 3);
        assert_eq!(seeds.errors(&NONE), None);
        for level in [1.2, 1.5, 1.1_f32] {
            seeds.add(&[level; 12]);
        }
        let errors = seeds.errors(&NONE).unwrap();
        near(errors.rel_mse, 0.04 / 1.01, 1e-6);
        near(errors.rel_mse_worst, 0.25 / 1.01, 1e-6);
        near(errors.bias, 0.8 / 3.0, 1e-6);
        // Deviations −1/15, 7/30, −1/6 over n (n − 1).
        near(errors.bias_se.unwrap(), (0.086_666_667_f64 / 6.0).sqrt(), 1e-6);
        near(errors.rel_mse_of_mean.unwrap(), (0.8_f64 / 3.0).powi(2) / 1.01, 1e-6);
        assert!(seeds.mean().iter().all(|value| (f64::from(*value) - 3.8 / 3.0).abs() < 1e-6));
        let mut one = Seeds::new(&reference, 4, 3);
        one.add(&[1.2; 12]);
        let errors = one.errors(&NONE).unwrap();
        assert_eq!((errors.bias_se, errors.systematic), (None, None));
        assert_eq!(errors.rel_mse_of_mean, Some(errors.rel_mse));
        assert_eq!(median(vec![4.0, 1.0, 2.0]), Some(2.0));
        assert_eq!((median(vec![4.0, 1.0]), median(Vec::new())), (Some(2.5), None));
    }

    #[test]
    fn nan_is_not_hidden_by_other_seeds() {
        let mut seeds = Seeds::new(&[1.0; 12], 4, 3);
        for level in [1.0, f32::NAN, 1.1] {
            seeds.add(&[level; 12]);
        }
        let errors = seeds.errors(&NONE).unwrap();
        let values = [errors.rel_mse, errors.rel_mse_worst, errors.bias, errors.rel_mse_blocks];
        assert!(values.iter().all(|value| value.is_nan()), "{errors:?}");
        assert!(errors.systematic.unwrap().is_nan() && errors.bias_se.unwrap().is_nan());
        assert!(errors.rel_mse_of_mean.unwrap().is_nan());
    }
}
