//! Adds the samples of a rectangle of pixels to a store.
//!
//! Takes a table of samples in the order of rows, columns and samples of a pixel; rows are filled in parallel.

use rayon::prelude::*;

use super::columns::Columns;
use super::row::{PIXEL_BLOCK, Row};
use super::store::Store;

/// The samples of a rectangle of pixels, equally many of each.
#[derive(Clone, Copy, Debug)]
pub struct SampleRectangle<'a> {
    /// The pixel of the upper left corner.
    pub corner: [usize; 2],
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Samples of each pixel.
    pub samples: usize,
    /// `[y][x][sample][column]`.
    pub values: &'a [f32],
}

/// A rectangle that does not fit a store.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RectangleError {
    #[error(
        "samples: found {}x{} pixels at ({}, {}); accepted are pixels within {}x{}",
        size[0], size[1], corner[0], corner[1], store[0], store[1]
    )]
    Outside { corner: [usize; 2], size: [usize; 2], store: [usize; 2] },
    #[error(
        "samples: found {found} values; accepted are {accepted}, one for each pixel, sample and dimension"
    )]
    Length { found: usize, accepted: usize },
    #[error("samples: found a layout of {found}; accepted is that of the store, {accepted}")]
    Layout { found: String, accepted: String },
}

impl Store {
    /// Adds the samples of a rectangle of pixels; see [`Row::push_block`] for what is rejected.
    ///
    /// # Errors
    /// Pixels outside the store, too few or too many values, columns of another layout. The store is then unchanged.
    pub fn push_rectangle(
        &mut self,
        columns: &Columns,
        rectangle: &SampleRectangle,
    ) -> Result<(), RectangleError> {
        let SampleRectangle { corner: [x0, y0], size: [width, height], samples, values } = *rectangle;
        // Check that they fit
        let is_within =
            |from: usize, size: usize, end: usize| from.checked_add(size).is_some_and(|to| to <= end);
        if !is_within(x0, width, self.width()) || !is_within(y0, height, self.height()) {
            let (corner, size, store) = (rectangle.corner, rectangle.size, [self.width(), self.height()]);
            return Err(RectangleError::Outside { corner, size, store });
        }
        let sizes = [height, samples, columns.count()];
        let accepted = sizes.into_iter().fold(width, usize::saturating_mul);
        if values.len() != accepted {
            return Err(RectangleError::Length { found: values.len(), accepted });
        }
        if columns.layout() != self.layout() {
            let names = |columns: &super::Layout| columns.names().collect::<Vec<_>>().join(" ");
            let (found, accepted) = (names(columns.layout()), names(self.layout()));
            return Err(RectangleError::Layout { found, accepted });
        }
        if values.is_empty() {
            return Ok(());
        }

        // Fill the rows
        let row_values = width * samples * columns.count();
        let rows = self.rows_mut()[y0..][..height].par_iter_mut().zip(values.par_chunks(row_values));
        rows.enumerate().for_each(|(y, (row, values))| {
            push_row(row, columns, [x0, y0 + y], samples, values);
        });
        Ok(())
    }
}

/// Adds the samples of neighbouring pixels of a row, from the pixel `start` on.
fn push_row(row: &mut Row, columns: &Columns, [x0, y]: [usize; 2], samples: usize, values: &[f32]) {
    let pixel_values = samples * columns.count();
    let end = x0 + values.len() / pixel_values;
    let mut lanes = vec![[0.0; PIXEL_BLOCK]; columns.layout().len()];
    for block in x0 / PIXEL_BLOCK..end.div_ceil(PIXEL_BLOCK) {
        let first = block * PIXEL_BLOCK;
        let pixels = first.max(x0)..(first + PIXEL_BLOCK).min(end);
        let present = pixels.clone().fold(0, |mask, x| mask | 1 << (x - first));
        for sample in 0..samples {
            for x in pixels.clone() {
                let start = (x - x0) * pixel_values + sample * columns.count();
                let found = columns.arrange(x, y, &values[start..][..columns.count()]);
                lanes.iter_mut().zip(found).for_each(|(lane, value)| lane[x - first] = value);
            }
            row.push_block(block, present, &lanes);
        }
        // Absent lanes of the next block must not hold values that are not finite.
        lanes.iter_mut().for_each(|lane| lane.fill(0.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Part;

    const COLUMNS: [&str; 3] = ["B", "R", "G"];

    /// Values that differ between pixels, samples and columns.
    fn value(x: usize, y: usize, sample: usize, column: usize) -> f32 {
        (x * 7 + y * 13 + sample * 5 + column * 3) as f32 % 11.0
    }

    fn table([x0, y0]: [usize; 2], [width, height]: [usize; 2], samples: usize) -> Vec<f32> {
        let mut values = Vec::new();
        for (y, x) in (y0..y0 + height).flat_map(|y| (x0..x0 + width).map(move |x| (y, x))) {
            values.extend((0..samples).flat_map(|s| (0..3).map(move |c| value(x, y, s, c))));
        }
        values
    }

    #[test]
    fn rectangles_give_the_statistics_of_single_samples() {
        let columns = Columns::new(&COLUMNS).unwrap();
        let empty = || Store::new(37, 9, columns.layout().clone(), 2, 7);
        for (corner, size, samples) in [([0, 0], [37, 9], 3), ([5, 2], [20, 4], 1), ([36, 8], [1, 1], 5)] {
            let (mut at_once, mut singly) = (empty(), empty());
            let values = table(corner, size, samples);
            let rectangle = SampleRectangle { corner, size, samples, values: &values };
            at_once.push_rectangle(&columns, &rectangle).unwrap();
            for (i, sample) in values.chunks(3).enumerate() {
                let pixel = i / samples;
                let (x, y) = (corner[0] + pixel % size[0], corner[1] + pixel / size[0]);
                singly.push(x, y, &columns.arrange(x, y, sample).collect::<Vec<_>>());
            }
            assert_eq!(at_once.counts(Part::Whole), singly.counts(Part::Whole));
            assert!(at_once.rows() == singly.rows(), "{corner:?} {size:?} {samples}");
        }
    }

    #[test]
    fn a_sample_that_is_not_finite_is_rejected_alone() {
        let columns = Columns::new(&COLUMNS).unwrap();
        let mut store = Store::new(20, 1, columns.layout().clone(), 0, 0);
        let mut values = table([0, 0], [20, 1], 2);
        values[3 * 2 * 17] = f32::NAN;
        let rectangle = SampleRectangle { corner: [0, 0], size: [20, 1], samples: 2, values: &values };
        store.push_rectangle(&columns, &rectangle).unwrap();
        assert_eq!((store.samples(), store.rejected()), (39, 1));
    }

    #[test]
    fn rectangles_that_do_not_fit_are_errors_and_change_nothing() {
        let columns = Columns::new(&COLUMNS).unwrap();
        let mut store = Store::new(4, 4, columns.layout().clone(), 0, 0);
        let mut error = |columns: &Columns, corner, size, samples, values: &[f32]| {
            let rectangle = SampleRectangle { corner, size, samples, values };
            store.push_rectangle(columns, &rectangle).unwrap_err().to_string()
        };
        let message = error(&columns, [3, 0], [2, 1], 1, &[0.0; 6]);
        assert_eq!(message, "samples: found 2x1 pixels at (3, 0); accepted are pixels within 4x4");
        assert!(error(&columns, [usize::MAX, 0], [1, 1], 1, &[0.0; 3]).contains("within 4x4"));
        assert!(error(&columns, [0, 0], [1, 1], 1, &[0.0; 4]).contains("found 4 values; accepted are 3"));
        let other = Columns::new(&["R", "G", "B", "time"]).unwrap();
        assert!(error(&other, [0, 0], [1, 1], 1, &[0.0; 4]).contains("found a layout of film.x"));
        assert!(error(&columns, [0, 0], [4, 4], 1 << 60, &[]).contains("found 0 values"));
        let nothing = SampleRectangle { corner: [0, 0], size: [0, 0], samples: 0, values: &[] };
        store.push_rectangle(&columns, &nothing).unwrap();
        assert_eq!(store.samples_taken(), 0);
    }
}
