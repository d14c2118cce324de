//! The worker threads that a command runs on.

use std::num::NonZeroUsize;

use super::failure::Failure;

/// Runs `work` on `threads` worker threads; on all cores by default.
pub fn in_pool<T: Send>(
    threads: Option<NonZeroUsize>,
    work: impl FnOnce() -> Result<T, Failure> + Send,
) -> Result<T, Failure> {
    // 0 lets rayon use all cores.
    let threads = threads.map_or(0, NonZeroUsize::get);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let refused = || anyhow::anyhow!("the system starts no more threads; --threads N needs fewer");
    pool.map_err(|_| Failure::Run(refused()))?.install(work)
}
