//! Reads scenes in pbrt's scene description format, of versions 2, 3 and 4.
//!
//! `parser` splits text into tokens and statements, `directives` carries them out on the
//! `builder::SceneBuilder`, which holds the scene under construction. The remaining folders
//! hold the directives by subject. `dialect` lists the differences between the versions.
//!
//! Source: the file format specification of pbrt-v4 (pbrt.org/fileformat-v4).

mod builder;
mod camera_directives;
mod dialect;
mod dialect_detection;
mod directives;
mod files;
mod lights;
mod materials;
mod options;
mod parser;
mod read_progress;
mod reader;
mod scene_error;
mod shapes;
mod spectrum;
#[cfg(test)]
mod tests;
mod textures;

pub use self::camera_directives::camera_directives;
pub use self::dialect::Dialect;
pub use self::read_progress::ReadProgress;
pub use self::reader::{read, read_reporting, read_str};
pub use self::scene_error::SceneError;
