//! Errors of reading and writing render states.

use std::io;
use std::path::PathBuf;

use super::format::VERSION;
use crate::files::error_message;
use crate::stats::RowError;

/// A state file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {kind}", path.display())]
pub struct StateError {
    pub path: PathBuf,
    pub kind: StateErrorKind,
}

/// What is wrong with the bytes of a state, or with the file.
#[derive(Debug, thiserror::Error)]
pub enum StateErrorKind {
    #[error("{}", error_message(.0))]
    File(#[from] io::Error),
    #[error("found no render state; accepted is what `prpf render --state` writes")]
    Foreign,
    #[error(
        "found a render state of format version {0}; accepted is version {VERSION}: render the scene again"
    )]
    Version(u32),
    #[error("found {found} bytes of a render state of {expected}; it was truncated or extended")]
    Length { found: usize, expected: u64 },
    #[error("the render state does not fit: {0}")]
    Memory(String),
    #[error("the render state is damaged: its checksum is not that of its content")]
    Checksum,
    #[error("the render state's header is wrong: {0}")]
    Header(String),
    #[error("the render state's store is wrong: {0}")]
    Row(#[from] RowError),
}
