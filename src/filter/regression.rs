//! A second estimate of the image: a weighted linear fit around every pixel.
//!
//! Source: nonlinearly weighted first-order regression (Bitterli et al. 2016), reduced to one pass
//! and guided across the halves of the samples: weights and regressors of one half's fit come from
//! the other half, so that the fit is linear in the half's own values.
//!
//! For pixel i the values of its neighbours j are fitted by β·x, x = (f_j − f_i, offset, 1), with
//! the weights of [`distance`](super::distance). The constant comes last: after M = LLᵀ and Lz = b
//! the fit at i is z_K/L_KK, and the share of the pixel's own value in it 1/L_KK². The code keeps
//! L's columns undivided by their roots (LDLᵀ), in which these are b_K/D_K and 1/D_K after elimination.

use multiversion::multiversion;
use rayon::prelude::*;

use super::bordered::{Bordered, Margin};
use super::distance::{self, Distance, DistanceSettings, Neighbours, Tile};
use super::halves::Estimate;

/// Features that are regressed on.
pub(super) const FEATURES: usize = 6;
/// Regressors: features, two coordinates, one constant.
const K: usize = FEATURES + 3;
/// Half side of the 3×3 patch of the distance.
const PATCH: usize = 1;
/// Tile in pixels: its sums fit the second-level cache, those of a row the first.
const TILE: (usize, usize) = (64, 32);
const WIDTH: usize = TILE.0;
/// Offsets that are worked off together.
const AT_ONCE: usize = 8;
/// Neighbouring pixels that are solved at once.
const LANES: usize = 16;
/// What the diagonal of the normal equations gains, relative to itself …
const RIDGE: f32 = 1e-3;
/// … and relative to the sum of the weights; features are about one.
const RIDGE_FLOOR: f32 = 1e-7;

/// Row r of the upper triangle of M, then the three right-hand sides of r, for r = 0 … K−1.
const SUMS: usize = K * (K + 1) / 2 + 3 * K;
/// Where each row starts in the sums.
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

/// Values of a row of a tile, from the start of a cache line on: what straddles two costs twice.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Line([f32; WIDTH]);

const EMPTY: Line = Line([0.0; WIDTH]);

/// Sums of a row of a tile.
type Row = [Line; SUMS];

/// What decides the fit: the other half.
#[derive(Clone, Copy)]
pub(super) struct Guide<'a> {
    /// Three planes.
    pub value: [&'a [f32]; 3],
    /// Their variances *of the mean*.
    pub variance: [&'a [f32]; 3],
    /// Regressors beside the coordinates.
    pub features: [&'a [f32]; FEATURES],
}

/// Fits `original` with weights and regressors from `guide`; no result is negative. All planes have
/// `width`×`height` finite values.
pub(super) fn fit(
    width: usize,
    height: usize,
    original: [&[f32]; 3],
    guide: Guide,
    settings: DistanceSettings,
) -> Estimate {
    let mut fitted = Estimate::unfiltered(width, height, original);
    if width == 0 || height == 0 {
        return fitted;
    }
    let weights =
        distance::Guide { value: guide.value, variance: guide.variance, features: &[], feature_gain: 0.0 };
    let distance = Distance::<PATCH>::new(width, height, weights, settings);
    let columns: Vec<&[f32]> = guide.features.into_iter().chain(original).collect();
    let columns = Bordered::new(width, height, &columns, settings.radius, Margin::Nearest);
    let tiles = distance.noisy_tiles(TILE);
    let solved: Vec<_> =
        tiles.par_iter().map(|&tile| fit_tile(tile, &distance, &columns, settings.radius)).collect();
    for (tile, rows) in tiles.iter().zip(&solved) {
        for (y, [r, g, b, own_weight]) in rows.iter().enumerate() {
            let start = (tile.y + y) * width + tile.x;
            for (plane, changes) in fitted.value.planes_mut().zip([r, g, b]) {
                let values = plane[start..][..tile.width].iter_mut().zip(changes);
                values.for_each(|(value, change)| *value = (*value + change).max(0.0));
            }
            fitted.own_weight[start..][..tile.width].copy_from_slice(&own_weight[..tile.width]);
        }
    }
    fitted
}

/// For each row of the tile the fit less the pixel's own value, three channels, and the own weight.
/// `columns` are the features of the guide and the values.
fn fit_tile(
    tile: Tile,
    distance: &Distance<PATCH>,
    columns: &Bordered,
    radius: usize,
) -> Vec<[[f32; WIDTH]; 4]> {
    let (x, y) = (tile.x as isize, tile.y as isize);
    let scale = 1.0 / radius.max(1) as f32;
    let mut sums = vec![[EMPTY; SUMS]; tile.height];
    // A pixel's own value has weight one; it differs in nothing from itself.
    sums.iter_mut().for_each(|row| row[STARTS[K - 1]].0.fill(1.0));
    // Some offsets of a row are worked off together, while its sums are in the first-level cache.
    let mut waiting = vec![Vec::new(); tile.height];
    let mut differences = [EMPTY; FEATURES + 3];
    let mut work_off = |row: usize, waiting: &mut Vec<((isize, isize), Line)>| {
        let y = y + row as isize;
        for ((dx, dy), weights) in waiting.drain(..) {
            for (c, difference) in differences.iter_mut().enumerate() {
                let i = columns.span(c, x, y, tile.width);
                let j = columns.span(c, x + dx, y + dy, tile.width);
                subtract(j, i, difference);
            }
            accumulate(&weights, [dx as f32 * scale, dy as f32 * scale], &differences, &mut sums[row]);
        }
    };
    distance.for_each_neighbour(tile, |Neighbours { row, offset, weights }| {
        let mut line = EMPTY;
        line.0[..tile.width].copy_from_slice(weights);
        waiting[row].push((offset, line));
        if waiting[row].len() == AT_ONCE {
            work_off(row, &mut waiting[row]);
        }
    });
    waiting.iter_mut().enumerate().for_each(|(row, waiting)| work_off(row, waiting));
    sums.iter().map(solve).collect()
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn subtract(a: &[f32], b: &[f32], difference: &mut Line) {
    difference.0.iter_mut().zip(a.iter().zip(b)).for_each(|(d, (a, b))| *d = a - b);
}

/// Adds a row's neighbours at one offset to the normal equations. `differences` from the pixels:
/// features, then values.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn accumulate(weights: &Line, offset: [f32; 2], differences: &[Line; FEATURES + 3], sums: &mut Row) {
    let (features, values) = differences.split_at(FEATURES);
    let mut weighted = EMPTY;
    for (r, feature) in features.iter().enumerate() {
        weighted.0.iter_mut().zip(weights.0.iter().zip(&feature.0)).for_each(|(out, (w, f))| *out = w * f);
        let (of_features, rest) = sums[STARTS[r]..].split_at_mut(FEATURES - r);
        let ([of_x, of_y, of_one], rest) = rest.split_first_chunk_mut().expect("three constants");
        features[r..].iter().zip(of_features).for_each(|(f, sum)| add_product(&weighted, f, sum));
        add_scaled(&weighted, offset[0], of_x);
        add_scaled(&weighted, offset[1], of_y);
        add_scaled(&weighted, 1.0, of_one);
        values.iter().zip(rest).for_each(|(v, sum)| add_product(&weighted, v, sum));
    }
    let constants = [offset[0], offset[1], 1.0];
    for (r, factor) in constants.into_iter().enumerate() {
        weighted.0.iter_mut().zip(&weights.0).for_each(|(out, w)| *out = w * factor);
        let (of_constants, rest) = sums[STARTS[FEATURES + r]..].split_at_mut(3 - r);
        constants[r..].iter().zip(of_constants).for_each(|(&c, sum)| add_scaled(&weighted, c, sum));
        values.iter().zip(rest).for_each(|(v, sum)| add_product(&weighted, v, sum));
    }
}

#[inline(always)]
fn add_product(a: &Line, b: &Line, sum: &mut Line) {
    for x in 0..WIDTH {
        sum.0[x] += a.0[x] * b.0[x];
    }
}

#[inline(always)]
fn add_scaled(a: &Line, factor: f32, sum: &mut Line) {
    for x in 0..WIDTH {
        sum.0[x] += a.0[x] * factor;
    }
}

/// Solves the normal equations of a row of pixels: the fit less the pixel's own value, three
/// channels, and the own weight.
fn solve(sums: &Row) -> [[f32; WIDTH]; 4] {
    let mut solved = [[0.0; WIDTH]; 4];
    for start in (0..WIDTH).step_by(LANES) {
        let block = std::array::from_fn(|s| std::array::from_fn(|l| sums[s].0[start + l]));
        for (out, of_block) in solved.iter_mut().zip(solve_block(block)) {
            out[start..][..LANES].copy_from_slice(&of_block);
        }
    }
    solved
}

/// Cholesky decomposition, row by row in place. Columns r … K−1 of the matrix and the three
/// right-hand sides are columns of one elimination.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn solve_block(sums: [[f32; LANES]; SUMS]) -> [[f32; LANES]; 4] {
    let mut m = sums;
    let total = m[STARTS[K - 1]];
    let mut result = [[0.0; LANES]; 4];
    for r in 0..K {
        let mut inverse = [0.0; LANES];
        for l in 0..LANES {
            let pivot = m[STARTS[r]][l];
            // The constant has no ridge, and its pivot holds at least the pixel's own weight.
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
mod tests {
    use super::*;

    const SIZE: usize = 33;

    /// Fits what is `value` of column, row and a feature, with a guide that says nothing.
    fn fitted(value: impl Fn(f32, f32, f32) -> f32) -> (Vec<f32>, Estimate) {
        let feature: Vec<f32> = (0..SIZE * SIZE).map(|i| (i * 7919 % 101) as f32 / 101.0).collect();
        let truth: Vec<f32> =
            (0..SIZE * SIZE).map(|i| value((i % SIZE) as f32, (i / SIZE) as f32, feature[i])).collect();
        let (flat, variance) = (vec![1.0; SIZE * SIZE], vec![1e-2; SIZE * SIZE]);
        let mut features = [flat.as_slice(); FEATURES];
        features[0] = &feature;
        let guide = Guide { value: [&flat; 3], variance: [&variance; 3], features };
        let settings = DistanceSettings { radius: 5, k: 1.0, epsilon: 1e-6, cautious: false };
        let fitted = fit(SIZE, SIZE, [&truth; 3], guide, settings);
        (truth, fitted)
    }

    #[test]
    fn what_is_linear_in_place_and_features_comes_back() {
        let (truth, fitted) = fitted(|x, y, f| 1.0 + 0.02 * x + 0.01 * y + 0.5 * f);
        for (value, truth) in fitted.value.plane(1).iter().zip(&truth) {
            assert!((value / truth - 1.0).abs() < 2e-3, "{value} {truth}");
        }
    }

    #[test]
    fn the_own_weight_is_what_the_result_takes_from_the_own_value() {
        let at = 12 * SIZE + 3;
        let value = |bump: f32| {
            move |x: f32, y: f32, f: f32| 5.0 + f + if (x, y) == (3.0, 12.0) { bump } else { 0.0 }
        };
        let (without, with) = (fitted(value(0.0)).1, fitted(value(1.0)).1);
        let change = with.value.plane(0)[at] - without.value.plane(0)[at];
        assert!((change - with.own_weight[at]).abs() < 1e-4, "{change} {}", with.own_weight[at]);
        assert!(change > 0.0 && change < 0.2);
    }

    #[test]
    fn fits_are_those_of_the_normal_equations_across_tiles() {
        use rand::{RngExt, SeedableRng};

        let (width, height) = (TILE.0 + 5, TILE.1 + 2);
        let pixels = width * height;
        let mut rng = rand_pcg::Pcg32::seed_from_u64(8);
        let mut random = |most: f32| (0..pixels).map(|_| most * rng.random::<f32>()).collect::<Vec<f32>>();
        let original = [(); 3].map(|()| random(1.0));
        let (value, variance) = ([(); 3].map(|()| random(1.0)), [(); 3].map(|()| random(0.3)));
        let features = [(); FEATURES].map(|()| random(1.0));
        let guide = Guide {
            value: value.each_ref().map(Vec::as_slice),
            variance: variance.each_ref().map(Vec::as_slice),
            features: features.each_ref().map(Vec::as_slice),
        };
        let radius = 2;
        let settings = DistanceSettings { radius, k: 1.0, epsilon: 1e-2, cautious: false };
        let fitted = fit(width, height, original.each_ref().map(Vec::as_slice), guide, settings);

        /// Regressors, values, and weight of a neighbour.
        type Equation = ([f64; K], [f64; 3], f64);
        let mut rows: Vec<Vec<Equation>> = vec![Vec::new(); pixels];
        let weights = distance::Guide {
            value: guide.value,
            variance: guide.variance,
            features: &[],
            feature_gain: 0.0,
        };
        let distance = Distance::<PATCH>::new(width, height, weights, settings);
        distance.for_each_neighbour(Tile { x: 0, y: 0, width, height }, |neighbours| {
            let (dx, dy) = neighbours.offset;
            let Some(y) = neighbours.row.checked_add_signed(dy).filter(|&y| y < height) else { return };
            for (x_i, &weight) in neighbours.weights.iter().enumerate() {
                let Some(x) = x_i.checked_add_signed(dx).filter(|&x| x < width) else { continue };
                let (i, j) = (neighbours.row * width + x_i, y * width + x);
                let change = |plane: &Vec<f32>| f64::from(plane[j]) - f64::from(plane[i]);
                let mut regressors = [1.0; K];
                regressors.iter_mut().zip(&features).for_each(|(r, f)| *r = change(f));
                regressors[FEATURES] = dx as f64 / radius as f64;
                regressors[FEATURES + 1] = dy as f64 / radius as f64;
                rows[i].push((regressors, original.each_ref().map(change), f64::from(weight)));
            }
        });
        for i in (0..pixels).step_by(3) {
            // The pixel itself differs in nothing from itself: it counts for the constant alone.
            let mut m = [[0.0; K + 3]; K];
            m[K - 1][K - 1] = 1.0;
            for (x, v, w) in &rows[i] {
                for r in 0..K {
                    (0..K).for_each(|c| m[r][c] += w * x[r] * x[c]);
                    (0..3).for_each(|c| m[r][K + c] += w * x[r] * v[c]);
                }
            }
            let total = m[K - 1][K - 1];
            (0..K - 1).for_each(|r| m[r][r] += 1e-3 * m[r][r] + 1e-7 * total);
            for r in 0..K - 1 {
                for s in r + 1..K {
                    let factor = m[s][r] / m[r][r];
                    (r..K + 3).for_each(|c| m[s][c] -= factor * m[r][c]);
                }
            }
            let [.., last] = m;
            let own = f64::from(fitted.own_weight[i]) * last[K - 1];
            assert!((own - 1.0).abs() < 0.01, "{i}: own weight {own} times what it should be");
            for c in 0..3 {
                let expected = (f64::from(original[c][i]) + last[K + c] / last[K - 1]).max(0.0);
                let found = f64::from(fitted.value.plane(c)[i]);
                assert!((found - expected).abs() < 0.01, "{i} {c}: {found} for {expected}");
            }
        }
        // Where the guide has no noise, all stays as it is; so does an image without pixels.
        let none = vec![0.0; pixels];
        let certain = Guide { variance: [&none; 3], ..guide };
        let kept = fit(width, height, original.each_ref().map(Vec::as_slice), certain, settings);
        assert!(
            (0..3).all(|c| kept.value.plane(c) == original[c]) && kept.own_weight.iter().all(|&a| a == 1.0)
        );
        let nothing = Guide { value: [&[]; 3], variance: [&[]; 3], features: [&[]; FEATURES] };
        for (width, height) in [(0, 4), (4, 0)] {
            assert!(fit(width, height, [&[]; 3], nothing, settings).own_weight.is_empty());
        }
    }
}
