//! A file whose camera replaces that of the scene.

use std::path::PathBuf;

/// The directives of a camera, from a file of their own.
pub struct CameraFile {
    pub path: PathBuf,
    pub text: Vec<u8>,
}
