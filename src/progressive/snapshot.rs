//! Means and counts of both halves when an image was made, to separate later samples from those before.

use crate::image::Planes;
use crate::stats::{Part, Store};

/// Means and counts of a store's halves at a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Radiance: 3 planes each.
    pub mean: [Planes; 2],
    pub count: [Vec<u32>; 2],
}

impl Snapshot {
    pub(super) fn new(store: &Store) -> Self {
        Self {
            mean: [0, 1].map(|h| store.means(Part::Half(h), store.layout().radiance())),
            count: [0, 1].map(|h| store.counts(Part::Half(h))),
        }
    }
}
