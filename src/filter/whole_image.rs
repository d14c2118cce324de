//! What a filter of a part of an image needs to know of the whole.

use rayon::prelude::*;

use super::common::exact_sum::ExactSum;
use super::common::interleaved_planes::InterleavedPlanes;
use crate::image::Planes;
use crate::stats::Rectangle;

/// The image of which a store has all pixels, or a part and a margin of pixels around it. Filters of all parts call its sums
/// in the same order.
pub trait WholeImage: Sync {
    /// Returns the pixels of the store that are not of its margin.
    fn part(&self) -> Rectangle;

    /// Adds up numbers of all parts.
    fn sum(&self, numbers: &mut [i64]);

    /// Returns the largest number of all parts.
    fn max(&self, number: f32) -> f32;

    /// Gives the margin the values that the filters of the parts there have computed. `planes` have a value for each
    /// `side`×`side` pixels of the store, where `side` is a divisor of 16, and so is the width of the margin a multiple of 16.
    fn complete_margin(&self, planes: &mut dyn PlaneRows, side: usize);
}

/// Planes, row by row.
pub trait PlaneRows {
    /// Returns the number of planes.
    fn count(&self) -> usize;

    /// Returns one row of one plane.
    fn row(&self, plane: usize, y: usize) -> &[f32];

    /// Returns one row of one plane.
    fn row_mut(&mut self, plane: usize, y: usize) -> &mut [f32];
}

impl PlaneRows for Planes {
    fn count(&self) -> usize {
        self.count()
    }

    fn row(&self, plane: usize, y: usize) -> &[f32] {
        self.row(plane, y)
    }

    fn row_mut(&mut self, plane: usize, y: usize) -> &mut [f32] {
        self.row_mut(plane, y)
    }
}

impl PlaneRows for InterleavedPlanes {
    fn count(&self) -> usize {
        self.count()
    }

    fn row(&self, plane: usize, y: usize) -> &[f32] {
        self.row(plane, y)
    }

    fn row_mut(&mut self, plane: usize, y: usize) -> &mut [f32] {
        self.row_mut(plane, y)
    }
}

/// An image that one store has.
pub struct AllPixels(Rectangle);

impl AllPixels {
    pub fn new(width: usize, height: usize) -> Self {
        Self(Rectangle::whole(width, height))
    }
}

impl WholeImage for AllPixels {
    fn part(&self) -> Rectangle {
        self.0
    }

    fn sum(&self, _: &mut [i64]) {}

    fn max(&self, number: f32) -> f32 {
        number
    }

    fn complete_margin(&self, _: &mut dyn PlaneRows, _: usize) {}
}

/// Returns the mean of a function of all values of all planes over the whole image; 0 without pixels.
pub(super) fn mean(
    whole: &dyn WholeImage,
    planes: &Planes,
    function: impl Fn(f32) -> f32 + Sync + Send,
) -> f64 {
    let part = whole.part();
    let [y0, height] = [part.y[0], part.height()];
    let row = |i: usize| &planes.row(i / height, y0 + i % height)[part.x[0]..part.x[1]];
    let mut sum = ExactSum::new((0..planes.count() * height).into_par_iter().map(row), function);
    let mut count = [(part.pixels() * planes.count()) as i64];
    whole.sum(&mut sum.0);
    whole.sum(&mut count);
    sum.value() / count[0].max(1) as f64
}

/// Returns the median of the positive values of a plane over the whole image, with an even number of them the mean of the two
/// in the middle; `None` if there are none.
pub(super) fn median_of_positive(whole: &dyn WholeImage, plane: &Planes) -> Option<f32> {
    let part = whole.part();
    let values = || part.select(plane.data(), plane.width()).flatten().filter(|&&value| value > 0.0);
    let mut count = [values().count() as i64];
    whole.sum(&mut count);
    // Bits of positive numbers have the order of the numbers: the digits of the one with this rank follow from counts
    let with_rank = |mut rank: i64| {
        let mut found = 0_u32;
        for shift in [24, 16, 8, 0] {
            let mut counts = [0; 256];
            let is_candidate = |bits: u32| u64::from(bits) >> (shift + 8) == u64::from(found) >> (shift + 8);
            let bits = values().map(|value| value.to_bits());
            bits.filter(|&bits| is_candidate(bits))
                .for_each(|bits| counts[(bits >> shift & 0xff) as usize] += 1);
            whole.sum(&mut counts);
            let mut digit = 0;
            while rank >= counts[digit] {
                rank -= counts[digit];
                digit += 1;
            }
            found |= (digit as u32) << shift;
        }
        f32::from_bits(found)
    };
    (count[0] > 0).then(|| 0.5 * with_rank((count[0] - 1) / 2) + 0.5 * with_rank(count[0] / 2))
}

/// Returns the mean number of samples of a pixel of the whole image; `counts` are those of both halves in a store of this width.
pub(super) fn samples_per_pixel(whole: &dyn WholeImage, counts: [&[u32]; 2], width: usize) -> f32 {
    let part = whole.part();
    let sum = |counts: &[u32]| part.select(counts, width).flatten().map(|&n| i64::from(n)).sum::<i64>();
    let mut numbers = [counts.into_iter().map(sum).sum(), part.pixels() as i64];
    whole.sum(&mut numbers);
    numbers[0] as f32 / numbers[1].max(1) as f32
}

#[cfg(test)]
mod tests;
