//! Pools the samples of squares of pixels: a store of a coarser image.
//!
//! The samples of a square become those of one pixel (moments after Chan, Golub and LeVeque 1983), so that a few samples per
//! pixel of a fine image are many of a coarse one. Halves of pixels change places where that evens those of the square, so that single
//! samples fill both. Reservoirs are left out.

use rayon::prelude::*;

use super::store::Store;

impl Store {
    /// Returns a store without reservoirs in which every pixel has the samples of a square of `side` pixels, of fewer at the
    /// right and lower border.
    ///
    /// # Panics
    /// If `side` is 0, or a pixel would have more than `u32::MAX` samples.
    pub fn pooled(&self, side: usize) -> Self {
        let (width, height) = (self.width().div_ceil(side), self.height().div_ceil(side));
        let mut pooled = Self::new(width, height, self.layout().clone(), 0, 0);
        let rows = pooled.rows_mut().par_iter_mut().zip(self.rows().par_chunks(side));
        rows.for_each(|(row, fine)| fine.iter().for_each(|fine| row.merge_groups(fine, side)));
        pooled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Layout, Part};

    #[test]
    fn single_samples_fill_both_halves() {
        let halves_of = |is_sampled: fn(usize, usize) -> bool| {
            let mut fine = Store::new(6, 4, Layout::with_blocks(|_| false), 0, 0);
            let sampled = (0..24).map(|i| (i % 6, i / 6)).filter(|&(x, y)| is_sampled(x, y));
            sampled.for_each(|(x, y)| fine.push(x, y, &[0.5; 5]));
            let pooled = fine.pooled(2);
            [0, 1].map(|half| pooled.counts(Part::Half(half)))
        };
        assert_eq!(halves_of(|_, _| true), [[2; 6], [2; 6]]);
        // The first half of a batch
        assert_eq!(halves_of(|x, y| (x + y) % 2 == 0), [[1; 6], [1; 6]]);
    }

    #[test]
    fn a_pixel_has_the_samples_of_its_square() {
        let (width, height, side) = (21, 6, 4);
        for layout in [Layout::with_blocks(|_| true), Layout::with_blocks(|_| false)] {
            let dims = layout.len();
            let mut fine = Store::new(width, height, layout.clone(), 2, 0);
            let mut expected = Store::new(width.div_ceil(side), height.div_ceil(side), layout, 0, 0);
            for i in 0..5 * width * height {
                let (x, y) = (i * 7 % width, i * 3 / width % height);
                // Some pixels have no samples, and one sample is rejected.
                let value = if i == 101 { f32::NAN } else { (i * 31 % 17) as f32 };
                if x % 3 != 1 {
                    fine.push(x, y, &vec![value; dims]);
                    expected.push(x / side, y / side, &vec![value; dims]);
                }
            }
            let pooled = fine.pooled(side);
            assert_eq!(pooled.next_indices(), expected.next_indices());
            assert_eq!((pooled.rejected(), pooled.capacity()), (1, 0));
            // Which half a sample is in depends on its index within its own pixel, and on the square's other samples.
            let close = |a: f32, b: f32| (a - b).abs() <= 1e-4 * b.abs().max(1.0);
            let pairs = [
                (pooled.means(Part::Whole, 0..dims), expected.means(Part::Whole, 0..dims)),
                (pooled.variances(Part::Whole, 0..dims), expected.variances(Part::Whole, 0..dims)),
            ];
            for (found, expected) in pairs {
                assert!(found.data().iter().zip(expected.data()).all(|(a, b)| close(*a, *b)));
            }
        }
    }
}
