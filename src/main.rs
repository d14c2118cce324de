//! The `prpf` program; see [`prpf::cli`].

use std::process::ExitCode;
use std::time::Instant;

use prpf::cli::Allocator;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// `mi_option_purge_delay` of mimalloc's header, for which its binding has no name.
const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;
/// As a delay: never.
const NEVER: std::ffi::c_long = -1;

fn main() -> ExitCode {
    let start = Instant::now();
    // By default what has been free for some seconds goes back to the system, and passes of the filter are
    // farther apart than that.
    // SAFETY: writes a number into the allocator's table of options, while there is no other thread.
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, NEVER) };
    prpf::cli::run(std::env::args_os(), start)
}
