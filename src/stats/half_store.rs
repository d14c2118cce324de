//! Makes a store of one half of the samples, divided into halves itself, so that a denoiser can filter that half alone.
//!
//! A store does not know how the samples of a half fall into two quarters. Their means are drawn from the half's moments: of n
//! samples with the unbiased variance s², quarters of a and b samples get means that differ by ±s √(n/(ab)), as they do if n is 2, if a
//! single sample is bright, and on average. Means of low-discrepancy samples differ less. The squared difference is therefore multiplied by
//! the ratio of the squared difference of both halves to that of independent samples, over all pixels.

use rayon::prelude::*;

use super::block::Block;
use super::moments::{Moments, round_deviations};
use super::part::Part;
use super::reservoir;
use super::store::Store;
use crate::simd::{apply, multiversioned};

/// Floor of the squared mean, relative to its mean over the image, in the weights of [`Store::stratification`].
const MEAN_FLOOR: f64 = 0.01;

impl Store {
    /// Returns a store of each half of the pixels' samples, without reservoirs. Of the other half, each depends on one ratio
    /// for each dimension only.
    pub fn split_halves(&self) -> [Self; 2] {
        let dims = 0..self.layout().len();
        let ratios: Vec<f64> = dims.clone().into_par_iter().map(|dim| self.stratification(dim)).collect();
        let emission = self.layout().block(Block::Emission).unwrap_or_default();
        let lights = [self.layout().colour(), self.layout().radiance(), emission];
        let is_light: Vec<bool> = dims.map(|dim| lights.iter().any(|light| light.contains(&dim))).collect();
        [0, 1].map(|half| self.half(half, &ratios, &is_light))
    }

    /// Returns a store of one half. `ratios` and `is_light`: of each dimension, see [`split`].
    fn half(&self, half: usize, ratios: &[f64], is_light: &[bool]) -> Self {
        let mut store = Self::new(self.width(), self.height(), self.layout().clone(), 0, 0);
        store.rows_mut().par_iter_mut().zip(self.rows()).enumerate().for_each(|(y, (row, whole))| {
            let is_first_larger: Vec<bool> =
                (0..self.width()).map(|x| reservoir::key(half as u64, x, y) & 1 == 0).collect();
            for (dim, (&ratio, &is_light)) in ratios.iter().zip(is_light).enumerate() {
                split_row(whole.half(half, dim), &is_first_larger, ratio, is_light, row.halves_mut(dim));
            }
            row.set_counts(|x| {
                let [a, b] = part_counts(whole.count(x, Part::Half(half)));
                if is_first_larger[x] { [a, b] } else { [b, a] }
            });
        });
        store
    }

    /// Returns the mean squared difference of the halves of a dimension relative to that of independent samples, at most 1.
    fn stratification(&self, dim: usize) -> f64 {
        let pixels = || self.rows().iter().flat_map(|row| (0..self.width()).map(move |x| (row, x)));
        let squares: f64 = pixels().map(|(row, x)| row.moments(x, dim, Part::Whole).mean.powi(2)).sum();
        let floor = (MEAN_FLOOR * squares / self.pixels().max(1) as f64).max(f64::MIN_POSITIVE);
        let (mut found, mut expected) = (0.0, 0.0);
        for (row, x) in pixels() {
            let whole = row.moments(x, dim, Part::Whole);
            let [a, b] = [0, 1].map(|half| row.moments(x, dim, Part::Half(half)));
            let [n, k] = [a, b].map(|half| f64::from(half.count));
            if n > 0.0 && k > 0.0 {
                let weight = 1.0 / (whole.mean * whole.mean + floor);
                found += weight * (a.mean - b.mean).powi(2) * n * k / (n + k);
                expected += weight * whole.variance();
            }
        }
        if expected > 0.0 { (found / expected).min(1.0) } else { 1.0 }
    }
}

/// Numbers of samples of two parts.
#[inline(always)]
fn part_counts(count: u32) -> [u32; 2] {
    [count.div_ceil(2), count / 2]
}

/// Splits one dimension of a half of a row, its counts, means and sums of squared deviations, into two parts. `is_first_larger`: for each
/// pixel whether the first part has the larger values; others as for [`split`].
#[apply(multiversioned!)]
fn split_row(
    (count, mean, m2): (&[u32], &[f64], &[f32]),
    is_first_larger: &[bool],
    ratio: f64,
    is_light: bool,
    [(mean_a, m2_a), (mean_b, m2_b)]: [(&mut [f64], &mut [f32]); 2],
) {
    let n = count.len();
    let (mean, m2, is_first_larger) = (&mean[..n], &m2[..n], &is_first_larger[..n]);
    let (mean_a, m2_a, mean_b, m2_b) = (&mut mean_a[..n], &mut m2_a[..n], &mut mean_b[..n], &mut m2_b[..n]);
    for x in 0..n {
        let samples = Moments { count: count[x], mean: mean[x], m2: f64::from(m2[x]) };
        let [larger, other] = split(samples, ratio, is_light);
        let (a, b) = if is_first_larger[x] { (larger, other) } else { (other, larger) };
        (mean_a[x], m2_a[x]) = (a.mean, round_deviations(a.m2, a.mean));
        (mean_b[x], m2_b[x]) = (b.mean, round_deviations(b.m2, b.mean));
    }
}

/// Divides samples into two parts, of which the first has the larger values and is as large or by one sample larger.
/// `ratio`: that of squared differences to those of independent samples. Light is not negative.
#[inline(always)]
fn split(samples: Moments, ratio: f64, is_light: bool) -> [Moments; 2] {
    // Without branches, so that loops over pixels become vector code
    let Moments { count, mean, m2 } = samples;
    let counts = part_counts(count);
    let [a, b] = counts.map(f64::from);
    // A single bright sample is in one of the parts, however even the others lie, and of two samples each is in one
    let variance = samples.variance();
    let light_rarity = (variance / ((a + b) * mean * mean).max(f64::MIN_POSITIVE)).min(1.0);
    let rarity = if is_light { light_rarity } else { 0.0 };
    let rarity = if count == 2 { 1.0 } else { rarity };
    let ratio = ratio + (1.0 - ratio) * rarity;
    let difference = (ratio * variance * (a + b) / (a * b).max(1.0)).sqrt();
    let largest = mean * (a + b) / a.max(1.0);
    let difference = if is_light { difference.min(largest) } else { difference };
    let within = (m2 - difference * difference * a * b / (a + b).max(1.0)).max(0.0);
    let part = |count: u32, change: f64| {
        let fraction = (f64::from(count) - 1.0).max(0.0) / (a + b - 2.0).max(1.0);
        let mean = if count > 0 { mean + change } else { 0.0 };
        Moments { count, mean, m2: within * fraction }
    };
    let n = (a + b).max(1.0);
    [part(counts[0], difference * b / n), part(counts[1], -(difference * a / n))]
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::stats::Layout;

    fn filled(count: impl Fn(usize) -> usize, mut value: impl FnMut(usize, usize) -> f32) -> Store {
        let layout = Layout::with_blocks(|block| block == Block::Radiance);
        let mut store = Store::new(40, 25, layout.clone(), 3, 0);
        for i in 0..store.pixels() {
            for k in 0..count(i) {
                store.push(i % 40, i / 40, &vec![value(i, k); layout.len()]);
            }
        }
        store
    }

    #[test]
    fn a_half_has_the_moments_of_its_samples() {
        let mut rng = Pcg32::seed_from_u64(3);
        let store = filled(|i| i % 12, |_, _| rng.random::<f32>().powi(8));
        for half in [0, 1] {
            let alone = &store.split_halves()[half];
            assert_eq!(alone.counts(Part::Whole), store.counts(Part::Half(half)));
            for i in 0..store.pixels() {
                for dim in 0..store.layout().len() {
                    let found = alone.rows()[i / 40].moments(i % 40, dim, Part::Whole);
                    let expected = store.rows()[i / 40].moments(i % 40, dim, Part::Half(half));
                    assert!((found.mean - expected.mean).abs() < 1e-12);
                    assert!((found.m2 - expected.m2).abs() <= 1e-6 * expected.m2, "{found:?} {expected:?}");
                }
            }
        }
    }

    #[test]
    fn quarters_differ_as_those_of_the_samples() {
        // Independent samples, and samples of which every four are spread evenly
        let mut rng = Pcg32::seed_from_u64(5);
        let independent = filled(|_| 16, |_, _| rng.random());
        let mut rng = Pcg32::seed_from_u64(6);
        let even = filled(|_| 16, |_, k| (k % 8 / 2) as f32 / 4.0 + 0.25 * rng.random::<f32>());
        for (store, ratio) in [(independent, 1.0), (even, 1.0 / 16.0)] {
            let [alone, _] = store.split_halves();
            let dim = store.layout().film().start;
            let [a, b] = [0, 1].map(|half| alone.means(Part::Half(half), [dim]));
            let squares: f32 = a.data().iter().zip(b.data()).map(|(a, b)| (a - b).powi(2)).sum();
            // Means of four uniform numbers of variance 1/12
            let expected = ratio * 2.0 / 12.0 / 4.0;
            let found = squares / store.pixels() as f32;
            assert!((found / expected - 1.0).abs() < 0.15, "{found} {expected}");
            let larger = a.data().iter().zip(b.data()).filter(|(a, b)| a > b).count();
            assert!((400..600).contains(&larger), "either part has the larger values: {larger}");
        }
    }

    #[test]
    fn a_single_bright_sample_is_in_one_quarter() {
        let store = filled(|_| 16, |_, k| if k == 4 { 80.0 } else { 0.0 });
        let [alone, _] = store.split_halves();
        let dim = store.layout().radiance().start;
        for x in 0..40 {
            let means = [0, 1].map(|half| alone.rows()[7].moments(x, dim, Part::Half(half)).mean);
            let [least, largest] = [means[0].min(means[1]), means[0].max(means[1])];
            assert!((0.0..1e-4).contains(&least) && (largest - 20.0).abs() < 1e-4, "{means:?}");
        }
    }
}
