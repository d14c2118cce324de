//! A coarse image of a view, to look at while a camera moves: one sample in every square of pixels.

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
        let (width, height) = self.resolution;
        let middle = |square: usize, size: usize| (square * side + side / 2).min(size - 1);
        let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));

        // Render into a store of the rows in the middle of squares
        let mut store = Store::new(width, rows, renderer.layout.clone(), 0, renderer.rows.seed);
        let mut counts = vec![0; width];
        (0..columns).for_each(|column| counts[middle(column, width)] = 1);
        store.rows_mut().par_iter_mut().enumerate().with_max_len(1).for_each(|(square, row)| {
            renderer.render_row(middle(square, height), &counts, None, row);
        });

        // Gather the pixels in the middle of squares
        let means = store.means(Part::Whole, renderer.layout.radiance());
        let mut image = Planes::new(columns, rows, means.count());
        for (plane, out) in image.planes_mut().enumerate() {
            let means = means.plane(plane);
            for (pixel, value) in out.iter_mut().enumerate() {
                *value = means[pixel / columns * width + middle(pixel % columns, width)];
            }
        }
        image
    }
}
