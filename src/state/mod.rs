//! Render states as files: to resume a render, to filter it again, or to merge it with those of other machines.
//!
//! | file | holds |
//! | --- | --- |
//! | `render_state` | [`RenderState`]: the content of a state file |
//! | `state_file` | [`RenderState::read`], [`RenderState::write`] |
//! | [`mod@format`] | the layout of the bytes |
//! | `header`, `array_bytes` | the two parts of the format: JSON and arrays |
//! | `encode`, `decode` | from a state to bytes and back |
//! | `checkpoints` | [`Checkpoints`]: the state file of a render that goes on |
//! | `checkpoint_writer` | writes states in the background |
//! | `image_metadata` | [`ImageMetadata`]: scene and view of an image |
//! | `stream` | [`Stream`]: which samples a state holds |
//! | `resume` | [`RenderState::can_resume`]: whether a render can go on from a state |
//! | `merge` | [`Merge`]: adds states that hold other samples |
//! | [`mod@export`], `npz` | a state as named numpy arrays |
//! | `sample_file` | [`SampleFile`]: the sample vectors of a render as pieces of a numpy archive |
//! | `error` | [`StateError`] |

mod array_bytes;
mod checkpoint_writer;
mod checkpoints;
mod decode;
mod encode;
mod error;
pub mod export;
pub mod format;
mod header;
mod image_metadata;
mod merge;
mod npz;
mod render_state;
mod resume;
mod sample_file;
mod state_file;
mod stream;

pub use checkpoints::{CheckpointError, Checkpoints};
pub use decode::decode;
pub use encode::encode;
pub use error::{StateError, StateErrorKind};
pub use export::export;
pub use format::{VERSION, estimate_size};
pub use image_metadata::ImageMetadata;
pub use merge::{Merge, MergeError};
pub use render_state::RenderState;
pub use resume::ResumeError;
pub use sample_file::SampleFile;
pub use state_file::check_signature;
pub use stream::Stream;

#[cfg(test)]
mod tests;
