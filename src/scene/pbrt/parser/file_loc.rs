//! Source locations of tokens and directives, for messages.

/// Location of a token in the scene files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FileLoc {
    /// Index into the list of files read; 0 is the main file.
    pub file: u32,
    /// 1-based; 0 if the location is the file as a whole.
    pub line: u32,
    /// 1-based, in bytes; 0 if the location is the file as a whole.
    pub column: u32,
}

impl FileLoc {
    /// Formats the location as `name:line:column`, with the file's name from `files`.
    pub fn display(self, files: &[String]) -> String {
        format_position(&files[self.file as usize], self.line as usize, self.column as usize)
    }
}

/// Formats a location as `file:line:column`, or as `file` if `line` is 0.
pub fn format_position(file: &str, line: usize, column: usize) -> String {
    if line == 0 { file.to_owned() } else { format!("{file}:{line}:{column}") }
}
