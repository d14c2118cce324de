//! Advisory file locks, and the check that an open file is still the one at its path.
//!
//! On file systems without locks two processes have to avoid each other by themselves.

use std::fs::{self, File};
use std::io;
use std::path::Path;

/// Opens a file that is to be locked: for writing as well if that is permitted, since NFS locks no file that is only read.
///
/// # Errors
/// Those of opening the file.
pub fn open_to_lock(path: &Path) -> io::Result<File> {
    match File::options().read(true).write(true).open(path) {
        Err(error) if error.kind() == io::ErrorKind::PermissionDenied => File::open(path),
        opened => opened,
    }
}

/// Locks an open file until it is closed.
///
/// # Errors
/// [`io::ErrorKind::ResourceBusy`] if another process holds the lock, or if another file stands at `path` by now: its
/// owner may have removed this one before it was locked.
pub fn lock_at(file: &File, path: &Path) -> io::Result<()> {
    let is_locked = matches!(file.try_lock(), Err(fs::TryLockError::WouldBlock));
    if is_locked || !is_at(file, path) {
        return Err(busy());
    }
    Ok(())
}

/// Returns the error for a file that another process owns.
pub fn busy() -> io::Error {
    io::Error::new(io::ErrorKind::ResourceBusy, "another program is writing this file")
}

/// Tests whether an open file is the one at `path`: same device, same inode.
#[cfg(unix)]
pub fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |data: fs::Metadata| (data.dev(), data.ino());
    let [open, at_path] = [file.metadata(), fs::metadata(path)].map(|data| data.map(identity).ok());
    open.is_some() && open == at_path
}

#[cfg(not(unix))]
pub fn is_at(_: &File, _: &Path) -> bool {
    true
}
