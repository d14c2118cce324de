//! Files that are replaced whole or not at all.
//!
//! A render of hours must not lose its last good image to a full disk or a pulled plug, so every
//! writer of this crate writes to a temporary file beside the target, syncs it, and renames it
//! over the target. Whatever fails, the old file is untouched and the temporary one is removed.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

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
    let target = resolve(path)?;
    let temporary = temporary_file(&target)?;
    fill_and_rename(temporary, &target, write)
}

/// Whether [`replace_file`] could begin now; nothing is left behind.
///
/// # Errors
/// Its own, but for what can only be known of the whole file.
pub fn can_replace(path: &Path) -> io::Result<()> {
    temporary_file(&resolve(path)?).map(drop)
}

/// A file that one program replaces again and again, and that nobody reads soon: on Linux it does not go through the
/// system's cache of files, whose fresh pages can cost more than the disk. The temporary file is named after the
/// target, so that what a killed program left is taken up by the next and does not pile up.
///
/// As long as this lives, no other program may replace the file by this way, nor this one what another has put there:
/// whoever comes second would replace hours of work by less.
pub struct OwnFile {
    target: PathBuf,
    /// What stands there, locked; `None` while there is nothing.
    held: Option<File>,
    /// The temporary file, locked, while there is nothing else to hold.
    reserved: Option<NamedTempFile>,
}

impl OwnFile {
    /// Takes a file for this program's own.
    ///
    /// # Errors
    /// As for [`replace_file`]; a file that is another program's.
    pub fn new(path: &Path) -> io::Result<Self> {
        let target = resolve(path)?;
        let held = match File::open(&target) {
            Ok(file) => lock_at(&file, &target).map(|()| Some(file))?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        let reserved = held.is_none().then(|| own_temporary_file(&target)).transpose()?;
        Ok(Self { target, held, reserved })
    }

    /// Replaces its content, whole or not at all.
    ///
    /// # Errors
    /// As for [`replace_file`], and if another program has put something there.
    pub fn replace(&mut self, content: &[u8]) -> io::Result<()> {
        let is_own = self.held.as_ref().is_some_and(|held| is_at(held, &self.target));
        if !is_own && self.target.exists() {
            return Err(others());
        }
        let temporary = match self.reserved.take() {
            Some(reserved) => reserved,
            None => own_temporary_file(&self.target)?,
        };
        let written =
            write_uncached(temporary.as_file(), content).and_then(|()| rename(temporary, &self.target));
        match written {
            Ok(file) => self.held = Some(file),
            Err(error) => {
                self.reserved = self.held.is_none().then(|| own_temporary_file(&self.target).ok()).flatten();
                return Err(error);
            }
        }
        Ok(())
    }

    /// Whether so many bytes could be written now. Leaves nothing behind.
    ///
    /// # Errors
    /// As for [`Self::replace`]; a full disk where the file system can tell beforehand.
    pub fn has_room(&self, bytes: usize) -> io::Result<()> {
        let own;
        let temporary = match &self.reserved {
            Some(reserved) => reserved.as_file(),
            None => {
                own = own_temporary_file(&self.target)?;
                own.as_file()
            }
        };
        let room = reserve(temporary, bytes as u64);
        temporary.set_len(0)?;
        room
    }
}

fn others() -> io::Error {
    io::Error::new(io::ErrorKind::ResourceBusy, "another program is writing this file")
}

/// All that [`OwnFile::replace`] does but replacing, to see how long it takes. The file itself may be being replaced
/// meanwhile.
///
/// # Errors
/// As for [`replace_file`].
pub fn rehearse_own_file(path: &Path, content: &[u8]) -> io::Result<()> {
    let target = resolve(path)?;
    let mut name = target.file_name().unwrap_or_default().to_owned();
    name.push(".rehearsal");
    let temporary = own_temporary_file(&target.with_file_name(name))?;
    write_uncached(temporary.as_file(), content)?;
    temporary.as_file().sync_all()
}

/// Whole pages go to the disk directly, from a buffer of whole pages; what is left, or all of it where the file
/// system cannot do that, is written as ever.
#[cfg(target_os = "linux")]
fn write_uncached(mut file: &File, content: &[u8]) -> io::Result<()> {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    const PAGE: usize = 4096;
    const PAGES_AT_ONCE: usize = 1024;
    let mut rest = content;
    let flags = fcntl_getfl(file)?;
    if content.len() >= PAGE && fcntl_setfl(file, flags | OFlags::DIRECT).is_ok() {
        let mut buffer = vec![0; (PAGES_AT_ONCE + 1) * PAGE];
        let start = buffer.as_ptr().align_offset(PAGE).min(PAGE);
        while rest.len() >= PAGE {
            let length = (rest.len() / PAGE).min(PAGES_AT_ONCE) * PAGE;
            let pages = &mut buffer[start..][..length];
            pages.copy_from_slice(&rest[..length]);
            // What goes wrong here goes wrong below, too, if it is not about pages.
            let Ok(written) = file.write(pages) else { break };
            rest = &rest[written..];
            if !written.is_multiple_of(PAGE) || written == 0 {
                break;
            }
        }
        fcntl_setfl(file, flags)?;
    }
    file.write_all(rest)
}

#[cfg(not(target_os = "linux"))]
fn write_uncached(mut file: &File, content: &[u8]) -> io::Result<()> {
    file.write_all(content)
}

#[cfg(target_os = "linux")]
fn reserve(file: &File, bytes: u64) -> io::Result<()> {
    use rustix::fs::{FallocateFlags, fallocate};
    if bytes == 0 {
        return Ok(());
    }
    match fallocate(file, FallocateFlags::empty(), 0, bytes) {
        Err(rustix::io::Errno::NOSPC) => Err(io::Error::from(io::ErrorKind::StorageFull)),
        // Not every file system can tell.
        _ => Ok(()),
    }
}

#[cfg(not(target_os = "linux"))]
fn reserve(_: &File, _: u64) -> io::Result<()> {
    Ok(())
}

fn fill_and_rename<E: From<io::Error>>(
    temporary: NamedTempFile,
    target: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), E>,
) -> Result<(), E> {
    let mut writer = BufWriter::new(temporary.as_file());
    write(&mut writer)?;
    writer.flush()?;
    drop(writer);
    rename(temporary, target)?;
    Ok(())
}

/// Makes a temporary file durable and puts it in the target's place.
fn rename(temporary: NamedTempFile, target: &Path) -> io::Result<File> {
    if let Ok(old) = fs::metadata(target) {
        temporary.as_file().set_permissions(old.permissions())?;
    }
    temporary.as_file().sync_all()?;
    let file = temporary.persist(target).map_err(|error| error.error)?;
    sync_folder(folder_of(target));
    Ok(file)
}

/// The file that a link stands for, which may be still to come; `path` itself where there is nothing yet.
///
/// # Errors
/// Links that lead nowhere.
pub fn behind_links(path: &Path) -> io::Result<PathBuf> {
    match fs::canonicalize(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => match fs::read_link(path) {
            Ok(link) => behind_links(&folder_of(path).join(link)),
            Err(_) => Ok(path.to_path_buf()),
        },
        resolved => resolved,
    }
}

/// What will be replaced.
fn resolve(path: &Path) -> io::Result<PathBuf> {
    let target = behind_links(path)?;
    if fs::metadata(&target).is_ok_and(|old| !old.is_file()) {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "exists and is not a regular file"));
    }
    Ok(target)
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// In the target's folder, because a rename is atomic within one file system only. Named after it, so that what killed
/// programs leave does not pile up, and by chance where another program writes the same file.
fn temporary_file(target: &Path) -> io::Result<NamedTempFile> {
    own_temporary_file(target).or_else(|_| temporary_file_by_chance(folder_of(target)))
}

fn temporary_file_by_chance(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".prpf-").suffix(".tmp");
    not_private(&mut builder);
    builder.tempfile_in(folder)
}

/// Named after the target, locked as long as it is open.
fn own_temporary_file(target: &Path) -> io::Result<NamedTempFile> {
    let folder = folder_of(target);
    let mut name = OsString::from(".");
    name.push(target.file_name().unwrap_or_default());
    let mut builder = tempfile::Builder::new();
    builder.prefix(&name).suffix(".tmp").rand_bytes(0);
    not_private(&mut builder);
    let mut left = name.clone();
    left.push(".tmp");
    let left = folder.join(left);
    if let Ok(file) = File::open(&left) {
        lock_at(&file, &left)?;
        fs::remove_file(&left)?;
    }
    let temporary = builder.tempfile_in(folder)?;
    lock_at(temporary.as_file(), &left)?;
    Ok(temporary)
}

/// Locks a file, as long as it is what stands at `path`: another program may have removed it before it was locked,
/// and put its own there. Where files cannot be locked, two programs have to keep apart by themselves.
fn lock_at(file: &File, path: &Path) -> io::Result<()> {
    let is_others = matches!(file.try_lock(), Err(fs::TryLockError::WouldBlock));
    if is_others || !is_at(file, path) {
        return Err(others());
    }
    Ok(())
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let place = |data: fs::Metadata| (data.dev(), data.ino());
    let [locked, there] = [file.metadata(), fs::metadata(path)].map(|data| data.map(place).ok());
    locked.is_some() && locked == there
}

#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

/// Temporary files are private by default; an image is not, so it gets what the umask grants.
fn not_private(builder: &mut tempfile::Builder) {
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
}

/// Makes the rename itself durable; elsewhere than on Unix a folder cannot be synced.
#[cfg(unix)]
fn sync_folder(folder: &Path) {
    // Some network file systems cannot sync a folder; the file is complete all the same.
    File::open(folder).and_then(|folder| folder.sync_all()).ok();
}

#[cfg(not(unix))]
fn sync_folder(_: &Path) {}

#[cfg(test)]
mod tests {
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
    fn whether_a_file_can_be_replaced_is_known_before_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        assert!(can_replace(&folder.path().join("new.exr")).is_ok());
        assert!(can_replace(&folder.path().join("none/new.exr")).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        // Not even root may.
        #[cfg(target_os = "linux")]
        assert!(can_replace(Path::new("/proc/new.exr")).is_err());
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

    #[test]
    fn a_file_past_the_cache_is_the_same_whatever_its_length() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        // Of no page, of whole pages, of some and a rest, of more than are written at once.
        for length in [0, 1, 4095, 4096, 8192, 12_345, 5_000_000, 8 << 20] {
            let content: Vec<u8> =
                (0..length).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
            OwnFile::new(&path).unwrap().replace(&content).unwrap();
            assert!(fs::read(&path).unwrap() == content, "{length}");
            rehearse_own_file(&path, &content[..length as usize / 2]).unwrap();
            assert!(fs::read(&path).unwrap() == content, "{length}");
        }
        assert_eq!(names_in(folder.path()), ["a"]);
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
        // And where what it stands for is still to come.
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
    fn what_a_killed_program_left_is_taken_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::write(folder.path().join(".a.tmp"), b"left").unwrap();
        // While another program writes it, this one does not wait.
        let others = own_temporary_file(&folder.path().join("b")).unwrap();
        for name in ["a", "b"] {
            replace(&folder.path().join(name), b"new").unwrap();
        }
        drop(others);
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names_in(folder.path()), ["a", "b"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_another_program_writes_is_left_to_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let busy = |result: io::Result<()>| result.unwrap_err().kind() == io::ErrorKind::ResourceBusy;
        // From the start, when there is nothing yet.
        let mut others = OwnFile::new(&path).unwrap();
        others.has_room(100_000).unwrap();
        assert!(busy(OwnFile::new(&path).map(drop)));
        // To see how long it would take does not disturb it.
        rehearse_own_file(&path, b"x").unwrap();
        others.replace(b"x").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"x");
        drop(others);
        let mut own = OwnFile::new(&path).unwrap();
        let others = own_temporary_file(&path).unwrap();
        assert!(busy(own.replace(b"x")) && busy(own.has_room(1)));
        // What one program has locked is not what stands there any more.
        fs::remove_file(others.path()).unwrap();
        fs::write(others.path(), b"").unwrap();
        assert!(!is_at(others.as_file(), others.path()));
        own.replace(b"y").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"y");
        // What one keeps, another may not take, be it old or its latest.
        assert!(busy(OwnFile::new(&path).map(drop)));
        own.replace(b"z").unwrap();
        assert!(busy(OwnFile::new(&path).map(drop)));
        fs::remove_file(&path).unwrap();
        own.replace(b"again").unwrap();
        drop(own);
        let mut next = OwnFile::new(&path).unwrap();
        // And what stands there by other ways is not replaced.
        replace(&path, b"longer").unwrap();
        assert!(busy(next.replace(b"w")));
        assert_eq!(fs::read(&path).unwrap(), b"longer");
        let mut early = OwnFile::new(&folder.path().join("b")).unwrap();
        replace(&folder.path().join("b"), b"others").unwrap();
        assert!(busy(early.replace(b"w")));
    }
}
