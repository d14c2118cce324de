//! The pixel-statistics store: moments and a reservoir of samples for every pixel of an image.

use rayon::prelude::*;

use super::layout::Layout;
use super::moments::Moments;
use super::part::Part;
use super::rectangle::Rectangle;
use super::row::{MOMENTS_BYTES, Row};
use crate::image::Planes;

mod rectangles;

/// Statistics of every pixel of an image, current after every sample.
///
/// Stored by row, so that a renderer can fill rows in parallel; within a row as planes, one for each
/// dimension.
#[derive(Clone, Debug)]
pub struct Store {
    width: usize,
    layout: Layout,
    capacity: usize,
    rows: Vec<Row>,
}

impl Store {
    /// An empty store. The reservoir holds up to `capacity` sample vectors of each pixel; `seed`
    /// decides which.
    pub fn new(width: usize, height: usize, layout: Layout, capacity: usize, seed: u64) -> Self {
        Self::for_rectangle(&Rectangle::whole(width, height), layout, capacity, seed)
    }

    /// An empty store of some pixels of an image; see [`Self::new`].
    pub fn for_rectangle(part: &Rectangle, layout: Layout, capacity: usize, seed: u64) -> Self {
        let Rectangle { x: [x0, x1], y: [y0, y1] } = *part;
        let rows = (y0..y1).into_par_iter().map(|y| Row::new(x0..x1, y, &layout, capacity, seed)).collect();
        Self { width: part.width(), layout, capacity, rows }
    }

    /// Forgets all samples. The reservoirs' seed stays.
    pub fn clear(&mut self) {
        self.rows.par_iter_mut().for_each(Row::clear);
    }

    /// Memory of a store in bytes per pixel.
    pub fn bytes_per_pixel(layout: &Layout, capacity: usize) -> usize {
        let moments = layout.len() * MOMENTS_BYTES;
        let key = if capacity > 0 { size_of::<u64>() } else { 0 };
        let bookkeeping = 4 * size_of::<u32>() + key;
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

    /// Sample vectors that a pixel's reservoir holds at most.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Size in bytes of the sample vectors in all reservoirs.
    pub fn reservoir_bytes(&self) -> u64 {
        // Without a look at all pixels: a preview asks at every status
        if self.capacity == 0 {
            return 0;
        }
        let row_bytes =
            |row: &Row| (0..self.width).map(|x| size_of_val(row.reservoir(x)) as u64).sum::<u64>();
        self.rows.iter().map(row_bytes).sum()
    }

    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// A store of copies of some rows, in the order given.
    ///
    /// # Panics
    /// If a row does not exist.
    pub fn select_rows(&self, rows: impl IntoIterator<Item = usize>) -> Self {
        let rows = rows.into_iter().map(|y| self.rows[y].clone()).collect();
        Self { width: self.width, layout: self.layout.clone(), capacity: self.capacity, rows }
    }

    /// The rows, for filling in parallel.
    pub fn rows_mut(&mut self) -> &mut [Row] {
        &mut self.rows
    }

    /// Adds samples to one pixel; see [`Row::push`].
    pub fn push(&mut self, x: usize, y: usize, samples: &[f32]) {
        self.rows[y].push(x, samples);
    }

    /// Adds another store's samples. The two stores' samples must be independent (of different seeds) or
    /// have disjoint indices.
    ///
    /// # Panics
    /// If sizes, layouts or capacities differ, or a pixel would have more than `u32::MAX` samples.
    pub fn merge(&mut self, other: &Self) {
        assert!(
            self.width == other.width
                && self.rows.len() == other.rows.len()
                && self.layout == other.layout
                && self.capacity == other.capacity,
            "stores to merge must have equal sizes, layouts and capacities"
        );
        self.rows.par_iter_mut().zip(&other.rows).for_each(|(a, b)| a.merge(b));
    }

    /// Number of valid samples of each pixel.
    pub fn counts(&self, part: Part) -> Vec<u32> {
        let mut counts = vec![0; self.pixels()];
        counts.par_chunks_mut(self.width.max(1)).zip(&self.rows).for_each(|(out, row)| {
            out.iter_mut().enumerate().for_each(|(x, count)| *count = row.count(x, part));
        });
        counts
    }

    /// Mean number of valid samples of a pixel; 0 without pixels.
    pub fn spp(&self) -> f64 {
        self.samples() as f64 / self.pixels().max(1) as f64
    }

    /// Number of valid samples of the whole image.
    pub fn samples(&self) -> u64 {
        self.sum(|row| row.halves.iter().flat_map(|half| &half.count).map(|&n| u64::from(n)).sum())
    }

    /// Number of samples taken of the whole image, rejected ones included.
    pub fn samples_taken(&self) -> u64 {
        self.sum(|row| row.next_index.iter().map(|&n| u64::from(n)).sum())
    }

    /// Index of each pixel's next sample: the number of samples taken, rejected ones included.
    pub fn next_indices(&self) -> Vec<u32> {
        self.rows.iter().flat_map(|row| &row.next_index[..self.width]).copied().collect()
    }

    /// Number of pixels of a rectangle of which no sample was taken.
    pub fn empty_pixels(&self, part: &Rectangle) -> usize {
        let Rectangle { x: [x0, x1], y: [y0, y1] } = *part;
        let empty = |row: &Row| row.next_index[x0..x1].iter().filter(|&&n| n == 0).count();
        self.rows[y0..y1].par_iter().map(empty).sum()
    }

    fn sum(&self, row_sum: impl Fn(&Row) -> u64 + Send + Sync) -> u64 {
        self.rows.par_iter().map(row_sum).sum()
    }

    /// Number of samples of the whole image rejected because a value was not finite or too large, or a
    /// radiance was negative.
    pub fn rejected(&self) -> u64 {
        self.rows.iter().flat_map(|row| &row.rejected).map(|&n| u64::from(n)).sum()
    }

    /// Means of some dimensions, one plane each; 0 in pixels without samples.
    pub fn means(&self, part: Part, dims: impl IntoIterator<Item = usize>) -> Planes {
        self.extract(part, dims, |m| m.mean)
    }

    /// Unbiased variances *of the samples* of some dimensions, one plane each; 0 in pixels with fewer
    /// than two samples. Divided by the number of samples, they are the variances of the mean.
    pub fn variances(&self, part: Part, dims: impl IntoIterator<Item = usize>) -> Planes {
        self.extract(part, dims, Moments::variance)
    }

    /// Means of both halves, and unbiased variances of all samples, of some dimensions, one plane each:
    /// the input of a cross filter, read in one pass.
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

    /// Number of valid samples of each pixel, as a plane.
    pub fn count_plane(&self) -> Planes {
        let mut plane = Planes::new(self.width, self.height(), 1);
        plane.data_mut().iter_mut().zip(self.counts(Part::Whole)).for_each(|(v, n)| *v = n as f32);
        plane
    }

    /// A function of the moments of some dimensions, one plane each.
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
                row.read(dim, part, out, |moments| value(moments) as f32);
            });
        });
        planes
    }
}

#[cfg(test)]
mod tests;
