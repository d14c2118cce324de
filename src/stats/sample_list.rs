//! Adds samples of pixels in any order to a store.

use super::columns::Columns;
use super::store::Store;

/// Samples that do not fit a store.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SampleListError {
    #[error("pixels: found {found} values; accepted is an even number, an x and a y for each sample")]
    Pixels { found: usize },
    #[error("samples: found {found} values; accepted are {accepted}, one for each pixel and dimension")]
    Length { found: usize, accepted: usize },
    #[error("pixels: found ({}, {}); accepted are pixels within {}x{}", pixel[0], pixel[1], store[0], store[1])]
    Outside { pixel: [u32; 2], store: [usize; 2] },
}

impl Store {
    /// Adds samples of the pixels `pixels`, `[sample][2]`, with the values `values`, `[sample][column]`. `columns` are of
    /// the store's layout; see [`Row::push_block`](super::Row::push_block) for what is rejected.
    ///
    /// # Errors
    /// Pixels outside the store, too few or too many values. The store is then unchanged.
    ///
    /// # Panics
    /// If the columns are of another layout.
    pub fn push_pixels(
        &mut self,
        columns: &Columns,
        pixels: &[u32],
        values: &[f32],
    ) -> Result<(), SampleListError> {
        assert_eq!(columns.layout(), self.layout(), "columns of the store's layout");
        // Check that they fit
        let (pixels, rest) = pixels.as_chunks::<2>();
        if !rest.is_empty() {
            return Err(SampleListError::Pixels { found: 2 * pixels.len() + 1 });
        }
        let (found, accepted) = (values.len(), pixels.len() * columns.count());
        if found != accepted {
            return Err(SampleListError::Length { found, accepted });
        }
        let store = [self.width(), self.height()];
        let is_outside = |[x, y]: &&[u32; 2]| *x as usize >= store[0] || *y as usize >= store[1];
        if let Some(&pixel) = pixels.iter().find(is_outside) {
            return Err(SampleListError::Outside { pixel, store });
        }

        // Add them
        let mut sample = Vec::new();
        for (&[x, y], values) in pixels.iter().zip(values.chunks_exact(columns.count())) {
            let (x, y) = (x as usize, y as usize);
            sample.clear();
            sample.extend(columns.arrange(x, y, values));
            self.push(x, y, &sample);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Part;

    #[test]
    fn samples_in_any_order_reach_their_pixels_and_those_that_do_not_fit_change_nothing() {
        let columns = Columns::new(&["B", "R", "G"]).unwrap();
        let mut store = Store::new(3, 2, columns.layout().clone(), 0, 0);
        store
            .push_pixels(&columns, &[2, 1, 0, 0, 2, 1], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
            .unwrap();
        assert_eq!(store.counts(Part::Whole), [1, 0, 0, 0, 0, 2]);
        assert_eq!(
            store.means(Part::Whole, store.layout().colour()).at(0, 2, 1),
            5.0,
            "the mean red of 2 and 8"
        );
        let mut error = |pixels: &[u32], values: &[f32]| {
            store.push_pixels(&columns, pixels, values).unwrap_err().to_string()
        };
        assert!(error(&[0, 0, 1], &[0.0; 3]).contains("pixels: found 3 values"));
        assert!(error(&[0, 0], &[0.0; 4]).contains("samples: found 4 values; accepted are 3"));
        let message = error(&[0, 0, 0, 2], &[0.0; 6]);
        assert_eq!(message, "pixels: found (0, 2); accepted are pixels within 3x2");
        assert_eq!(store.samples_taken(), 3);
    }
}
