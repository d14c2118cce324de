//! The patch distance: how alike two pixels are, in units of their noise, and the weights that
//! follow from it.
//!
//! Source: the distance of Rousselle, Knaus and Zwicker (2012, eq. 3, with their variance
//! cancellation), taken in one half of the samples to weigh the other half, as there. For pixels i
//! and j,
//!
//! d_ij = mean over 3 channels and the patch of (Δ² − v_i − min(v_i, v_j)) / (ε + k²(v_i + v_j)),
//! w_ij = exp(−max(0, d_ij) − Σ_f s (f_i − f_j)²).
//!
//! With ε as the unit of what is squared, e = k²v + ½ and r = 1/(e_i + e_j), the patch sums
//! P = Σ(k²Δ² + 1 − min e)·r and Q = Σ e_i·r give both directions, k²d_ij ∝ P − Q and
//! k²d_ji ∝ P + Q − (number of terms), so each pair of pixels is looked at once.

use multiversion::multiversion;
use rayon::prelude::*;

use super::bordered::{Bordered, Margin};
use super::fast_exp::exp_negative;

/// Bound of one pixel's contribution to a patch sum. Larger ones mean weight zero anyway, and
/// would cost the running sums their digits.
const LARGEST_TERM: f32 = 3000.0;
/// Bound of e: no product of three sums of two of them overflows.
const LARGEST_E: f32 = 1e12;
/// e of what has no noise.
const NOISELESS: f32 = 0.5;
/// In the margin of the feature planes: so far from any feature that the weight vanishes.
const OUTSIDE: f32 = 1e3;
/// The least that a squared difference of features is multiplied by: it keeps the margin out.
const LEAST_GAIN: f32 = 1e-3;

/// Rows of scratch are whole vectors of this many pixels: a rest would be worked off one by one.
const LANES: usize = 16;

/// What decides the weights: three channels of one half, and features.
#[derive(Clone, Copy)]
pub(super) struct Guide<'a> {
    /// Three planes.
    pub value: [&'a [f32]; 3],
    /// Their variances *of the mean*.
    pub variance: [&'a [f32]; 3],
    /// Any number of planes; with `feature_gain` s the exponent gets s·(f_i − f_j)² for each.
    pub features: &'a [&'a [f32]],
    pub feature_gain: f32,
}

/// Constants of the distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct DistanceSettings {
    /// Radius of the disc of neighbours, in pixels.
    pub radius: usize,
    /// Sensitivity: differences of k standard deviations begin to count.
    pub k: f32,
    /// Added to the variances, in squared units of the guide.
    pub epsilon: f32,
    /// Both pixels of a pair take the smaller weight of the two. Right for what has hard edges and is
    /// either there or not, such as an emitter; wrong for radiance, where no variance may mean that
    /// none of few samples found the light.
    pub cautious: bool,
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tile {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
}

/// Tiles of at most `side`s that cover an image.
pub(super) fn tiles(width: usize, height: usize, side: (usize, usize)) -> Vec<Tile> {
    let starts = |y| (0..width).step_by(side.0).map(move |x| (x, y));
    let tile = |(x, y)| Tile { x, y, width: side.0.min(width - x), height: side.1.min(height - y) };
    (0..height).step_by(side.1).flat_map(starts).map(tile).collect()
}

/// Weights of the pixels of a row of a tile's neighbours at one offset.
pub(super) struct Neighbours<'a> {
    /// Row in the tile.
    pub row: usize,
    /// From pixel to neighbour.
    pub offset: (isize, isize),
    /// One for each pixel of the row.
    pub weights: &'a [f32],
}

/// A guide prepared for distances between patches of (2·PATCH + 1)² pixels.
pub(super) struct Distance<const PATCH: usize> {
    width: usize,
    height: usize,
    /// In units of √ε.
    value: Bordered,
    /// e = k²v + ½.
    e: Bordered,
    features: Bordered,
    feature_gain: f32,
    settings: DistanceSettings,
}

impl<const PATCH: usize> Distance<PATCH> {
    const SIDE: usize = 2 * PATCH + 1;

    /// All planes have `width`×`height` finite values.
    pub fn new(width: usize, height: usize, guide: Guide, settings: DistanceSettings) -> Self {
        let margin = settings.radius + PATCH;
        let k2 = settings.k * settings.k;
        let per_epsilon = 1.0 / settings.epsilon;
        let scaled = |plane: &[f32], scale: f32| plane.iter().map(|v| scale * v).collect::<Vec<_>>();
        let [r, g, b] = guide.value.map(|plane| scaled(plane, per_epsilon.sqrt()));
        let e = |v: &f32| (k2 * per_epsilon * v + NOISELESS).min(LARGEST_E);
        let [e_r, e_g, e_b] = guide.variance.map(|plane| plane.iter().map(e).collect::<Vec<_>>());
        // Without features there is still one plane: it keeps the margin out.
        let inside = vec![0.0; width * height];
        let features = if guide.features.is_empty() { &[inside.as_slice()] } else { guide.features };
        Self {
            width,
            height,
            value: Bordered::new(width, height, &[&r, &g, &b], margin, Margin::Nearest),
            e: Bordered::new(width, height, &[&e_r, &e_g, &e_b], margin, Margin::Nearest),
            features: Bordered::new(width, height, features, margin, Margin::Value(OUTSIDE)),
            feature_gain: guide.feature_gain.max(LEAST_GAIN),
            settings,
        }
    }

    /// Tiles of at most `side`, cut to what is not exact as it is: pixels with a variance and, without
    /// caution, those in their reach.
    pub fn noisy_tiles(&self, side: (usize, usize)) -> Vec<Tile> {
        tiles(self.width, self.height, side).par_iter().filter_map(|&tile| self.noisy_part(tile)).collect()
    }

    fn noisy_part(&self, tile: Tile) -> Option<Tile> {
        let reach = if self.settings.cautious { 0 } else { self.settings.radius };
        let (wide, high) = (tile.width + 2 * reach, tile.height + 2 * reach);
        // Both counted from the first pixel in reach of the tile.
        let noisy = |c, y: usize| {
            let (left, top) = (tile.x as isize - reach as isize, tile.y as isize - reach as isize);
            let row = self.e.span(c, left, top + y as isize, wide);
            let is_noisy = |&e: &f32| e > NOISELESS;
            Some((row.iter().position(is_noisy)?, row.iter().rposition(is_noisy)?))
        };
        let rows = (0..high).flat_map(|y| (0..3).filter_map(move |c| Some((y, noisy(c, y)?))));
        let (left, right, top, bottom) = rows.fold(None, |part, (y, (first, last))| {
            let (left, right, top, _) = part.unwrap_or((first, last, y, y));
            Some((first.min(left), last.max(right), top, y))
        })?;
        // What reaches from there, within the tile.
        let [left, top] = [left, top].map(|first| first.saturating_sub(2 * reach));
        let (right, bottom) = ((right + 1).min(tile.width), (bottom + 1).min(tile.height));
        Some(Tile { x: tile.x + left, y: tile.y + top, width: right - left, height: bottom - top })
    }

    /// Hands on the weights of all neighbours in the disc of all pixels of the tile, the pixels
    /// themselves excepted.
    pub fn for_each_neighbour(&self, tile: Tile, mut add: impl FnMut(Neighbours)) {
        let longest = (tile.width + self.settings.radius).next_multiple_of(LANES) + 2 * PATCH;
        let mut scratch = Scratch::new(longest.next_multiple_of(LANES), Self::SIDE);
        for offset in half_disc(self.settings.radius) {
            self.for_each_row(tile, offset, &mut scratch, &mut add);
        }
    }

    /// The same for one offset and its opposite.
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
        // The pixels i for which i or j lies in the tile.
        let (left, right) = (x0.min(x0 - dx), x1.max(x1 - dx));
        let length = ((right - left) as usize).next_multiple_of(LANES);
        let patch = PATCH as isize;
        let wide = (length + 2 * PATCH).next_multiple_of(LANES);
        let k2 = self.settings.k * self.settings.k;
        scratch.clear();
        for y in y0 - dy - patch..y1 + patch {
            let x = left - patch;
            let slot = (y - (y0 - dy - patch)) as usize % Self::SIDE;
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
            for ((new, old), sum) in
                scratch.terms.iter().zip(&mut scratch.ring[slot]).zip(&mut scratch.columns)
            {
                replace(&new[..wide], &mut old[..wide], &mut sum[..wide]);
            }
            // The patch around row `y - PATCH` is complete once its last row is in.
            let y = y - patch;
            if y < y0 - dy {
                continue;
            }
            let [w_ij, w_ji] = &mut scratch.weights;
            let (w_ij, w_ji) = (&mut w_ij[..length], &mut w_ji[..length]);
            w_ij.fill(0.0);
            for f in 0..self.features.count() {
                let i = self.features.span(f, left, y, length);
                let j = self.features.span(f, left + dx, y + dy, length);
                add_squared_difference(i, j, w_ij);
            }
            let [p, q] = &scratch.columns;
            let to_exponents = Exponents {
                scale: 1.0 / (k2 * (3 * Self::SIDE * Self::SIDE) as f32),
                terms: (3 * Self::SIDE * Self::SIDE) as f32,
                feature_gain: self.feature_gain,
                cautious: self.settings.cautious,
            };
            to_weights::<PATCH>(to_exponents, &p[..wide], &q[..wide], w_ij, w_ji);
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

/// Half of the offsets of a disc: of each pair ±o the one that comes later in reading order.
fn half_disc(radius: usize) -> impl Iterator<Item = (isize, isize)> {
    let r = radius as isize;
    (0..=r)
        .flat_map(move |dy| (-r..=r).map(move |dx| (dx, dy)))
        .filter(move |&(dx, dy)| dx * dx + dy * dy <= r * r && (dy > 0 || dx > 0))
}

/// Rows of scratch for one offset, each wide enough for a tile, an offset and a patch.
struct Scratch {
    /// P and Q of one row.
    terms: [Vec<f32>; 2],
    /// P and Q of the last rows, as many as a patch has.
    ring: Vec<[Vec<f32>; 2]>,
    /// Their sums over these rows.
    columns: [Vec<f32>; 2],
    /// Weights of j for i, and of i for j.
    weights: [Vec<f32>; 2],
}

impl Scratch {
    fn new(length: usize, rows: usize) -> Self {
        let pair = || [vec![0.0; length], vec![0.0; length]];
        Self { terms: pair(), ring: (0..rows).map(|_| pair()).collect(), columns: pair(), weights: pair() }
    }

    fn clear(&mut self) {
        self.ring.iter_mut().flatten().chain(&mut self.columns).for_each(|row| row.fill(0.0));
    }
}

/// P and Q of single pixels of a row, not yet summed over patches.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
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
    // One name for each row, all as long as the results: only so do the bounds checks go.
    let ([a0, a1, a2], [b0, b1, b2]) = (value_i, value_j);
    let ([e0, e1, e2], [f0, f1, f2]) = (e_i, e_j);
    let (a0, a1, a2, b0, b1, b2) = (&a0[..n], &a1[..n], &a2[..n], &b0[..n], &b1[..n], &b2[..n]);
    let (e0, e1, e2, f0, f1, f2) = (&e0[..n], &e1[..n], &e2[..n], &f0[..n], &f1[..n], &f2[..n]);
    for x in 0..n {
        let (s0, s1, s2) = (e0[x] + f0[x], e1[x] + f1[x], e2[x] + f2[x]);
        // One division, which is slow, in place of three.
        let inverse = 1.0 / (s0 * s1 * s2);
        let (r0, r1, r2) = (inverse * (s1 * s2), inverse * (s0 * s2), inverse * (s0 * s1));
        let (d0, d1, d2) = (a0[x] - b0[x], a1[x] - b1[x], a2[x] - b2[x]);
        let sum = (k2 * d0 * d0 + (1.0 - smaller(e0[x], f0[x]))) * r0
            + (k2 * d1 * d1 + (1.0 - smaller(e1[x], f1[x]))) * r1
            + (k2 * d2 * d2 + (1.0 - smaller(e2[x], f2[x]))) * r2;
        p[x] = smaller(sum, LARGEST_TERM);
        q[x] = e0[x] * r0 + e1[x] * r1 + e2[x] * r2;
    }
}

/// The smaller of two numbers in one instruction: `f32::min` spends more on values that are none.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Replaces a row in a sum of rows.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn replace(new: &[f32], old: &mut [f32], sum: &mut [f32]) {
    let n = new.len();
    let (old, sum) = (&mut old[..n], &mut sum[..n]);
    for x in 0..n {
        sum[x] += new[x] - old[x];
    }
    old.copy_from_slice(new);
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn add_squared_difference(i: &[f32], j: &[f32], sum: &mut [f32]) {
    let n = sum.len();
    let (i, j) = (&i[..n], &j[..n]);
    for x in 0..n {
        let d = i[x] - j[x];
        sum[x] += d * d;
    }
}

/// From patch sums to exponents.
#[derive(Clone, Copy)]
struct Exponents {
    scale: f32,
    terms: f32,
    feature_gain: f32,
    cautious: bool,
}

/// Turns column sums into the weights of both directions; `w_ij` holds the squared feature
/// difference on entry.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn to_weights<const PATCH: usize>(
    exponents: Exponents,
    p: &[f32],
    q: &[f32],
    w_ij: &mut [f32],
    w_ji: &mut [f32],
) {
    let n = w_ij.len();
    let w_ji = &mut w_ji[..n];
    let (p, q) = (&p[..n + 2 * PATCH], &q[..n + 2 * PATCH]);
    let Exponents { scale, terms, feature_gain, cautious } = exponents;
    for x in 0..n {
        let (mut sum_p, mut sum_q) = (0.0, 0.0);
        for t in 0..2 * PATCH + 1 {
            sum_p += p[x + t];
            sum_q += q[x + t];
        }
        let feature = feature_gain * w_ij[x];
        let d_ij = ((sum_p - sum_q) * scale).max(0.0);
        let d_ji = ((sum_p + sum_q - terms) * scale).max(0.0);
        let larger = d_ij.max(d_ji);
        w_ij[x] = exp_negative(if cautious { larger } else { d_ij } + feature);
        w_ji[x] = exp_negative(if cautious { larger } else { d_ji } + feature);
    }
}

#[cfg(test)]
mod tests;
