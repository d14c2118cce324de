//! The outputs of a render: their paths, image files with layers and attributes, and the report.

mod image_output;
mod layers;
pub mod paths;
mod report;
mod sample_counts;

pub use image_output::{ImageOutput, WriteErrors};
pub use layers::{Layers, UnknownLayer};
pub use report::{Report, Times};
pub use sample_counts::SampleCounts;
