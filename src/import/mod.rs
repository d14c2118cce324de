//! Reads renders of other programs: finds their layers by name, and makes a store of two renders of one frame that differ
//! in their seeds, or of one render with its variance.
//!
//! | file | holds |
//! | --- | --- |
//! | `exr_layer` | the layers of a file: channels of one part with a common name |
//! | `role` | what a denoiser needs, and the names by which renderers call it |
//! | `frame` | the planes of one file |
//! | `halves` | the halves of a store, of two frames or of one |

mod exr_layer;
mod frame;
mod halves;
mod role;

use std::path::PathBuf;

pub use frame::Frame;
pub use halves::FrameStore;
pub use role::{LayerMap, Role};

use crate::image::ImageError;
use crate::stats::HalfMomentsError;

/// A file that cannot be denoised. The message is complete.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error("{}: {problem}", path.display())]
    Layers { path: PathBuf, problem: String },
    #[error("{0}")]
    Frames(String),
    #[error(transparent)]
    Moments(#[from] HalfMomentsError),
}
