//! The worker threads that a command runs on.

use std::num::NonZeroUsize;

use anyhow::Context;

use super::failure::Failure;

/// Runs `work` on `threads` worker threads; on all cores by default.
pub fn in_pool<T: Send>(
    threads: Option<NonZeroUsize>,
    work: impl FnOnce() -> Result<T, Failure> + Send,
) -> Result<T, Failure> {
    // 0 lets rayon use all cores.
    let threads = threads.map_or(0, NonZeroUsize::get);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.context("starting the worker threads").map_err(Failure::Run)?.install(work)
}
