//! Resolves the symbolic links of a path that is about to be written.
//!
//! Takes a path; gives the path of the file that a write through it reaches.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Returns the file that a link points to, which need not exist yet; without a link, the path of an existing file
/// in canonical form, or `path` itself.
///
/// # Errors
/// Links that form a cycle, folders that cannot be read.
pub fn resolve_links(path: &Path) -> io::Result<PathBuf> {
    match fs::canonicalize(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => match fs::read_link(path) {
            Ok(link) => resolve_links(&folder_of(path).join(link)),
            Err(_) => Ok(path.to_path_buf()),
        },
        resolved => resolved,
    }
}

/// Returns the file that replacing `path` replaces, links resolved.
///
/// # Errors
/// Those of [`resolve_links`]; an existing target that is not a regular file.
pub(super) fn resolve_target(path: &Path) -> io::Result<PathBuf> {
    let target = resolve_links(path)?;
    if fs::metadata(&target).is_ok_and(|old| !old.is_file()) {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "exists and is not a regular file"));
    }
    Ok(target)
}

/// Returns the folder that holds `path`; `.` for a bare file name.
pub(super) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
