//! The limit of threads, which holds for the whole process.

use std::sync::OnceLock;

use rayon::ThreadPoolBuilder;

use crate::status::{PrpfStatus, guard, invalid};

/// The limit, once it is fixed; 0 stands for one thread on each core.
static LIMIT: OnceLock<usize> = OnceLock::new();

/// Returns the number of threads to work on; the limit is fixed from now on.
pub fn limit() -> usize {
    *LIMIT.get_or_init(|| {
        start(0);
        0
    })
}

/// Starts the threads on which stores work. If that fails they are started when they are needed, or work is done without.
fn start(threads: usize) {
    let _ = ThreadPoolBuilder::new().num_threads(threads).build_global();
}

/// Sets the number of threads that a call works on at most; 0 stands for one on each core, the default. It holds for the
/// whole process and can be set once, before stores and filters are created.
#[unsafe(no_mangle)]
pub extern "C" fn prpf_set_threads(threads: usize) -> PrpfStatus {
    guard(|| {
        const MOST: usize = 1 << 16;
        if threads > MOST {
            return Err(invalid(format!("threads: found {threads}; accepted are at most {MOST}")));
        }
        let mut is_set = false;
        LIMIT.get_or_init(|| {
            start(threads);
            is_set = true;
            threads
        });
        match is_set {
            true => Ok(()),
            false => Err(invalid(
                "threads: found a call after the first store or filter, or a second one; accepted is one before",
            )),
        }
    })
}
