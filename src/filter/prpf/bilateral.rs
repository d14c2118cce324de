//! Filters the image once with the joint bilateral weights of one pass (paper, Eq. 4).
//!
//! For pixel i, with inverse bandwidths g and its cluster P_i, the filtered value is Σ_j ω_ij x_j ∕ Σ_j ω_ij
//! over the similar pixels j of the window, with ω_ij = exp(−|Δp|² ∕ 2σ_p² − Σ_k g_ik Δ_k²). Differences
//! Δ of normalised values equal differences of values over the neighbourhood's standard deviation, so
//! normalisation is part of g and no normalised plane is stored.

use multiversion::target::match_target;
use rayon::prelude::*;

use super::feature_guide::{FeatureGuide, meets_alike};
use super::inverse_bandwidths::inverse_bandwidths;
use super::neighbourhood::Neighbourhood;
use super::settings::{Bandwidth, PrpfSettings};
use crate::filter::cancellable_pool::stop_if_cancelled;
use crate::filter::common::fast_exp::exp_negative_precise;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::filter::common::lanes::{lanes, multiply_add};
use crate::simd::{LANES, Lanes, apply, multiversioned};

/// Filtered channels: the image, and the difference of its halves.
pub const CHANNELS: usize = 6;

/// Rows of the window that are processed together, so that the pixel's own values are loaded once for all of
/// them. Rows rather than columns, whose overlapping loads the compiler would turn into shuffles.
const ROWS: usize = 4;

/// Rows of the image in one task.
const TASK_ROWS: usize = 8;

/// Width of the tiles of a task, in blocks of [`LANES`] pixels. The planes of a tile's windows stay in the cache.
const TILE_BLOCKS: usize = 8;

/// Exponent above which a weight is 0: those of a whole window are below the precision of `f32` relative to the pixel's
/// own weight.
const MAX_EXPONENT: f32 = 25.0;

/// Features after which the distances of a block are looked at for the first time: most dissimilar pixels lie elsewhere
/// in the world, and its position comes first.
const FIRST_FEATURES: usize = 3;

/// Maximum number of features and colours.
const MAX_DIMENSIONS: usize = 18;

/// Filters all channels of `values` with the same weights. `weights` are α, β and W_c^r of the pass, as
/// [`WeightInputs::evaluate`](super::weight_inputs::WeightInputs::evaluate) writes them.
pub fn filter(
    values: &InterleavedPlanes,
    guide: &FeatureGuide,
    neighbourhood: &Neighbourhood,
    weights: &InterleavedPlanes,
    window: usize,
    settings: &PrpfSettings,
) -> InterleavedPlanes {
    let bandwidths = inverse_bandwidths(guide, neighbourhood, weights, settings.bandwidth);
    let row_step = if window >= settings.alternate_rows_from { 2 } else { 1 };
    let spatial = SpatialGaussian::new(window, row_step, settings.bandwidth);
    let mut filtered = values.clone();
    let rows = values.row_len() * TASK_ROWS;
    if rows > 0 {
        filtered.data_mut().par_chunks_mut(rows).enumerate().for_each(|(task, out)| {
            stop_if_cancelled();
            filter_rows(values, guide, &bandwidths, &spatial, task * TASK_ROWS, out);
        });
    }
    filtered
}

/// The Gaussian of the film distance, as exponents by offset along one axis.
struct SpatialGaussian {
    radius: usize,
    /// Distance of the rows that contribute, of which the pixel's own is one.
    row_step: usize,
    /// For offsets from −radius to radius.
    exponents: Vec<f32>,
}

impl SpatialGaussian {
    fn new(window: usize, row_step: usize, bandwidth: Bandwidth) -> Self {
        let half = window / 2;
        let (deviation, radius) = match bandwidth {
            Bandwidth::RpfSigma { .. } => (window as f32 / 4.0, half),
            // Neighbours beyond √12 standard deviations (exponent 6) have weights below 1/400.
            Bandwidth::Literal | Bandwidth::MeanVariance { .. } => {
                let deviation = window as f32 / 12.0;
                (deviation, half.min((12f32.sqrt() * deviation) as usize))
            }
        };
        let exponent = |i: usize| {
            let d = i as f32 - radius as f32;
            d * d / (2.0 * deviation * deviation)
        };
        Self { radius, row_step, exponents: (0..=2 * radius).map(exponent).collect() }
    }
}

/// Filters the rows of `out`, from row `first` on.
#[apply(multiversioned!)]
fn filter_rows(
    values: &InterleavedPlanes,
    guide: &FeatureGuide,
    bandwidths: &InterleavedPlanes,
    spatial: &SpatialGaussian,
    first: usize,
    out: &mut [f32],
) {
    match_target! {
        "x86_64+fma" => filter_tiles::<true>(values, guide, bandwidths, spatial, first, out),
        "aarch64" => filter_tiles::<true>(values, guide, bandwidths, spatial, first, out),
        _ => filter_tiles::<false>(values, guide, bandwidths, spatial, first, out),
    }
}

#[inline(always)]
fn filter_tiles<const FMA: bool>(
    values: &InterleavedPlanes,
    guide: &FeatureGuide,
    bandwidths: &InterleavedPlanes,
    spatial: &SpatialGaussian,
    first: usize,
    out: &mut [f32],
) {
    let tile = TILE_BLOCKS * LANES;
    for start in (0..values.width()).step_by(tile) {
        for (row, out) in out.chunks_mut(values.row_len()).enumerate() {
            for x in (start..values.width().min(start + tile)).step_by(LANES) {
                let block = filter_block::<FMA>(values, guide, bandwidths, spatial, x, first + row);
                let inside = LANES.min(values.width() - x);
                for (channel, block) in block.iter().enumerate() {
                    let at = channel * values.stride() + values.margin() + x;
                    out[at..at + inside].copy_from_slice(&block[..inside]);
                }
            }
        }
    }
}

/// Values of a block of pixels that enter all its pairs.
struct Centre {
    hit: Lanes,
    takes_emission: Lanes,
    values: [Lanes; CHANNELS],
}

/// Sums over a block's neighbours.
struct Sums {
    weights: Lanes,
    /// Sums of weighted differences from the centre, so that a constant image is reproduced exactly.
    values: [Lanes; CHANNELS],
}

/// Filters [`LANES`] pixels of one row.
#[inline(always)]
fn filter_block<const FMA: bool>(
    values: &InterleavedPlanes,
    guide: &FeatureGuide,
    bandwidths: &InterleavedPlanes,
    spatial: &SpatialGaussian,
    x: usize,
    y: usize,
) -> [Lanes; CHANNELS] {
    // Load the pixels' own values
    let centre = Centre {
        hit: *guide.own_hit.lanes(0, y, x),
        takes_emission: *guide.takes_emission.lanes(0, y, x),
        values: std::array::from_fn(|c| *values.lanes(c, y, x)),
    };
    let mut sums = Sums { weights: [0.0; LANES], values: [[0.0; LANES]; CHANNELS] };

    // Interleave mean, inverse bandwidth and threshold of each dimension
    let mut dims = [[[f32::INFINITY; LANES]; 3]; MAX_DIMENSIONS];
    for (k, own) in dims[..guide.means.count()].iter_mut().enumerate() {
        (own[0], own[1]) = (*guide.means.lanes(k, y, x), *bandwidths.lanes(k, y, x));
        if k < guide.features() {
            own[2] = *guide.thresholds.lanes(k, y, x);
        }
    }
    let (features, colours) = dims[..guide.means.count()].split_at(guide.features());
    let (first_features, other_features) = features.split_at(features.len().min(FIRST_FEATURES));

    // Sum over the window
    let SpatialGaussian { radius, row_step, .. } = *spatial;
    let first = y - radius.min(y) / row_step * row_step;
    let last = (y + radius).min(values.height() - 1);
    for top in (first..=last).step_by(ROWS * row_step) {
        // Rows past the end of the window repeat its last row with an infinite exponent.
        let row = |r: usize| top + r * row_step;
        let rows: [usize; ROWS] = std::array::from_fn(|r| row(r).min(last));
        let vertical: [f32; ROWS] = std::array::from_fn(|r| {
            if row(r) <= last { spatial.exponents[row(r) + radius - y] } else { f32::INFINITY }
        });
        'columns: for (column, horizontal) in spatial.exponents.iter().enumerate() {
            let at = values.margin() + x + column - radius;
            // The compiler would keep an array of exponents in memory, four variables stay in registers.
            let [mut e0, mut e1, mut e2, mut e3] = vertical.map(|vertical| [vertical + horizontal; LANES]);
            let [r0, r1, r2, r3] = rows.map(|row| guide.means.row_planes(row, at));
            let mut others = r0.zip(r1).zip(r2).zip(r3);
            for features in [first_features, other_features] {
                for ([own, bandwidth, threshold], (((r0, r1), r2), r3)) in features.iter().zip(&mut others) {
                    add_distance::<FMA, true>(&mut e0, own, lanes(r0), bandwidth, threshold);
                    add_distance::<FMA, true>(&mut e1, own, lanes(r1), bandwidth, threshold);
                    add_distance::<FMA, true>(&mut e2, own, lanes(r2), bandwidth, threshold);
                    add_distance::<FMA, true>(&mut e3, own, lanes(r3), bandwidth, threshold);
                }
                if are_negligible([&e0, &e1, &e2, &e3]) {
                    continue 'columns;
                }
            }
            for ([own, bandwidth, threshold], (((r0, r1), r2), r3)) in colours.iter().zip(&mut others) {
                add_distance::<FMA, false>(&mut e0, own, lanes(r0), bandwidth, threshold);
                add_distance::<FMA, false>(&mut e1, own, lanes(r1), bandwidth, threshold);
                add_distance::<FMA, false>(&mut e2, own, lanes(r2), bandwidth, threshold);
                add_distance::<FMA, false>(&mut e3, own, lanes(r3), bandwidth, threshold);
            }
            if are_negligible([&e0, &e1, &e2, &e3]) {
                continue;
            }
            for (e, row) in [e0, e1, e2, e3].iter().zip(rows) {
                add_neighbours::<FMA>(&mut sums, &centre, e, guide, values, row, at);
            }
        }
    }

    // Divide by the sum of weights
    for (values, centre) in sums.values.iter_mut().zip(&centre.values) {
        for l in 0..LANES {
            let shift = if sums.weights[l] > 0.0 { values[l] / sums.weights[l] } else { 0.0 };
            values[l] = centre[l] + shift;
        }
    }
    sums.values
}

/// Adds the term of one dimension to the exponents. With `TEST` an exponent becomes infinite where the difference
/// exceeds the similarity threshold.
#[inline(always)]
fn add_distance<const FMA: bool, const TEST: bool>(
    exponents: &mut Lanes,
    own: &Lanes,
    others: &Lanes,
    bandwidth: &Lanes,
    threshold: &Lanes,
) {
    for l in 0..LANES {
        let d = own[l] - others[l];
        let d2 = d * d;
        let sum = multiply_add::<FMA>(bandwidth[l], d2, exponents[l]);
        exponents[l] = if TEST && d2 > threshold[l] { f32::INFINITY } else { sum };
    }
}

/// Returns whether all weights of these exponents are 0.
#[inline(always)]
fn are_negligible(exponents: [&Lanes; ROWS]) -> bool {
    let [a, b, c, d] = exponents;
    (0..LANES).fold(true, |all, l| all & (a[l].min(b[l]).min(c[l].min(d[l])) > MAX_EXPONENT))
}

/// Adds one neighbour of each pixel of a block to the sums.
#[inline(always)]
fn add_neighbours<const FMA: bool>(
    sums: &mut Sums,
    centre: &Centre,
    exponents: &Lanes,
    guide: &FeatureGuide,
    values: &InterleavedPlanes,
    y: usize,
    at: usize,
) {
    let [hits, met_emitter] =
        [&guide.hit, &guide.met_emitter].map(|plane| lanes(&plane.row_with_margins(0, y)[at..]));
    let mut weights = [0.0; LANES];
    for l in 0..LANES {
        let weight = exp_negative_precise::<FMA>(exponents[l]);
        let is_similar = meets_alike([centre.hit[l], centre.takes_emission[l]], [hits[l], met_emitter[l]]);
        weights[l] = if is_similar & (exponents[l] <= MAX_EXPONENT) { weight } else { 0.0 };
        sums.weights[l] += weights[l];
    }
    // Each block is loaded before any sum is stored: the compiler must assume that the two overlap.
    let mut others = values.row_planes(y, at);
    for c in 0..CHANNELS {
        let (others, old) = (*lanes(others.next().expect("all channels are there")), sums.values[c]);
        sums.values[c] =
            std::array::from_fn(|l| multiply_add::<FMA>(weights[l], others[l] - centre.values[c][l], old[l]));
    }
}

#[cfg(test)]
mod tests;
