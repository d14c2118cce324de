//! Edge-avoiding à-trous filter whose kernels the network predicts (Işık et al. 2021, Interactive Monte Carlo Denoising
//! using Affinity of Neural Features, section 4).
//!
//! On each level the weight of a neighbour q in the filtered value of p is exp(a_q − |f_p − f_q|²), that of p itself
//! exp(b_p); f, a and b are predicted per pixel and level. The neighbours are the 3×3 pixels at the level's dilation.
//! The weights do not depend on what is filtered, so that the filter is linear. Between a pixel that only shows surfaces and one
//! that shows none the weight is 0.

use multiversion::target::match_target;
use rayon::prelude::*;

use crate::filter::cancellable_pool::stop_if_cancelled;
use crate::filter::common::fast_exp::exp_negative;
use crate::filter::common::interleaved_planes::{InterleavedPlanes, extend};
use crate::filter::common::lanes::{lanes, multiply_add};
use crate::simd::{LANES, Lanes, apply, multiversioned};

/// Dilations of the levels, in pixels. The last ones smooth the grid that the wide ones leave.
pub const DILATIONS: [usize; 8] = [1, 2, 4, 8, 16, 32, 2, 1];

/// Margin of all planes, in which the neighbours of pixels near the border lie.
pub const MARGIN: usize = 32;

/// Features f.
const FEATURES: usize = 6;

/// Predicted planes of a level: the features, a and b.
pub const PLANES_PER_LEVEL: usize = FEATURES + 2;

/// Greatest magnitude of a and b.
const MAX_LOG_WEIGHT: f32 = 20.0;

/// Difference in hit fraction from which two pixels do not mix.
const APART: f32 = 0.99;

/// Added to the exponent of pixels that do not mix.
const FAR: f32 = 100.0;

/// Filters all planes of `values`. `kernels` computes the predicted planes of a level, and `hit` is the fraction of samples that
/// hit a surface, 1 plane. The margins of all three have the values of the nearest pixel.
pub fn filter(
    kernels: impl Fn(usize, &mut InterleavedPlanes),
    hit: &InterleavedPlanes,
    mut values: InterleavedPlanes,
) -> InterleavedPlanes {
    let mut filtered =
        InterleavedPlanes::new(values.width(), values.height(), values.count(), values.margin(), 0.0);
    let row_len = values.row_len();
    let mut predicted =
        InterleavedPlanes::new(values.width(), values.height(), PLANES_PER_LEVEL, MARGIN, 0.0);
    for (level, dilation) in DILATIONS.into_iter().enumerate() {
        kernels(level, &mut predicted);
        let rows = filtered.data_mut().par_chunks_mut(row_len).enumerate();
        rows.for_each_init(
            || RowWeights::new(values.width()),
            |weights, (y, out)| {
                stop_if_cancelled();
                filter_row(&predicted, hit, dilation, &values, y, weights, out);
                out.chunks_exact_mut(values.stride()).for_each(|plane| extend(plane, MARGIN, values.width()));
            },
        );
        std::mem::swap(&mut values, &mut filtered);
    }
    values
}

/// Weights for a row of pixels. They are computed for the whole row before they are used, so that each loop reads few planes: the rows
/// of all at once would compete for the cache.
struct RowWeights {
    neighbours: [Vec<f32>; 8],
    /// One over the sum of the neighbours' weights and the pixel's own.
    factor: Vec<f32>,
}

impl RowWeights {
    fn new(width: usize) -> Self {
        let row = || vec![0.0; width.next_multiple_of(LANES)];
        Self { neighbours: std::array::from_fn(|_| row()), factor: row() }
    }
}

#[apply(multiversioned!)]
fn filter_row(
    predicted: &InterleavedPlanes,
    hit: &InterleavedPlanes,
    dilation: usize,
    values: &InterleavedPlanes,
    y: usize,
    weights: &mut RowWeights,
    out: &mut [f32],
) {
    match_target! {
        "x86_64+fma" => sum_row::<true>(predicted, hit, dilation, values, y, weights, out),
        "aarch64" => sum_row::<true>(predicted, hit, dilation, values, y, weights, out),
        _ => sum_row::<false>(predicted, hit, dilation, values, y, weights, out),
    }
}

#[inline(always)]
fn sum_row<const FMA: bool>(
    predicted: &InterleavedPlanes,
    hit: &InterleavedPlanes,
    dilation: usize,
    values: &InterleavedPlanes,
    y: usize,
    weights: &mut RowWeights,
    out: &mut [f32],
) {
    let neighbours = neighbours(dilation, y, values.height());
    weigh_row::<FMA>(predicted, hit, y, neighbours, weights);
    let RowWeights { neighbours: weights, factor } = weights;
    for (plane, out) in out.chunks_exact_mut(values.stride()).enumerate() {
        let own = &values.row_with_margins(plane, y)[MARGIN..];
        let others = neighbours.map(|(y, at)| &values.row_with_margins(plane, y)[at..]);
        for x in (0..values.width()).step_by(LANES) {
            // Sums of differences, which reproduce constants exactly
            let centre = lanes(&own[x..]);
            let mut sum = [0.0; LANES];
            for (weight, other) in weights.iter().zip(others) {
                sum = add_difference::<FMA>(&sum, lanes(&weight[x..]), lanes(&other[x..]), centre);
            }
            out[MARGIN + x..][..LANES].copy_from_slice(&add_difference::<FMA>(
                centre,
                lanes(&factor[x..]),
                &sum,
                &[0.0; LANES],
            ));
        }
    }
}

/// Computes the weights for row `y`.
#[inline(always)]
fn weigh_row<const FMA: bool>(
    predicted: &InterleavedPlanes,
    hit: &InterleavedPlanes,
    y: usize,
    neighbours: [(usize, usize); 8],
    RowWeights { neighbours: weights, factor }: &mut RowWeights,
) {
    let pixels = (0..predicted.width()).step_by(LANES);
    // Until all weights are there, the sums stand in the place of the factors
    for x in pixels.clone() {
        factor[x..][..LANES]
            .copy_from_slice(&exponential(predicted.lanes(FEATURES + 1, y, x), &[0.0; LANES]));
    }
    let own: [&[f32]; FEATURES] = std::array::from_fn(|f| &predicted.row_with_margins(f, y)[MARGIN..]);
    for (weights, (other_y, at)) in weights.iter_mut().zip(neighbours) {
        let others: [&[f32]; FEATURES] =
            std::array::from_fn(|f| &predicted.row_with_margins(f, other_y)[at..]);
        let (a, other_hit) =
            (&predicted.row_with_margins(FEATURES, other_y)[at..], &hit.row_with_margins(0, other_y)[at..]);
        for x in pixels.clone() {
            let mut squared = apart(hit.lanes(0, y, x), lanes(&other_hit[x..]));
            for (own, other) in own.iter().zip(others) {
                squared = add_square::<FMA>(&squared, lanes(&own[x..]), lanes(&other[x..]));
            }
            let weight = exponential(lanes(&a[x..]), &squared);
            weights[x..][..LANES].copy_from_slice(&weight);
            factor[x..][..LANES].iter_mut().zip(weight).for_each(|(sum, weight)| *sum += weight);
        }
    }
    factor.iter_mut().for_each(|sum| *sum = 1.0 / *sum);
}

/// exp(a − d), where a is bounded.
#[inline(always)]
fn exponential(a: &Lanes, d: &Lanes) -> Lanes {
    std::array::from_fn(|i| exp_negative(d[i] - a[i].clamp(-MAX_LOG_WEIGHT, MAX_LOG_WEIGHT)))
}

/// The exponent of pixels of which one shows a surface and the other does not.
#[inline(always)]
fn apart(a: &Lanes, b: &Lanes) -> Lanes {
    std::array::from_fn(|i| if (a[i] - b[i]).abs() > APART { FAR } else { 0.0 })
}

/// sum + (a − b)².
#[inline(always)]
fn add_square<const FMA: bool>(sum: &Lanes, a: &Lanes, b: &Lanes) -> Lanes {
    std::array::from_fn(|i| multiply_add::<FMA>(a[i] - b[i], a[i] - b[i], sum[i]))
}

/// sum + w(a − b).
#[inline(always)]
fn add_difference<const FMA: bool>(sum: &Lanes, w: &Lanes, a: &Lanes, b: &Lanes) -> Lanes {
    std::array::from_fn(|i| multiply_add::<FMA>(w[i], a[i] - b[i], sum[i]))
}

/// Rows of the eight neighbours of row `y` at a dilation, and the index in the row with its margins of that of the first pixel.
#[inline(always)]
fn neighbours(dilation: usize, y: usize, height: usize) -> [(usize, usize); 8] {
    std::array::from_fn(|i| {
        // The pixel itself is left out.
        let i = i + usize::from(i >= 4);
        let (dx, dy) = (i % 3, i / 3);
        let row = (y + dy * dilation).saturating_sub(dilation).min(height - 1);
        (row, MARGIN + dx * dilation - dilation)
    })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::image::Planes;

    /// Planes with random values, whose margins are extended.
    fn random(width: usize, height: usize, count: usize, rng: &mut Pcg32) -> InterleavedPlanes {
        let mut planes = Planes::new(width, height, count);
        planes.data_mut().fill_with(|| 2.0 * rng.random::<f32>() - 1.0);
        InterleavedPlanes::extended(&planes, MARGIN)
    }

    /// The kernels of all levels.
    fn random_kernels(width: usize, height: usize, rng: &mut Pcg32) -> Vec<InterleavedPlanes> {
        DILATIONS.map(|_| random(width, height, PLANES_PER_LEVEL, rng)).into()
    }

    /// The definition of a level.
    fn plain(
        predicted: &InterleavedPlanes,
        hit: &InterleavedPlanes,
        dilation: usize,
        values: &Planes,
    ) -> Planes {
        let (width, height) = (values.width(), values.height());
        let mut filtered = values.clone();
        let dilation = dilation as isize;
        for (y, x) in (0..width * height).map(|i| (i / width, i % width)) {
            let mut sums = vec![0.0f64; values.count()];
            let mut norm = 0.0;
            for (dy, dx) in (0..9).map(|i| (i / 3 - 1, i % 3 - 1)) {
                let clamp = |v: usize, d: isize, size: usize| {
                    (v as isize + d * dilation).clamp(0, size as isize - 1) as usize
                };
                let (qx, qy) = (clamp(x, dx, width), clamp(y, dy, height));
                let at = |plane, x, y| f64::from(predicted.at(plane, x, y));
                let log = if (dx, dy) == (0, 0) {
                    at(FEATURES + 1, x, y)
                } else {
                    let squared: f64 = (0..FEATURES).map(|f| (at(f, x, y) - at(f, qx, qy)).powi(2)).sum();
                    let apart = (hit.at(0, x, y) - hit.at(0, qx, qy)).abs() > APART;
                    at(FEATURES, qx, qy) - squared - if apart { f64::from(FAR) } else { 0.0 }
                };
                norm += log.exp();
                for (plane, sum) in sums.iter_mut().enumerate() {
                    *sum += log.exp() * f64::from(values.at(plane, qx, qy));
                }
            }
            for (plane, sum) in sums.iter().enumerate() {
                filtered.plane_mut(plane)[y * width + x] = (sum / norm) as f32;
            }
        }
        filtered
    }

    #[test]
    fn the_filter_agrees_with_the_definition() {
        let mut rng = Pcg32::seed_from_u64(6);
        for (width, height) in [(1, 1), (2, 3), (16, 2), (17, 5), (41, 19)] {
            let kernels = random_kernels(width, height, &mut rng);
            let values = random(width, height, 4, &mut rng);
            let mut hit = random(width, height, 1, &mut rng);
            hit.data_mut().iter_mut().for_each(|v| *v = v.signum().max(0.0));
            let levels = kernels.iter().zip(DILATIONS);
            let expected = levels.fold(values.to_planes(), |values, (kernels, dilation)| {
                plain(kernels, &hit, dilation, &values)
            });
            let found = filter(|level, out| out.clone_from(&kernels[level]), &hit, values).to_planes();
            for (found, expected) in found.data().iter().zip(expected.data()) {
                assert!((found - expected).abs() < 2e-4, "{found} {expected}");
            }
        }
    }

    #[test]
    fn constants_are_exact_whatever_is_predicted() {
        let mut rng = Pcg32::seed_from_u64(7);
        let mut kernels = random_kernels(20, 12, &mut rng);
        kernels.iter_mut().flat_map(InterleavedPlanes::data_mut).for_each(|v| *v *= 1e3);
        let mut values = Planes::new(20, 12, 1);
        values.data_mut().fill(0.1);
        let values = InterleavedPlanes::extended(&values, MARGIN);
        let filtered =
            filter(|level, out| out.clone_from(&kernels[level]), &values, values.clone()).to_planes();
        assert!(filtered.data().iter().all(|&v| v == 0.1));
    }
}
