//! The memory of this process: what it holds, and what it may still take of the machine, of its resource limits and of its
//! control groups.

mod control_groups;
mod resource_limits;

use std::time::Instant;

use rayon::prelude::*;
use sysinfo::System;

/// Returns the bytes that this process may still take; `None` if the system does not tell.
pub fn available_bytes() -> Option<f64> {
    let limits = [machine(), resource_limits::available(), control_groups::available()];
    limits.into_iter().flatten().reduce(f64::min)
}

/// Returns the bytes that are free on the machine.
fn machine() -> Option<f64> {
    let mut system = System::new();
    system.refresh_memory();
    Some(system.available_memory() as f64).filter(|&bytes| bytes > 0.0)
}

/// Checks that `bytes` may be taken, before they are.
///
/// # Errors
/// In half a sentence: what is needed, and what there is.
pub fn check_available(bytes: u64) -> Result<(), String> {
    /// Smaller requests are not checked: asking the system takes longer than they do.
    const SMALL: u64 = 16 << 20;
    if bytes <= SMALL {
        return Ok(());
    }
    match available_bytes().filter(|&available| bytes as f64 > available) {
        Some(available) => Err(format!(
            "it takes {} of memory, and {} are available",
            format_bytes(bytes as f64),
            format_bytes(available)
        )),
        None => Ok(()),
    }
}

/// Allocates `bytes` bytes, touches every page and frees them. The allocator keeps the pages (see `main`), so that a filter
/// pass after it takes no longer than another one: on a virtual machine new pages can be most of its time. Returns the seconds that a
/// thread took for a byte, the median of pieces of 8 MiB: some of them may be of memory that was free already, and some wait for other
/// programs. `None` if there is no such piece.
pub fn prepare(bytes: usize) -> Option<f64> {
    /// Bytes that one thread touches at a time.
    const PIECE: usize = 8 << 20;
    let touch = |_| {
        let started = Instant::now();
        // The system provides a page when it is first written, and zeros are not written.
        (vec![1u8; PIECE], started.elapsed().as_secs_f64() / PIECE as f64)
    };
    let (pieces, mut seconds): (Vec<_>, Vec<_>) = (0..bytes / PIECE).into_par_iter().map(touch).unzip();
    std::hint::black_box(pieces);
    seconds.sort_by(f64::total_cmp);
    seconds.get(seconds.len() / 2).copied()
}

/// Returns a number of bytes in a unit that suits it.
pub fn format_bytes(bytes: f64) -> String {
    if bytes < 1e9 { format!("{:.1} MB", bytes / 1e6) } else { format!("{:.1} GB", bytes / 1e9) }
}

/// Returns the bytes that the process holds now, if the system tells.
#[cfg(feature = "app")]
pub fn held_bytes() -> Option<u64> {
    status_bytes("VmRSS")
}

/// Returns the bytes that the process has held at most, if the system tells.
pub fn peak_bytes() -> Option<u64> {
    status_bytes("VmHWM")
}

/// Returns a field of Linux's account of the process.
fn status_bytes(field: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(field)?.strip_prefix(':'))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_memory_is_left_to_this_test_and_an_exabyte_is_not() {
        assert!(available_bytes().is_none_or(|bytes| bytes > 1e6));
        assert!(check_available(1 << 20).is_ok());
        assert!(
            available_bytes().is_none() || check_available(1 << 60).unwrap_err().contains("are available")
        );
    }
}
