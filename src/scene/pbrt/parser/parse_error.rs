//! Errors of the reader, located but not yet with the name of their file.

use super::FileLoc;

/// A located error message.
#[derive(Debug)]
pub struct ParseError {
    pub loc: FileLoc,
    pub message: String,
}

impl ParseError {
    pub fn new(loc: FileLoc, message: impl Into<String>) -> Self {
        Self { loc, message: message.into() }
    }
}

pub type Result<T> = std::result::Result<T, ParseError>;
