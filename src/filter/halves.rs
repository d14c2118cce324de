//! Groups of three dimensions as each half of the samples sees them: means, and how uncertain
//! these are.

use rayon::prelude::*;

use crate::image::Planes;
use crate::stats::{Part, Store};

use super::blur;
use super::gaps::Gaps;
use super::outliers::{self, Clamped, OutlierSettings};

/// Weight of the neighbourhood's variance against a pixel's own, in samples.
const POOL_SAMPLES: f32 = 2.0;
/// Blur, in pixels, of what the halves say of the variance of the mean (after Rousselle, Knaus and
/// Zwicker 2012, section 5.1).
const AGREEMENT_SIGMA: f32 = 3.0;
/// The halves may correct s²/n within these factors.
const AGREEMENT_RANGE: (f32, f32) = (0.02, 2.0);

/// Three dimensions of a store, by halves.
#[derive(Clone, Debug)]
pub(super) struct Halves {
    /// Mean of each half: 3 planes.
    pub mean: [Planes; 2],
    /// Variance of that mean: 3 planes.
    pub variance: [Planes; 2],
}

/// An estimate of one half of the samples that is linear in its values.
pub(super) struct Estimate {
    /// 3 planes.
    pub value: Planes,
    /// ∂F/∂c: what a pixel's own value weighs in its result, in (0, 1].
    pub own_weight: Vec<f32>,
}

impl Estimate {
    /// The values themselves.
    pub fn unfiltered(width: usize, height: usize, values: [&[f32]; 3]) -> Self {
        let mut value = Planes::new(width, height, 3);
        value.planes_mut().zip(values).for_each(|(plane, values)| plane.copy_from_slice(values));
        Self { value, own_weight: vec![1.0; width * height] }
    }
}

/// What a function makes of each half, both at once.
pub(super) fn of_halves<T: Send>(make: impl Fn(usize) -> T + Sync) -> [T; 2] {
    let (a, b) = rayon::join(|| make(0), || make(1));
    [a, b]
}

/// Sample counts of the halves.
#[derive(Clone, Debug)]
pub(super) struct Counts {
    whole: [Vec<u32>; 2],
    /// As floats.
    of: [Vec<f32>; 2],
    /// Where both are 0.
    gaps: Gaps,
}

impl Counts {
    pub fn of(store: &Store) -> Self {
        Self::new(store.width(), [0, 1].map(|h| store.counts(Part::Half(h))))
    }

    fn new(width: usize, whole: [Vec<u32>; 2]) -> Self {
        let of = whole.each_ref().map(|counts| counts.iter().map(|&n| n as f32).collect());
        let gaps = Gaps::of(width, whole[0].iter().zip(&whole[1]).map(|(a, b)| a.saturating_add(*b)));
        Self { whole, of, gaps }
    }

    /// Whether some pixel has two samples, so that a variance of 0 means something.
    fn are_several(&self) -> bool {
        self.of[0].iter().zip(&self.of[1]).any(|(a, b)| a + b >= 2.0)
    }

    /// As whole numbers.
    pub fn whole(&self) -> [&[u32]; 2] {
        [&self.whole[0], &self.whole[1]]
    }

    /// Mean of the halves' values, weighted by their counts.
    pub fn mean(&self, halves: [&Planes; 2]) -> Planes {
        let mut mean = halves[0].clone();
        for (plane, b) in mean.planes_mut().zip(halves[1].data().chunks(halves[1].pixels().max(1))) {
            for (((a, &b), &n_a), &n_b) in plane.iter_mut().zip(b).zip(&self.of[0]).zip(&self.of[1]) {
                let share = if n_a + n_b > 0.0 { n_b / (n_a + n_b) } else { 0.5 };
                *a += share * (b - *a);
            }
        }
        mean
    }
}

impl Halves {
    /// Reads dimensions of a store. A half without samples in a pixel takes the other half's mean,
    /// and a pixel without any the mean of its nearest neighbours that have some.
    pub fn of(store: &Store, dims: std::ops::Range<usize>, counts: &Counts) -> Self {
        let (mean, sample_variance) = store.halves(dims);
        Self::new(mean, sample_variance, counts)
    }

    /// The same without outliers, and these, beside the whole's mean that is left.
    pub fn without_outliers(
        store: &Store,
        dims: std::ops::Range<usize>,
        counts: &Counts,
        settings: &OutlierSettings,
    ) -> (Self, Clamped) {
        let (mean, mut sample_variance) = store.halves(dims);
        let [a, b] = &mean;
        let clamped = outliers::clamp(&counts.mean([&mean[0], &mean[1]]), [a, b], counts.whole(), settings);
        for outlier in &clamped.outliers {
            let factor = outlier.scale * outlier.scale;
            sample_variance.planes_mut().for_each(|plane| plane[outlier.pixel] *= factor);
        }
        (Self::new(clamped.halves.clone(), sample_variance, counts), clamped)
    }

    fn new(mut mean: [Planes; 2], mut sample_variance: Planes, counts: &Counts) -> Self {
        fill_missing(&mut mean, counts);
        if sample_variance.data().iter().all(|&v| v == 0.0) && counts.are_several() {
            // Noise-free, as the normals of a still scene without a lens are inside surfaces.
            return Self { mean, variance: [sample_variance.clone(), sample_variance] };
        }
        pool(&mut sample_variance, &mean[0], counts);
        let mut variance = [sample_variance.clone(), sample_variance];
        // Points of low discrepancy make means less uncertain than s²/n; the halves are independent
        // and tell by how much.
        for (variance, count) in variance.iter_mut().zip(&counts.of) {
            variance.planes_mut().par_bridge().for_each(|plane| {
                plane.iter_mut().zip(count).for_each(|(v, n)| *v /= n.max(0.5));
            });
        }
        let agreement = agreement(&mean, &variance, counts);
        for variance in &mut variance {
            variance.planes_mut().par_bridge().for_each(|plane| {
                plane.iter_mut().zip(&agreement).for_each(|(v, &factor)| *v *= factor);
            });
        }
        Self { mean, variance }
    }

    /// Divides by a colour per pixel and half.
    pub fn divide(&mut self, divisor: [&Planes; 2]) {
        for ((mean, variance), divisor) in self.mean.iter_mut().zip(&mut self.variance).zip(divisor) {
            let values = mean.data_mut().iter_mut().zip(variance.data_mut()).zip(divisor.data());
            for ((mean, variance), &d) in values {
                *mean /= d;
                *variance /= d * d;
            }
        }
    }
}

/// Variance of the mean by the halves' difference over that by s²/n, both blurred.
fn agreement(mean: &[Planes; 2], variance: &[Planes; 2], counts: &Counts) -> Vec<f32> {
    let (width, height) = (mean[0].width(), mean[0].height());
    let sum = |value: &(dyn Fn(usize, usize) -> f32 + Sync)| -> Vec<f32> {
        let both = |i: usize| counts.of[0][i] > 0.0 && counts.of[1][i] > 0.0;
        let of_pixel = |i| if both(i) { value(0, i) + value(1, i) + value(2, i) } else { 0.0 };
        let plane: Vec<f32> = (0..width * height).into_par_iter().map(of_pixel).collect();
        blur::gaussian(width, height, &plane, AGREEMENT_SIGMA)
    };
    let seen = sum(&|c, i| (mean[0].plane(c)[i] - mean[1].plane(c)[i]).powi(2));
    let expected = sum(&|c, i| variance[0].plane(c)[i] + variance[1].plane(c)[i]);
    let (low, high) = AGREEMENT_RANGE;
    let factor = |(&s, &e): (&f32, &f32)| if e > 0.0 { (s / e).clamp(low, high) } else { 1.0 };
    seen.iter().zip(&expected).map(factor).collect()
}

/// Draws each pixel's sample variance towards the mean over its 3×3 neighbourhood, the more the
/// fewer samples it has: σ̃² = (ν₀σ_pool² + (n−1)s²)/(ν₀ + n − 1). Where no pixel around has two
/// samples, half the squared difference of horizontal neighbours, which is a variance of means, stands
/// in, n times.
fn pool(variance: &mut Planes, mean: &Planes, counts: &Counts) {
    let (width, height) = (variance.width(), variance.height());
    let count: Vec<f32> = counts.of[0].iter().zip(&counts.of[1]).map(|(a, b)| a + b).collect();
    let known: Vec<f32> = count.iter().map(|&n| if n >= 2.0 { 1.0 } else { 0.0 }).collect();
    let weight = sum_3x3(width, height, &known);
    variance.planes_mut().enumerate().for_each(|(channel, plane)| {
        let sum = sum_3x3(width, height, plane);
        let of_neighbours = |i: usize| {
            let row = mean.row(channel, i / width);
            let x = i % width;
            0.5 * (row[x] - row[if x > 0 { x - 1 } else { 1.min(width - 1) }]).powi(2) * count[i]
        };
        plane.par_iter_mut().enumerate().with_min_len(width).for_each(|(i, v)| {
            let pooled = if weight[i] > 0.0 { sum[i] / weight[i] } else { of_neighbours(i) };
            let freedom = (count[i] - 1.0).max(0.0);
            *v = (POOL_SAMPLES * pooled + freedom * *v) / (POOL_SAMPLES + freedom);
        });
    });
}

/// Sums over 3×3 pixels, of which fewer are there at the border.
fn sum_3x3(width: usize, height: usize, plane: &[f32]) -> Vec<f32> {
    let mut sums = vec![0.0; plane.len()];
    if width == 0 {
        return sums;
    }
    sums.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let mut column = vec![0.0; width];
        for row in plane.chunks_exact(width).take((y + 2).min(height)).skip(y.saturating_sub(1)) {
            column.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
        }
        out.copy_from_slice(&column);
        out[1..].iter_mut().zip(&column).for_each(|(out, v)| *out += v);
        out.iter_mut().zip(&column[1..]).for_each(|(out, v)| *out += v);
    });
    sums
}

/// A half without samples in a pixel takes the other half's mean, and a pixel without any those of others.
fn fill_missing(mean: &mut [Planes; 2], counts: &Counts) {
    let [a, b] = mean;
    let pixels = a.pixels().max(1);
    for (a, b) in a.data_mut().chunks_mut(pixels).zip(b.data_mut().chunks_mut(pixels)) {
        for (((a, b), &n_a), &n_b) in a.iter_mut().zip(b).zip(&counts.of[0]).zip(&counts.of[1]) {
            match (n_a > 0.0, n_b > 0.0) {
                (true, false) => *b = *a,
                (false, true) => *a = *b,
                _ => {}
            }
        }
    }
    mean.iter_mut().for_each(|half| counts.gaps.fill(half));
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::super::synthetic::{store, wall};
    use super::*;
    use crate::stats::Layout;

    const WIDTH: usize = 9;
    const HEIGHT: usize = 6;
    const PIXELS: usize = WIDTH * HEIGHT;

    fn counts(of: [Vec<u32>; 2]) -> Counts {
        Counts::new(WIDTH, of)
    }

    fn planes(value: impl FnMut(usize) -> f32) -> Planes {
        let mut planes = Planes::new(WIDTH, HEIGHT, 3);
        let values: Vec<f32> = (0..3 * PIXELS).map(value).collect();
        planes.data_mut().copy_from_slice(&values);
        planes
    }

    fn random(seed: u64) -> Planes {
        let mut rng = Pcg32::seed_from_u64(seed);
        planes(|_| rng.random())
    }

    /// Pixels of the 3×3 around one.
    fn around(i: usize) -> impl Iterator<Item = usize> {
        let near = |a: usize, b: usize| a.abs_diff(b) <= 1;
        (0..PIXELS).filter(move |j| near(i % WIDTH, j % WIDTH) && near(i / WIDTH, j / WIDTH))
    }

    #[test]
    fn the_mean_of_halves_is_weighted_by_counts_and_even_where_there_are_none() {
        let counts = counts([vec![3; PIXELS], vec![1; PIXELS]]);
        assert_eq!(counts.mean([&planes(|_| 1.0), &planes(|_| 5.0)]).at(2, 4, 4), 2.0);
        let none = self::counts([vec![0; PIXELS], vec![0; PIXELS]]);
        assert_eq!(none.mean([&planes(|_| 1.0), &planes(|_| 5.0)]).at(1, 4, 4), 3.0);
        assert!(!none.are_several() && counts.are_several());
        assert!(!self::counts([vec![1; PIXELS], vec![0; PIXELS]]).are_several());
        assert!(self::counts([vec![1; PIXELS], vec![1; PIXELS]]).are_several());
    }

    #[test]
    fn a_half_without_samples_takes_the_others_and_holes_fill_ring_by_ring_from_their_rim() {
        let mut of = [vec![2; PIXELS], vec![2; PIXELS]];
        (of[0][3], of[1][5]) = (0, 0);
        // A hole of 3×3 whose middle has no neighbour with samples.
        let hole: Vec<usize> = around(3 * WIDTH + 4).collect();
        hole.iter().for_each(|&i| of.iter_mut().for_each(|counts| counts[i] = 0));
        let (a, b) = (random(1), random(2));
        let mut mean = [a.clone(), b.clone()];
        fill_missing(&mut mean, &counts(of));
        for c in 0..3 {
            assert_eq!((mean[0].plane(c)[3], mean[1].plane(c)[3]), (b.plane(c)[3], b.plane(c)[3]));
            assert_eq!((mean[0].plane(c)[5], mean[1].plane(c)[5]), (a.plane(c)[5], a.plane(c)[5]));
            for (mean, half) in mean.iter().zip([&a, &b]) {
                let (mean, half) = (mean.plane(c), half.plane(c));
                let middle = 3 * WIDTH + 4;
                for &i in hole.iter().filter(|&&i| i != middle) {
                    let from: Vec<f32> = around(i).filter(|j| !hole.contains(j)).map(|j| mean[j]).collect();
                    let expected = from.iter().sum::<f32>() / from.len() as f32;
                    assert!((mean[i] - expected).abs() < 1e-6, "{i}");
                }
                let rim = hole.iter().filter(|&&i| i != middle).map(|&i| mean[i]).sum::<f32>() / 8.0;
                assert!((mean[middle] - rim).abs() < 1e-6);
                assert_eq!(mean[..3], half[..3]);
            }
        }
    }

    #[test]
    fn variances_are_pooled_with_those_around_or_taken_from_neighbours_means() {
        let count = |i: usize| [0, 1, 2, 5][(i * 7 + i / 5) % 4];
        // The two left columns have no pixel with two samples in reach.
        let of: Vec<u32> = (0..PIXELS).map(|i| if i % WIDTH < 3 { 1 } else { count(i) }).collect();
        let (mean, own) = (random(3), random(4));
        let known = |c: usize, i: usize| if of[i] >= 2 { own.plane(c)[i] } else { 0.0 };
        let sampled = planes(|k| known(k / PIXELS, k % PIXELS));
        let mut pooled = sampled.clone();
        pool(&mut pooled, &mean, &counts([of.clone(), vec![0; PIXELS]]));
        for (c, i) in (0..3).flat_map(|c| (0..PIXELS).map(move |i| (c, i))) {
            let from: Vec<usize> = around(i).filter(|&j| of[j] >= 2).collect();
            let beside = if i % WIDTH > 0 { i - 1 } else { i + 1 };
            let pool = if from.is_empty() {
                (mean.plane(c)[i] - mean.plane(c)[beside]).powi(2) / 2.0 * of[i] as f32
            } else {
                from.iter().map(|&j| own.plane(c)[j]).sum::<f32>() / from.len() as f32
            };
            let freedom = of[i].saturating_sub(1) as f32;
            let expected = (2.0 * pool + freedom * known(c, i)) / (2.0 + freedom);
            let found = pooled.plane(c)[i];
            assert!((found - expected).abs() < 1e-5, "{c} {i}: {found} for {expected}");
        }
    }

    #[test]
    fn the_halves_correct_the_variance_of_the_mean_within_limits() {
        let (a, b) = (random(5), random(6));
        let mut of = [vec![2; PIXELS], vec![2; PIXELS]];
        of[1][20] = 0;
        let counts = counts(of);
        for scale in [0.1, 1e-3, 1e3] {
            let variance =
                [planes(|k| scale * (1.0 + (k % 7) as f32)), planes(|k| scale * (2.0 + (k % 3) as f32))];
            let sum = |of: &dyn Fn(usize, usize) -> f32| {
                let of_pixel = |i: usize| if i == 20 { 0.0 } else { (0..3).map(|c| of(c, i)).sum() };
                let plane: Vec<f32> = (0..PIXELS).map(of_pixel).collect();
                blur::gaussian(WIDTH, HEIGHT, &plane, AGREEMENT_SIGMA)
            };
            let seen = sum(&|c, i| (a.plane(c)[i] - b.plane(c)[i]).powi(2));
            let expected = sum(&|c, i| variance[0].plane(c)[i] + variance[1].plane(c)[i]);
            let found = agreement(&[a.clone(), b.clone()], &variance, &counts);
            for (i, found) in found.into_iter().enumerate() {
                let ratio = (seen[i] / expected[i]).clamp(0.02, 2.0);
                assert!((found - ratio).abs() < 1e-4 * ratio, "{i}: {found} for {ratio}");
            }
        }
        let none = planes(|_| 0.0);
        assert!(agreement(&[a, b], &[none.clone(), none], &counts).iter().all(|&factor| factor == 1.0));
    }

    #[test]
    fn the_variance_is_that_of_each_halfs_mean_and_outliers_have_what_is_left_of_theirs() {
        let layout = Layout::with_blocks(|_| false);
        let made = |spike: f32| {
            store(
                WIDTH,
                HEIGHT,
                layout.clone(),
                |_, _| 9,
                |x, y, index, rng| {
                    let light = rng.random::<f32>() + if (x, y, index) == (4, 3, 2) { spike } else { 0.0 };
                    wall(&layout, x, y, [light; 3], rng)
                },
            )
        };
        let (plain, spiked) = (made(0.0), made(1e4));
        let settings = OutlierSettings::default();
        let of = |store: &Store| {
            let counts = Counts::of(store);
            (Halves::of(store, layout.colour(), &counts), counts)
        };
        let (halves, counts) = of(&plain);
        let (mean, mut variance) = plain.halves(layout.colour());
        pool(&mut variance, &mean[0], &counts);
        let n = [5.0, 4.0];
        let of_mean = n.map(|n| planes(|k| variance.data()[k] / n));
        let agreement = agreement(&mean, &of_mean, &counts);
        for (found, of_mean) in halves.variance.iter().zip(&of_mean) {
            for (k, (&found, &of_mean)) in found.data().iter().zip(of_mean.data()).enumerate() {
                let expected = of_mean * agreement[k % PIXELS];
                assert!((found / expected - 1.0).abs() < 1e-5, "{k}: {found} for {expected}");
            }
        }

        let (clean, clamped) =
            Halves::without_outliers(&spiked, layout.colour(), &Counts::of(&spiked), &settings);
        assert_eq!(clamped.outliers.len(), 1);
        let at = 3 * WIDTH + 4;
        // What is left is of the order of the others' noise; all of it would be 10⁷ times that.
        let [left, usual] = [&clean, &halves].map(|halves| halves.variance[0].plane(0)[at]);
        assert!(left < 1000.0 * usual && left > 0.1 * usual, "{left} for {usual}");
        assert_eq!(clean.mean[0], clamped.halves[0]);
    }

    #[test]
    fn what_never_varies_has_no_variance_and_single_samples_have_that_of_their_neighbours() {
        let layout = Layout::with_blocks(|_| false);
        for (n, noisy) in [(1, true), (2, false)] {
            let store = store(
                WIDTH,
                HEIGHT,
                layout.clone(),
                |_, _| n,
                |x, y, _, rng| wall(&layout, x, y, [x as f32; 3], rng),
            );
            let halves = Halves::of(&store, layout.colour(), &Counts::of(&store));
            assert!(halves.variance.iter().all(|half| half.data().iter().all(|&v| (v > 0.0) == noisy)));
        }
    }

    #[test]
    fn dividing_divides_variances_by_the_square() {
        let mut halves =
            Halves { mean: [random(1), random(2)], variance: [planes(|_| 0.9), planes(|_| 0.9)] };
        let first = halves.mean[1].at(2, 3, 3);
        halves.divide([&planes(|_| 1.0), &planes(|_| 3.0)]);
        assert_eq!(halves.variance[0].at(0, 1, 1), 0.9);
        assert!((halves.variance[1].at(2, 3, 3) - 0.1).abs() < 1e-6);
        assert!((halves.mean[1].at(2, 3, 3) - first / 3.0).abs() < 1e-6);
    }

    #[test]
    fn a_single_column_of_single_samples_has_no_neighbour_to_differ_from() {
        let layout = Layout::with_blocks(|_| false);
        let store =
            store(1, 5, layout.clone(), |_, _| 1, |x, y, _, rng| wall(&layout, x, y, [y as f32; 3], rng));
        let halves = Halves::of(&store, layout.colour(), &Counts::of(&store));
        assert!(halves.variance.iter().all(|half| half.data().iter().all(|&v| v == 0.0)));
    }
}
