//! The `prpf` program; see [`prpf::cli`].

use std::process::ExitCode;
use std::time::Instant;

/// The filters take and give back planes of many megabytes with every batch; an allocator that keeps
/// its pages saves the system clearing them each time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    prpf::cli::run(std::env::args_os(), Instant::now())
}
