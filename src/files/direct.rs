//! Direct I/O: writes that bypass the page cache, and reserving disk space.
//!
//! Fresh pages of the cache can cost more time than the disk itself, and nobody reads a checkpoint soon. Both are
//! implemented on Linux only; elsewhere the plain write takes their place.

use std::fs::File;
use std::io::{self, Write};

/// Writes `content` at the file's position: whole pages directly from an aligned buffer, the rest through the cache.
/// File systems without direct I/O get all of it through the cache.
#[cfg(target_os = "linux")]
pub fn write_direct(mut file: &File, content: &[u8]) -> io::Result<()> {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    const PAGE: usize = 4096;
    const PAGES_PER_WRITE: usize = 1024;
    let mut rest = content;
    let flags = fcntl_getfl(file)?;
    if content.len() >= PAGE && fcntl_setfl(file, flags | OFlags::DIRECT).is_ok() {
        let mut buffer = vec![0; (PAGES_PER_WRITE + 1) * PAGE];
        let start = buffer.as_ptr().align_offset(PAGE).min(PAGE);
        while rest.len() >= PAGE {
            let length = (rest.len() / PAGE).min(PAGES_PER_WRITE) * PAGE;
            let pages = &mut buffer[start..][..length];
            pages.copy_from_slice(&rest[..length]);
            // The plain write below meets and reports any error that is not about alignment.
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
pub fn write_direct(mut file: &File, content: &[u8]) -> io::Result<()> {
    file.write_all(content)
}

/// Reserves disk space for a file of `bytes`.
///
/// # Errors
/// [`io::ErrorKind::StorageFull`] on file systems that know; others always succeed.
#[cfg(target_os = "linux")]
pub fn reserve(file: &File, bytes: u64) -> io::Result<()> {
    use rustix::fs::{FallocateFlags, fallocate};
    if bytes == 0 {
        return Ok(());
    }
    match fallocate(file, FallocateFlags::empty(), 0, bytes) {
        Err(rustix::io::Errno::NOSPC) => Err(io::Error::from(io::ErrorKind::StorageFull)),
        _ => Ok(()),
    }
}

#[cfg(not(target_os = "linux"))]
pub fn reserve(_: &File, _: u64) -> io::Result<()> {
    Ok(())
}
