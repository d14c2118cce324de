//! Opening files that end.

use std::fs::File;
use std::path::Path;

/// Opens a file for reading; also gives its length in bytes.
///
/// # Errors
/// The system's words, without the file's name; the same for what is no regular file.
pub fn open(path: &Path) -> Result<(File, u64), String> {
    // Before opening: a pipe would wait for who writes into it, a device may never end.
    let metadata = path.metadata().map_err(|error| error.to_string())?;
    if metadata.is_dir() {
        return Err("it is a folder".into());
    }
    if !metadata.is_file() {
        return Err("it is no regular file".into());
    }
    Ok((File::open(path).map_err(|error| error.to_string())?, metadata.len()))
}
