//! Replaces a file whole or not at all.
//!
//! A render of hours must not lose its last good image to a full disk or a power failure. Every writer of this crate
//! therefore writes to a temporary file beside the target, syncs it, and renames it over the target. If any step
//! fails, the old file stays untouched and the temporary one is removed, unless it is complete and only the renaming failed.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::links::{folder_of, resolve_target};
use super::temporary::{rename_over, temporary_file};

/// Replaces `path` by what `write` produces.
///
/// A symbolic link is followed, and the permissions of an existing file are kept.
///
/// # Errors
/// Those of `write`, and those of the file system: no such folder, unwritable folder, disk full.
/// A target that exists and is not a regular file is refused: renaming over a device or a pipe
/// would remove it.
pub fn replace_file<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), E>,
) -> Result<(), E> {
    let target = resolve_target(path)?;
    let temporary = temporary_file(&target)?;
    let mut writer = BufWriter::new(temporary.as_file());
    write(&mut writer)?;
    writer.flush()?;
    drop(writer);
    rename_over(temporary, &target)?;
    Ok(())
}

/// Tests whether [`replace_file`] could begin and end now, and leaves nothing behind.
///
/// # Errors
/// Those of [`replace_file`] that can be known before there is any content.
pub fn can_replace(path: &Path) -> io::Result<()> {
    let target = resolve_target(path)?;
    let temporary = temporary_file(&target)?;
    let refused = Err(io::ErrorKind::PermissionDenied.into());
    if may_rename_over(&target, temporary.as_file())? { Ok(()) } else { refused }
}

/// Returns whether this process, which owns `own`, may rename over the target: in a folder with the sticky bit, as `/tmp`, only
/// what is its own.
#[cfg(unix)]
fn may_rename_over(target: &Path, own: &File) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    const STICKY: u32 = 0o1000;
    const ROOT: u32 = 0;
    let Ok(old) = target.metadata() else { return Ok(true) };
    let folder = folder_of(target).metadata()?;
    let user = own.metadata()?.uid();
    Ok(folder.mode() & STICKY == 0 || [ROOT, old.uid(), folder.uid()].contains(&user))
}

/// Only Unix has the sticky bit.
#[cfg(not(unix))]
fn may_rename_over(_: &Path, _: &File) -> io::Result<bool> {
    Ok(true)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::temporary::locked_temporary_file;
    use super::*;

    fn names_in(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn replace(path: &Path, content: &[u8]) -> io::Result<()> {
        replace_file(path, |writer| writer.write_all(content))
    }

    #[test]
    fn can_replace_tells_beforehand_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        assert!(can_replace(&folder.path().join("new.exr")).is_ok());
        assert!(can_replace(&folder.path().join("none/new.exr")).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        // Not even root may write there.
        #[cfg(target_os = "linux")]
        assert!(can_replace(Path::new("/proc/new.exr")).is_err());
    }

    /// As for another user's file in a folder with the sticky bit, or a mounted file.
    #[test]
    fn what_cannot_take_the_targets_place_stays_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a");
        let mut temporary = temporary_file(&target).unwrap();
        temporary.write_all(b"new").unwrap();
        fs::create_dir(&target).unwrap();
        let message = rename_over(temporary, &target).unwrap_err().to_string();
        assert!(message.contains("the new content is in") && message.ends_with(".a.tmp"), "{message}");
        assert_eq!(fs::read(folder.path().join(".a.tmp")).unwrap(), b"new");
    }

    #[test]
    fn a_file_is_created_and_then_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        replace(&path, b"first, longer").unwrap();
        replace(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(names_in(folder.path()), ["a"]);
    }

    #[test]
    fn a_full_disk_leaves_the_old_file_and_no_temporary_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        replace(&path, b"old").unwrap();
        let result = replace_file(&path, |writer| {
            writer.write_all(b"half of the new")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        });
        assert_eq!(result.unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names_in(folder.path()), ["a"]);
    }

    #[cfg(unix)]
    #[test]
    fn another_processs_file_in_the_temporary_ones_place_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (path, temporary) = (folder.path().join("a"), folder.path().join(".a.tmp"));
        replace(&path, b"old").unwrap();
        let result = replace_file(&path, |writer| {
            writer.write_all(b"new")?;
            // As another process does where there are no locks.
            fs::remove_file(&temporary)?;
            fs::write(&temporary, b"half of another's")
        });
        assert_eq!(result.unwrap_err().kind(), io::ErrorKind::ResourceBusy);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read(&temporary).unwrap(), b"half of another's");
    }

    #[cfg(unix)]
    #[test]
    fn an_unwritable_folder_leaves_the_old_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        replace(&path, b"old").unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o555)).unwrap();
        let result = replace(&path, b"new");
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        // A privileged user may write everywhere: then the new content must be whole.
        match result {
            Err(error) => {
                assert_eq!(error.kind(), io::ErrorKind::PermissionDenied);
                assert_eq!(fs::read(&path).unwrap(), b"old");
            }
            Ok(()) => assert_eq!(fs::read(&path).unwrap(), b"new"),
        }
        assert_eq!(names_in(folder.path()), ["a"]);
    }

    #[test]
    fn a_missing_folder_and_a_file_as_folder_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let missing = replace(&folder.path().join("no/a"), b"x").unwrap_err();
        assert_eq!(missing.kind(), io::ErrorKind::NotFound);
        replace(&folder.path().join("file"), b"x").unwrap();
        let below_file = replace(&folder.path().join("file/a"), b"x").unwrap_err();
        assert_eq!(below_file.kind(), io::ErrorKind::NotADirectory);
        assert_eq!(names_in(folder.path()), ["file"]);
    }

    #[test]
    fn a_folder_in_the_targets_place_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("a")).unwrap();
        assert!(replace(&folder.path().join("a"), b"x").is_err());
        assert_eq!(names_in(folder.path()), ["a"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_refused_and_stays() {
        use std::os::unix::fs::FileTypeExt;
        assert!(replace(Path::new("/dev/null"), b"x").is_err());
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_followed_and_permissions_are_kept() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        replace(&file, b"old").unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        replace(&link, b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        // A link whose target does not exist yet is followed, too.
        fs::create_dir(folder.path().join("sub")).unwrap();
        let early = folder.path().join("early");
        std::os::unix::fs::symlink("sub/late", &early).unwrap();
        replace(&early, b"first").unwrap();
        assert!(fs::symlink_metadata(&early).unwrap().is_symlink());
        assert_eq!(fs::read(folder.path().join("sub/late")).unwrap(), b"first");
        let ring = folder.path().join("ring");
        std::os::unix::fs::symlink(&ring, &ring).unwrap();
        assert!(replace(&ring, b"x").is_err());
    }

    #[test]
    fn temporary_files_of_a_killed_process_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::write(folder.path().join(".a.tmp"), b"left").unwrap();
        // Another process writes `b` at the same time; this one does not wait for it.
        let others = locked_temporary_file(&folder.path().join("b")).unwrap();
        for name in ["a", "b"] {
            replace(&folder.path().join(name), b"new").unwrap();
        }
        drop(others);
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names_in(folder.path()), ["a", "b"]);
    }
}
