//! ꟻLIP: what a person sees who flips between two pictures (Andersson et al. 2020), and its form for pictures of any
//! range, the worst over the exposures that show the reference (Andersson et al. 2021).
//!
//! Written from the papers: the crate that binds the authors' program has no HDR form and a C++ library behind it.

use std::f64::consts::PI;

/// Pixels a degree of sight, of the authors' observer: a screen 0.7 m wide with 3840 pixels, seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Seen error of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct FlipMap {
    /// 0 (none) … 1, row by row.
    pub map: Vec<f32>,
}

impl FlipMap {
    /// The error of the picture.
    #[must_use]
    pub fn mean(&self) -> f64 {
        super::mean(self.map.iter().map(|&error| f64::from(error)))
    }
}

/// HDR-ꟻLIP of pictures of three channels, for [`PIXELS_PER_DEGREE`] and the ACES curve that the authors use. Not
/// symmetric: exposures are the reference's, from its brightest pixel at the curve's shoulder to its median lit one.
///
/// # Panics
/// If the slices differ in length or are not whole rows.
#[must_use]
pub fn flip(image: &[f32], reference: &[f32], width: usize) -> FlipMap {
    check(image, reference, width);
    let (start, stop) = exposures(reference);
    let count = ((stop - start).ceil() as usize).max(2);
    let step = (stop - start) / (count - 1) as f64;
    let maps: Vec<FlipMap> = std::thread::scope(|scope| {
        let at = |index: usize| {
            let gain = (start + step * index as f64).exp2();
            scope.spawn(move || {
                let show = |picture: &[f32]| picture.iter().map(|&v| aces(f64::from(v) * gain)).collect();
                let (image, reference): (Vec<f32>, Vec<f32>) = (show(image), show(reference));
                flip_ldr(&image, &reference, width)
            })
        };
        let threads: Vec<_> = (0..count).map(at).collect();
        threads.into_iter().filter_map(|thread| thread.join().ok()).collect()
    });
    let mut worst = FlipMap { map: vec![0.0; image.len() / 3] };
    for map in maps {
        // `f32::max` would hide a NaN.
        let pixels = worst.map.iter_mut().zip(map.map);
        pixels
            .filter(|(worst, error)| error > *worst || error.is_nan())
            .for_each(|(worst, error)| *worst = error);
    }
    worst
}

/// ꟻLIP of pictures as a screen shows them: linear Rec. 709 of three channels, 0 … 1; what lies outside is clamped.
/// For [`PIXELS_PER_DEGREE`]; symmetric.
///
/// # Panics
/// If the slices differ in length or are not whole rows.
#[must_use]
pub fn flip_ldr(image: &[f32], reference: &[f32], width: usize) -> FlipMap {
    check(image, reference, width);
    let (image, reference) = (Seen::of(image, width), Seen::of(reference, width));
    let green = lab([0.0, 1.0, 0.0]);
    let largest = distance(green, lab([0.0, 0.0, 1.0])).powf(COLOUR_POWER);
    let pixels = image.lab.iter().zip(&reference.lab).zip(image.features.iter().zip(&reference.features));
    let map = pixels.map(|((&a, &b), (f, g))| {
        let difference = distance(a, b).powf(COLOUR_POWER);
        // Most of the range goes to differences below 0.4 of the largest.
        let knee = 0.4 * largest;
        let colour = if difference < knee {
            difference * 0.95 / knee
        } else {
            0.95 + (difference - knee) / (largest - knee) * 0.05
        };
        let feature = (f[0] - g[0]).abs().max((f[1] - g[1]).abs());
        colour.powf(1.0 - (feature / 2.0_f32.sqrt()).sqrt())
    });
    FlipMap { map: map.collect() }
}

const COLOUR_POWER: f32 = 0.7;

fn check(image: &[f32], reference: &[f32], width: usize) {
    assert_eq!(image.len(), reference.len(), "picture and reference differ in size");
    assert_eq!(image.len() % (3 * width), 0, "not whole rows of three channels");
}

/// Exposures (stops) at which the reference's brightest pixel, and its median lit one, come to 0.85 on the curve.
fn exposures(reference: &[f32]) -> (f64, f64) {
    let luminance = reference
        .chunks_exact(3)
        .map(|c| 0.2126 * f64::from(c[0]) + 0.7152 * f64::from(c[1]) + 0.0722 * f64::from(c[2]));
    let mut lit: Vec<f64> = luminance.filter(|y| *y > 0.0).collect();
    if lit.is_empty() {
        return (0.0, 0.0);
    }
    lit.sort_by(f64::total_cmp);
    // Where the curve (a x² + b x) / (c x² + d x + e) is 0.85.
    let [a, b, c, d, e] = ACES;
    let (a, b, c) = (a - 0.85 * c, b - 0.85 * d, -0.85 * e);
    let shown = -b / (2.0 * a) + ((b / (2.0 * a)).powi(2) - c / a).sqrt();
    ((shown / lit[lit.len() - 1]).log2(), (shown / lit[lit.len() / 2]).log2())
}

/// Narkowicz's fit of the ACES curve, with the exposure of 0.6 that the authors put before it.
const ACES: [f64; 5] = [0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14];

fn aces(x: f64) -> f32 {
    let [a, b, c, d, e] = ACES;
    (((a * x + b) * x) / ((c * x + d) * x + e)).clamp(0.0, 1.0) as f32
}

/// What is left of a picture in the eye.
struct Seen {
    /// Colour after blurring, in L*a*b* whose chroma the Hunt effect dims.
    lab: Vec<[f32; 3]>,
    /// Strength of edges and of points.
    features: Vec<[f32; 2]>,
}

impl Seen {
    fn of(picture: &[f32], width: usize) -> Self {
        let opponent: Vec<[f32; 3]> = picture
            .chunks_exact(3)
            .map(|c| to_opponent(to_xyz([0, 1, 2].map(|i| c[i].clamp(0.0, 1.0)))))
            .collect();
        let plane = |channel: usize| -> Vec<f32> { opponent.iter().map(|c| c[channel]).collect() };
        // Contrast sensitivity (achromatic, red–green, blue–yellow) as sums of Gaussians, weight and width.
        let [y, cx, cz] = [&[(1.0, 0.0047)][..], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]]
            .map(|sensitivity| sensitivity.to_vec());
        let blurred = [blur(&plane(0), width, &y), blur(&plane(1), width, &cx), blur(&plane(2), width, &cz)];
        let lab = (0..opponent.len())
            .map(|i| lab(to_rgb(from_opponent([blurred[0][i], blurred[1][i], blurred[2][i]]))))
            .collect();
        let luminance: Vec<f32> = opponent.iter().map(|c| (c[0] + 16.0) / 116.0).collect();
        Self { lab, features: features(&luminance, width) }
    }
}

/// Convolves with Σ a √(π/b) exp(−π² r² / b), r in degrees, normalised.
fn blur(plane: &[f32], width: usize, gaussians: &[(f64, f64)]) -> Vec<f32> {
    const WIDEST: f64 = 0.04;
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let taps = |&(_, b): &(f64, f64)| -> Vec<f64> {
        let degrees = |i: i32| f64::from(i) / PIXELS_PER_DEGREE;
        (-radius..=radius).map(|i| (-PI * PI * degrees(i).powi(2) / b).exp()).collect()
    };
    let taps: Vec<Vec<f64>> = gaussians.iter().map(taps).collect();
    let weights: Vec<f64> = gaussians.iter().map(|(a, b)| a * (PI / b).sqrt()).collect();
    let sums = taps.iter().map(|taps| taps.iter().sum::<f64>());
    let all: f64 = weights.iter().zip(sums).map(|(weight, sum)| weight * sum * sum).sum();
    let mut result = vec![0.0; plane.len()];
    for (taps, weight) in taps.iter().zip(weights) {
        let down: Vec<f32> = taps.iter().map(|tap| *tap as f32).collect();
        let across: Vec<f32> = taps.iter().map(|tap| (tap * weight / all) as f32).collect();
        let part = columns(&rows(plane, width, &across), width, &down);
        result.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
    }
    result
}

/// Edges and points of the size of the eye's own detectors: first and second derivatives of a Gaussian 0.082° wide,
/// each side of them summing to one.
fn features(luminance: &[f32], width: usize) -> Vec<[f32; 2]> {
    let deviation = 0.5 * 0.082 * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as i32;
    let gaussian = |i: i32| (-0.5 * (f64::from(i) / deviation).powi(2)).exp();
    let kernel = |f: &dyn Fn(i32) -> f64| -> Vec<f64> { (-radius..=radius).map(f).collect() };
    let smooth = kernel(&gaussian);
    let all: f64 = smooth.iter().sum();
    let smooth: Vec<f32> = smooth.iter().map(|tap| (tap / all) as f32).collect();
    let balanced = |taps: Vec<f64>| -> Vec<f32> {
        let side = |sign: f64| taps.iter().map(|tap| (sign * tap).max(0.0)).sum::<f64>();
        let (positive, negative) = (side(1.0), side(-1.0));
        taps.iter().map(|tap| (tap / if *tap > 0.0 { positive } else { negative }) as f32).collect()
    };
    let edge = balanced(kernel(&|i| -f64::from(i) * gaussian(i)));
    let point = balanced(kernel(&|i| ((f64::from(i) / deviation).powi(2) - 1.0) * gaussian(i)));
    let across = rows(luminance, width, &smooth);
    let both = |kernel: &[f32]| {
        let x = columns(&rows(luminance, width, kernel), width, &smooth);
        let y = columns(&across, width, kernel);
        x.into_iter().zip(y).map(|(x, y)| x.hypot(y)).collect::<Vec<f32>>()
    };
    both(&edge).into_iter().zip(both(&point)).map(|(edge, point)| [edge, point]).collect()
}

/// Convolves along x; beyond the border the border goes on.
fn rows(plane: &[f32], width: usize, taps: &[f32]) -> Vec<f32> {
    let radius = taps.len() / 2;
    let mut result = vec![0.0; plane.len()];
    let mut padded = vec![0.0; width + 2 * radius];
    for (row, out) in plane.chunks_exact(width).zip(result.chunks_exact_mut(width)) {
        padded[..radius].fill(row[0]);
        padded[radius..radius + width].copy_from_slice(row);
        padded[radius + width..].fill(row[width - 1]);
        for (k, tap) in taps.iter().enumerate() {
            out.iter_mut().zip(&padded[k..]).for_each(|(out, value)| *out += tap * value);
        }
    }
    result
}

/// Convolves along y; beyond the border the border goes on.
fn columns(plane: &[f32], width: usize, taps: &[f32]) -> Vec<f32> {
    let (radius, height) = (taps.len() / 2, plane.len() / width);
    let mut result = vec![0.0; plane.len()];
    for (y, out) in result.chunks_exact_mut(width).enumerate() {
        for (k, tap) in taps.iter().enumerate() {
            let from = (y + k).saturating_sub(radius).min(height - 1) * width;
            out.iter_mut().zip(&plane[from..from + width]).for_each(|(out, value)| *out += tap * value);
        }
    }
    result
}

/// Reference white, D65.
const WHITE: [f32; 3] = [0.950_428_5, 1.0, 1.088_900_4];

fn to_xyz([r, g, b]: [f32; 3]) -> [f32; 3] {
    [
        0.412_386_56 * r + 0.357_591_5 * g + 0.180_450_5 * b,
        0.212_636_82 * r + 0.715_183 * g + 0.072_180_2 * b,
        0.019_330_62 * r + 0.119_197_16 * g + 0.950_372_6 * b,
    ]
}

fn to_rgb([x, y, z]: [f32; 3]) -> [f32; 3] {
    [
        3.241_003_3 * x - 1.537_398_9 * y - 0.498_615_9 * z,
        -0.969_224_3 * x + 1.875_93 * y + 0.041_554_226 * z,
        0.055_639_42 * x - 0.204_011_21 * y + 1.057_148_9 * z,
    ]
}

/// Y, Cx, Cz: L*a*b* without its cube root, so that blurring averages light.
fn to_opponent(xyz: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = [0, 1, 2].map(|i| xyz[i] / WHITE[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn from_opponent([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (y + 16.0) / 116.0;
    [(y + cx / 500.0) * WHITE[0], y, (y - cz / 200.0) * WHITE[2]]
}

/// L*a*b* of a linear colour clamped to what a screen shows, chroma dimmed as the Hunt effect has it.
fn lab(rgb: [f32; 3]) -> [f32; 3] {
    let xyz = to_xyz(rgb.map(|v| v.clamp(0.0, 1.0)));
    const DELTA: f32 = 6.0 / 29.0;
    let f = |t: f32| {
        if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i] / WHITE[i]));
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    [lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z)]
}

/// HyAB, for large colour differences: city blocks between lightness and chroma.
fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::tests::formula;

    #[test]
    fn it_agrees_with_the_authors_program() {
        let (image, reference) = formula();
        let found = flip(&image, &reference, 48);
        assert!((found.mean() - 0.128_924_236).abs() < 1e-5, "{}", found.mean());
        assert!((found.map[16 * 48 + 5] - 0.278_961_78).abs() < 1e-4, "{}", found.map[16 * 48 + 5]);
        assert!((found.map[5 * 48 + 32] - 0.024_669_87).abs() < 1e-4, "{}", found.map[5 * 48 + 32]);
        assert!((flip(&reference, &image, 48).mean() - 0.128_804_609).abs() < 1e-5);
        let found = flip_ldr(&image, &reference, 48);
        assert!((found.mean() - 0.132_244_751).abs() < 1e-5, "{}", found.mean());
        assert!((found.map[16 * 48 + 5] - 0.276_341_98).abs() < 1e-4, "{}", found.map[16 * 48 + 5]);
        assert_eq!(found, flip_ldr(&reference, &image, 48));
        let (start, stop) = exposures(&reference);
        assert!((start + 1.978_549_5).abs() < 1e-5 && (stop - 2.386_419_1).abs() < 1e-5, "{start} {stop}");
    }

    #[test]
    fn equal_pictures_differ_by_nothing_and_black_from_white_by_almost_all() {
        let (image, _) = formula();
        assert!(flip(&image, &image, 48).map.iter().all(|error| *error == 0.0));
        let (black, white) = (vec![0.0; 3 * 256], vec![1.0; 3 * 256]);
        assert_eq!(flip(&black, &black, 16).mean(), 0.0);
        let most = flip_ldr(&black, &white, 16).mean();
        assert!(most > 0.95 && most <= 1.0, "{most}");
        // Green and blue are farthest apart: the scale's end.
        let [green, blue] = [1, 2].map(|c| (0..768).map(|i| f32::from(i % 3 == c)).collect::<Vec<f32>>());
        assert!((flip_ldr(&green, &blue, 16).mean() - 1.0).abs() < 1e-3);
    }

    /// Twice the light is the same picture under another exposure.
    #[test]
    fn the_unit_of_light_does_not_matter() {
        let (image, reference) = formula();
        let scaled = |picture: &[f32]| picture.iter().map(|v| v * 4.0).collect::<Vec<_>>();
        let scaled = flip(&scaled(&image), &scaled(&reference), 48).mean();
        assert!((scaled - flip(&image, &reference, 48).mean()).abs() < 1e-5);
    }
}
