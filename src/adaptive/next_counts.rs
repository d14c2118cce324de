//! Computes the sample counts of a store's next batch: for programs that take samples themselves.
//!
//! Takes a store, a priority for each of its pixels, the number of samples of the batch and bounds of a pixel's total.

use super::allocate::{NO_CEILING, allocate_above};
use crate::stats::Store;

/// Why no counts can be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NextCountsError {
    #[error("priority: found {found} values; accepted are {accepted}, one for each pixel")]
    Length { found: usize, accepted: usize },
    #[error("priority: found {found}; accepted are finite numbers from 0 up")]
    Value { found: f32 },
    #[error("max_spp: found {max_spp}; accepted is a number from min_spp, {min_spp}, to {NO_CEILING}")]
    Bounds { min_spp: u32, max_spp: u32 },
}

/// Returns the samples of each pixel in a batch of `samples`; total counts become proportional to `priority` as
/// [`allocate`](super::allocate()) describes, within `min_spp` and `max_spp`. `seed` is that of the store's samples.
///
/// # Errors
/// Priorities of another number than pixels, negative or not finite; bounds that exclude each other.
pub fn next_counts(
    store: &Store,
    priority: &[f32],
    samples: u64,
    [min_spp, max_spp]: [u32; 2],
    seed: u64,
) -> Result<Vec<u32>, NextCountsError> {
    // Check the arguments
    let (found, accepted) = (priority.len(), store.pixels());
    if found != accepted {
        return Err(NextCountsError::Length { found, accepted });
    }
    if let Some(&found) = priority.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
        return Err(NextCountsError::Value { found });
    }
    if min_spp > max_spp || max_spp > NO_CEILING {
        return Err(NextCountsError::Bounds { min_spp, max_spp });
    }

    // Allocate
    // Rejected samples count: a pixel that rejects all of them must not hold up the others.
    let taken = store.next_indices();
    let key = batch_key(store, seed);
    Ok(allocate_above(min_spp, priority, &taken, store.width(), samples, max_spp, key))
}

/// Returns the key of a store's next batch: each batch has its own, so that its uniform fraction goes to other pixels.
pub fn batch_key(store: &Store, seed: u64) -> u64 {
    seed.rotate_left(32) ^ store.samples_taken()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Layout;

    #[test]
    fn counts_sum_to_the_batch_and_wrong_arguments_are_errors() {
        let store = Store::new(4, 2, Layout::with_blocks(|_| false), 0, 0);
        let priority = [1.0, 1.0, 1.0, 1.0, 0.0, 2.0, 4.0, 8.0];
        let counts = next_counts(&store, &priority, 100, [2, 60], 0).unwrap();
        assert_eq!(counts.iter().sum::<u32>(), 100);
        assert!(counts.iter().all(|count| (2..=60).contains(count)), "{counts:?}");
        let error =
            |priority: &[f32], bounds| next_counts(&store, priority, 1, bounds, 0).unwrap_err().to_string();
        assert!(error(&priority[1..], [0, 1]).contains("found 7 values; accepted are 8"));
        assert!(error(&[f32::NAN; 8], [0, 1]).contains("found NaN"));
        assert!(error(&[-1.0; 8], [0, 1]).contains("found -1"));
        assert!(error(&priority, [4, 3]).contains("max_spp: found 3; accepted is a number from min_spp, 4"));
        assert!(error(&priority, [0, u32::MAX]).contains("max_spp: found 4294967295"));
    }
}
