//! The joint bilateral filter of one pass (paper, Eq. 4), pixel by pixel.
//!
//! Differences of normalised values are differences of values over the neighbourhood's deviation,
//! so that normalisation is a factor in each dimension's gain and nothing normalised is stored.

use multiversion::multiversion;
use multiversion::target::match_target;
use rayon::prelude::*;

use super::neighbourhood::{Guide, Neighbourhood};
use super::padded::{LANES, OFFSETS, Padded};
use super::prpf::Gain;

/// Channels that are averaged: the image, and the difference of its halves.
pub(super) const CHANNELS: usize = 6;

/// Rows that one task filters.
const TASK_ROWS: usize = 8;

/// Blocks of pixels whose windows are filtered row after row while their planes stay in the cache.
const TASK_BLOCKS: usize = 8;

/// Exponents above it give a weight of 0: e⁻⁴⁰ beside the pixel's own weight is below `f32`'s
/// precision, and smaller weights would bring slow denormal numbers.
const EXPONENT_CUT: f32 = 40.0;

/// Most that a neighbour's sample count may count above or below the pixel's own.
const COUNT_RATIO: f32 = 4.0;

/// Below this share of |mean| (or of 1) a deviation is rounding noise, and the dimension constant.
pub(super) const CONSTANT: f32 = 1e-6;

/// Filters all channels once with the same weights. `weights` are planes as
/// [`Evidence::evaluate`](super::weights::Evidence::evaluate) writes them.
pub(super) fn filter(
    values: &Padded,
    guide: &Guide,
    neighbourhood: &Neighbourhood,
    weights: &Padded,
    window: usize,
    gain: Gain,
) -> Padded {
    let gains = gains(guide, neighbourhood, weights, gain);
    let spatial = Spatial::new(window, gain);
    let mut filtered = values.clone();
    let rows = values.row_len() * TASK_ROWS;
    if rows > 0 {
        filtered.data_mut().par_chunks_mut(rows).enumerate().for_each(|(task, out)| {
            filter_rows(values, guide, &gains, &spatial, task * TASK_ROWS, out);
        });
    }
    filtered
}

/// Factors of the squared differences in the exponent: features, then colours.
fn gains(guide: &Guide, hood: &Neighbourhood, weights: &Padded, gain: Gain) -> Padded {
    let features = guide.features();
    let dims = features + 3;
    let mut gains = Padded::new(guide.width(), guide.height(), dims, 0, 0.0);
    let (stride, row_len) = (gains.stride(), gains.row_len());
    gains.data_mut().par_chunks_mut(row_len.max(1)).enumerate().for_each(|(y, row)| {
        let counts = guide.counts.row(0, y);
        let colour_randomness = weights.row(dims, y);
        for (k, out) in row.chunks_mut(stride).enumerate() {
            let weight = weights.row(k, y);
            let variances = hood.variances.row(k, y);
            let means = hood.means.row(k, y);
            let own = guide.variances.row(k, y);
            for x in 0..counts.len() {
                if variances[x] <= (CONSTANT * means[x].abs().max(1.0)).powi(2) {
                    continue;
                }
                let factor = match gain {
                    Gain::RpfSigma { sigma8_squared } => {
                        (1.0 - colour_randomness[x]).powi(2) / (16.0 * sigma8_squared * variances[x])
                    }
                    Gain::OwnVariance { kappa, rho } => 1.0 / (2.0 * kappa * (own[x] + rho * variances[x])),
                };
                out[x] = weight[x] * counts[x] * factor;
            }
        }
    });
    gains
}

/// The Gaussian of the film distance, as exponents by offset along one axis.
struct Spatial {
    radius: usize,
    /// From -radius on; infinite past +radius.
    exponents: Vec<f32>,
}

impl Spatial {
    fn new(window: usize, gain: Gain) -> Self {
        let half = window / 2;
        let (deviation, radius) = match gain {
            Gain::RpfSigma { .. } => (window as f32 / 4.0, half),
            // Beyond √12 deviations (exponent 6) a neighbour counts less than 1/400.
            Gain::OwnVariance { .. } => {
                let deviation = window as f32 / 12.0;
                (deviation, half.min((12f32.sqrt() * deviation) as usize))
            }
        };
        let side = 2 * radius + 1;
        let exponent = |i: usize| {
            let d = i as f32 - radius as f32;
            if i < side { d * d / (2.0 * deviation * deviation) } else { f32::INFINITY }
        };
        Self { radius, exponents: (0..side.next_multiple_of(OFFSETS)).map(exponent).collect() }
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn filter_rows(
    values: &Padded,
    guide: &Guide,
    gains: &Padded,
    spatial: &Spatial,
    first: usize,
    out: &mut [f32],
) {
    match_target! {
        "x86_64+fma" => filter_tiles::<true>(values, guide, gains, spatial, first, out),
        "aarch64" => filter_tiles::<true>(values, guide, gains, spatial, first, out),
        _ => filter_tiles::<false>(values, guide, gains, spatial, first, out),
    }
}

#[inline(always)]
fn filter_tiles<const FMA: bool>(
    values: &Padded,
    guide: &Guide,
    gains: &Padded,
    spatial: &Spatial,
    first: usize,
    out: &mut [f32],
) {
    let tile = TASK_BLOCKS * LANES;
    for start in (0..values.width()).step_by(tile) {
        for (row, out) in out.chunks_mut(values.row_len()).enumerate() {
            for x in (start..values.width().min(start + tile)).step_by(LANES) {
                let block = filter_block::<FMA>(values, guide, gains, spatial, x, first + row);
                let lanes = LANES.min(values.width() - x);
                for (channel, block) in block.iter().enumerate() {
                    let at = channel * values.stride() + values.margin() + x;
                    out[at..at + lanes].copy_from_slice(&block[..lanes]);
                }
            }
        }
    }
}

/// Filters [`LANES`] pixels of one row.
#[inline(always)]
fn filter_block<const FMA: bool>(
    values: &Padded,
    guide: &Guide,
    gains: &Padded,
    spatial: &Spatial,
    x: usize,
    y: usize,
) -> [[f32; LANES]; CHANNELS] {
    let features = guide.features();
    let radius = spatial.radius;
    let own_hit = guide.own_hit.lanes(0, y, x);
    let own_count = guide.counts.lanes(0, y, x);
    // A pixel without samples takes its neighbours as they are.
    let at_least = own_count.map(|n| n / COUNT_RATIO);
    let at_most = own_count.map(|n| if n > 0.0 { n * COUNT_RATIO } else { f32::INFINITY });
    let centre: [[f32; LANES]; CHANNELS] = std::array::from_fn(|c| *values.lanes(c, y, x));
    let mut sums = [[0.0; LANES]; CHANNELS];
    let mut total = [0.0; LANES];
    for yj in y.saturating_sub(radius)..=(y + radius).min(values.height() - 1) {
        let vertical = spatial.exponents[yj + radius - y];
        for (step, horizontal) in spatial.exponents.chunks_exact(OFFSETS).enumerate() {
            let xj = values.margin() + x + step * OFFSETS - radius;
            let mut exponents = [[0.0; LANES]; OFFSETS];
            for o in 0..OFFSETS {
                exponents[o] = [vertical + horizontal[o]; LANES];
            }
            for k in 0..features {
                let (own, gain) = (guide.means.lanes(k, y, x), gains.lanes(k, y, x));
                let threshold = guide.thresholds.lanes(k, y, x);
                let others = neighbours(&guide.means, k, yj, xj);
                for o in 0..OFFSETS {
                    for l in 0..LANES {
                        let d = own[l] - others[o + l];
                        let d2 = d * d;
                        let e = add_product::<FMA>(gain[l], d2, exponents[o][l]);
                        exponents[o][l] = if d2 > threshold[l] { f32::INFINITY } else { e };
                    }
                }
            }
            for k in features..features + 3 {
                let (own, gain) = (guide.means.lanes(k, y, x), gains.lanes(k, y, x));
                let others = neighbours(&guide.means, k, yj, xj);
                for o in 0..OFFSETS {
                    for l in 0..LANES {
                        let d = own[l] - others[o + l];
                        exponents[o][l] = add_product::<FMA>(gain[l], d * d, exponents[o][l]);
                    }
                }
            }
            let hits = neighbours(&guide.hit, 0, yj, xj);
            let counts = neighbours(&guide.counts, 0, yj, xj);
            for o in 0..OFFSETS {
                let mut weight = [0.0; LANES];
                for l in 0..LANES {
                    let d = own_hit[l] - hits[o + l];
                    let e = exponents[o][l];
                    let count = counts[o + l].max(at_least[l]).min(at_most[l]);
                    let w = count * exp_minus::<FMA>(e);
                    let accepted = (e <= EXPONENT_CUT) & (d.abs() <= Guide::HIT_TOLERANCE);
                    weight[l] = if accepted { w } else { 0.0 };
                    total[l] += weight[l];
                }
                for c in 0..CHANNELS {
                    let others = neighbours(values, c, yj, xj);
                    for l in 0..LANES {
                        // Differences from the pixel itself: what is constant stays so exactly.
                        let d = others[o + l] - centre[c][l];
                        sums[c][l] = add_product::<FMA>(weight[l], d, sums[c][l]);
                    }
                }
            }
        }
    }
    for c in 0..CHANNELS {
        for l in 0..LANES {
            let mean = sums[c][l] / total[l];
            sums[c][l] = centre[c][l] + if total[l] > 0.0 { mean } else { 0.0 };
        }
    }
    sums
}

/// What a block reads of a plane for [`OFFSETS`] neighbouring offsets.
#[inline(always)]
fn neighbours(planes: &Padded, plane: usize, y: usize, x: usize) -> &[f32; LANES + OFFSETS - 1] {
    planes.wide(plane, y)[x..x + LANES + OFFSETS - 1].try_into().expect("the slice has this length")
}

#[inline(always)]
fn add_product<const FMA: bool>(a: f32, b: f32, sum: f32) -> f32 {
    if FMA { a.mul_add(b, sum) } else { a * b + sum }
}

/// e⁻ᵉ for 0 ≤ e ≤ [`EXPONENT_CUT`], relative error below 10⁻⁵ and exact at 0: 2ᶠ by its Taylor
/// polynomial on [-½, ½], the integer part added to the exponent's bits. Without a conversion to
/// integers, which would keep the compiler from using vectors.
#[inline(always)]
fn exp_minus<const FMA: bool>(e: f32) -> f32 {
    // Adding it leaves the nearest integer in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    const LN_2: f32 = std::f32::consts::LN_2;
    const C: [f32; 5] = [
        LN_2,
        LN_2 * LN_2 / 2.0,
        LN_2 * LN_2 * LN_2 / 6.0,
        LN_2 * LN_2 * LN_2 * LN_2 / 24.0,
        LN_2 * LN_2 * LN_2 * LN_2 * LN_2 / 120.0,
    ];
    let x = e * -std::f32::consts::LOG2_E;
    let rounded = x + ROUND;
    let f = x - (rounded - ROUND);
    let p = C.into_iter().rev().fold(0.0, |p, c| add_product::<FMA>(p, f, c));
    let p = add_product::<FMA>(p, f, 1.0);
    f32::from_bits(p.to_bits().wrapping_add(rounded.to_bits() << 23))
}
