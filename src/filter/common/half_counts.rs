//! Sample counts of the two halves of the samples, and the operations on images of the halves that depend on them.

use rayon::prelude::*;

use super::TASK_PIXELS;
use super::hole_filling::HoleFilling;
use crate::image::Planes;
use crate::stats::{Part, Store};

/// Sample counts of the halves, pixel by pixel.
#[derive(Clone, Debug)]
pub struct HalfCounts {
    integers: [Vec<u32>; 2],
    floats: [Vec<f32>; 2],
    /// Pixels where both are 0.
    holes: HoleFilling,
}

impl HalfCounts {
    pub fn from_store(store: &Store) -> Self {
        Self::new(store.width(), [0, 1].map(|h| store.counts(Part::Half(h))))
    }

    /// `width` is that of the image.
    pub fn new(width: usize, counts: [Vec<u32>; 2]) -> Self {
        let floats = counts.each_ref().map(|counts| counts.iter().map(|&n| n as f32).collect());
        let totals = counts[0].iter().zip(&counts[1]).map(|(a, b)| a.saturating_add(*b));
        let holes = HoleFilling::new(width, totals);
        Self { integers: counts, floats, holes }
    }

    pub fn integers(&self) -> [&[u32]; 2] {
        [&self.integers[0], &self.integers[1]]
    }

    pub fn floats(&self) -> [&[f32]; 2] {
        [&self.floats[0], &self.floats[1]]
    }

    /// Fractions of the samples that the halves have, pixel by pixel; 0 without samples.
    pub fn fractions(&self) -> impl IndexedParallelIterator<Item = [f32; 2]> {
        let [a, b] = &self.floats;
        a.par_iter().zip(b).map(|(a, b)| [a, b].map(|n| n / (a + b).max(1.0)))
    }

    /// Whether a pixel has at least two samples, without which every sample variance is 0.
    pub fn have_variances(&self) -> bool {
        self.floats[0].iter().zip(&self.floats[1]).any(|(a, b)| a + b >= 2.0)
    }

    /// Returns the mean of two images, one of each half, weighted by sample counts; the even mean where there
    /// are none.
    pub fn mean(&self, halves: [&Planes; 2]) -> Planes {
        let mut mean = halves[0].clone();
        for (plane, b) in mean.planes_mut().zip(halves[1].data().chunks(halves[1].pixels().max(1))) {
            let values = plane
                .par_iter_mut()
                .with_min_len(TASK_PIXELS)
                .zip(b)
                .zip(&self.floats[0])
                .zip(&self.floats[1]);
            values.for_each(|(((a, &b), &n_a), &n_b)| {
                let fraction = if n_a + n_b > 0.0 { n_b / (n_a + n_b) } else { 0.5 };
                *a += fraction * (b - *a);
            });
        }
        mean
    }

    /// Fills pixels without samples in the images of both halves: if one half has samples, with its value,
    /// otherwise from the nearest pixels with samples.
    pub fn fill_missing(&self, halves: &mut [Planes; 2]) {
        let [a, b] = halves;
        let pixels = a.pixels().max(1);
        for (a, b) in a.data_mut().chunks_mut(pixels).zip(b.data_mut().chunks_mut(pixels)) {
            let values =
                a.par_iter_mut().with_min_len(TASK_PIXELS).zip(b).zip(&self.floats[0]).zip(&self.floats[1]);
            values.for_each(|(((a, b), &n_a), &n_b)| match (n_a > 0.0, n_b > 0.0) {
                (true, false) => *b = *a,
                (false, true) => *a = *b,
                _ => {}
            });
        }
        halves.iter_mut().for_each(|half| self.holes.fill(half));
    }
}
