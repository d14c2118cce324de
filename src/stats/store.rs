//! The pixel-statistics store.

mod block;
mod bytes;

pub use block::{BLOCK, BlockValues};
pub use bytes::RowError;

use rayon::prelude::*;

use super::moments::Moments;
use super::{Group, Layout, reservoir};
use crate::image::Planes;

/// Largest magnitude of a sample's values. Filters work with variances and sums of squares as `f32`, which
/// hold squares up to 10³⁸; nothing in a picture is near it.
pub const LARGEST_VALUE: f32 = 1e15;

/// `f64` numbers in a cache line.
const CACHE_LINE: usize = 8;

/// Which samples of a pixel are meant. The halves are the samples of even and of odd index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Whole,
    /// 0 or 1.
    Half(usize),
}

/// Statistics of every pixel of an image, current after every sample.
///
/// Kept as rows so that a renderer can fill rows in parallel; within a row as planes, one for each
/// dimension.
#[derive(Clone, Debug)]
pub struct Store {
    width: usize,
    layout: Layout,
    capacity: usize,
    rows: Vec<Row>,
}

/// One row of the store. Sample vectors are pushed into it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    width: usize,
    /// Pixels from one dimension to the next: all blocks, and then a cache line, so that the
    /// dimensions of one pixel do not compete for the same cache sets. What lies behind the last pixel stays 0.
    stride: usize,
    dims: usize,
    /// Dimensions whose values must be non-negative.
    radiance: Vec<usize>,
    capacity: usize,
    /// Indices drawn per pixel, rejected ones included: the address of the pixel's next sample.
    drawn: Vec<u32>,
    rejected: Vec<u32>,
    halves: [HalfRow; 2],
    /// `[pixel][slot][dimension]`.
    reservoir: Vec<f32>,
    keys: Vec<u64>,
}

/// Moments of one half of the samples, `[dimension][pixel]`.
#[derive(Clone, Debug, PartialEq)]
struct HalfRow {
    count: Vec<u32>,
    mean: Vec<f64>,
    m2: Vec<f64>,
}

impl Store {
    /// An empty store. `capacity` is how many whole sample vectors the reservoir keeps per pixel;
    /// `seed` decides which.
    pub fn new(width: usize, height: usize, layout: Layout, capacity: usize, seed: u64) -> Self {
        let rows = (0..height).into_par_iter().map(|y| Row::new(width, y, &layout, capacity, seed)).collect();
        Self { width, layout, capacity, rows }
    }

    /// Bytes that a store needs per pixel.
    pub fn bytes_per_pixel(layout: &Layout, capacity: usize) -> usize {
        let moments = 2 * (size_of::<u32>() + layout.len() * 2 * size_of::<f64>());
        let bookkeeping = 2 * size_of::<u32>() + size_of::<u64>();
        moments + bookkeeping + capacity * layout.len() * size_of::<f32>()
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.rows.len()
    }

    pub fn pixels(&self) -> usize {
        self.width * self.height()
    }

    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Sample vectors kept per pixel at most.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Bytes of the sample vectors that are kept whole.
    pub fn reservoir_bytes(&self) -> u64 {
        let kept = |row: &Row| (0..self.width).map(|x| size_of_val(row.reservoir(x)) as u64).sum::<u64>();
        self.rows.iter().map(kept).sum()
    }

    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// A store of some of the rows, in the order given.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn of_rows(&self, rows: impl IntoIterator<Item = usize>) -> Self {
        let rows = rows.into_iter().map(|y| self.rows[y].clone()).collect();
        Self { width: self.width, layout: self.layout.clone(), capacity: self.capacity, rows }
    }

    /// The rows, to be filled in parallel.
    pub fn rows_mut(&mut self) -> &mut [Row] {
        &mut self.rows
    }

    /// Takes in samples of one pixel, see [`Row::push`].
    pub fn push(&mut self, x: usize, y: usize, samples: &[f32]) {
        self.rows[y].push(x, samples);
    }

    /// Adds another store's samples. The streams must be independent (other seeds) or disjoint.
    ///
    /// # Panics
    /// If sizes, layouts or capacities differ, or a pixel would have more samples than can be counted.
    pub fn merge(&mut self, other: &Self) {
        assert!(
            self.width == other.width
                && self.rows.len() == other.rows.len()
                && self.layout == other.layout
                && self.capacity == other.capacity,
            "only stores of the same shape can be merged"
        );
        self.rows.par_iter_mut().zip(&other.rows).for_each(|(a, b)| a.merge(b));
    }

    /// Accepted samples per pixel.
    pub fn counts(&self, part: Part) -> Vec<u32> {
        self.rows.iter().flat_map(|row| (0..self.width).map(move |x| row.count(x, part))).collect()
    }

    /// Accepted samples of the whole image.
    pub fn samples(&self) -> u64 {
        self.sum(|row| row.halves.iter().flat_map(|half| &half.count).map(|&n| u64::from(n)).sum())
    }

    /// Samples of the whole image, rejected ones included.
    pub fn drawn(&self) -> u64 {
        self.sum(|row| row.drawn.iter().map(|&n| u64::from(n)).sum())
    }

    /// Samples of each pixel, rejected ones included: the addresses of their next ones.
    pub fn next_indices(&self) -> Vec<u32> {
        self.rows.iter().flat_map(|row| &row.drawn[..self.width]).copied().collect()
    }

    fn sum(&self, of_row: impl Fn(&Row) -> u64 + Send + Sync) -> u64 {
        self.rows.par_iter().map(of_row).sum()
    }

    /// Samples rejected because a value was not finite or too large, or a radiance negative.
    pub fn rejected(&self) -> u64 {
        self.rows.iter().flat_map(|row| &row.rejected).map(|&n| u64::from(n)).sum()
    }

    /// Means of some dimensions, a plane for each; 0 where there is no sample.
    pub fn means(&self, part: Part, dims: impl IntoIterator<Item = usize>) -> Planes {
        self.extract(part, dims, |m| m.mean)
    }

    /// Unbiased variances *of the samples* (divide by the count for that of the mean), a plane for
    /// each of the dimensions; 0 where there are fewer than two samples.
    pub fn variances(&self, part: Part, dims: impl IntoIterator<Item = usize>) -> Planes {
        self.extract(part, dims, Moments::variance)
    }

    /// What a filter that works on halves reads of some dimensions, in one go: the means of both
    /// halves, and the unbiased variance of the samples of the whole.
    pub fn halves(&self, dims: std::ops::Range<usize>) -> ([Planes; 2], Planes) {
        let planes = || Planes::new(self.width, self.height(), dims.len());
        let (mut a, mut b, mut variance) = (planes(), planes(), planes());
        let width = self.width.max(1);
        let each = a.planes_mut().zip(b.planes_mut()).zip(variance.planes_mut()).zip(dims.clone());
        for (((a, b), variance), dim) in each {
            let rows =
                a.par_chunks_mut(width).zip(b.par_chunks_mut(width)).zip(variance.par_chunks_mut(width));
            rows.zip(&self.rows).for_each(|(((a, b), variance), row)| row.read_halves(dim, a, b, variance));
        }
        ([a, b], variance)
    }

    /// One plane: accepted samples of each pixel.
    pub fn count_plane(&self) -> Planes {
        let mut plane = Planes::new(self.width, self.height(), 1);
        plane.data_mut().iter_mut().zip(self.counts(Part::Whole)).for_each(|(v, n)| *v = n as f32);
        plane
    }

    fn extract(
        &self,
        part: Part,
        dims: impl IntoIterator<Item = usize>,
        value: impl Fn(Moments) -> f64 + Sync,
    ) -> Planes {
        let dims: Vec<usize> = dims.into_iter().collect();
        let mut planes = Planes::new(self.width, self.height(), dims.len());
        let width = self.width.max(1);
        planes.planes_mut().zip(&dims).for_each(|(plane, &dim)| {
            plane.par_chunks_mut(width).zip(&self.rows).for_each(|(out, row)| {
                for (x, out) in out.iter_mut().enumerate() {
                    *out = value(row.moments(x, dim, part)) as f32;
                }
            });
        });
        planes
    }
}

impl Row {
    fn new(width: usize, y: usize, layout: &Layout, capacity: usize, seed: u64) -> Self {
        let dims = layout.len();
        let blocks = width.next_multiple_of(BLOCK);
        let stride = blocks + CACHE_LINE;
        let half = || HalfRow {
            count: vec![0; blocks],
            mean: vec![0.0; stride * dims],
            m2: vec![0.0; stride * dims],
        };
        Self {
            width,
            stride,
            dims,
            radiance: layout
                .dimensions()
                .iter()
                .enumerate()
                .filter_map(|(i, d)| (d.group == Group::Colour).then_some(i))
                .chain(layout.radiance())
                .collect(),
            capacity,
            drawn: vec![0; blocks],
            rejected: vec![0; blocks],
            halves: [half(), half()],
            reservoir: vec![0.0; width * capacity * dims],
            keys: (0..width).map(|x| reservoir::key(seed, x, y)).collect(),
        }
    }

    /// Index of the pixel's next sample.
    pub fn next_index(&self, x: usize) -> u32 {
        self.drawn[x]
    }

    /// Takes in the pixel's next samples, in the order of their indices: `samples` holds whole
    /// sample vectors one after the other. See [`Self::push_block`].
    ///
    /// # Panics
    /// If there is no such pixel.
    pub fn push(&mut self, x: usize, samples: &[f32]) {
        assert!(x < self.width, "pixel {x} of a row of {}", self.width);
        let lane = x % BLOCK;
        let mut values = vec![[0.0; BLOCK]; self.dims];
        for sample in samples.chunks_exact(self.dims) {
            values.iter_mut().zip(sample).for_each(|(lanes, &value)| lanes[lane] = value);
            self.push_block(x / BLOCK, 1 << lane, &values);
        }
    }

    /// Takes in the next sample of some of the [`BLOCK`] pixels from `BLOCK * block` on: those whose bit is
    /// set in `present`. A sample with a value that is not finite or beyond [`LARGEST_VALUE`], or with
    /// negative radiance, is counted as rejected and touches no statistic; its index is used up.
    pub fn push_block(&mut self, block: usize, present: u32, values: &BlockValues) {
        let first = block * BLOCK;
        let sound = block::sound(values, &self.radiance);
        let mut weights = [[0.0; BLOCK]; 2];
        for lane in (0..BLOCK).filter(|lane| present >> lane & 1 == 1) {
            let x = first + lane;
            let index = self.drawn[x];
            // What cannot be counted is not taken in.
            let Some(next) = index.checked_add(1) else { continue };
            self.drawn[x] = next;
            if sound >> lane & 1 == 0 {
                self.rejected[x] += 1;
                continue;
            }
            self.keep(x, values.iter().map(|lanes| lanes[lane]));
            let half = index as usize & 1;
            let count = &mut self.halves[half].count[x];
            *count += 1;
            weights[half][lane] = 1.0 / f64::from(*count);
        }
        for (half, weights) in self.halves.iter_mut().zip(&weights) {
            if weights.iter().any(|&weight| weight > 0.0) {
                block::update(&mut half.mean[first..], &mut half.m2[first..], self.stride, values, weights);
            }
        }
    }

    /// Accepted samples.
    pub fn count(&self, x: usize, part: Part) -> u32 {
        match part {
            Part::Half(h) => self.halves[h].count[x],
            Part::Whole => self.halves[0].count[x] + self.halves[1].count[x],
        }
    }

    /// Samples rejected.
    pub fn rejected(&self, x: usize) -> u32 {
        self.rejected[x]
    }

    /// Moments of one dimension.
    #[inline]
    pub fn moments(&self, x: usize, dim: usize, part: Part) -> Moments {
        let half = |h: usize| {
            let half = &self.halves[h];
            let i = dim * self.stride + x;
            Moments { count: half.count[x], mean: half.mean[i], m2: half.m2[i] }
        };
        match part {
            Part::Half(h) => half(h),
            Part::Whole => half(0).merge(half(1)),
        }
    }

    /// Means of the halves and variance of the whole of one dimension, in a loop over pixels that
    /// has no branches.
    fn read_halves(&self, dim: usize, mean_a: &mut [f32], mean_b: &mut [f32], variance: &mut [f32]) {
        let width = self.width;
        let [a, b] = &self.halves;
        let span = dim * self.stride..dim * self.stride + width;
        let (n_a, n_b) = (&a.count[..width], &b.count[..width]);
        let (m_a, m_b) = (&a.mean[span.clone()], &b.mean[span.clone()]);
        let (s_a, s_b) = (&a.m2[span.clone()], &b.m2[span]);
        let (mean_a, mean_b, variance) = (&mut mean_a[..width], &mut mean_b[..width], &mut variance[..width]);
        for x in 0..width {
            let (n, k) = (f64::from(n_a[x]), f64::from(n_b[x]));
            let d = m_a[x] - m_b[x];
            let m2 = s_a[x] + s_b[x] + d * d * (n * k) / (n + k).max(1.0);
            mean_a[x] = m_a[x] as f32;
            mean_b[x] = m_b[x] as f32;
            variance[x] = (m2 / (n + k - 1.0).max(1.0)) as f32;
        }
    }

    /// Number of sample vectors that are kept of a pixel.
    #[inline]
    pub fn kept(&self, x: usize) -> usize {
        (self.count(x, Part::Whole) as usize).min(self.capacity)
    }

    /// Whole sample vectors kept of a pixel, one after the other: a uniform choice of those seen.
    #[inline]
    pub fn reservoir(&self, x: usize) -> &[f32] {
        &self.reservoir[x * self.capacity * self.dims..][..self.kept(x) * self.dims]
    }

    #[inline]
    fn keep(&mut self, x: usize, sample: impl Iterator<Item = f32>) {
        let seen = self.count(x, Part::Whole);
        if let Some(slot) = reservoir::slot(self.keys[x], seen, self.capacity) {
            let start = (x * self.capacity + slot) * self.dims;
            self.reservoir[start..][..self.dims].iter_mut().zip(sample).for_each(|(to, from)| *to = from);
        }
    }

    fn merge(&mut self, other: &Self) {
        for x in 0..self.width {
            self.merge_reservoir(x, other);
            self.drawn[x] = self.drawn[x].saturating_add(other.drawn[x]);
            self.rejected[x] = self.rejected[x].saturating_add(other.rejected[x]);
        }
        for (h, half) in self.halves.iter_mut().enumerate() {
            let other = &other.halves[h];
            for (dim, x) in (0..self.dims).flat_map(|dim| (0..self.width).map(move |x| (dim, x))) {
                let i = dim * self.stride + x;
                let a = Moments { count: half.count[x], mean: half.mean[i], m2: half.m2[i] };
                let b = Moments { count: other.count[x], mean: other.mean[i], m2: other.m2[i] };
                let m = a.merge(b);
                (half.mean[i], half.m2[i]) = (m.mean, m.m2);
            }
            for (a, b) in half.count.iter_mut().zip(&other.count) {
                *a = a.checked_add(*b).expect("the number of a pixel's samples is a u32");
            }
        }
    }

    /// Fills the reservoir from both, each kept sample standing for an equal share of its stream.
    fn merge_reservoir(&mut self, x: usize, other: &Self) {
        let (mut left_a, mut left_b) =
            (u64::from(self.count(x, Part::Whole)), u64::from(other.count(x, Part::Whole)));
        let (a, b) = (self.reservoir(x).to_vec(), other.reservoir(x));
        let (mut a, mut b) = (a.chunks_exact(self.dims), b.chunks_exact(self.dims));
        let mut merged = Vec::with_capacity(self.capacity * self.dims);
        for slot in 0..self.capacity as u64 {
            let total = left_a + left_b;
            if total == 0 {
                break;
            }
            // Draw without replacement from the union of the streams.
            let from_a = reservoir::hash(self.keys[x] ^ other.keys[x].rotate_left(1) ^ slot) % total < left_a;
            let drawn = if from_a { a.next() } else { b.next() };
            let left = if from_a { &mut left_a } else { &mut left_b };
            *left -= 1;
            merged.extend_from_slice(drawn.expect("a stream keeps all it has, up to the capacity"));
        }
        self.reservoir[x * self.capacity * self.dims..][..merged.len()].copy_from_slice(&merged);
    }
}

#[cfg(test)]
mod tests;
