//! The limit of threads, which holds for the whole process.

use std::fmt::Display;
use std::io;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;

use rayon::{ThreadBuilder, ThreadPoolBuilder};

use crate::status::{Failure, PrpfStatus, guard, invalid};

/// The limit, once the threads have started; 0 stands for one on each core.
static LIMIT: Mutex<Option<usize>> = Mutex::new(None);

/// Returns the number of threads to work on; the limit is fixed from now on.
///
/// # Errors
/// The threads cannot start. The limit is then not fixed.
pub fn limit() -> Result<usize, Failure> {
    let mut limit = lock();
    if let Some(threads) = *limit {
        return Ok(threads);
    }
    start(0)?;
    Ok(*limit.insert(0))
}

fn lock() -> MutexGuard<'static, Option<usize>> {
    LIMIT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts the threads on which stores work: all of them or none. If one failed to start within `build_global`, every later
/// call of rayon in this process would panic.
fn start(threads: usize) -> Result<(), Failure> {
    // Count them by a pool that starts none
    let pool = ThreadPoolBuilder::new().num_threads(threads).spawn_handler(|_| Ok(())).build();
    let count = pool.map_or(1, |pool| pool.current_num_threads());

    // Start them; those that get no work end
    let waiting: io::Result<Vec<Sender<ThreadBuilder>>> = (0..count)
        .map(|_| {
            let (sender, receiver) = channel::<ThreadBuilder>();
            thread::Builder::new().spawn(move || receiver.recv().map(ThreadBuilder::run))?;
            Ok(sender)
        })
        .collect();
    let mut waiting = waiting.map_err(cannot_start)?.into_iter();

    // Make them the global pool
    let hand_over = |work: ThreadBuilder| {
        let sender = waiting.next().expect("as many threads as were counted");
        sender.send(work).expect("the thread waits");
        Ok(())
    };
    // It fails only where the program has started a global pool itself, which then does the work
    let _ = ThreadPoolBuilder::new().num_threads(count).spawn_handler(hand_over).build_global();
    Ok(())
}

/// Turns the error of threads that the system does not start into a failure.
pub fn cannot_start(error: impl Display) -> Failure {
    Failure { status: PrpfStatus::OutOfMemory, message: format!("cannot start threads: {error}") }
}

/// Sets the number of threads that a call works on at most; 0 stands for one on each core, the default. It holds for the
/// whole process and can be set once, before stores and filters are created. If the system starts no more threads the status is
/// PRPF_STATUS_OUT_OF_MEMORY, and another number can be set.
#[unsafe(no_mangle)]
pub extern "C" fn prpf_set_threads(threads: usize) -> PrpfStatus {
    guard(|| {
        // More than the cores of any machine; far more would use up the memory mappings of a process
        const MOST: usize = 4096;
        if threads > MOST {
            return Err(invalid(format!("threads: found {threads}; accepted are at most {MOST}")));
        }
        let mut limit = lock();
        if limit.is_some() {
            return Err(invalid(
                "threads: found a call after the first store or filter, or a second one; accepted is one before",
            ));
        }
        start(threads)?;
        *limit = Some(threads);
        Ok(())
    })
}
