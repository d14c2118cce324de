//! The `prpf` program; see [`prpf::cli`].

use std::process::ExitCode;
use std::time::Instant;

fn main() -> ExitCode {
    prpf::cli::run(std::env::args_os(), Instant::now())
}
