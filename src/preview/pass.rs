//! Filter passes on threads of their own, so that one can be given up: it then runs to its end unseen,
//! with the store it reads, while a new render has already begun.

use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use crossbeam::channel::{Receiver, bounded, select};
use rayon::ThreadPool;

use super::protocol::Command;
use crate::progressive::{FilterJob, Shown};

/// How often a pass is looked at when nobody says anything.
const POLL: Duration = Duration::from_millis(50);

/// Passes that were given up and still run beside a new one, at most: each holds a whole store.
const MOST_GIVEN_UP: usize = 1;

/// What came while waiting for a pass.
pub enum Given {
    Command(Command),
    Nothing,
}

/// Threads for filter passes, started with the first.
#[derive(Clone, Default)]
pub struct Passes {
    pool: Arc<OnceLock<Option<ThreadPool>>>,
    running: Arc<AtomicUsize>,
}

impl Passes {
    /// Whether a pass that was given up still runs.
    pub fn is_busy(&self) -> bool {
        self.running.load(Ordering::Relaxed) > 0
    }

    /// Runs a pass while `hear` is told of commands, until it is done or `hear` gives it up by false.
    pub fn run(
        &self,
        job: FilterJob,
        commands: &Receiver<Command>,
        mut hear: impl FnMut(Given) -> bool,
    ) -> Option<Shown> {
        let threads = rayon::current_num_threads();
        let start = || rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok();
        let Some(pool) = self.pool.get_or_init(start) else {
            // A system without threads to give still filters, only not aside.
            return Some(job.run());
        };
        while self.running.load(Ordering::Relaxed) > MOST_GIVEN_UP {
            let goes_on = select! {
                recv(commands) -> command => hear(command.map_or(Given::Nothing, Given::Command)),
                default(POLL) => hear(Given::Nothing),
            };
            if !goes_on {
                return None;
            }
        }
        let (done, result) = bounded(1);
        let running = self.running.clone();
        running.fetch_add(1, Ordering::Relaxed);
        pool.spawn(move || {
            let shown = job.run();
            // The store must be free again before the loop goes on, or it would have to be copied.
            drop(job);
            running.fetch_sub(1, Ordering::Relaxed);
            let _ = done.send(shown);
        });
        loop {
            let goes_on = select! {
                recv(result) -> shown => return shown.ok(),
                recv(commands) -> command => hear(command.map_or(Given::Nothing, Given::Command)),
                default(POLL) => hear(Given::Nothing),
            };
            if !goes_on {
                return None;
            }
        }
    }
}
