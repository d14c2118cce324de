//! The program as a user runs it.

use std::path::Path;
use std::process::{Command, Output, Stdio};

/// The program in a folder; what it says is collected.
pub fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_prpf"));
    command.current_dir(folder).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Runs it.
pub fn prpf(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().expect("the program starts")
}

/// Runs a command whose input is wrong; the one line that it says.
pub fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = prpf(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    said
}
