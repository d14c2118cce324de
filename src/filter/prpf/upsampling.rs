//! Weights at all pixels from few evaluations (paper, section 4.3): computed at the nodes of a sparse grid,
//! interpolated between them by a joint bilateral filter, and computed directly where interpolation fails.

use rayon::prelude::*;

use super::feature_guide::{FeatureGuide, meets_alike};
use super::grid::{Grid, NODES};
use super::neighbourhood::Neighbourhood;
use super::settings::PrpfSettings;
use super::weight_inputs::{Scratch, WeightInputs};
use crate::filter::cancellable_pool::stop_if_cancelled;
use crate::filter::common::fast_exp::exp_negative_precise;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::simd::{LANES, apply, multiversioned};

/// Minimum variance of a feature's mean in the interpolation weight, relative to the neighbourhood's variance.
const MIN_FEATURE_VARIANCE: f32 = 1e-4;

/// Minimum variance of a colour in the interpolation weight, relative to the squared colour.
const MIN_COLOUR_VARIANCE: f32 = 1e-8;

/// Minimum variance of any dimension.
const MIN_VARIANCE: f32 = 1e-12;

/// Exponent above which an interpolation weight is 0.
const MAX_EXPONENT: f32 = 40.0;

/// Maximum number of weights of a pixel.
const MAX_WEIGHTS: usize = 2 * LANES;

/// Computes the weights of one pass at all pixels: the planes that [`WeightInputs::evaluate`] writes, then
/// the sum of interpolation weights, which is infinite where nothing was interpolated.
pub fn weights(inputs: &WeightInputs) -> InterleavedPlanes {
    let settings = inputs.settings;
    let (width, height) = (inputs.guide.width(), inputs.guide.height());
    let mut weights = InterleavedPlanes::new(width, height, inputs.len() + 1, 0, f32::INFINITY);
    if !settings.upsampling {
        let pixels: Vec<_> = (0..width * height).map(|i| (i % width, i / width)).collect();
        write_at(&mut weights, &pixels, &evaluate(inputs, &pixels));
        return weights;
    }

    // Compute the nodes and interpolate between them
    let grid = Grid::new(width, height, settings.grid_spacing);
    let nodes = grid.nodes();
    let values = evaluate(inputs, &nodes);
    interpolate(inputs.guide, inputs.neighbourhood, inputs.window, &grid, &values, &mut weights);
    write_at(&mut weights, &nodes, &values);
    nodes.iter().for_each(|&(x, y)| weights.set(inputs.len(), x, y, f32::INFINITY));

    // Compute pixels directly where interpolation failed
    let failed = (0..width * height)
        .map(|i| (i % width, i / width))
        .filter(|&(x, y)| weights.at(inputs.len(), x, y) <= settings.interpolation_threshold);
    let Failed { direct, copies } = Failed::new(inputs, failed);
    write_at(&mut weights, &direct, &evaluate(inputs, &direct));
    for (to, from) in copies {
        (0..inputs.len()).for_each(|k| weights.set(k, to.0, to.1, weights.at(k, from.0, from.1)));
    }
    weights
}

/// Pixels between whose nodes interpolation failed.
struct Failed {
    /// Those whose weights are computed.
    direct: Vec<(usize, usize)>,
    /// Those that take over the weights of a pixel of `direct` in their block of 2×2.
    copies: Vec<((usize, usize), (usize, usize))>,
}

impl Failed {
    /// Divides `pixels`, which are in row order. The first of a block is a node to the others, which are interpolated
    /// where its interpolation weight alone exceeds the threshold.
    fn new(inputs: &WeightInputs, pixels: impl Iterator<Item = (usize, usize)>) -> Self {
        const SIDE: usize = 2;
        let blocks = inputs.guide.width().div_ceil(SIDE);
        let mut nodes = vec![None; blocks * inputs.guide.height().div_ceil(SIDE)];
        let mut failed = Self { direct: Vec::new(), copies: Vec::new() };
        for pixel in pixels {
            let node = &mut nodes[pixel.1 / SIDE * blocks + pixel.0 / SIDE];
            match *node {
                Some(node)
                    if interpolation_weight(inputs, pixel, node)
                        > inputs.settings.interpolation_threshold =>
                {
                    failed.copies.push((pixel, node));
                }
                _ => {
                    node.get_or_insert(pixel);
                    failed.direct.push(pixel);
                }
            }
        }
        failed
    }
}

/// Returns the interpolation weight between a pixel and a node.
fn interpolation_weight(inputs: &WeightInputs, (x, y): (usize, usize), node: (usize, usize)) -> f32 {
    let guide = inputs.guide;
    let (dx, dy) = (node.0.abs_diff(x) as f32, node.1.abs_diff(y) as f32);
    let distance = |k: usize| {
        let own = guide.means.at(k, x, y);
        let d = guide.means.at(k, node.0, node.1) - own;
        let (variance, around) = (guide.variances.at(k, x, y), inputs.neighbourhood.variance(k, x, y));
        d * d * inverse_variance(guide.z.get(k).copied(), own, variance, around)
    };
    let exponent = film_factor(inputs.window) * (dx * dx + dy * dy)
        + (0..guide.features() + 3).map(distance).sum::<f32>();
    if guide.meets_alike((x, y), node) { (-0.5 * exponent).exp() } else { 0.0 }
}

/// Returns one over the variance by which the squared differences of a dimension are divided. `z` is the similarity
/// threshold of a feature; a colour has none. `variance` is that of the pixel, `around` that of its neighbourhood.
#[inline(always)]
fn inverse_variance(z: Option<f32>, mean: f32, variance: f32, around: f32) -> f32 {
    let variance = match z {
        Some(z) => z * z * variance + MIN_FEATURE_VARIANCE * around,
        None => around + MIN_COLOUR_VARIANCE * mean * mean,
    };
    1.0 / (variance + MIN_VARIANCE)
}

/// Returns one over the variance of positions in a window.
fn film_factor(window: usize) -> f32 {
    12.0 / (window * window) as f32
}

/// Computes the sums of interpolation weights alone: the last plane of [`weights`].
pub fn interpolation_sums(
    guide: &FeatureGuide,
    neighbourhood: &Neighbourhood,
    window: usize,
    settings: &PrpfSettings,
) -> InterleavedPlanes {
    let mut sums = InterleavedPlanes::new(guide.width(), guide.height(), 1, 0, f32::INFINITY);
    let grid = Grid::new(guide.width(), guide.height(), settings.grid_spacing);
    interpolate(guide, neighbourhood, window, &grid, &[], &mut sums);
    for (x, y) in grid.nodes() {
        sums.set(0, x, y, f32::INFINITY);
    }
    sums
}

/// Computes the weights of some pixels directly. The pixels are in row order, and evaluated in vertical strips, so that
/// the samples of a pixel's window are still in the cache for the next row.
fn evaluate(inputs: &WeightInputs, pixels: &[(usize, usize)]) -> Vec<f32> {
    /// In pixels.
    const STRIP_WIDTH: usize = 40;
    let mut order: Vec<usize> = (0..pixels.len()).collect();
    order.sort_by_key(|&i| pixels[i].0 / STRIP_WIDTH);
    let mut ordered = vec![0.0; pixels.len() * inputs.len()];
    ordered.par_chunks_mut(inputs.len()).zip(&order).for_each_init(
        || Scratch::new(inputs),
        |scratch, (out, &i)| {
            stop_if_cancelled();
            inputs.evaluate(pixels[i], scratch, out);
        },
    );
    let mut values = vec![0.0; ordered.len()];
    for (ordered, i) in ordered.chunks(inputs.len()).zip(order) {
        values[i * inputs.len()..][..inputs.len()].copy_from_slice(ordered);
    }
    values
}

/// Writes directly computed weights; the last plane stays as it is.
fn write_at(weights: &mut InterleavedPlanes, pixels: &[(usize, usize)], values: &[f32]) {
    let count = weights.count() - 1;
    for (&(x, y), values) in pixels.iter().zip(values.chunks(count)) {
        values.iter().enumerate().for_each(|(k, &value)| weights.set(k, x, y, value));
    }
}

/// Writes the interpolated `values` (all values of a node side by side) and the sums of interpolation weights.
fn interpolate(
    guide: &FeatureGuide,
    neighbourhood: &Neighbourhood,
    window: usize,
    grid: &Grid,
    values: &[f32],
    out: &mut InterleavedPlanes,
) {
    let (row_len, stride) = (out.row_len().max(1), out.stride());
    let film_factor = film_factor(window);
    out.data_mut().par_chunks_mut(row_len).enumerate().for_each(|(y, out)| {
        stop_if_cancelled();
        interpolate_row(guide, neighbourhood, grid, film_factor, values, y, stride, out);
    });
}

/// Interpolates one row. `film_factor` is one over the variance of positions in the window.
#[apply(multiversioned!)]
#[expect(clippy::too_many_arguments, reason = "a function chosen at run time cannot be a closure")]
fn interpolate_row(
    guide: &FeatureGuide,
    neighbourhood: &Neighbourhood,
    grid: &Grid,
    film_factor: f32,
    values: &[f32],
    y: usize,
    stride: usize,
    out: &mut [f32],
) {
    let planes = out.len() / stride - 1;
    let dims = guide.features() + 3;
    let mut block = None;
    let (mut xs, mut ys, mut hits) = ([0.0; NODES], [0.0; NODES], [FeatureGuide::NO_PIXEL; NODES]);
    let mut met_emitter = [0.0; NODES];
    let mut means = vec![[0.0; NODES]; dims];
    let mut node_values = [[0.0; MAX_WEIGHTS]; NODES];
    let mut own = vec![([0.0; LANES], [0.0; LANES]); dims];
    for x in 0..guide.width() {
        // Load means and inverse variances of the next pixels
        let lane = x % LANES;
        if lane == 0 {
            for (k, (means, factors)) in own.iter_mut().enumerate() {
                let around = neighbourhood.variance_lanes(k, x, y);
                let variances = guide.variances.lanes(k, y, x);
                *means = *guide.means.lanes(k, y, x);
                let z = guide.z.get(k).copied();
                for l in 0..LANES {
                    factors[l] = inverse_variance(z, means[l], variances[l], around[l]);
                }
            }
        }

        // Load the surrounding nodes of a new block
        let here = grid.block((x, y));
        if block != Some(here) {
            block = Some(here);
            hits = [FeatureGuide::NO_PIXEL; NODES];
            for (n, node) in grid.surrounding(here).into_iter().enumerate() {
                let Some(node) = node else { continue };
                let (xn, yn) = grid.node(node);
                (xs[n], ys[n]) = (xn as f32, yn as f32);
                (hits[n], met_emitter[n]) = (guide.hit.at(0, xn, yn), guide.met_emitter.at(0, xn, yn));
                means.iter_mut().enumerate().for_each(|(k, means)| means[n] = guide.means.at(k, xn, yn));
                node_values[n][..planes].copy_from_slice(&values[node * planes..][..planes]);
            }
        }

        // Sum squared distances in units of variances
        let mut exponents = [0.0; NODES];
        for n in 0..NODES {
            let (dx, dy) = (xs[n] - x as f32, ys[n] - y as f32);
            exponents[n] = film_factor * (dx * dx + dy * dy);
        }
        for (means, (own, factors)) in means.iter().zip(&own) {
            for n in 0..NODES {
                let d = means[n] - own[lane];
                exponents[n] += factors[lane] * d * d;
            }
        }

        // Compute the interpolation weights
        let mut weights = [0.0; NODES];
        let own_met = [&guide.own_hit, &guide.takes_emission].map(|plane| plane.at(0, x, y));
        for n in 0..NODES {
            let is_similar = meets_alike(own_met, [hits[n], met_emitter[n]]);
            let exponent = 0.5 * exponents[n];
            let weight = exp_negative_precise::<false>(exponent.min(MAX_EXPONENT));
            weights[n] = if is_similar & (exponent <= MAX_EXPONENT) { weight } else { 0.0 };
        }

        // Average the nodes
        let sum: f32 = weights.iter().sum();
        let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        let mut averages = [0.0; MAX_WEIGHTS];
        for (weight, values) in weights.iter().zip(&node_values) {
            for k in 0..MAX_WEIGHTS {
                averages[k] += weight * values[k];
            }
        }
        averages[..planes].iter().enumerate().for_each(|(k, average)| out[k * stride + x] = scale * average);
        out[planes * stride + x] = sum;
    }
}

#[cfg(test)]
mod tests;
