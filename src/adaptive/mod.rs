//! Allocates the samples of the next batch: from the maps of a filtered image to a priority per pixel, and
//! from priorities, or from a given map of counts, to sample counts.
//!
//! Functions of planes and settings only; nothing here renders, filters or reads a clock.

mod allocate;
mod next_counts;
mod priority;
mod sample_map;

pub use allocate::{MAX_RATIO_TO_MEAN, NO_CEILING, allocate, allocate_above, uniform};
pub use next_counts::{NextCountsError, batch_key, next_counts};
pub use priority::{FilterMaps, PrioritySettings, expected_ratio, priority};
pub use sample_map::{MapValues, SampleMap, SampleMapError, follow};

/// How the samples of a batch are distributed over the pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampling {
    /// Equally, or by a [`SampleMap`].
    Uniform,
    /// By the priorities of the pixels.
    Adaptive,
}
