//! What a filter of a part of an image needs to know of the whole.

use rayon::prelude::*;

use super::common::exact_sum::ExactSum;
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
}

/// An image that one store has.
pub struct AllPixels(Rectangle);

impl AllPixels {
    pub fn new(width: usize, height: usize) -> Self {
        Self(Rectangle::of_image(width, height))
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

/// Returns the mean number of samples of a pixel of the whole image; `counts` are those of both halves in a store of this width.
pub(super) fn samples_per_pixel(whole: &dyn WholeImage, counts: [&[u32]; 2], width: usize) -> f32 {
    let part = whole.part();
    let sum = |counts: &[u32]| part.select(counts, width).flatten().map(|&n| i64::from(n)).sum::<i64>();
    let mut numbers = [counts.into_iter().map(sum).sum(), part.pixels() as i64];
    whole.sum(&mut numbers);
    numbers[0] as f32 / numbers[1].max(1) as f32
}
