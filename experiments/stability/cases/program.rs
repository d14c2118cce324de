//! Finds the built program `prpf`.

use std::path::PathBuf;

/// Path of the program: from cargo in tests, beside the running program otherwise.
pub fn program() -> PathBuf {
    option_env!("CARGO_BIN_EXE_prpf").map(PathBuf::from).unwrap_or_else(|| {
        let own = std::env::current_exe().expect("a program has a path");
        own.with_file_name(format!("prpf{}", std::env::consts::EXE_SUFFIX))
    })
}
