//! What was read but is not simulated, said once however often it occurs.

use std::collections::HashMap;

use super::{Place, position};

/// Messages in the order of their first occurrence.
#[derive(Debug, Default)]
pub struct Warnings {
    list: Vec<Warning>,
    index: HashMap<String, usize>,
}

#[derive(Debug)]
struct Warning {
    place: Place,
    message: String,
    count: usize,
}

impl Warnings {
    pub fn add(&mut self, place: Place, message: impl Into<String>) {
        let message = message.into();
        let index = *self.index.entry(message.clone()).or_insert(self.list.len());
        match self.list.get_mut(index) {
            Some(warning) => warning.count += 1,
            None => self.list.push(Warning { place, message, count: 1 }),
        }
    }

    /// One line each, with the first place.
    pub fn lines(&self, files: &[String]) -> Vec<String> {
        let line = |warning: &Warning| {
            let Place { file, line, column } = warning.place;
            let again = match warning.count - 1 {
                0 => String::new(),
                more => format!(" (and {more} more)"),
            };
            let at = position(&files[file as usize], line as usize, column as usize);
            format!("{at}: {}{again}", warning.message)
        };
        self.list.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_warning_is_one_line_with_its_first_place() {
        let mut warnings = Warnings::default();
        warnings.add(Place { file: 0, line: 3, column: 4 }, "a");
        warnings.add(Place::default(), "b");
        warnings.add(Place::default(), "a");
        assert_eq!(warnings.lines(&["f".into()]), ["f:3:4: a (and 1 more)", "f: b"]);
    }
}
