//! The command line as a person typed it, for the files and the page that name it.

/// Returns the command line of this process, to be pasted into a shell.
pub fn command_line() -> String {
    quoted(std::env::args_os().map(|word| word.to_string_lossy().into_owned()))
}

/// Joins words, in quotes where a shell would divide or change them.
pub fn quoted(words: impl Iterator<Item = String>) -> String {
    let words: Vec<String> = words.collect();
    // No word that a system hands over has the zero that cannot be quoted
    shlex::try_join(words.iter().map(String::as_str)).unwrap_or_else(|_| words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_divide_them() {
        let words = ["prpf", "render", "my scene.pbrt", "-o", "a.exr"].map(str::to_owned);
        let line = quoted(words.clone().into_iter());
        assert_eq!(shlex::split(&line).unwrap(), words);
        assert_eq!(quoted(["a/b.exr", "--time", "5s"].map(str::to_owned).into_iter()), "a/b.exr --time 5s");
    }
}
