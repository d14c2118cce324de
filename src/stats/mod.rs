//! What is remembered of the samples: per pixel, for each alive dimension of the sample vector,
//! Welford's mean and sum of squared deviations, in two independent halves, and a bounded
//! reservoir of whole sample vectors.
//!
//! Knows nothing of what the dimensions mean to a renderer.

mod layout;
mod moments;
mod reservoir;
mod store;

pub use layout::{Block, Dimension, Feature, Group, Layout, MAX_DIMENSIONS};
pub use moments::Moments;
pub(crate) use reservoir::hash;
pub use store::{BLOCK, BlockValues, LARGEST_VALUE, Part, Row, RowError, Store};
