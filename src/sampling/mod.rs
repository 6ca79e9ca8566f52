//! Low-discrepancy numbers, hashes and warps: the CPU twins of `glsl/lib/sampling.glsl`.
//!
//! Integers (digits, hashes) are equal bit for bit on every device; the float warps agree within 1e-5.

use glam::{Mat3, Vec2, Vec3};
use std::f32::consts::TAU;

/// Dimensions of the Halton sequence on the device: 5 for a light path's start and a pair for each of 32 bounces.
pub const HALTON_DIMENSIONS: u32 = PRIMES.len() as u32;

/// Most bounces a light path can have.
pub const MAX_BOUNCES: u32 = (HALTON_DIMENSIONS - 5) / 2;

const PRIMES: [u32; 69] = [
    2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89, 97, 101, 103,
    107, 109, 113, 127, 131, 137, 139, 149, 151, 157, 163, 167, 173, 179, 181, 191, 193, 197, 199, 211, 223,
    227, 229, 233, 239, 241, 251, 257, 263, 269, 271, 277, 281, 283, 293, 307, 311, 313, 317, 331, 337, 347,
];

/// PCG as a hash (Jarzynski & Olano, "Hash Functions for GPU Rendering", 2020).
#[must_use]
pub fn hash(v: u32) -> u32 {
    let state = v.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

fn hash3(a: u32, b: u32, c: u32) -> u32 {
    hash(a ^ hash(b ^ hash(c)))
}

/// The radical inverse of `index` in the base of `dimension` as (numerator, denominator).
///
/// Seed 0 is the plain sequence; any other maps every digit by an affine permutation modulo the base.
///
/// # Panics
/// If `dimension` is not below [`HALTON_DIMENSIONS`].
#[must_use]
pub fn halton_digits(dimension: u32, mut index: u32, seed: u32) -> [u32; 2] {
    let base = PRIMES[dimension as usize];
    let (mut numerator, mut denominator, mut level) = (0, 1, 0);
    while denominator <= u32::MAX / base {
        let mut digit = index % base;
        index /= base;
        if seed != 0 {
            let h = hash3(seed, dimension, level);
            digit = (digit * (1 + (h & 0xffff) % (base - 1)) + (h >> 16) % base) % base;
        }
        numerator = numerator * base + digit;
        denominator *= base;
        level += 1;
    }
    [numerator, denominator]
}

/// Element `index` of the Halton sequence's `dimension`, in [0, 1).
#[must_use]
pub fn halton(dimension: u32, index: u32, seed: u32) -> f32 {
    let [numerator, denominator] = halton_digits(dimension, index, seed);
    (numerator as f32 / denominator as f32).min(1.0f32.next_down())
}

/// Owen scrambling of binary digits, the least significant first: each is flipped by a hash of those below (Burley,
/// "Practical Hash-based Owen Scrambling", 2020; constants of Vegdahl, "Building a Better LK Hash", 2021).
fn owen_scramble(mut digits: u32, seed: u32) -> u32 {
    digits ^= digits.wrapping_mul(0x3d20_adea);
    digits = digits.wrapping_add(seed);
    digits = digits.wrapping_mul((seed >> 16) | 1);
    digits ^= digits.wrapping_mul(0x0552_6c56);
    digits ^ digits.wrapping_mul(0x53a2_2864)
}

/// Element `index` of an Owen-scrambled and shuffled (0, 2)-sequence (Sobol' 1967), digits after the binary point from
/// the top bit down. Every seed is another, independent one.
#[must_use]
pub fn sobol_bits(index: u32, seed: u32) -> [u32; 2] {
    let part = |n: u32| hash(seed ^ hash(n));
    let i = owen_scramble(index.reverse_bits(), part(0)).reverse_bits();
    // Times Pascal's triangle modulo 2.
    let masks = [0x0000_ffff, 0x00ff_00ff, 0x0f0f_0f0f, 0x3333_3333, 0x5555_5555];
    let j = masks.iter().zip([16, 8, 4, 2, 1]).fold(i, |j, (mask, shift)| j ^ ((j >> shift) & mask));
    [owen_scramble(i, part(1)).reverse_bits(), owen_scramble(j, part(2)).reverse_bits()]
}

/// [`sobol_bits`] as numbers in [0, 1), rounded down to 24 digits.
#[must_use]
pub fn sobol(index: u32, seed: u32) -> Vec2 {
    let [x, y] = sobol_bits(index, seed).map(|bits| (bits >> 8) as f32 / 16_777_216.0);
    Vec2::new(x, y)
}

/// Orthonormal basis whose third column is `n` (Duff et al., "Building an Orthonormal Basis, Revisited", 2017).
#[must_use]
pub fn basis_around(n: Vec3) -> Mat3 {
    let s = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    Mat3::from_cols(
        Vec3::new(1.0 + s * n.x * n.x * a, s * b, -s * n.x),
        Vec3::new(b, s + n.y * n.y * a, -n.y),
        n,
    )
}

/// Uniform direction, density 1/4π.
#[must_use]
pub fn sample_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * (TAU * u.y).cos(), r * (TAU * u.y).sin(), z)
}

/// Uniform direction within the cone around +Z whose half-angle has cosine `cos_max`.
#[must_use]
pub fn sample_cone(u: Vec2, cos_max: f32) -> Vec3 {
    let z = 1.0 - u.x * (1.0 - cos_max);
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * (TAU * u.y).cos(), r * (TAU * u.y).sin(), z)
}

/// Uniform point on the unit disc.
#[must_use]
pub fn sample_disc(u: Vec2) -> Vec2 {
    u.x.sqrt() * Vec2::new((TAU * u.y).cos(), (TAU * u.y).sin())
}

/// Direction around +Z with density cosθ/π.
#[must_use]
pub fn sample_cosine_hemisphere(u: Vec2) -> Vec3 {
    sample_disc(u).extend((1.0 - u.x).max(0.0).sqrt())
}

/// Position of sample `index` of `count` inside a pixel: one in each of `count` columns and of `count` rows,
/// centred on the pixel; (½, ½) for a single sample.
#[must_use]
pub fn pixel_offset(index: u32, count: u32) -> Vec2 {
    let inverse = |i| halton(0, i, 0);
    let row = (0..count).filter(|&other| inverse(other) < inverse(index)).count();
    (Vec2::new(index as f32, row as f32) + 0.5) / count as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halton_starts_as_published() {
        let expect = |dimension, values: &[f32]| {
            for (i, &value) in values.iter().enumerate() {
                assert!(
                    (halton(dimension, i as u32, 0) - value).abs() < 1e-6,
                    "dimension {dimension}, element {i}"
                );
            }
        };
        expect(0, &[0.0, 0.5, 0.25, 0.75, 0.125, 0.625, 0.375, 0.875]);
        expect(1, &[0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0 / 9.0, 4.0 / 9.0, 7.0 / 9.0, 2.0 / 9.0]);
        expect(2, &[0.0, 0.2, 0.4, 0.6, 0.8, 0.04, 0.24]);
    }

    #[test]
    fn scrambling_keeps_every_stratum() {
        for dimension in 0..HALTON_DIMENSIONS {
            let base = PRIMES[dimension as usize];
            for seed in [0, 1, 77] {
                let mut seen = vec![false; base as usize];
                for index in 0..base {
                    let [numerator, denominator] = halton_digits(dimension, index, seed);
                    seen[(numerator / (denominator / base)) as usize] = true;
                }
                assert!(seen.iter().all(|&s| s), "base {base}, seed {seed}");
            }
        }
    }

    #[test]
    fn pixel_offsets_centre_on_the_pixel() {
        assert_eq!(pixel_offset(0, 1), Vec2::splat(0.5));
        for count in [2, 3, 5, 16, 100] {
            let mean = (0..count).map(|i| pixel_offset(i, count)).sum::<Vec2>() / count as f32;
            assert!((mean - 0.5).abs().max_element() < 1e-6, "{count}: {mean}");
        }
    }

    /// Any 2^m elements that begin at a multiple of 2^m have one in each box of 2^-a × 2^-(m-a): a (0, m, 2)-net.
    #[test]
    fn sobol_points_are_nets() {
        for (seed, m) in [0, 1, 77, 0xdead_beef].into_iter().flat_map(|seed| (0..=10).map(move |m| (seed, m)))
        {
            let start = (seed % 5) << m;
            for a in 0..=m {
                let mut seen = vec![false; 1 << m];
                for index in start..start + (1 << m) {
                    let [x, y] = sobol_bits(index, seed).map(u64::from);
                    let column = (x << a) >> 32;
                    let row = (y << (m - a)) >> 32;
                    seen[((column << (m - a)) | row) as usize] = true;
                }
                assert!(seen.iter().all(|&s| s), "seed {seed}, 2^{m} points, 2^{a} columns");
            }
        }
    }

    /// Sums over few points of independent seeds vary as those of a jittered grid do, and have the mean of x·y.
    #[test]
    fn seeds_are_independent() {
        let seeds = 4096;
        let means = [1, 2, 16].map(|count| {
            let of = |seed| {
                (0..count).map(|i| sobol(i, hash(seed))).map(|p| p.x * p.y).sum::<f32>() / count as f32
            };
            let values: Vec<f64> = (0..seeds).map(|seed| f64::from(of(seed))).collect();
            let mean = values.iter().sum::<f64>() / f64::from(seeds);
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(seeds);
            assert!((mean - 0.25).abs() < 4.5 * (variance / f64::from(seeds)).sqrt(), "{count}: {mean}");
            variance
        });
        assert!((means[0] / (7.0 / 144.0) - 1.0).abs() < 0.1, "one point is uniform: {means:?}");
        assert!(means[2] < means[0] / 64.0, "sixteen are stratified: {means:?}");
    }

    #[test]
    fn bases_are_orthonormal() {
        for i in 0..1000 {
            let n = sample_sphere(Vec2::new(halton(0, i, 3), halton(1, i, 3)));
            let basis = basis_around(n);
            let error = basis.transpose() * basis - Mat3::IDENTITY;
            assert!(error.to_cols_array().iter().all(|e| e.abs() < 1e-5), "{n}");
            assert!(basis.determinant() > 0.99);
        }
    }
}
