//! A render's state as a file: everything that is needed to go on, to filter again, or to add to the
//! states of other machines.
//!
//! [`mod@format`] says what the bytes are, [`Keeper`] gets them to the disk while the render goes on,
//! [`Stream`]s say which samples a state holds and so what it may be merged with.

mod arrays;
pub mod export;
pub mod format;
mod header;
mod keeper;
mod merge;
mod npz;
mod stream;

use std::fs::File;
use std::io::Read;
use std::path::Path;

pub use export::export;
pub use format::{Problem, VERSION, bytes, read_bytes, size};
pub use header::Frame;
pub use keeper::Keeper;
pub use merge::{Merge, MergeError};
pub use stream::Stream;

use crate::files::{self, ExclusiveFile};
use crate::progressive::{Memory, Settings};

/// A render that can go on.
#[derive(Clone, Debug)]
pub struct State {
    pub frame: Frame,
    pub settings: Settings,
    /// The samples it holds: one stream, or several that were merged.
    pub streams: Vec<Stream>,
    pub memory: Memory,
}

/// What is wrong with a state file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct StateError {
    pub path: std::path::PathBuf,
    pub problem: Problem,
}

/// Whether a file begins as states do.
///
/// # Errors
/// A file that cannot be read, or that is something else.
pub fn check_kind(path: &Path) -> Result<(), StateError> {
    let begins = || {
        let data = path.metadata()?;
        if !data.is_file() && !data.is_dir() {
            // A pipe would wait for who writes into it.
            return Err(Problem::Foreign);
        }
        let mut first = Vec::new();
        File::open(path)?.take(format::MAGIC.len() as u64).read_to_end(&mut first)?;
        if first == format::MAGIC { Ok(()) } else { Err(Problem::Foreign) }
    };
    begins().map_err(|problem| StateError { path: path.to_path_buf(), problem })
}

impl State {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read, is no state, is of another version, or is damaged.
    pub fn read(path: &Path) -> Result<Self, StateError> {
        // Other files may be larger than any memory.
        check_kind(path)?;
        let state = std::fs::read(path).map_err(Problem::from).and_then(|bytes| read_bytes(&bytes));
        state.map_err(|problem| StateError { path: path.to_path_buf(), problem })
    }

    /// Does what writing does, but leaves the file as it is: to see how long it takes.
    ///
    /// # Errors
    /// As for [`Self::write`].
    pub fn rehearse(&self, path: &Path) -> std::io::Result<()> {
        let mut file = Vec::new();
        bytes(self, &mut file);
        files::exclusive::write_and_discard(path, &file)
    }

    /// Replaces a file, whole or not at all.
    ///
    /// # Errors
    /// Those of the file system: no such folder, unwritable folder, disk full; a file that another program keeps.
    pub fn write(&self, path: &Path) -> Result<(), StateError> {
        let mut file = Vec::new();
        bytes(self, &mut file);
        ExclusiveFile::new(path)
            .and_then(|mut own| own.replace(&file))
            .map_err(|error| StateError { path: path.to_path_buf(), problem: error.into() })
    }
}

#[cfg(test)]
mod tests;
