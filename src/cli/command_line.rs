//! The command line as a person typed it, for the files and the page that name it.

/// Returns the command line of this process.
pub fn command_line() -> String {
    let words: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    words.join(" ")
}
