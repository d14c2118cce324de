//! Calibration: measures how long the finalisation takes, by doing it on some rows of the image.
//!
//! The cost of a filter and of an encoder follows from the machine, from what else runs on it, and from the layout, all
//! of which the rows share with the image.

use std::time::Instant;

use super::finalisation::{CalibrationTimes, ROW_RATIO};
use super::time_constants::{FILTER_EXCESS, WRITE_EXCESS};
use crate::filter::FilterResult;
use crate::stats::Store;

/// Number of bands of rows, evenly spread over the image.
const BANDS: usize = 4;
/// Least number of rows of a band: fewer are mostly borders.
const LEAST_ROWS: usize = 12;

/// Filters some rows of a store by `filter` and encodes the output of them; returns the times for the whole image, with the seconds that
/// gathering its statistics took.
pub(super) fn calibrate(
    store: &Store,
    gathering: f64,
    filter: impl FnOnce(&Store) -> FilterResult,
    encode_and_discard: impl Fn(&FilterResult, &Store),
) -> CalibrationTimes {
    let started = Instant::now();
    let rows = store.select_rows(rows(store.height()));
    let ratio = store.pixels() as f64 / rows.pixels().max(1) as f64;
    let filtering = Instant::now();
    let result = filter(&rows);
    let filter_seconds = FILTER_EXCESS * ratio * filtering.elapsed().as_secs_f64();
    let writing = Instant::now();
    encode_and_discard(&result, &rows);
    let write_seconds = WRITE_EXCESS * ratio * writing.elapsed().as_secs_f64();
    CalibrationTimes {
        filter: filter_seconds,
        total: gathering + filter_seconds + write_seconds,
        gathering,
        spent: gathering + started.elapsed().as_secs_f64(),
    }
}

/// Returns the rows that stand for an image of this height.
fn rows(height: usize) -> Vec<usize> {
    let rows = (height / (ROW_RATIO * BANDS)).max(LEAST_ROWS);
    if rows * BANDS >= height {
        return (0..height).collect();
    }
    let band = height / BANDS;
    (0..BANDS).flat_map(|i| (0..rows).map(move |y| i * band + (band - rows) / 2 + y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sixteenth_of_a_large_image_and_all_of_a_small_one_are_calibrated() {
        let of_large = rows(1024);
        assert_eq!(of_large.len(), 64);
        assert!(of_large.is_sorted() && of_large[0] > 0 && of_large[63] < 1023);
        assert_eq!(rows(40), (0..40).collect::<Vec<_>>());
        assert!(rows(0).is_empty());
    }
}
