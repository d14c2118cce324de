//! Filter passes on threads of their own. One that nobody waits for any more runs to its end, with the store it
//! reads, while a new render has already begun: unseen, or, if an image was to be saved, until that is there.

use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use crossbeam::channel::{Receiver, RecvError, TryRecvError, bounded, select};
use rayon::ThreadPool;

use super::command::Command;
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

/// A pass under way.
pub struct Pass(Receiver<Shown>);

impl Passes {
    /// Whether a pass that was given up still runs.
    pub fn is_busy(&self) -> bool {
        self.running.load(Ordering::Relaxed) > 0
    }

    /// Starts a pass, whatever runs already.
    pub fn start(&self, job: FilterJob) -> Pass {
        let (done, result) = bounded(1);
        let threads = rayon::current_num_threads();
        let make = || rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok();
        let running = self.running.clone();
        running.fetch_add(1, Ordering::Relaxed);
        let run = move || {
            let shown = job.run();
            // The store must be free again before the loop goes on, or it would have to be copied.
            drop(job);
            running.fetch_sub(1, Ordering::Relaxed);
            let _ = done.send(shown);
        };
        match self.pool.get_or_init(make) {
            Some(pool) => pool.spawn(run),
            // A system without threads to give still filters, only not aside.
            None => run(),
        }
        Pass(result)
    }

    /// Runs a pass while `hear` is told of commands, until it is done or `hear` gives it up by false. Waits for
    /// earlier ones that were given up if they are too many.
    pub fn run(
        &self,
        job: FilterJob,
        commands: &Receiver<Command>,
        hear: &mut dyn FnMut(Given) -> bool,
    ) -> Option<Shown> {
        while self.running.load(Ordering::Relaxed) > MOST_GIVEN_UP {
            let goes_on = select! {
                recv(commands) -> command => hear(command.map_or(Given::Nothing, Given::Command)),
                default(POLL) => hear(Given::Nothing),
            };
            if !goes_on {
                return None;
            }
        }
        self.start(job).hearing(commands, hear)
    }
}

impl Pass {
    /// Waits while `hear` is told of commands, until the pass is done or `hear` will wait no longer and says false.
    pub fn hearing(
        &self,
        commands: &Receiver<Command>,
        hear: &mut dyn FnMut(Given) -> bool,
    ) -> Option<Shown> {
        loop {
            let goes_on = select! {
                recv(self.0) -> shown => return shown.ok(),
                recv(commands) -> command => hear(command.map_or(Given::Nothing, Given::Command)),
                default(POLL) => hear(Given::Nothing),
            };
            if !goes_on {
                return None;
            }
        }
    }

    /// What it has made, if it is done.
    ///
    /// # Errors
    /// [`TryRecvError::Empty`] as long as it runs.
    pub fn made(&self) -> Result<Shown, TryRecvError> {
        self.0.try_recv()
    }

    /// Waits for what it makes.
    ///
    /// # Errors
    /// If its thread ended early.
    pub fn wait(&self) -> Result<Shown, RecvError> {
        self.0.recv()
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use crossbeam::channel::unbounded;

    use super::*;
    use crate::filter::Quality;
    use crate::progressive::Denoiser;
    use crate::stats::{Layout, Store};

    fn job() -> FilterJob {
        let store = Arc::new(Store::new(8, 8, Layout::with_blocks(|_| true), 0, 0));
        FilterJob { store, denoiser: Denoiser::None, quality: Quality::Draft, seed: 0, interpolation: false }
    }

    #[test]
    fn a_new_pass_waits_while_too_many_run_that_were_given_up() {
        let (passes, (_says, commands)) = (Passes::default(), unbounded());
        passes.running.store(MOST_GIVEN_UP, Ordering::Relaxed);
        assert!(passes.run(job(), &commands, &mut |_| true).is_some());
        passes.running.store(MOST_GIVEN_UP + 1, Ordering::Relaxed);
        // Who waits is heard, and may think better of it.
        assert!(passes.run(job(), &commands, &mut |_| false).is_none());
        assert_eq!(passes.running.load(Ordering::Relaxed), MOST_GIVEN_UP + 1, "none was started");
        let asked = Cell::new(0);
        let shown = passes.run(job(), &commands, &mut |_| {
            asked.set(asked.get() + 1);
            passes.running.store(MOST_GIVEN_UP, Ordering::Relaxed);
            true
        });
        assert!(shown.is_some() && asked.get() > 0);
        // One that somebody wants kept begins whatever runs.
        passes.running.store(MOST_GIVEN_UP + 5, Ordering::Relaxed);
        assert!(passes.start(job()).wait().is_ok());
    }
}
