//! Runs a filter pass on threads of its own, so that the caller can watch it and cancel it.
//!
//! The parallel loops of the denoisers call [`stop_if_cancelled`] before each row or tile. A cancelled pass unwinds from
//! there to [`CancellablePool::run`], so that no denoiser has to pass a half-finished result on.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

/// Time between two looks of the caller.
const INTERVAL: Duration = Duration::from_millis(20);

thread_local! {
    /// Whether the pass of this thread's pool is cancelled; `None` on threads of other pools.
    static IS_CANCELLED: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// The payload with which a cancelled pass unwinds.
struct Cancelled;

/// Threads for filter passes that can be cancelled.
pub struct CancellablePool {
    pool: ThreadPool,
    is_cancelled: Arc<AtomicBool>,
}

impl CancellablePool {
    /// Starts the threads; 0 stands for one on each core.
    ///
    /// # Errors
    /// The system starts no more threads.
    pub fn new(threads: usize) -> Result<Self, ThreadPoolBuildError> {
        let is_cancelled = Arc::new(AtomicBool::new(false));
        let flag = is_cancelled.clone();
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .start_handler(move |_| IS_CANCELLED.set(Some(flag.clone())))
            .build()?;
        Ok(Self { pool, is_cancelled })
    }

    /// Returns the number of threads.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Runs a pass. Meanwhile the calling thread calls `should_cancel` about 50 times a second. Returns `None` once that
    /// has returned true.
    ///
    /// # Panics
    /// If the pass does.
    pub fn run<T: Send>(
        &mut self,
        pass: impl FnOnce() -> T + Send,
        mut should_cancel: impl FnMut() -> bool,
    ) -> Option<T> {
        self.is_cancelled.store(false, Ordering::Relaxed);
        let (sender, receiver) = channel();
        let outcome = self.pool.in_place_scope(|scope| {
            scope.spawn(|_| {
                // The receiver is gone only if `should_cancel` has panicked, which the scope hands on.
                let _ = sender.send(catch_unwind(AssertUnwindSafe(pass)));
            });
            loop {
                match receiver.recv_timeout(INTERVAL) {
                    Ok(outcome) => break outcome,
                    Err(RecvTimeoutError::Timeout) if should_cancel() => {
                        self.is_cancelled.store(true, Ordering::Relaxed);
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => unreachable!("the pass sends before it ends"),
                }
            }
        });
        match outcome {
            Ok(_) if self.is_cancelled.load(Ordering::Relaxed) => None,
            Ok(result) => Some(result),
            Err(payload) if payload.is::<Cancelled>() => None,
            Err(payload) => resume_unwind(payload),
        }
    }
}

/// Ends the pass of this thread's pool if it is cancelled: for loops of denoisers that take long.
pub fn stop_if_cancelled() {
    let is_cancelled =
        IS_CANCELLED.with_borrow(|flag| flag.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed)));
    if is_cancelled {
        // Without the message of a panic.
        resume_unwind(Box::new(Cancelled));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{DEFAULT, DENOISERS, synthetic};
    use crate::stats::{Layout, Store};
    use rand::RngExt;
    use std::time::Instant;

    /// A store with noise in every pixel.
    fn noisy_store() -> Store {
        let layout = Layout::with_blocks(|_| true);
        synthetic::store(
            12,
            9,
            layout.clone(),
            |_, _| 8,
            |x, y, _, rng| {
                let noise = rng.random::<f32>();
                synthetic::wall(&layout, x, y, [noise; 3], rng)
            },
        )
    }

    #[test]
    fn a_pass_on_a_pool_is_the_same_pass() {
        let store = noisy_store();
        let mut pool = CancellablePool::new(2).unwrap();
        assert_eq!(pool.threads(), 2);
        let denoiser = DEFAULT;
        let on_pool = pool.run(|| denoiser.filter(&store, 0), || false).expect("nobody cancels");
        assert_eq!(on_pool.image, denoiser.filter(&store, 0).image);
    }

    #[test]
    fn a_cancelled_pass_ends_soon_and_the_next_one_runs() {
        let mut pool = CancellablePool::new(1).unwrap();
        let start = Instant::now();
        let endless = || {
            while start.elapsed() < Duration::from_secs(60) {
                stop_if_cancelled();
            }
        };
        assert!(pool.run(endless, || true).is_none());
        assert!(start.elapsed() < Duration::from_secs(30));
        assert_eq!(pool.run(|| 7, || false), Some(7));
    }

    #[test]
    fn every_denoiser_of_this_crate_hears_that_it_is_cancelled() {
        let store = noisy_store();
        for denoiser in DENOISERS.into_iter().filter(|denoiser| denoiser.missing().is_none()) {
            let pool = CancellablePool::new(1).unwrap();
            pool.is_cancelled.store(true, Ordering::Relaxed);
            let outcome = pool.pool.install(|| catch_unwind(AssertUnwindSafe(|| denoiser.filter(&store, 0))));
            let is_heard = outcome.is_err_and(|payload| payload.is::<Cancelled>());
            // The mean of the samples takes no time, and Open Image Denoise is another library's.
            assert_eq!(is_heard, !["none", "oidn"].contains(&denoiser.name().method), "{}", denoiser.name());
        }
    }

    #[test]
    #[should_panic(expected = "the pass is wrong")]
    fn a_pass_that_panics_does_so_for_its_caller() {
        CancellablePool::new(1).unwrap().run(|| panic!("the pass is wrong"), || false);
    }
}
