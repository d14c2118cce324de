//! Reads and writes files that hold a render state.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use super::decode::decode;
use super::encode::encode;
use super::error::{StateError, StateErrorKind};
use super::format::MAGIC;
use super::render_state::RenderState;
use crate::files::ExclusiveFile;
use crate::files::exclusive::write_and_discard;
use crate::memory::check_available;

/// Tests whether a file begins with the signature of a render state.
///
/// # Errors
/// A file that cannot be read, or that is something else.
pub fn check_signature(path: &Path) -> Result<(), StateError> {
    let check = || {
        let data = path.metadata()?;
        if !data.is_file() && !data.is_dir() {
            // Opening a pipe would wait for a writer.
            return Err(StateErrorKind::Foreign);
        }
        let mut first = Vec::new();
        File::open(path)?.take(MAGIC.len() as u64).read_to_end(&mut first)?;
        if first == MAGIC { Ok(()) } else { Err(StateErrorKind::Foreign) }
    };
    check().map_err(|kind| StateError { path: path.to_path_buf(), kind })
}

impl RenderState {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read, is no state, has another version, or is damaged.
    pub fn read(path: &Path) -> Result<Self, StateError> {
        // A file of another kind may be larger than the memory.
        check_signature(path)?;
        let read = || {
            // The bytes, and the store that they become.
            let bytes = 2 * std::fs::metadata(path)?.len();
            check_available(bytes).map_err(StateErrorKind::Memory)?;
            decode(&std::fs::read(path)?)
        };
        read().map_err(|kind| StateError { path: path.to_path_buf(), kind })
    }

    /// Replaces a file, whole or not at all.
    ///
    /// # Errors
    /// Those of the file system: no such folder, unwritable folder, disk full; a file that another process owns.
    pub fn write(&self, path: &Path) -> Result<(), StateError> {
        let mut file = Vec::new();
        encode(self, &mut file);
        ExclusiveFile::new(path)
            .and_then(|mut target| target.replace(&file))
            .map_err(|error| StateError { path: path.to_path_buf(), kind: error.into() })
    }

    /// Does the work of [`Self::write`] without changing the file, to calibrate how long it takes.
    ///
    /// # Errors
    /// Those of [`Self::write`].
    pub fn write_and_discard(&self, path: &Path) -> io::Result<()> {
        let mut file = Vec::new();
        encode(self, &mut file);
        write_and_discard(path, &file)
    }
}
