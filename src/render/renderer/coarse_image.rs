//! A coarse image of a view, to look at while a camera moves: a few samples in every square of pixels.

use rayon::prelude::*;

use super::Renderer;
use crate::image::Planes;
use crate::stats::{BlockSet, Part, Store};

impl Renderer<'_> {
    /// Returns the radiance of one sample in the middle of every square of `side` pixels: 3 planes of a pixel for each square,
    /// 0 where the sample is rejected.
    ///
    /// # Panics
    /// If `side` is 0.
    pub fn coarse_image(&self, side: usize) -> Planes {
        let renderer = self.recording(BlockSet::NONE);
        renderer.coarse_store(side, 1).means(Part::Whole, renderer.layout.radiance())
    }

    /// Returns a store without reservoirs with a pixel for every square of `side` pixels: it has the first `samples` samples
    /// of the pixel in the middle of the square.
    ///
    /// # Panics
    /// If `side` is 0.
    pub fn coarse_store(&self, side: usize, samples: u32) -> Store {
        let (width, height) = self.resolution;
        let middle = |square: usize, size: usize| (square * side + side / 2).min(size - 1);
        let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
        let mut counts = vec![0; width];
        (0..columns).for_each(|column| counts[middle(column, width)] = samples);
        let mut store = Store::new(columns, rows, self.layout.clone(), 0, self.rows.seed);
        let fine = || Store::new(width, 1, self.layout.clone(), 0, self.rows.seed);
        store.rows_mut().par_iter_mut().enumerate().with_max_len(1).for_each_init(fine, |fine, (y, row)| {
            fine.clear();
            let fine = &mut fine.rows_mut()[0];
            self.render_row(middle(y, height), &counts, None, fine);
            row.merge_groups(fine, side);
        });
        store
    }
}
