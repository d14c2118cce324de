//! Replaces one file again and again, and keeps other processes from replacing it meanwhile.
//!
//! Two renders that wrote the same checkpoint would replace hours of work by less. An [`ExclusiveFile`] therefore
//! locks the file, or its temporary file while there is none, until it is dropped. Its content bypasses the page
//! cache (see `direct`).

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::direct::{reserve, write_direct};
use super::links::resolve_target;
use super::lock::{busy, is_at, lock_at, open_to_lock};
use super::temporary::{locked_temporary_file, rename_over};

/// A file that only this process may replace, as long as this value lives.
///
/// It never replaces a file that another process has put at its path.
pub struct ExclusiveFile {
    target: PathBuf,
    /// The existing file, locked; `None` while there is none.
    current: Option<File>,
    /// The temporary file, locked, while there is no existing file to lock.
    reserved: Option<NamedTempFile>,
}

impl ExclusiveFile {
    /// Locks the file at `path`, which need not exist yet.
    ///
    /// # Errors
    /// Those of [`super::replace_file`]; [`io::ErrorKind::ResourceBusy`] if another process has locked it.
    pub fn new(path: &Path) -> io::Result<Self> {
        let target = resolve_target(path)?;
        let current = match open_to_lock(&target) {
            Ok(file) => lock_at(&file, &target).map(|()| Some(file))?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        let reserved = current.is_none().then(|| locked_temporary_file(&target)).transpose()?;
        Ok(Self { target, current, reserved })
    }

    /// Replaces the file's content, whole or not at all.
    ///
    /// # Errors
    /// Those of [`super::replace_file`]; [`io::ErrorKind::ResourceBusy`] if another process has replaced the file.
    pub fn replace(&mut self, content: &[u8]) -> io::Result<()> {
        let is_own = self.current.as_ref().is_some_and(|current| is_at(current, &self.target));
        if !is_own && self.target.exists() {
            return Err(busy());
        }
        let temporary = match self.reserved.take() {
            Some(reserved) => reserved,
            None => locked_temporary_file(&self.target)?,
        };
        let written =
            write_direct(temporary.as_file(), content).and_then(|()| rename_over(temporary, &self.target));
        match written {
            Ok(file) => self.current = Some(file),
            Err(error) => {
                // Where locks do not work, two processes that each took the other's place again would never write. What could not be
                // renamed stays
                let stays = matches!(error.kind(), io::ErrorKind::ResourceBusy | io::ErrorKind::Other);
                let reserves = self.current.is_none() && !stays;
                self.reserved = reserves.then(|| locked_temporary_file(&self.target).ok()).flatten();
                return Err(error);
            }
        }
        Ok(())
    }

    /// Tests whether the disk has space for `bytes` bytes beside the current file, and leaves nothing behind.
    ///
    /// # Errors
    /// Those of [`Self::replace`]; [`io::ErrorKind::StorageFull`] where the file system can tell.
    pub fn check_space(&self, bytes: usize) -> io::Result<()> {
        let own;
        let temporary = match &self.reserved {
            Some(reserved) => reserved.as_file(),
            None => {
                own = locked_temporary_file(&self.target)?;
                own.as_file()
            }
        };
        let result = reserve(temporary, bytes as u64);
        temporary.set_len(0)?;
        result
    }
}

/// Writes `content` as [`ExclusiveFile::replace`] does, but to a file that is then removed: calibrates how long
/// writing takes. The file at `path` is untouched and may be locked.
///
/// # Errors
/// Those of [`super::replace_file`].
pub fn write_and_discard(path: &Path, content: &[u8]) -> io::Result<()> {
    let target = resolve_target(path)?;
    let mut name = target.file_name().unwrap_or_default().to_owned();
    name.push(".calibration");
    let temporary = locked_temporary_file(&target.with_file_name(name))?;
    write_direct(temporary.as_file(), content)?;
    temporary.as_file().sync_all()
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::io::Write;

    use super::super::replace_file;
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
    fn contents_of_any_length_are_written_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        // Less than a page, whole pages, pages and a rest, more than one write takes.
        for length in [0, 1, 4095, 4096, 8192, 12_345, 5_000_000, 8 << 20] {
            let content: Vec<u8> =
                (0..length).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
            ExclusiveFile::new(&path).unwrap().replace(&content).unwrap();
            assert!(fs::read(&path).unwrap() == content, "{length}");
            write_and_discard(&path, &content[..length as usize / 2]).unwrap();
            assert!(fs::read(&path).unwrap() == content, "{length}");
        }
        assert_eq!(names_in(folder.path()), ["a"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_another_process_owns_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let busy = |result: io::Result<()>| result.unwrap_err().kind() == io::ErrorKind::ResourceBusy;
        // Before the file exists.
        let mut others = ExclusiveFile::new(&path).unwrap();
        others.check_space(100_000).unwrap();
        assert!(busy(ExclusiveFile::new(&path).map(drop)));
        // A calibration does not disturb the owner.
        write_and_discard(&path, b"x").unwrap();
        others.replace(b"x").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"x");
        drop(others);
        let mut own = ExclusiveFile::new(&path).unwrap();
        let others = locked_temporary_file(&path).unwrap();
        assert!(busy(own.replace(b"x")) && busy(own.check_space(1)));
        // A lock on a file that was removed protects nothing.
        fs::remove_file(others.path()).unwrap();
        fs::write(others.path(), b"").unwrap();
        assert!(!is_at(others.as_file(), others.path()));
        own.replace(b"y").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"y");
        // The existing file is locked, and so is each that replaces it.
        assert!(busy(ExclusiveFile::new(&path).map(drop)));
        own.replace(b"z").unwrap();
        assert!(busy(ExclusiveFile::new(&path).map(drop)));
        fs::remove_file(&path).unwrap();
        own.replace(b"again").unwrap();
        drop(own);
        let mut next = ExclusiveFile::new(&path).unwrap();
        // A file that was put there by other means is not replaced.
        replace(&path, b"longer").unwrap();
        assert!(busy(next.replace(b"w")));
        assert_eq!(fs::read(&path).unwrap(), b"longer");
        let mut early = ExclusiveFile::new(&folder.path().join("b")).unwrap();
        replace(&folder.path().join("b"), b"others").unwrap();
        assert!(busy(early.replace(b"w")));
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_that_was_removed_is_named_as_the_cause() {
        let folder = tempfile::tempdir().unwrap();
        let removed = folder.path().join("removed");
        fs::create_dir(&removed).unwrap();
        let mut own = ExclusiveFile::new(&removed.join("a")).unwrap();
        fs::remove_dir_all(&removed).unwrap();
        for _ in 0..2 {
            assert_eq!(own.replace(b"x").unwrap_err().kind(), io::ErrorKind::NotFound);
        }
        fs::create_dir(&removed).unwrap();
        own.replace(b"x").unwrap();
        assert_eq!(fs::read(removed.join("a")).unwrap(), b"x");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_may_only_be_read_is_locked_and_replaced() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        replace(&path, b"old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
        ExclusiveFile::new(&path).unwrap().replace(b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }
}
