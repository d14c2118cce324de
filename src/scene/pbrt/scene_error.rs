//! The error type of the reader.

use super::parser::{ParseError, format_position};

/// Error of reading a scene: where, what was found, and what was expected.
#[derive(Debug, thiserror::Error)]
#[error("{}: {message}", format_position(file, *line, *column))]
pub struct SceneError {
    /// Path as the scene or the caller gives it; `<text>` for a scene in memory.
    pub file: String,
    /// 1-based; 0 if the error concerns the file as a whole.
    pub line: usize,
    /// 1-based, in bytes; 0 if the error concerns the file as a whole.
    pub column: usize,
    /// One sentence, without the location.
    pub message: String,
}

impl SceneError {
    /// Gives a parse error the name of its file, from the list of files read.
    pub(super) fn from_parse_error(ParseError { loc, message }: ParseError, files: &[String]) -> Self {
        Self {
            file: files[loc.file as usize].clone(),
            line: loc.line as usize,
            column: loc.column as usize,
            message,
        }
    }
}
