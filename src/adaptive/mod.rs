//! Where the next samples go: maps → priority per pixel → sample counts of the next batch.
//!
//! Deciding is pure arithmetic on planes; nothing here renders, filters or reads a clock.

mod allocate;
mod priority;

pub use allocate::{Allocation, CEILING, allocate, allocate_above, uniform};
pub use priority::{Maps, PrioritySettings, priority};

/// How a batch is spread over the pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampling {
    /// Every pixel the same.
    Uniform,
    /// By the filter's maps.
    Adaptive,
}
