//! The patch-distance filter: non-local means with a distance normalised by variance, in which
//! one half of the samples decides the weights of the other half.
//!
//! Source: the distance of Rousselle, Knaus and Zwicker (2012, eq. 3, with their variance
//! cancellation), cross-filtered between two sample buffers as there. For pixels i and j,
//!
//! d_ij = mean over 3 channels and the patch of (Δ² − v_i − min(v_i, v_j)) / (ε + k²(v_i + v_j)),
//! w_ij = exp(−max(0, d_ij) − Σ_f s (f_i − f_j)²).
//!
//! With e = k²v + ε/2 and r = 1/(e_i + e_j) the patch sums P = Σ(k²Δ² + ε − min e)·r and Q = Σ e_i·r
//! give both directions, k²d_ij ∝ P − Q and k²d_ji ∝ P + Q − (number of terms), so each pair of
//! pixels is looked at once.

use multiversion::multiversion;
use rayon::prelude::*;

use super::fast_exp::exp_negative;
use super::margin::{Margin, Padded};
use crate::image::Planes;

/// Half side of the 7×7 patch.
const PATCH: usize = 3;
const PATCH_SIDE: usize = 2 * PATCH + 1;
/// Terms in a patch distance.
const TERMS: f32 = (3 * PATCH_SIDE * PATCH_SIDE) as f32;
/// Bound of one pixel's contribution to a patch sum. Larger ones mean weight zero anyway, and
/// would cost the running sums their digits.
const LARGEST_TERM: f32 = 3000.0;
/// Tile in pixels: its rows of scratch fit the first-level cache.
const TILE_WIDTH: usize = 256;
const TILE_HEIGHT: usize = 64;
/// In the margin of the feature planes: so far from any feature that the weight vanishes.
const OUTSIDE: f32 = 1e3;

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
pub(super) struct PatchSettings {
    /// Radius of the disc of neighbours, in pixels.
    pub radius: usize,
    /// Sensitivity: differences of k standard deviations begin to count.
    pub k: f32,
    /// Added to the variances, in squared units of the guide.
    pub epsilon: f32,
    /// Both pixels of a pair take the smaller weight of the two, and a pixel without variance keeps
    /// its value. Right for what has hard edges and is either there or not, such as an emitter; wrong
    /// for radiance, where no variance may mean that none of few samples found the light.
    pub cautious: bool,
}

/// Weighted means of three value planes.
pub(super) struct PatchFiltered {
    /// 3 planes.
    pub value: Planes,
    /// Weight of a pixel's own value in its result, in (0, 1].
    pub own_weight: Vec<f32>,
}

/// The guide with its margins.
struct Prepared {
    value: Padded,
    /// e = k²v + ε/2.
    e: Padded,
    features: Padded,
    feature_gain: f32,
}

/// Filters `original` with weights from `guide`. All planes have `width`×`height` finite values.
pub(super) fn filter(
    width: usize,
    height: usize,
    original: [&[f32]; 3],
    guide: Guide,
    settings: PatchSettings,
) -> PatchFiltered {
    let mut filtered =
        PatchFiltered { value: Planes::new(width, height, 3), own_weight: vec![1.0; width * height] };
    if width == 0 || height == 0 {
        return filtered;
    }
    let margin = settings.radius + PATCH;
    let prepared = prepare(width, height, guide, settings, margin);
    let values = Padded::new(width, height, &original, margin, Margin::Nearest);

    let tiles: Vec<Tile> = tiles(width, height).collect();
    let sums: Vec<Sums> = tiles.par_iter().map(|tile| tile.filter(&prepared, &values, settings)).collect();
    for (tile, sums) in tiles.iter().zip(&sums) {
        for row in 0..tile.height {
            let start = (tile.y + row) * width + tile.x;
            let weights = sums.row(3, row);
            for channel in 0..3 {
                let out = &mut filtered.value.plane_mut(channel)[start..][..tile.width];
                for ((out, &sum), &weight) in out.iter_mut().zip(sums.row(channel, row)).zip(weights) {
                    *out = sum / weight;
                }
            }
            for (out, &weight) in filtered.own_weight[start..][..tile.width].iter_mut().zip(weights) {
                *out = 1.0 / weight;
            }
        }
    }
    if settings.cautious {
        restore_certain(&mut filtered, original, guide.variance);
    }
    filtered
}

fn restore_certain(filtered: &mut PatchFiltered, original: [&[f32]; 3], variance: [&[f32]; 3]) {
    for i in (0..filtered.own_weight.len()).filter(|&i| variance.iter().all(|v| v[i] == 0.0)) {
        (0..3).for_each(|channel| filtered.value.plane_mut(channel)[i] = original[channel][i]);
        filtered.own_weight[i] = 1.0;
    }
}

fn prepare(width: usize, height: usize, guide: Guide, settings: PatchSettings, margin: usize) -> Prepared {
    let k2 = settings.k * settings.k;
    let e = guide.variance.map(|v| v.iter().map(|v| k2 * v + 0.5 * settings.epsilon).collect::<Vec<_>>());
    // Without features there is still one plane: it keeps the margin out.
    let inside = vec![0.0; width * height];
    let features = if guide.features.is_empty() { &[inside.as_slice()] } else { guide.features };
    Prepared {
        value: Padded::new(width, height, &guide.value, margin, Margin::Nearest),
        e: Padded::new(width, height, &[&e[0], &e[1], &e[2]], margin, Margin::Nearest),
        features: Padded::new(width, height, features, margin, Margin::Value(OUTSIDE)),
        feature_gain: guide.feature_gain.max(1e-3),
    }
}

/// Half of the offsets of a disc: of each pair ±o the one that comes later in reading order.
fn half_disc(radius: usize) -> impl Iterator<Item = (isize, isize)> {
    let r = radius as isize;
    (0..=r)
        .flat_map(move |dy| (-r..=r).map(move |dx| (dx, dy)))
        .filter(move |&(dx, dy)| dx * dx + dy * dy <= r * r && (dy > 0 || dx > 0))
}

fn tiles(width: usize, height: usize) -> impl Iterator<Item = Tile> {
    let starts = move |y| (0..width).step_by(TILE_WIDTH).map(move |x| (x, y));
    (0..height).step_by(TILE_HEIGHT).flat_map(starts).map(move |(x, y)| Tile {
        x,
        y,
        width: TILE_WIDTH.min(width - x),
        height: TILE_HEIGHT.min(height - y),
    })
}

/// Weighted sums of a tile: three channels and the weights.
struct Sums {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

impl Sums {
    fn row(&self, plane: usize, y: usize) -> &[f32] {
        &self.data[(plane * self.height + y) * self.width..][..self.width]
    }

    /// A row of all four planes.
    fn rows_mut(&mut self, y: usize) -> [&mut [f32]; 4] {
        let width = self.width;
        let mut planes = self.data.chunks_exact_mut(width * self.height);
        std::array::from_fn(|_| &mut planes.next().expect("four planes")[y * width..][..width])
    }
}

/// Rows of scratch for one offset, each wide enough for a tile, an offset and a patch.
struct Scratch {
    /// P and Q of the last [`PATCH_SIDE`] rows.
    ring: Vec<[Vec<f32>; 2]>,
    /// Their sums over these rows.
    columns: [Vec<f32>; 2],
    /// Weights of j for i, and of i for j.
    weights: [Vec<f32>; 2],
}

impl Scratch {
    fn new(length: usize) -> Self {
        let pair = || [vec![0.0; length], vec![0.0; length]];
        Self { ring: (0..PATCH_SIDE).map(|_| pair()).collect(), columns: pair(), weights: pair() }
    }

    fn clear(&mut self) {
        self.ring.iter_mut().flatten().chain(&mut self.columns).for_each(|row| row.fill(0.0));
    }
}

#[derive(Clone, Copy)]
struct Tile {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

impl Tile {
    fn filter(&self, guide: &Prepared, values: &Padded, settings: PatchSettings) -> Sums {
        let mut sums =
            Sums { width: self.width, height: self.height, data: vec![0.0; 4 * self.width * self.height] };
        // A pixel's own value has weight one.
        for y in 0..self.height {
            let [r, g, b, weight] = sums.rows_mut(y);
            for (channel, sum) in [r, g, b].into_iter().enumerate() {
                let (x, y) = (self.x as isize, (self.y + y) as isize);
                sum.copy_from_slice(values.span(channel, x, y, self.width));
            }
            weight.fill(1.0);
        }
        if !self.is_noisy(guide, settings) {
            return sums;
        }
        let mut scratch = Scratch::new(self.width + settings.radius + 2 * PATCH);
        for offset in half_disc(settings.radius) {
            self.add_offset(guide, values, settings, offset, &mut scratch, &mut sums);
        }
        sums
    }

    /// Whether any pixel of the tile has a variance; one without is exact as it is.
    fn is_noisy(&self, guide: &Prepared, settings: PatchSettings) -> bool {
        let noiseless = 0.5 * settings.epsilon;
        let row = |c, y: usize| guide.e.span(c, self.x as isize, (self.y + y) as isize, self.width);
        (0..3).any(|c| (0..self.height).any(|y| row(c, y).iter().any(|&e| e > noiseless)))
    }

    /// Adds, for every pair (i, i + offset), each pixel's share in the other's sums.
    fn add_offset(
        &self,
        guide: &Prepared,
        values: &Padded,
        settings: PatchSettings,
        offset: (isize, isize),
        scratch: &mut Scratch,
        sums: &mut Sums,
    ) {
        let (dx, dy) = offset;
        let (x0, y0) = (self.x as isize, self.y as isize);
        let (x1, y1) = (x0 + self.width as isize, y0 + self.height as isize);
        // The pixels i for which i or j lies in the tile.
        let (left, right) = (x0.min(x0 - dx), x1.max(x1 - dx));
        let length = (right - left) as usize;
        let patch = PATCH as isize;
        let wide = length + 2 * PATCH;
        let k2 = settings.k * settings.k;
        scratch.clear();
        for y in y0 - dy - patch..y1 + patch {
            let x = left - patch;
            let slot = (y - (y0 - dy - patch)) as usize % PATCH_SIDE;
            add_terms(
                Constants { k2, epsilon: settings.epsilon },
                std::array::from_fn(|c| guide.value.span(c, x, y, wide)),
                std::array::from_fn(|c| guide.value.span(c, x + dx, y + dy, wide)),
                std::array::from_fn(|c| guide.e.span(c, x, y, wide)),
                std::array::from_fn(|c| guide.e.span(c, x + dx, y + dy, wide)),
                &mut scratch.ring[slot],
                &mut scratch.columns,
            );
            // The patch around row `y - PATCH` is complete once its last row is in.
            let y = y - patch;
            if y < y0 - dy {
                continue;
            }
            let [w_ij, w_ji] = &mut scratch.weights;
            let (w_ij, w_ji) = (&mut w_ij[..length], &mut w_ji[..length]);
            w_ij.fill(0.0);
            for f in 0..guide.features.count() {
                let i = guide.features.span(f, left, y, length);
                let j = guide.features.span(f, left + dx, y + dy, length);
                add_squared_difference(i, j, w_ij);
            }
            let [p, q] = &scratch.columns;
            to_weights(k2, settings.cautious, guide.feature_gain, &p[..wide], &q[..wide], w_ij, w_ji);
            if y >= y0 {
                let from = std::array::from_fn(|c| values.span(c, x0 + dx, y + dy, self.width));
                let weights = &w_ij[(x0 - left) as usize..][..self.width];
                accumulate(weights, from, sums.rows_mut((y - y0) as usize));
            }
            if y + dy < y1 {
                let from = std::array::from_fn(|c| values.span(c, x0 - dx, y, self.width));
                let weights = &w_ji[(x0 - dx - left) as usize..][..self.width];
                accumulate(weights, from, sums.rows_mut((y + dy - y0) as usize));
            }
        }
    }
}

#[derive(Clone, Copy)]
struct Constants {
    k2: f32,
    epsilon: f32,
}

/// Puts a row's P and Q into the ring's oldest slot, and keeps the column sums current.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn add_terms(
    constants: Constants,
    value_i: [&[f32]; 3],
    value_j: [&[f32]; 3],
    e_i: [&[f32]; 3],
    e_j: [&[f32]; 3],
    ring: &mut [Vec<f32>; 2],
    columns: &mut [Vec<f32>; 2],
) {
    let n = value_i[0].len();
    let Constants { k2, epsilon } = constants;
    let (a, b, e, f) =
        (value_i.map(|r| &r[..n]), value_j.map(|r| &r[..n]), e_i.map(|r| &r[..n]), e_j.map(|r| &r[..n]));
    let [ring_p, ring_q] = ring;
    let (ring_p, ring_q) = (&mut ring_p[..n], &mut ring_q[..n]);
    let [column_p, column_q] = columns;
    let (column_p, column_q) = (&mut column_p[..n], &mut column_q[..n]);
    for x in 0..n {
        let (mut p, mut q) = (0.0, 0.0);
        for c in 0..3 {
            let d = a[c][x] - b[c][x];
            let (e, f) = (e[c][x], f[c][x]);
            let r = 1.0 / (e + f);
            p += (k2 * d * d + (epsilon - e.min(f))) * r;
            q += e * r;
        }
        let p = p.min(LARGEST_TERM);
        column_p[x] += p - ring_p[x];
        column_q[x] += q - ring_q[x];
        ring_p[x] = p;
        ring_q[x] = q;
    }
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

/// Turns column sums into the weights of both directions; `w_ij` holds the squared feature
/// difference on entry.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn to_weights(
    k2: f32,
    cautious: bool,
    feature_gain: f32,
    p: &[f32],
    q: &[f32],
    w_ij: &mut [f32],
    w_ji: &mut [f32],
) {
    let n = w_ij.len();
    let w_ji = &mut w_ji[..n];
    let (p, q) = (&p[..n + 2 * PATCH], &q[..n + 2 * PATCH]);
    let scale = 1.0 / (k2 * TERMS);
    for x in 0..n {
        let (mut sum_p, mut sum_q) = (0.0, 0.0);
        for t in 0..PATCH_SIDE {
            sum_p += p[x + t];
            sum_q += q[x + t];
        }
        let feature = feature_gain * w_ij[x];
        let d_ij = ((sum_p - sum_q) * scale).max(0.0);
        let d_ji = ((sum_p + sum_q - TERMS) * scale).max(0.0);
        let larger = d_ij.max(d_ji);
        w_ij[x] = exp_negative(if cautious { larger } else { d_ij } + feature);
        w_ji[x] = exp_negative(if cautious { larger } else { d_ji } + feature);
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn accumulate(weights: &[f32], values: [&[f32]; 3], sums: [&mut [f32]; 4]) {
    let n = weights.len();
    let [r, g, b] = values.map(|v| &v[..n]);
    let [sum_r, sum_g, sum_b, sum] = sums.map(|s| &mut s[..n]);
    for x in 0..n {
        let w = weights[x];
        sum_r[x] += w * r[x];
        sum_g[x] += w * g[x];
        sum_b[x] += w * b[x];
        sum[x] += w;
    }
}
