//! What the program prints: texts on standard output, lines on standard error.

use std::io::Write;

use anyhow::Context;

/// Prints to standard output. A closed pipe, as after `| head`, is no failure.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error).context("cannot print"),
        _ => Ok(()),
    }
}

/// Prints a line to standard error, if that is open.
pub fn print_error(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Returns one line that a terminal can show: control characters are escaped, and the middle of a long text is left out.
pub fn escaped(text: &str) -> String {
    /// Characters shown of a message; of the longest file names there is enough to recognise them.
    const LONGEST: usize = 1000;
    let printable = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    let line: Vec<char> = text.chars().flat_map(|c| printable(c).chars().collect::<Vec<_>>()).collect();
    if line.len() <= LONGEST {
        return line.into_iter().collect();
    }
    let (start, end) = (&line[..LONGEST / 2], &line[line.len() - LONGEST / 2..]);
    start.iter().chain(&['.', '.', '.']).chain(end).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_one_printable_line_of_bounded_length() {
        assert_eq!(escaped("a\u{1b}[2Jb\nc é"), "a\\u{1b}[2Jb\\nc é");
        let long = escaped(&"x".repeat(5000));
        assert!(long.len() < 1010 && long.contains("..."));
    }
}
