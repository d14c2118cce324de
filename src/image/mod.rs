//! Planes of `f32`, image files, tone mapping and error metrics.
//!
//! | file | holds |
//! | --- | --- |
//! | [`planes`] | [`Planes`], the one container for images, feature buffers and maps |
//! | [`exr_file`] | OpenEXR with named layers and attributes |
//! | [`png_file`] | 8-bit sRGB out; PNG, JPEG and TGA in |
//! | [`formats`] | which of the two a file name or a file's content means |
//! | [`tone`] | the sRGB transfer curve |
//! | [`metrics`], [`perceptual`] | how far an image is from its reference |

pub mod error;
pub mod exr_file;
pub mod formats;
pub mod metrics;
pub mod perceptual;
pub mod planes;
pub mod png_file;
pub mod tone;

pub use error::{ImageError, Problem};
pub use planes::Planes;
