//! Fits a weighted local linear model around every pixel: nonlinearly weighted first-order regression
//! (Bitterli et al. 2016) in one pass.
//!
//! Weights and regressors of one half of the samples come from the other half, so that the fit is linear in
//! the half's own values. For pixel i the values of its neighbours j are fitted by β·x, x = (f_j − f_i,
//! offset, 1), with the weights of [`patch_distance`](super::patch_distance). The constant comes last: after
//! M = LLᵀ and Lz = b the fit at i is z_K/L_KK, and the derivative by the pixel's own value 1/L_KK². The code
//! does not divide L's columns by their roots (LDLᵀ), so that these are b_K/D_K and 1/D_K after elimination.

use rayon::prelude::*;

use super::patch_distance::{ColourGuide, DistanceSettings, Neighbours, PatchDistance, Tile};
use crate::filter::cancellable_pool::stop_if_cancelled;
use crate::filter::common::linear_estimate::LinearEstimate;
use crate::filter::common::padded_planes::{Margin, PaddedPlanes};
use crate::simd::{LANES, apply, multiversioned};

/// Number of features among the regressors.
pub const FEATURES: usize = 6;
/// Number of regressors: features, two coordinates, one constant.
const K: usize = FEATURES + 3;
/// Half side of the 3×3 patch of the distance.
const PATCH: usize = 1;
/// Size of tiles in pixels. The sums of a tile fit the second-level cache, those of a row the first.
const TILE: (usize, usize) = (64, 32);
const WIDTH: usize = TILE.0;
/// Offsets that are accumulated together: each sum is read and written once for all of them.
const OFFSETS: usize = 4;
/// Addition to the diagonal of the normal equations, relative to the diagonal …
const RIDGE: f32 = 1e-3;
/// … and relative to the sum of weights. Features are of order 1.
const RIDGE_FLOOR: f32 = 1e-7;

/// Number of sums: for each r = 0 … K−1, row r of the upper triangle of M and the three right-hand sides of r.
const SUMS: usize = K * (K + 1) / 2 + 3 * K;
/// Index of the first sum of each row.
const STARTS: [usize; K] = starts();

const fn starts() -> [usize; K] {
    let mut starts = [0; K];
    let mut r = 1;
    while r < K {
        starts[r] = starts[r - 1] + K - (r - 1) + 3;
        r += 1;
    }
    starts
}

/// Values of a row of a tile. They are aligned, as access across cache lines takes twice the time.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Line([f32; WIDTH]);

const EMPTY: Line = Line([0.0; WIDTH]);

/// Sums for a row of a tile.
type Row = [Line; SUMS];

/// Fits `original` with weights from `guide` and the given features as regressors. Results are not negative.
/// All planes have `width`×`height` finite values.
pub fn fit(
    width: usize,
    height: usize,
    original: [&[f32]; 3],
    guide: ColourGuide,
    features: [&[f32]; FEATURES],
    settings: DistanceSettings,
) -> LinearEstimate {
    let mut fitted = LinearEstimate::unfiltered(width, height, original);
    if width == 0 || height == 0 {
        return fitted;
    }

    // Solve the tiles with noise
    let distance = PatchDistance::<PATCH>::new(width, height, guide, settings);
    let columns: Vec<&[f32]> = features.into_iter().chain(original).collect();
    let columns = PaddedPlanes::new(width, height, &columns, settings.radius, Margin::Nearest);
    let tiles = distance.noisy_tiles(TILE);
    let solve = |&tile: &Tile| {
        stop_if_cancelled();
        fit_tile(tile, &distance, &columns, settings.radius)
    };
    let solved: Vec<_> = tiles.par_iter().map(solve).collect();

    // Add the differences to the values
    for (tile, rows) in tiles.iter().zip(&solved) {
        for (y, [r, g, b, derivative]) in rows.iter().enumerate() {
            let start = (tile.y + y) * width + tile.x;
            for (plane, changes) in fitted.value.planes_mut().zip([r, g, b]) {
                let values = plane[start..][..tile.width].iter_mut().zip(changes);
                values.for_each(|(value, change)| *value = (*value + change).max(0.0));
            }
            fitted.derivative[start..][..tile.width].copy_from_slice(&derivative[..tile.width]);
        }
    }
    fitted.restore(original, &distance.changed_pixels());
    fitted
}

/// Returns, for each row of the tile, the difference of the fit from the pixel's own value in three channels,
/// and the derivative. `columns` are the features and the values.
fn fit_tile(
    tile: Tile,
    distance: &PatchDistance<PATCH>,
    columns: &PaddedPlanes,
    radius: usize,
) -> Vec<[[f32; WIDTH]; 4]> {
    let (x, y) = (tile.x as isize, tile.y as isize);
    let scale = 1.0 / radius.max(1) as f32;
    let mut sums = vec![[EMPTY; SUMS]; tile.height];
    // The pixel itself has weight 1 and adds to the constant only
    sums.iter_mut().for_each(|row| row[STARTS[K - 1]].0.fill(1.0));

    // Accumulate several offsets of a row together
    let mut pending = vec![Pending::NONE; tile.height];
    let mut differences = [[EMPTY; OFFSETS]; FEATURES + 3];
    let mut accumulate_pending = |row: usize, pending: &mut Pending| {
        let y = y + row as isize;
        for (c, differences) in differences.iter_mut().enumerate() {
            let i = columns.span(c, x, y, tile.width);
            for ((dx, dy), difference) in pending.offsets.iter().zip(differences) {
                subtract(columns.span(c, x + dx, y + dy, tile.width), i, difference);
            }
        }
        let offsets = pending.offsets.map(|(dx, dy)| [dx as f32 * scale, dy as f32 * scale]);
        accumulate(&pending.weights, &offsets, &differences, &mut sums[row]);
        pending.count = 0;
    };
    distance.for_each_neighbour(tile, |Neighbours { row, offset, weights }| {
        let pending = &mut pending[row];
        pending.offsets[pending.count] = offset;
        pending.weights[pending.count].0[..tile.width].copy_from_slice(weights);
        pending.count += 1;
        if pending.count == OFFSETS {
            accumulate_pending(row, pending);
        }
    });
    debug_assert!(pending.iter().all(|pending| pending.count == 0), "a disc has 4n neighbours");
    sums.iter().map(solve).collect()
}

#[apply(multiversioned!)]
fn subtract(a: &[f32], b: &[f32], difference: &mut Line) {
    difference.0.iter_mut().zip(a.iter().zip(b)).for_each(|(d, (a, b))| *d = a - b);
}

/// Neighbours of a row of pixels, collected until there are [`OFFSETS`]. A disc has a multiple of four.
#[derive(Clone)]
struct Pending {
    count: usize,
    offsets: [(isize, isize); OFFSETS],
    weights: [Line; OFFSETS],
}

impl Pending {
    const NONE: Self = Self { count: 0, offsets: [(0, 0); OFFSETS], weights: [EMPTY; OFFSETS] };
}

/// Adds the neighbours of a row at some offsets to the normal equations. `differences` are those of features
/// and values from the pixel's own.
#[apply(multiversioned!)]
fn accumulate(
    weights: &[Line; OFFSETS],
    offsets: &[[f32; 2]; OFFSETS],
    differences: &[[Line; OFFSETS]; FEATURES + 3],
    sums: &mut Row,
) {
    let (features, values) = differences.split_at(FEATURES);
    let constants = [offsets.map(|[dx, _]| dx), offsets.map(|[_, dy]| dy), [1.0; OFFSETS]];
    let mut weighted = [EMPTY; OFFSETS];
    for (r, feature) in features.iter().enumerate() {
        for k in 0..OFFSETS {
            for x in 0..WIDTH {
                weighted[k].0[x] = weights[k].0[x] * feature[k].0[x];
            }
        }
        let (feature_sums, rest) = sums[STARTS[r]..].split_at_mut(FEATURES - r);
        let (constant_sums, rest) = rest.split_at_mut(3);
        features[r..].iter().zip(feature_sums).for_each(|(f, sum)| add_products(&weighted, f, sum));
        constants.iter().zip(constant_sums).for_each(|(c, sum)| add_scaled(&weighted, c, sum));
        values.iter().zip(rest).for_each(|(v, sum)| add_products(&weighted, v, sum));
    }
    for (r, factors) in constants.iter().enumerate() {
        for k in 0..OFFSETS {
            for x in 0..WIDTH {
                weighted[k].0[x] = weights[k].0[x] * factors[k];
            }
        }
        let (constant_sums, rest) = sums[STARTS[FEATURES + r]..].split_at_mut(3 - r);
        constants[r..].iter().zip(constant_sums).for_each(|(c, sum)| add_scaled(&weighted, c, sum));
        values.iter().zip(rest).for_each(|(v, sum)| add_products(&weighted, v, sum));
    }
}

#[inline(always)]
fn add_products(a: &[Line; OFFSETS], b: &[Line; OFFSETS], sum: &mut Line) {
    let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (a, b);
    for x in 0..WIDTH {
        let s = sum.0[x] + a0.0[x] * b0.0[x] + a1.0[x] * b1.0[x];
        sum.0[x] = s + a2.0[x] * b2.0[x] + a3.0[x] * b3.0[x];
    }
}

#[inline(always)]
fn add_scaled(a: &[Line; OFFSETS], factors: &[f32; OFFSETS], sum: &mut Line) {
    let ([a0, a1, a2, a3], [f0, f1, f2, f3]) = (a, factors);
    for x in 0..WIDTH {
        sum.0[x] = sum.0[x] + a0.0[x] * f0 + a1.0[x] * f1 + a2.0[x] * f2 + a3.0[x] * f3;
    }
}

/// Solves the normal equations of a row of pixels. Returns the difference of the fit from the pixel's own
/// value in three channels, and the derivative.
fn solve(sums: &Row) -> [[f32; WIDTH]; 4] {
    let mut solved = [[0.0; WIDTH]; 4];
    for start in (0..WIDTH).step_by(LANES) {
        let block = std::array::from_fn(|s| std::array::from_fn(|l| sums[s].0[start + l]));
        for (out, block_solution) in solved.iter_mut().zip(solve_block(block)) {
            out[start..][..LANES].copy_from_slice(&block_solution);
        }
    }
    solved
}

/// Solves the equations of a block of pixels by Cholesky decomposition, row by row in place. Columns r … K−1
/// of the matrix and the three right-hand sides are the columns of one elimination.
#[apply(multiversioned!)]
fn solve_block(sums: [[f32; LANES]; SUMS]) -> [[f32; LANES]; 4] {
    let mut m = sums;
    let total = m[STARTS[K - 1]];
    let mut result = [[0.0; LANES]; 4];
    for r in 0..K {
        let mut inverse = [0.0; LANES];
        for l in 0..LANES {
            let pivot = m[STARTS[r]][l];
            // The constant has no ridge; its pivot is at least the pixel's own weight of 1.
            inverse[l] = 1.0
                / if r + 1 == K {
                    pivot.max(1.0)
                } else {
                    (pivot + RIDGE * sums[STARTS[r]][l]).max(0.0) + RIDGE_FLOOR * total[l]
                };
        }
        for s in r + 1..K {
            let mut factor = [0.0; LANES];
            for l in 0..LANES {
                factor[l] = inverse[l] * m[STARTS[r] + s - r][l];
            }
            for c in s..K + 3 {
                for l in 0..LANES {
                    m[STARTS[s] + c - s][l] -= factor[l] * m[STARTS[r] + c - r][l];
                }
            }
        }
        if r + 1 == K {
            for c in 0..3 {
                for l in 0..LANES {
                    result[c][l] = inverse[l] * m[STARTS[r] + 1 + c][l];
                }
            }
            result[3] = inverse;
        }
    }
    result
}

#[cfg(test)]
mod tests;
