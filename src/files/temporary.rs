//! Temporary files beside the file that they will replace.
//!
//! They stand in the target's folder, because a rename is atomic within one file system only. Their name follows from
//! the target's, so that the next process removes what a killed one left behind.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io;
use std::path::Path;

use tempfile::NamedTempFile;

use super::error_message::error_message;
use super::links::folder_of;
use super::lock::{busy, is_at, lock_at, open_to_lock};

/// Creates a temporary file for `target`, under a random name if another process is writing the same target.
pub fn temporary_file(target: &Path) -> io::Result<NamedTempFile> {
    locked_temporary_file(target).or_else(|_| random_temporary_file(folder_of(target)))
}

/// Creates the temporary file named after `target`, locked while it is open.
///
/// # Errors
/// [`io::ErrorKind::ResourceBusy`] if another process has it; those of the file system.
pub fn locked_temporary_file(target: &Path) -> io::Result<NamedTempFile> {
    let folder = folder_of(target);
    let mut name = OsString::from(".");
    name.push(target.file_name().unwrap_or_default());
    let mut builder = tempfile::Builder::new();
    builder.prefix(&name).suffix(".tmp").rand_bytes(0);
    grant_by_umask(&mut builder);
    let mut stale = name.clone();
    stale.push(".tmp");
    let stale = folder.join(stale);
    if let Ok(file) = open_to_lock(&stale) {
        lock_at(&file, &stale)?;
        fs::remove_file(&stale)?;
    }
    let temporary = builder.tempfile_in(folder)?;
    lock_at(temporary.as_file(), &stale)?;
    Ok(temporary)
}

fn random_temporary_file(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".prpf-").suffix(".tmp");
    grant_by_umask(&mut builder);
    builder.tempfile_in(folder)
}

/// Makes a temporary file durable and renames it over `target`, whose permissions it takes as far as it may. If the system does
/// not let it, the temporary file stays, since its content may have taken hours.
///
/// # Errors
/// [`io::ErrorKind::ResourceBusy`] if another process has put a file of its own in the temporary one's place, which then
/// stays; those of the file system, such as [`io::ErrorKind::NotFound`] if the temporary file was removed with its folder.
pub fn rename_over(temporary: NamedTempFile, target: &Path) -> io::Result<File> {
    if let Ok(old) = fs::metadata(target) {
        // Some file systems keep no permissions
        temporary.as_file().set_permissions(old.permissions()).ok();
    }
    temporary.as_file().sync_all()?;
    if !is_at(temporary.as_file(), temporary.path()) {
        let removed = fs::symlink_metadata(temporary.path()).err();
        // Dropped, it would remove the other process's file.
        temporary.keep().map_err(|error| error.error)?;
        return Err(removed.unwrap_or_else(busy));
    }
    match temporary.persist(target) {
        Ok(file) => {
            sync_folder(folder_of(target));
            Ok(file)
        }
        Err(refused) => {
            let (_, path) = refused.file.keep().map_err(|error| error.error)?;
            let cause = error_message(&refused.error);
            Err(io::Error::other(format!("{cause}; the new content is in {}", path.display())))
        }
    }
}

/// Temporary files are private by default; the final file gets the permissions that the umask grants.
fn grant_by_umask(builder: &mut tempfile::Builder) {
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
}

/// Makes the rename itself durable.
#[cfg(unix)]
fn sync_folder(folder: &Path) {
    // Some network file systems cannot sync a folder; the file is complete all the same.
    File::open(folder).and_then(|folder| folder.sync_all()).ok();
}

/// Only Unix can sync a folder.
#[cfg(not(unix))]
fn sync_folder(_: &Path) {}
