//! Checks of the paths of files that are written, before minutes of work.

use std::path::Path;

use prpf::files::{can_replace, error_message};
use prpf::output::paths;
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;

use crate::errors::file_error;

/// Checks that a file can be written.
///
/// # Errors
/// That of the file system, a name that is no file's.
pub fn can_be_written(path: &Path) -> PyResult<()> {
    can_replace(path).map_err(|error| {
        file_error(error.kind(), format!("{}: {}", path.display(), error_message(&error)))
    })?;
    // This refuses names that end like those of folders as well
    paths::can_be_written(path).map_err(|error| PyOSError::new_err(error.to_string()))
}
