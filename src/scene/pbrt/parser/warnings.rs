//! Warnings of the reader. Equal messages are merged into one line with a count.

use std::collections::HashMap;

use super::FileLoc;

/// Warnings in the order of their first occurrence.
#[derive(Debug, Default)]
pub struct Warnings {
    list: Vec<Warning>,
    index: HashMap<String, usize>,
}

#[derive(Debug)]
struct Warning {
    loc: FileLoc,
    message: String,
    count: usize,
}

impl Warnings {
    /// Adds a warning, or counts it if the message is known.
    pub fn add(&mut self, loc: FileLoc, message: impl Into<String>) {
        let message = message.into();
        let index = *self.index.entry(message.clone()).or_insert(self.list.len());
        match self.list.get_mut(index) {
            Some(warning) => warning.count += 1,
            None => self.list.push(Warning { loc, message, count: 1 }),
        }
    }

    /// Formats one line per message, with the location of its first occurrence.
    pub fn lines(&self, files: &[String]) -> Vec<String> {
        let line = |warning: &Warning| {
            let again = match warning.count - 1 {
                0 => String::new(),
                more => format!(" (and {more} more)"),
            };
            format!("{}: {}{again}", warning.loc.display(files), warning.message)
        };
        self.list.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_warning_is_one_line_with_its_first_location() {
        let mut warnings = Warnings::default();
        warnings.add(FileLoc { file: 0, line: 3, column: 4 }, "a");
        warnings.add(FileLoc::default(), "b");
        warnings.add(FileLoc::default(), "a");
        assert_eq!(warnings.lines(&["f".into()]), ["f:3:4: a (and 1 more)", "f: b"]);
    }
}
