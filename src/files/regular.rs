//! Opens regular files only: pipes and devices could block or never end.
//!
//! Takes a path; gives the open file and its length.

use std::fs::File;
use std::path::Path;

use super::error_message::error_message;

/// Opens a file for reading; also returns its length in bytes.
///
/// # Errors
/// The cause without the file's name; also for anything but a regular file.
pub fn open_regular(path: &Path) -> Result<(File, u64), String> {
    // The kind is checked first: opening a pipe waits for a writer, and a device may never end.
    let metadata = path.metadata().map_err(|error| error_message(&error))?;
    if metadata.is_dir() {
        return Err("it is a folder".into());
    }
    if !metadata.is_file() {
        return Err("it is no regular file".into());
    }
    Ok((File::open(path).map_err(|error| error_message(&error))?, metadata.len()))
}
