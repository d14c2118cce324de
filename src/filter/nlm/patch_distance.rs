//! Weights of non-local means from patch distances: how much two pixels differ, in units of their noise.
//!
//! Takes the guide, which is one half of the samples, and returns the weights for the other half, as
//! Rousselle, Knaus and Zwicker (2012, eq. 3, with their variance cancellation). For pixels i and j,
//!
//! d_ij = mean over 3 channels and the patch of (Δ² − v_i − min(v_i, v_j)) / (ε + k²(v_i + v_j)),
//! w_ij = exp(−max(0, d_ij) − Σ_f s (f_i − f_j)²).
//!
//! In units of ε, with e = k²v + ½ and r = 1/(e_i + e_j), the patch sums P = Σ(k²Δ² + 1 − min e)·r and Q = Σ
//! e_i·r give the distances of both directions, k²d_ij ∝ P − Q and k²d_ji ∝ P + Q − (number of terms), so
//! that each pair of pixels is visited once.

use rayon::prelude::*;

use super::row_sums::RowSums;
use crate::filter::common::fast_exp::exp_negative;
use crate::filter::common::lanes::lanes;
use crate::filter::common::padded_planes::{Margin, PaddedPlanes};
use crate::simd::{LANES, Lanes, apply, multiversioned};

/// Maximum contribution of one pixel to a patch sum. Larger terms give a weight of 0 as well, and would take
/// precision from the sums.
const MAX_TERM: f32 = 3000.0;
/// Maximum of e: the product of three sums of two of them does not overflow.
const MAX_E: f32 = 1e12;
/// e of a pixel without noise.
const NOISE_FREE_E: f32 = 0.5;
/// Value of the features in the margin: so far from any feature that the weight is 0.
const OUTSIDE: f32 = 1e3;
/// Minimum inverse bandwidth of features, with which weights of the margin are 0.
const MIN_FEATURE_BANDWIDTH: f32 = 1e-3;

/// The images that determine the weights: three channels of one half, and features.
#[derive(Clone, Copy)]
pub struct ColourGuide<'a> {
    /// Three planes.
    pub value: [&'a [f32]; 3],
    /// Variances of their means.
    pub variance: [&'a [f32]; 3],
    /// Any number of planes f, each of which adds s·(f_i − f_j)² to the exponent.
    pub features: &'a [&'a [f32]],
    /// s.
    pub feature_inverse_bandwidth: f32,
}

/// Constants of the distance.
#[derive(Clone, Copy, Debug)]
pub struct DistanceSettings {
    /// Radius of the disc of neighbours, in pixels.
    pub radius: usize,
    /// Bandwidth, in standard deviations.
    pub k: f32,
    /// ε, in squared units of the guide.
    pub epsilon: f32,
    /// Whether both pixels of a pair use the smaller weight of the two. This suits images with hard edges,
    /// such as emitters. It does not suit radiance, where the variance of few samples may be 0 because none
    /// found the light.
    pub symmetric_weights: bool,
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug)]
pub struct Tile {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
}

/// Returns tiles of at most the size `side` that cover an image.
fn tiles(width: usize, height: usize, side: (usize, usize)) -> Vec<Tile> {
    let starts = |y| (0..width).step_by(side.0).map(move |x| (x, y));
    let tile = |(x, y)| Tile { x, y, width: side.0.min(width - x), height: side.1.min(height - y) };
    (0..height).step_by(side.1).flat_map(starts).map(tile).collect()
}

/// Weights of the neighbours of a row of pixels at one offset.
pub struct Neighbours<'a> {
    /// Row in the tile.
    pub row: usize,
    /// Offset from pixel to neighbour.
    pub offset: (isize, isize),
    /// One weight for each pixel of the row.
    pub weights: &'a [f32],
}

/// Distances between patches of (2·PATCH + 1)² pixels of a guide.
pub struct PatchDistance<const PATCH: usize> {
    width: usize,
    height: usize,
    /// In units of √ε.
    value: PaddedPlanes,
    /// e = k²v + ½.
    e: PaddedPlanes,
    features: PaddedPlanes,
    feature_inverse_bandwidth: f32,
    settings: DistanceSettings,
}

impl<const PATCH: usize> PatchDistance<PATCH> {
    const SIDE: usize = 2 * PATCH + 1;

    /// Prepares a guide. All planes have `width`×`height` finite values.
    pub fn new(width: usize, height: usize, guide: ColourGuide, settings: DistanceSettings) -> Self {
        let margin = settings.radius + PATCH;
        let k2 = settings.k * settings.k;
        let per_epsilon = 1.0 / settings.epsilon;
        let scaled = |plane: &[f32], scale: f32| plane.iter().map(|v| scale * v).collect::<Vec<_>>();
        let [r, g, b] = guide.value.map(|plane| scaled(plane, per_epsilon.sqrt()));
        let e = |v: &f32| (k2 * per_epsilon * v + NOISE_FREE_E).min(MAX_E);
        let [e_r, e_g, e_b] = guide.variance.map(|plane| plane.iter().map(e).collect::<Vec<_>>());
        // Without features a constant plane gives the margin a weight of 0.
        let inside = vec![0.0; width * height];
        let features = if guide.features.is_empty() { &[inside.as_slice()] } else { guide.features };
        Self {
            width,
            height,
            value: PaddedPlanes::new(width, height, &[&r, &g, &b], margin, Margin::Nearest),
            e: PaddedPlanes::new(width, height, &[&e_r, &e_g, &e_b], margin, Margin::Nearest),
            features: PaddedPlanes::new(width, height, features, margin, Margin::Value(OUTSIDE)),
            feature_inverse_bandwidth: guide.feature_inverse_bandwidth.max(MIN_FEATURE_BANDWIDTH),
            settings,
        }
    }

    /// Returns tiles of at most the size `side`, reduced to the pixels that filtering may change: those with
    /// a variance and, unless weights are symmetric, their neighbours.
    pub fn noisy_tiles(&self, side: (usize, usize)) -> Vec<Tile> {
        tiles(self.width, self.height, side).par_iter().filter_map(|&tile| self.noisy_part(tile)).collect()
    }

    fn noisy_part(&self, tile: Tile) -> Option<Tile> {
        let reach = if self.settings.symmetric_weights { 0 } else { self.settings.radius };
        let (wide, high) = (tile.width + 2 * reach, tile.height + 2 * reach);
        // Find the first and last noisy pixels, counted from the first neighbour of the tile
        let noisy = |c, y: usize| {
            let (left, top) = (tile.x as isize - reach as isize, tile.y as isize - reach as isize);
            let row = self.e.span(c, left, top + y as isize, wide);
            let is_noisy = |&e: &f32| e > NOISE_FREE_E;
            Some((row.iter().position(is_noisy)?, row.iter().rposition(is_noisy)?))
        };
        let rows = (0..high).flat_map(|y| (0..3).filter_map(move |c| Some((y, noisy(c, y)?))));
        let (left, right, top, bottom) = rows.fold(None, |part, (y, (first, last))| {
            let (left, right, top, _) = part.unwrap_or((first, last, y, y));
            Some((first.min(left), last.max(right), top, y))
        })?;
        // Extend by the reach, within the tile
        let [left, top] = [left, top].map(|first| first.saturating_sub(2 * reach));
        let (right, bottom) = ((right + 1).min(tile.width), (bottom + 1).min(tile.height));
        Some(Tile { x: tile.x + left, y: tile.y + top, width: right - left, height: bottom - top })
    }

    /// Returns whether filtering may change each pixel: those with a variance and, unless weights are symmetric, those with
    /// one within a square of the radius.
    pub fn changed_pixels(&self) -> Vec<bool> {
        let (width, radius) = (self.width, self.settings.radius);
        let mut noisy = vec![false; width * self.height];
        noisy.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
            let [a, b, c] = std::array::from_fn(|channel| self.e.span(channel, 0, y as isize, width));
            for (x, noisy) in row.iter_mut().enumerate() {
                *noisy = (a[x] > NOISE_FREE_E) | (b[x] > NOISE_FREE_E) | (c[x] > NOISE_FREE_E);
            }
        });
        if self.settings.symmetric_weights || !noisy.contains(&false) {
            return noisy;
        }
        // Extend by the radius, along rows and then along columns
        let mut wide = noisy.clone();
        wide.par_chunks_mut(width).zip(noisy.par_chunks(width)).for_each(|(wide, row)| {
            for shift in 1..=radius.min(width - 1) {
                wide[shift..].iter_mut().zip(row).for_each(|(wide, &noisy)| *wide |= noisy);
                wide.iter_mut().zip(&row[shift..]).for_each(|(wide, &noisy)| *wide |= noisy);
            }
        });
        let mut changed = wide.clone();
        changed.par_chunks_mut(width).enumerate().for_each(|(y, changed)| {
            let rows = y.saturating_sub(radius)..(y + radius + 1).min(self.height);
            for row in rows.map(|y| &wide[y * width..][..width]) {
                changed.iter_mut().zip(row).for_each(|(changed, &wide)| *changed |= wide);
            }
        });
        changed
    }

    /// Calls `add` with the weights of all neighbours of the tile's pixels, except the pixels themselves.
    pub fn for_each_neighbour(&self, tile: Tile, mut add: impl FnMut(Neighbours)) {
        let longest = (tile.width + self.settings.radius).next_multiple_of(LANES) + 2 * PATCH;
        let mut scratch = Scratch::new(longest.next_multiple_of(LANES));
        for offset in half_disc(self.settings.radius) {
            self.for_each_row(tile, offset, &mut scratch, &mut add);
        }
    }

    /// Does the same for one offset and its opposite.
    fn for_each_row(
        &self,
        tile: Tile,
        offset: (isize, isize),
        scratch: &mut Scratch,
        add: &mut impl FnMut(Neighbours),
    ) {
        let (dx, dy) = offset;
        let (x0, y0) = (tile.x as isize, tile.y as isize);
        let (x1, y1) = (x0 + tile.width as isize, y0 + tile.height as isize);
        // Pixels i for which i or j lies in the tile
        let (left, right) = (x0.min(x0 - dx), x1.max(x1 - dx));
        let length = ((right - left) as usize).next_multiple_of(LANES);
        let patch = PATCH as isize;
        let wide = (length + 2 * PATCH).next_multiple_of(LANES);
        let k2 = self.settings.k * self.settings.k;
        for y in y0 - dy - patch..y1 + patch {
            // Add a row to the column sums, which extend over the rows of a patch
            let x = left - patch;
            let row = (y - (y0 - dy - patch)) as usize;
            let [p, q] = &mut scratch.terms;
            compute_terms(
                k2,
                std::array::from_fn(|c| self.value.span(c, x, y, wide)),
                std::array::from_fn(|c| self.value.span(c, x + dx, y + dy, wide)),
                std::array::from_fn(|c| self.e.span(c, x, y, wide)),
                std::array::from_fn(|c| self.e.span(c, x + dx, y + dy, wide)),
                &mut p[..wide],
                &mut q[..wide],
            );
            for (terms, sums) in scratch.terms.iter().zip(&mut scratch.columns) {
                sums.add::<PATCH>(row, &terms[..wide]);
            }
            // The patches around row `y - PATCH` are complete with their last row.
            let y = y - patch;
            if y < y0 - dy {
                continue;
            }

            // Compute the weights of both directions
            let [w_ij, w_ji] = &mut scratch.weights;
            let (w_ij, w_ji) = (&mut w_ij[..length], &mut w_ji[..length]);
            w_ij.fill(0.0);
            for f in 0..self.features.count() {
                let i = self.features.span(f, left, y, length);
                let j = self.features.span(f, left + dx, y + dy, length);
                add_squared_difference(i, j, w_ij);
            }
            let [p, q] = scratch.columns.each_ref().map(|sums| sums.sum());
            let to_exponents = Exponents {
                scale: 1.0 / (k2 * (3 * Self::SIDE * Self::SIDE) as f32),
                terms: (3 * Self::SIDE * Self::SIDE) as f32,
                feature_inverse_bandwidth: self.feature_inverse_bandwidth,
                symmetric_weights: self.settings.symmetric_weights,
            };
            to_weights::<PATCH>(to_exponents, &p[..wide], &q[..wide], w_ij, w_ji);

            // Pass on those of the tile
            if y >= y0 {
                let weights = &w_ij[(x0 - left) as usize..][..tile.width];
                add(Neighbours { row: (y - y0) as usize, offset: (dx, dy), weights });
            }
            if y + dy < y1 {
                let weights = &w_ji[(x0 - dx - left) as usize..][..tile.width];
                add(Neighbours { row: (y + dy - y0) as usize, offset: (-dx, -dy), weights });
            }
        }
    }
}

/// Returns half of the offsets of a disc: of each pair ±o the later one in reading order.
fn half_disc(radius: usize) -> impl Iterator<Item = (isize, isize)> {
    let r = radius as isize;
    (0..=r)
        .flat_map(move |dy| (-r..=r).map(move |dx| (dx, dy)))
        .filter(move |&(dx, dy)| dx * dx + dy * dy <= r * r && (dy > 0 || dx > 0))
}

/// Memory for one offset: rows that are long enough for a tile, an offset and a patch. Their length is a
/// multiple of [`LANES`], so that vector loops have no remainder.
struct Scratch {
    /// P and Q of one row.
    terms: [Vec<f32>; 2],
    /// Sums of P and Q over the rows of a patch.
    columns: [RowSums; 2],
    /// Weights w_ij and w_ji.
    weights: [Vec<f32>; 2],
}

impl Scratch {
    fn new(length: usize) -> Self {
        let pair = || [vec![0.0; length], vec![0.0; length]];
        let sums = || RowSums::new(length);
        Self { terms: pair(), columns: [sums(), sums()], weights: pair() }
    }
}

/// Writes P and Q of single pixels of a row.
#[apply(multiversioned!)]
fn compute_terms(
    k2: f32,
    value_i: [&[f32]; 3],
    value_j: [&[f32]; 3],
    e_i: [&[f32]; 3],
    e_j: [&[f32]; 3],
    p: &mut [f32],
    q: &mut [f32],
) {
    let n = p.len();
    let q = &mut q[..n];
    // With a name for each row and equal lengths the compiler removes all bounds checks.
    let ([a0, a1, a2], [b0, b1, b2]) = (value_i, value_j);
    let ([e0, e1, e2], [f0, f1, f2]) = (e_i, e_j);
    let (a0, a1, a2, b0, b1, b2) = (&a0[..n], &a1[..n], &a2[..n], &b0[..n], &b1[..n], &b2[..n]);
    let (e0, e1, e2, f0, f1, f2) = (&e0[..n], &e1[..n], &e2[..n], &f0[..n], &f1[..n], &f2[..n]);
    for x in 0..n {
        let (s0, s1, s2) = (e0[x] + f0[x], e1[x] + f1[x], e2[x] + f2[x]);
        // One division instead of three
        let inverse = 1.0 / (s0 * s1 * s2);
        let (r0, r1, r2) = (inverse * (s1 * s2), inverse * (s0 * s2), inverse * (s0 * s1));
        let (d0, d1, d2) = (a0[x] - b0[x], a1[x] - b1[x], a2[x] - b2[x]);
        let sum = (k2 * d0 * d0 + (1.0 - min(e0[x], f0[x]))) * r0
            + (k2 * d1 * d1 + (1.0 - min(e1[x], f1[x]))) * r1
            + (k2 * d2 * d2 + (1.0 - min(e2[x], f2[x]))) * r2;
        p[x] = min(sum, MAX_TERM);
        q[x] = e0[x] * r0 + e1[x] * r1 + e2[x] * r2;
    }
}

/// Returns the smaller of two numbers in one instruction; `f32::min` takes more, to handle NaN.
#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The same for the larger one.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[apply(multiversioned!)]
fn add_squared_difference(i: &[f32], j: &[f32], sum: &mut [f32]) {
    let n = sum.len();
    let (i, j) = (&i[..n], &j[..n]);
    for x in 0..n {
        let d = i[x] - j[x];
        sum[x] += d * d;
    }
}

/// Constants that turn patch sums into exponents.
#[derive(Clone, Copy)]
struct Exponents {
    scale: f32,
    terms: f32,
    feature_inverse_bandwidth: f32,
    symmetric_weights: bool,
}

/// Computes the weights of both directions from column sums. On entry `w_ij` holds the squared feature differences. Its length is a
/// multiple of [`LANES`], and `w_ji` has the same.
#[apply(multiversioned!)]
fn to_weights<const PATCH: usize>(
    exponents: Exponents,
    p: &[f32],
    q: &[f32],
    w_ij: &mut [f32],
    w_ji: &mut [f32],
) {
    let Exponents { scale, terms, feature_inverse_bandwidth, symmetric_weights } = exponents;
    debug_assert!(w_ij.len().is_multiple_of(LANES) && w_ij.len() == w_ji.len(), "whole blocks of pixels");
    // In blocks, or the compiler assembles the overlapping sums from shuffled registers
    let blocks = w_ij.as_chunks_mut::<LANES>().0.iter_mut().zip(w_ji.as_chunks_mut::<LANES>().0);
    for (k, (w_ij, w_ji)) in blocks.enumerate() {
        let (sum_p, sum_q) = (patch_sums::<PATCH>(&p[k * LANES..]), patch_sums::<PATCH>(&q[k * LANES..]));
        for i in 0..LANES {
            let feature = feature_inverse_bandwidth * w_ij[i];
            let d_ij = max((sum_p[i] - sum_q[i]) * scale, 0.0);
            let d_ji = max((sum_p[i] + sum_q[i] - terms) * scale, 0.0);
            let larger = max(d_ij, d_ji);
            w_ij[i] = exp_negative(if symmetric_weights { larger } else { d_ij } + feature);
            w_ji[i] = exp_negative(if symmetric_weights { larger } else { d_ji } + feature);
        }
    }
}

/// Sums of as many neighbouring columns as a patch has, from the first [`LANES`] columns on.
#[inline(always)]
fn patch_sums<const PATCH: usize>(columns: &[f32]) -> Lanes {
    let columns = &columns[..LANES + 2 * PATCH];
    let mut sums = *lanes(columns);
    for t in 1..2 * PATCH + 1 {
        let next = lanes(&columns[t..]);
        for i in 0..LANES {
            sums[i] += next[i];
        }
    }
    sums
}

#[cfg(test)]
mod tests;
