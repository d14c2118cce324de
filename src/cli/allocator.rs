//! The program's memory allocator: mimalloc, which ends the program with one line where the system refuses memory.
//!
//! Rust would print a backtrace and abort, and its hook for that (`std::alloc::set_alloc_error_hook`) is not stable. Outputs
//! and states that have been written stay whole: they are replaced in one step.

use std::alloc::{GlobalAlloc, Layout};
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use mimalloc::MiMalloc;

/// The filters take and give back planes of many megabytes with every pass; mimalloc can keep its pages, which saves the
/// system clearing them each time.
pub struct Allocator;

// SAFETY: each method forwards to mimalloc under the caller's guarantees; a null pointer is not returned.
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        given(unsafe { MiMalloc.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        given(unsafe { MiMalloc.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { MiMalloc.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        given(unsafe { MiMalloc.realloc(pointer, layout, size) }, size)
    }
}

/// Returns the pointer, if memory was given.
fn given(pointer: *mut u8, bytes: usize) -> *mut u8 {
    if pointer.is_null() {
        exit_out_of_memory(bytes);
    }
    pointer
}

/// Prints one line and ends the program with status 1, without any more memory.
#[cold]
fn exit_out_of_memory(bytes: usize) -> ! {
    static IS_ENDING: AtomicBool = AtomicBool::new(false);
    if IS_ENDING.swap(true, Ordering::Relaxed) {
        // Another thread prints the line and ends the program.
        loop {
            std::thread::sleep(std::time::Duration::from_secs(1));
        }
    }
    let mut line = [0; 160];
    let capacity = line.len();
    let mut rest = &mut line[..];
    // A progress bar may stand in the terminal's line.
    let clear = if std::io::stderr().is_terminal() { "\r\x1b[K" } else { "" };
    let _ = writeln!(
        rest,
        "{clear}prpf: out of memory: the system gives no more ({} kB were asked for); what has been saved is kept",
        bytes.div_ceil(1000)
    );
    let length = capacity - rest.len();
    let _ = std::io::stderr().write_all(&line[..length]);
    // At once: other threads may hold what an orderly exit would wait for.
    signal_hook::low_level::exit(1)
}
