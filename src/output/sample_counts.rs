//! Statistics of the samples per pixel.

use crate::stats::{Part, Store};

/// Least, mean and largest number of samples of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleCounts {
    pub min: u32,
    pub mean: f64,
    pub max: u32,
}

impl SampleCounts {
    /// Counts the valid samples of a store.
    pub fn new(store: &Store) -> Self {
        let counts = store.counts(Part::Whole);
        Self {
            min: counts.iter().copied().min().unwrap_or(0),
            mean: store.spp(),
            max: counts.iter().copied().max().unwrap_or(0),
        }
    }
}
