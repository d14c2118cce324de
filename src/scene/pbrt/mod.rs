//! Reader of pbrt's scene description.
//!
//! tokens → directives → scene; what differs between the dialects v2, v3 and v4 stands in one
//! place.

use std::path::Path;

use super::Scene;

/// Why a scene could not be read: file, line, column, what was found, what would be accepted.
#[derive(Debug, thiserror::Error)]
#[error("{file}:{line}:{column}: {message}")]
pub struct SceneError {
    pub file: String,
    /// 1-based; 0 where the error concerns the file as a whole.
    pub line: usize,
    pub column: usize,
    pub message: String,
}

/// Reads a scene file and all it includes.
///
/// # Errors
/// On anything that is wrong in a file, or missing.
pub fn read(path: &Path) -> Result<Scene, SceneError> {
    let _ = path;
    todo!()
}

/// Reads a scene from text; relative file names are resolved against `folder`.
///
/// # Errors
/// As [`read`].
pub fn read_str(text: &str, folder: &Path) -> Result<Scene, SceneError> {
    let _ = (text, folder);
    todo!()
}
