//! Adaptive sampling: more samples where the picture is noisy, fewer where it is not.
//!
//! Sampling goes in rounds: 16 samples a pixel everywhere, then as many as all rounds before together. When a round
//! begins, each tile of 8×8 pixels (a workgroup: its threads stay together) is given a rate, ¼ … 8 times the mean in
//! steps of ¼, in proportion to the root of its relative variance for each sample. That is estimated by the squared
//! difference of the two half pictures, with the floor of [`crate::renderer::noise`], and spread over the eight tiles
//! around, so that a tile that was lucky is not starved. Rates come to at most 1 on average.
//!
//! Bias: a mean of a number of samples that depends on their values is biased: what is dark by chance is left alone.
//! Here each round's mean has the weight of the round, whatever its rate, and a pixel's rate comes of the tile's *other*
//! pixels, those of the other colour of a chessboard; its own samples act on it two rounds later only, by how well others
//! are known. Where one sample in three thousand finds a light, a mean by counts and own rates is 19 % too dark, this one
//! right within its noise of 3 %. Where the number of samples is no multiple of 4, a round may weigh up to 4 samples more.
//! Samples taken at a low rate weigh more: up to 4 times brighter specks.
//!
//! Measured in rays to equal noise, by default settings at 128×96 and 256 samples a pixel: 1.16 times fewer in the Cornell
//! box (1.29 by samples: what is noisy there takes longer paths), 1.05 in the Office, where noise is even. A sequence of
//! its own for each round would bar the bias altogether, and lose more than that: four times the samples of one sequence
//! leave 5.5 times less variance in the Cornell box, 4.5 in the Office.

use crate::shaders::path_trace::trace;

/// Samples a pixel of the first round.
const FIRST: u32 = 16;

/// Width and height of the tiles that share a rate (pixels).
const TILE: u32 = trace::CODE.workgroup[0];

/// Most samples a pixel takes where the mean is one.
pub(crate) const MAX_RATE: u32 = 8;

/// Rates are so many parts of 1: a round takes whole samples, as many for either half.
const STEPS: f64 = 4.0;

/// A stretch of samples with the same rates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Round {
    /// Mean number of samples a pixel where it begins.
    pub(crate) start: u32,
    /// And where the next one does.
    pub(crate) end: u32,
}

impl Round {
    /// The round in which a picture of so many samples a pixel goes on.
    pub(crate) fn of(samples: u32) -> Self {
        match samples / FIRST {
            0 => Self { start: 0, end: FIRST },
            n => Self { start: FIRST << n.ilog2(), end: FIRST << (n.ilog2() + 1) },
        }
    }
}

/// Squared difference of two halves of a picture's samples over the square of the mean of all of them, number by number;
/// times `share` it is relative variance. What is dark counts as a tenth of the picture's average.
pub(crate) fn relative_variance<'a>(
    mean: &'a [f32],
    a: &'a [f32],
    b: &'a [f32],
    share: f64,
) -> impl Iterator<Item = f64> + 'a {
    let average = mean.iter().map(|&m| f64::from(m)).sum::<f64>() / mean.len().max(1) as f64;
    mean.iter().zip(a.iter().zip(b)).map(move |(&m, (&a, &b))| {
        let variance = share * (f64::from(a) - f64::from(b)).powi(2);
        if variance == 0.0 { 0.0 } else { variance / (f64::from(m).powi(2) + 0.01 * average * average) }
    })
}

/// What pixels of a tile and a colour of the chessboard take.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Tile {
    /// Samples in this round, for each of the mean pixel's.
    rate: f32,
    /// Variance before this round, in units of what as many samples at a rate of 1 leave.
    variance: f32,
    /// Samples of a pixel before this round.
    taken: f32,
}

/// The rates of a round.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rates {
    extent: [u32; 2],
    /// Tile by tile, row by row, of either colour.
    tiles: Vec<Tile>,
}

impl Rates {
    /// Those of the first round.
    pub(crate) fn new(extent: [u32; 2]) -> Self {
        let [columns, rows] = extent.map(|n| n.div_ceil(TILE));
        let tile = Tile { rate: 1.0, variance: 1.0, taken: 0.0 };
        Self { extent, tiles: vec![tile; (2 * columns * rows) as usize] }
    }

    /// From three numbers a pixel, those of its [`Self::texels`]; `None` where no render wrote them.
    pub(crate) fn read(extent: [u32; 2], pixels: &[f32]) -> Option<Self> {
        let mut rates = Self::new(extent);
        for (pixel, values) in pixels.chunks_exact(3).enumerate() {
            let [rate, variance, taken] = [values[0], values[1], values[2]];
            let steps = f64::from(rate) * STEPS;
            let possible = steps.fract() == 0.0 && (1.0..=STEPS * f64::from(MAX_RATE)).contains(&steps);
            let counts = taken >= 0.0 && taken % 2.0 == 0.0;
            if !(possible && variance.is_finite() && variance > 0.0 && counts) {
                return None;
            }
            let tile = rates.tile(pixel);
            rates.tiles[tile] = Tile { rate, variance, taken };
        }
        Some(rates)
    }

    fn tile(&self, pixel: usize) -> usize {
        let [width, tile] = [self.extent[0] as usize, TILE as usize];
        let (x, y) = (pixel % width, pixel / width);
        2 * (y / tile * width.div_ceil(tile) + x / tile) + (x + y) % 2
    }

    /// A texel a pixel: rate, variance, samples taken before the round and a zero.
    pub(crate) fn texels(&self) -> Vec<[f32; 4]> {
        let pixels = self.extent[0] as usize * self.extent[1] as usize;
        let tiles = (0..pixels).map(|pixel| self.tiles[self.tile(pixel)]);
        tiles.map(|tile| [tile.rate, tile.variance, tile.taken, 0.0]).collect()
    }

    /// What the samples of a pixel weigh, of all and of either half, once there are `samples` on average. Twin of
    /// `glsl/path_trace/trace.comp`.
    pub(crate) fn weights(&self, pixel: usize, samples: u32) -> [f32; 3] {
        let round = Round::of(samples);
        let Tile { rate, .. } = self.tiles[self.tile(pixel)];
        let taken = ((samples - round.start) as f32 * rate).ceil() as u32;
        let weight = |before: f32, taken: u32| before + taken as f32 / rate;
        let start = round.start as f32;
        [weight(start, taken), weight(0.5 * start, taken.div_ceil(2)), weight(0.5 * start, taken / 2)]
    }

    /// Those of the round that begins at `samples`, by the mean of all samples so far and of either half, RGB.
    pub(crate) fn next(&self, mean: &[f32], a: &[f32], b: &[f32], samples: u32) -> Self {
        let [columns, rows] = self.extent.map(|n| n.div_ceil(TILE) as usize);
        let last = Round::of(samples - 1);
        let tiles: Vec<Tile> = self
            .tiles
            .iter()
            .map(|tile| Tile {
                // The mean of all rounds before, as long together as the last, and of that.
                variance: 0.5 * (tile.variance + 1.0 / tile.rate),
                taken: tile.taken + (last.end - last.start) as f32 * tile.rate,
                ..*tile
            })
            .collect();
        let mut sums = vec![(0.0, 0u32); tiles.len()];
        for (value, term) in relative_variance(mean, a, b, 0.25).enumerate() {
            let tile = self.tile(value / 3);
            let (sum, count) = &mut sums[tile];
            (*sum, *count) = (*sum + term / f64::from(tiles[tile].variance), *count + 1);
        }
        // By the other colour, in the tiles around.
        let wanted = |index: usize| {
            let (tile, other) = (index / 2, 1 - index % 2);
            let (x, y) = (tile % columns, tile / columns);
            let (mut total, mut weights) = (0.0, 0.0);
            for row in y.saturating_sub(1)..(y + 2).min(rows) {
                for column in x.saturating_sub(1)..(x + 2).min(columns) {
                    let (sum, count) = sums[2 * (row * columns + column) + other];
                    let weight = f64::from((2u32 >> x.abs_diff(column)) * (2 >> y.abs_diff(row)));
                    total += weight * sum;
                    weights += weight * f64::from(count);
                }
            }
            if weights > 0.0 { (total / weights).sqrt() } else { 0.0 }
        };
        let wanted: Vec<f64> = (0..tiles.len()).map(wanted).collect();
        let rate = |index: usize, scale: f64| {
            ((STEPS * scale * wanted[index]).round() / STEPS).clamp(1.0 / STEPS, f64::from(MAX_RATE))
        };
        let average = |scale: f64| {
            let rates =
                sums.iter().enumerate().map(|(index, &(_, count))| f64::from(count) * rate(index, scale));
            rates.sum::<f64>() / mean.len() as f64
        };
        let largest = wanted.iter().copied().fold(0.0, f64::max);
        if largest == 0.0 {
            // Nothing to go by yet.
            return Self { tiles: tiles.iter().map(|tile| Tile { rate: 1.0, ..*tile }).collect(), ..*self };
        }
        // All rates are the least at one end, and more than 1 somewhere at the other.
        let (mut low, mut high) = (0.0, f64::from(MAX_RATE) / largest);
        while average(high) <= 1.0 && high < 1e3 * f64::from(MAX_RATE) / largest {
            high *= 2.0;
        }
        for _ in 0..48 {
            let middle = 0.5 * (low + high);
            *(if average(middle) <= 1.0 { &mut low } else { &mut high }) = middle;
        }
        let tiles = tiles.iter().enumerate();
        Self { tiles: tiles.map(|(i, tile)| Tile { rate: rate(i, low) as f32, ..*tile }).collect(), ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_double() {
        let mut at = 0;
        for end in [16, 32, 64, 128] {
            for samples in at..end {
                assert_eq!(Round::of(samples), Round { start: at, end });
            }
            at = end;
        }
        assert_eq!(Round::of((1 << 24) - 1).end, 1 << 24);
    }

    /// A picture 48×24 whose halves differ by `noise(x, y)`.
    fn halves(noise: impl Fn(u32, u32) -> f32) -> [Vec<f32>; 3] {
        let pixel = |sign: f32| {
            let noise = &noise;
            (0..24).flat_map(move |y| (0..48).flat_map(move |x| [1.0 + sign * noise(x, y); 3])).collect()
        };
        [pixel(0.0), pixel(0.5), pixel(-0.5)]
    }

    fn rate_at(rates: &Rates, x: u32, y: u32) -> f32 {
        rates.tiles[rates.tile((48 * y + x) as usize)].rate
    }

    #[test]
    fn rates_follow_the_noise_and_come_to_one() {
        let noise = |x: u32| if x < 16 { 0.8 } else { 0.1 };
        let [mean, a, b] = halves(|x, _| noise(x));
        let first = Rates::new([48, 24]);
        let rates = first.next(&mean, &a, &b, 16);
        let texels = rates.texels();
        let average = texels.iter().map(|t| t[0]).sum::<f32>() / texels.len() as f32;
        assert!((0.8..=1.0).contains(&average), "{average}");
        assert!(rate_at(&rates, 4, 12) > 2.0 * rate_at(&rates, 40, 12));
        assert!(rate_at(&rates, 20, 12) > rate_at(&rates, 40, 12), "neighbours of noise have a share");
        assert!(texels.iter().all(|t| (0.25..=8.0).contains(&t[0]) && t[1..] == [1.0, 16.0, 0.0]));
        // Fewer samples are no more noise, once that they were fewer is accounted for.
        let variance = |rate: f32| 0.5 * (1.0 + 1.0 / rate);
        let [mean, a, b] = halves(|x, y| noise(x) * variance(rate_at(&rates, x, y)).sqrt());
        let again = rates.next(&mean, &a, &b, 32);
        for (before, after) in rates.tiles.iter().zip(&again.tiles) {
            assert_eq!(before.rate, after.rate);
            assert_eq!((after.variance, after.taken), (variance(before.rate), 16.0 + 16.0 * before.rate));
        }
        let [mean, a, b] = halves(|_, _| 0.0);
        assert!(first.next(&mean, &a, &b, 16).tiles.iter().all(|tile| tile.rate == 1.0));
    }

    /// What a pixel shows decides nothing about itself.
    #[test]
    fn a_pixel_does_not_choose_its_own_rate() {
        let [mean, a, b] = halves(|_, _| 0.1);
        let [mean_of_one, a_of_one, b_of_one] = halves(|x, y| if (x, y) == (20, 12) { 9.0 } else { 0.1 });
        let plain = Rates::new([48, 24]).next(&mean, &a, &b, 16);
        let speck = Rates::new([48, 24]).next(&mean_of_one, &a_of_one, &b_of_one, 16);
        // Less is left for it; its neighbours have more.
        assert!(rate_at(&speck, 20, 12) <= rate_at(&plain, 20, 12));
        assert!(rate_at(&speck, 21, 12) > rate_at(&plain, 21, 12));
    }

    /// Whatever the rates, a round's samples weigh as much as the round once it is over.
    #[test]
    fn rounds_weigh_what_they_take_on_average() {
        let [mean, a, b] = halves(|x, y| 0.01 * (x * y) as f32);
        let rates = Rates::new([48, 24]).next(&mean, &a, &b, 16);
        let mut seen: Vec<f32> = rates.tiles.iter().map(|tile| tile.rate).collect();
        seen.sort_by(f32::total_cmp);
        seen.dedup();
        assert!(seen.len() > 3, "{seen:?}");
        for pixel in 0..48 * 24 {
            for samples in (16..32).step_by(4) {
                assert_eq!(rates.weights(pixel, samples)[0], samples as f32);
            }
            let [all, a, b] = rates.weights(pixel, 31);
            assert!((31.0..35.0).contains(&all) && (a + b - all).abs() < 1e-5);
        }
    }

    #[test]
    fn rates_are_read_back() {
        let [mean, a, b] = halves(|x, y| 0.01 * (x * y) as f32);
        let rates = Rates::new([48, 24]).next(&mean, &a, &b, 16);
        let mut pixels: Vec<f32> = rates.texels().iter().flat_map(|t| [t[0], t[1], t[2]]).collect();
        assert_eq!(Rates::read([48, 24], &pixels), Some(rates));
        pixels[3] = 0.3;
        assert_eq!(Rates::read([48, 24], &pixels), None);
    }
}
