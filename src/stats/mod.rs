//! Collects statistics of the samples of each pixel.
//!
//! A sample is a vector whose dimensions a [`Layout`] describes. A [`Store`] takes sample vectors in and
//! gives, for each pixel and dimension, Welford's mean and sum of squared deviations, of all samples and
//! of two independent halves; and for each pixel a bounded reservoir of whole sample vectors. A restricted
//! layout keeps fewer dimensions. It does not depend on a renderer.

mod block;
mod block_set;
mod columns;
mod half_moments;
mod half_store;
mod layout;
mod moments;
mod part;
mod pooled;
mod rectangle;
mod reservoir;
mod row;
mod sample_list;
mod sample_rectangle;
mod statistics_extent;
mod store;

pub use block::{Block, Dimension, Feature, Group, MAX_DIMENSIONS};
pub use block_set::BlockSet;
pub use columns::{ColumnError, Columns};
pub use half_moments::{HalfMoments, HalfMomentsError};
pub use layout::{Layout, LayoutError};
pub use moments::Moments;
pub use part::Part;
pub use rectangle::Rectangle;
pub use row::{LARGEST_VALUE, PIXEL_BLOCK, PixelBlockValues, Row, RowError};
pub use sample_list::SampleListError;
pub use sample_rectangle::{RectangleError, SampleRectangle};
pub use statistics_extent::StatisticsExtent;
pub use store::Store;
