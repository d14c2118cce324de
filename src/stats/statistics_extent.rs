//! The choice between all statistics of a pixel and those that decide where its next samples go.

/// The statistics of a pixel that are copied or sent; each extent has those of the ones before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub enum StatisticsExtent {
    /// Counts, and the moments of the radiance.
    Radiance,
    /// Counts, the moments of all dimensions, and the reservoir.
    All,
}
