//! One row of the pixel-statistics store, which takes samples in.

mod bytes;
mod merge;
mod pixel_block;

pub use bytes::RowError;
pub(super) use bytes::{MOMENTS_BYTES, Selection};
pub use pixel_block::{LARGEST_VALUE, PIXEL_BLOCK, PixelBlockValues};

use std::ops::Range;

use super::block::Group;
use super::layout::Layout;
use super::moments::{Moments, round_deviations};
use super::part::Part;
use super::reservoir;
use pixel_block::CACHE_LINE;

/// The statistics of one row of pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    width: usize,
    /// Offset from one dimension to the next in `HalfRow`: the pixels of all blocks and one cache line,
    /// so that the dimensions of a pixel do not compete for the same cache sets. Elements behind the
    /// last pixel stay 0.
    stride: usize,
    dims: usize,
    /// Dimensions whose values must be non-negative.
    radiance: Vec<usize>,
    capacity: usize,
    /// Index of each pixel's next sample: the number of samples taken, rejected ones included.
    pub(super) next_index: Vec<u32>,
    pub(super) rejected: Vec<u32>,
    pub(super) halves: [HalfRow; 2],
    /// Sample vectors, `[pixel][slot][dimension]`.
    pub(super) reservoir: Vec<f32>,
    /// Keys of the pixels' reservoirs; empty without reservoirs.
    pub(super) keys: Vec<u64>,
}

/// Moments of one half of the samples.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct HalfRow {
    /// Number of valid samples, `[pixel]`.
    pub(super) count: Vec<u32>,
    /// `[dimension][pixel]`.
    pub(super) mean: Vec<f64>,
    /// Sums of squared deviations from the mean, `[dimension][pixel]`, rounded at random.
    pub(super) m2: Vec<f32>,
}

impl HalfRow {
    /// Moments of element `i` of the planes, which is of pixel `x`.
    #[inline]
    fn moments(&self, x: usize, i: usize) -> Moments {
        Moments { count: self.count[x], mean: self.mean[i], m2: f64::from(self.m2[i]) }
    }

    /// Replaces mean and deviations of element `i`.
    #[inline]
    fn set(&mut self, i: usize, moments: Moments) {
        (self.mean[i], self.m2[i]) = (moments.mean, round_deviations(moments.m2, moments.mean));
    }
}

impl Row {
    /// Some columns of row `y` of an image, without samples; see [`Store::new`](super::Store::new).
    pub(super) fn new(columns: Range<usize>, y: usize, layout: &Layout, capacity: usize, seed: u64) -> Self {
        let (width, dims) = (columns.len(), layout.len());
        let blocks = width.next_multiple_of(PIXEL_BLOCK);
        let stride = blocks + CACHE_LINE;
        let half = || HalfRow {
            count: vec![0; blocks],
            mean: vec![0.0; stride * dims],
            m2: vec![0.0; stride * dims],
        };
        let keyed = if capacity > 0 { columns } else { 0..0 };
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
            next_index: vec![0; blocks],
            rejected: vec![0; blocks],
            halves: [half(), half()],
            reservoir: vec![0.0; width * capacity * dims],
            keys: keyed.map(|x| reservoir::key(seed, x, y)).collect(),
        }
    }

    /// Forgets all samples.
    pub(super) fn clear(&mut self) {
        self.next_index.fill(0);
        self.rejected.fill(0);
        for half in &mut self.halves {
            half.count.fill(0);
            half.mean.fill(0.0);
            half.m2.fill(0.0);
        }
        self.reservoir.fill(0.0);
    }

    /// Index of the pixel's next sample.
    pub fn next_index(&self, x: usize) -> u32 {
        self.next_index[x]
    }

    /// Adds a pixel's next samples, in the order of their indices. `samples` is a concatenation of
    /// sample vectors. See [`Self::push_block`].
    ///
    /// # Panics
    /// If the row has no pixel `x`.
    pub fn push(&mut self, x: usize, samples: &[f32]) {
        assert!(x < self.width, "pixel {x} of a row of {}", self.width);
        let lane = x % PIXEL_BLOCK;
        let mut values = vec![[0.0; PIXEL_BLOCK]; self.dims];
        for sample in samples.chunks_exact(self.dims) {
            values.iter_mut().zip(sample).for_each(|(lanes, &value)| lanes[lane] = value);
            self.push_block(x / PIXEL_BLOCK, 1 << lane, &values);
        }
    }

    /// Adds the next sample of some of the [`PIXEL_BLOCK`] pixels from `PIXEL_BLOCK * block` on: those
    /// whose bit is set in `present`. A sample with a value that is not finite or larger than
    /// [`LARGEST_VALUE`], or with negative radiance, is counted as rejected and changes no statistic;
    /// its index is used up. Returns the pixels whose samples were rejected, a bit each.
    pub fn push_block(&mut self, block: usize, present: u32, values: &PixelBlockValues) -> u32 {
        let first = block * PIXEL_BLOCK;
        let valid = pixel_block::valid_lanes(values, &self.radiance);
        let mut weights = [[0.0; PIXEL_BLOCK]; 2];
        let mut rejected = 0;
        for lane in (0..PIXEL_BLOCK).filter(|lane| present >> lane & 1 == 1) {
            let x = first + lane;
            let index = self.next_index[x];
            // Samples beyond the range of the counter are ignored.
            let Some(next) = index.checked_add(1) else { continue };
            self.next_index[x] = next;
            if valid >> lane & 1 == 0 {
                self.rejected[x] += 1;
                rejected |= 1 << lane;
                continue;
            }
            self.push_to_reservoir(x, values.iter().map(|lanes| lanes[lane]));
            let half = index as usize & 1;
            let count = &mut self.halves[half].count[x];
            *count += 1;
            weights[half][lane] = 1.0 / f64::from(*count);
        }
        for (half, weights) in self.halves.iter_mut().zip(&weights) {
            if weights.iter().any(|&weight| weight > 0.0) {
                let (means, m2s) = (&mut half.mean[first..], &mut half.m2[first..]);
                pixel_block::update(means, m2s, self.stride, values, weights);
            }
        }
        rejected
    }

    /// Replaces the statistics of pixels from `at` on by those of a selection of a row with the same layout and capacity.
    pub(super) fn copy_pixels(&mut self, at: usize, from: &Self, selection: &Selection) {
        let Selection { pixels, dims, reservoir } = selection.clone();
        let to = at..at + pixels.len();
        self.next_index[to.clone()].copy_from_slice(&from.next_index[pixels.clone()]);
        self.rejected[to.clone()].copy_from_slice(&from.rejected[pixels.clone()]);
        for (half, other) in self.halves.iter_mut().zip(&from.halves) {
            half.count[to.clone()].copy_from_slice(&other.count[pixels.clone()]);
            for dim in dims.clone() {
                let (at, source) = (dim * self.stride + to.start, dim * from.stride + pixels.start);
                let (to, source) = (at..at + pixels.len(), source..source + pixels.len());
                half.mean[to.clone()].copy_from_slice(&other.mean[source.clone()]);
                half.m2[to].copy_from_slice(&other.m2[source]);
            }
        }
        if reservoir > 0 {
            self.keys[to.clone()].copy_from_slice(&from.keys[pixels.clone()]);
            self.reservoir[to.start * reservoir..to.end * reservoir]
                .copy_from_slice(&from.reservoir[pixels.start * reservoir..pixels.end * reservoir]);
        }
    }

    /// Gives half of a pixel without samples the moments of `count` samples; `values` has the mean and the unbiased variance
    /// of each dimension.
    pub(super) fn set_half(
        &mut self,
        x: usize,
        half: usize,
        count: u32,
        values: impl Iterator<Item = (f32, f32)>,
    ) {
        self.next_index[x] += count;
        let half = &mut self.halves[half];
        half.count[x] = count;
        for (dim, (mean, variance)) in values.enumerate() {
            let m2 = f64::from(variance) * f64::from(count.saturating_sub(1));
            half.set(dim * self.stride + x, Moments { count, mean: f64::from(mean), m2 });
        }
    }

    /// Sample counts of a half, and means and sums of squared deviations of one dimension, pixel by pixel.
    pub(super) fn half(&self, half: usize, dim: usize) -> (&[u32], &[f64], &[f32]) {
        let half = &self.halves[half];
        let span = dim * self.stride..dim * self.stride + self.width;
        (&half.count[..self.width], &half.mean[span.clone()], &half.m2[span])
    }

    /// The means and sums of squared deviations of both halves.
    pub(super) fn halves_mut(&mut self, dim: usize) -> [(&mut [f64], &mut [f32]); 2] {
        let span = dim * self.stride..dim * self.stride + self.width;
        self.halves.each_mut().map(|half| (&mut half.mean[span.clone()], &mut half.m2[span.clone()]))
    }

    /// Sets the sample counts of the halves, which have none.
    pub(super) fn set_counts(&mut self, of: impl Fn(usize) -> [u32; 2]) {
        for x in 0..self.width {
            let counts = of(x);
            self.halves.iter_mut().zip(counts).for_each(|(half, count)| half.count[x] = count);
            self.next_index[x] = counts[0] + counts[1];
        }
    }

    /// Number of valid samples of a pixel.
    #[inline]
    pub fn count(&self, x: usize, part: Part) -> u32 {
        match part {
            Part::Half(h) => self.halves[h].count[x],
            Part::Whole => self.halves[0].count[x] + self.halves[1].count[x],
        }
    }

    /// Number of rejected samples of a pixel.
    pub fn rejected(&self, x: usize) -> u32 {
        self.rejected[x]
    }

    /// Moments of one dimension of a pixel.
    #[inline]
    pub fn moments(&self, x: usize, dim: usize, part: Part) -> Moments {
        let i = dim * self.stride + x;
        let [a, b] = &self.halves;
        match part {
            Part::Half(h) => self.halves[h].moments(x, i),
            Part::Whole => a.moments(x, i).merge(b.moments(x, i)),
        }
    }

    /// Writes a function of the moments of one dimension, in a loop over pixels that becomes vector code.
    #[inline]
    pub(super) fn read(&self, dim: usize, part: Part, out: &mut [f32], value: impl Fn(Moments) -> f32) {
        let width = out.len();
        let span = dim * self.stride..dim * self.stride + width;
        let [a, b] = self
            .halves
            .each_ref()
            .map(|half| (&half.count[..width], &half.mean[span.clone()], &half.m2[span.clone()]));
        let at = |half: (&[u32], &[f64], &[f32]), x: usize| Moments {
            count: half.0[x],
            mean: half.1[x],
            m2: f64::from(half.2[x]),
        };
        let pixels = out.iter_mut().enumerate();
        match part {
            Part::Half(h) => {
                let half = [a, b][h];
                pixels.for_each(|(x, out)| *out = value(at(half, x)));
            }
            Part::Whole => pixels.for_each(|(x, out)| *out = value(at(a, x).merge(at(b, x)))),
        }
    }

    /// Reads the means of both halves and the unbiased variance of all samples of one dimension, in a
    /// loop over pixels without branches.
    pub(super) fn read_halves(
        &self,
        dim: usize,
        mean_a: &mut [f32],
        mean_b: &mut [f32],
        variance: &mut [f32],
    ) {
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
            let m2 = f64::from(s_a[x]) + f64::from(s_b[x]) + d * d * (n * k) / (n + k).max(1.0);
            mean_a[x] = m_a[x] as f32;
            mean_b[x] = m_b[x] as f32;
            variance[x] = (m2 / (n + k - 1.0).max(1.0)) as f32;
        }
    }

    /// Number of sample vectors in a pixel's reservoir.
    #[inline]
    pub fn reservoir_len(&self, x: usize) -> usize {
        (self.count(x, Part::Whole) as usize).min(self.capacity)
    }

    /// The sample vectors in a pixel's reservoir, concatenated: a uniform choice among its valid samples.
    #[inline]
    pub fn reservoir(&self, x: usize) -> &[f32] {
        &self.reservoir[x * self.capacity * self.dims..][..self.reservoir_len(x) * self.dims]
    }

    /// Offers the pixel's next valid sample to its reservoir.
    #[inline]
    fn push_to_reservoir(&mut self, x: usize, sample: impl Iterator<Item = f32>) {
        if self.capacity == 0 {
            return;
        }
        let index = self.count(x, Part::Whole);
        if let Some(slot) = reservoir::slot(self.keys[x], index, self.capacity) {
            let start = (x * self.capacity + slot) * self.dims;
            self.reservoir[start..][..self.dims].iter_mut().zip(sample).for_each(|(to, from)| *to = from);
        }
    }
}
