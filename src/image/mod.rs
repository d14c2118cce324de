//! Holds images as planes of `f32`; reads and writes image files, encodes them for display, and compares
//! them.
//!
//! | file | holds |
//! | --- | --- |
//! | [`planes`] | [`Planes`], the one container for images, feature buffers and maps |
//! | [`exr_file`] | reads and writes OpenEXR with named layers and attributes |
//! | [`png_file`] | writes 8-bit sRGB PNG; reads PNG, JPEG and TGA |
//! | [`output_format`] | [`OutputFormat`], chosen by a file name's extension |
//! | `read_rgb` | [`read_rgb()`]: any supported file, by its content |
//! | [`tone`] | luminance, the sRGB transfer curve |
//! | [`metrics`], [`perceptual`] | errors of an image with respect to a reference |
//! | `comparison` | [`Comparison`]: all of these at once |
//! | `enlargement` | full images of coarse ones |
//! | [`error`] | [`ImageError`], an image file and its problem |

mod comparison;
pub(crate) mod enlargement;
pub mod error;
pub mod exr_file;
pub mod metrics;
pub mod output_format;
pub mod perceptual;
pub mod planes;
pub mod png_file;
mod read_rgb;
pub mod tone;

pub use comparison::Comparison;
pub use error::{ImageError, Problem};
pub use output_format::OutputFormat;
pub use planes::Planes;
pub use read_rgb::read_rgb;
pub use tone::luminance;
