//! Filter passes on threads of their own, while the render thread handles commands.
//!
//! A pass that is given up runs to its end, and its result is dropped; one for an image that is to be saved is waited for.

use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use crossbeam::channel::{Receiver, RecvError, TryRecvError, bounded, select};
use rayon::ThreadPool;

use super::command::Command;
use crate::progressive::{FilterPass, Filtered};

/// Time between two checks of a pass while no command comes.
const POLL: Duration = Duration::from_millis(50);

/// Most passes that were given up and still run beside a new one: each holds a store.
const MOST_ABANDONED: usize = 1;

/// An event during a pass.
pub enum Event {
    Command(Command),
    /// No command for a while.
    Idle,
}

/// The threads of filter passes, started with the first.
#[derive(Clone, Default)]
pub struct PassThreads {
    pool: Arc<OnceLock<Option<ThreadPool>>>,
    running: Arc<AtomicUsize>,
}

/// A running pass.
pub struct BackgroundPass(Receiver<Filtered>);

impl PassThreads {
    /// Returns whether a pass still runs.
    pub fn is_busy(&self) -> bool {
        self.running.load(Ordering::Relaxed) > 0
    }

    /// Starts a pass, whatever runs already.
    pub fn start(&self, pass: FilterPass) -> BackgroundPass {
        let (done, result) = bounded(1);
        let threads = rayon::current_num_threads();
        let make = || rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok();
        let running = self.running.clone();
        running.fetch_add(1, Ordering::Relaxed);
        let run = move || {
            // The store is free again before the loop goes on, or it would have to be copied.
            let filtered = pass.run();
            running.fetch_sub(1, Ordering::Relaxed);
            let _ = done.send(filtered);
        };
        match self.pool.get_or_init(make) {
            Some(pool) => pool.spawn(run),
            // Without more threads the pass runs on this one.
            None => run(),
        }
        BackgroundPass(result)
    }

    /// Runs a pass, with `handle` called for every event, until it is done or `handle` returns false, which gives it up:
    /// then returns `None`. Waits first if too many abandoned passes still run.
    pub fn run(
        &self,
        pass: FilterPass,
        commands: &Receiver<Command>,
        handle: &mut dyn FnMut(Event) -> bool,
    ) -> Option<Filtered> {
        while self.running.load(Ordering::Relaxed) > MOST_ABANDONED {
            let goes_on = select! {
                recv(commands) -> command => handle(command.map_or(Event::Idle, Event::Command)),
                default(POLL) => handle(Event::Idle),
            };
            if !goes_on {
                return None;
            }
        }
        self.start(pass).wait_handling(commands, handle)
    }
}

impl BackgroundPass {
    /// Waits, with `handle` called for every event, until the pass is done or `handle` returns false.
    pub fn wait_handling(
        &self,
        commands: &Receiver<Command>,
        handle: &mut dyn FnMut(Event) -> bool,
    ) -> Option<Filtered> {
        loop {
            let goes_on = select! {
                recv(self.0) -> filtered => return filtered.ok(),
                recv(commands) -> command => handle(command.map_or(Event::Idle, Event::Command)),
                default(POLL) => handle(Event::Idle),
            };
            if !goes_on {
                return None;
            }
        }
    }

    /// Returns the result, if the pass is done.
    ///
    /// # Errors
    /// [`TryRecvError::Empty`] as long as it runs.
    pub fn result(&self) -> Result<Filtered, TryRecvError> {
        self.0.try_recv()
    }

    /// Waits for the result.
    ///
    /// # Errors
    /// If its thread ended early.
    pub fn wait(&self) -> Result<Filtered, RecvError> {
        self.0.recv()
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use crossbeam::channel::unbounded;

    use super::*;
    use crate::filter::UNFILTERED;
    use crate::stats::{Layout, Store};

    fn pass() -> FilterPass {
        let store = Arc::new(Store::new(8, 8, Layout::with_blocks(|_| true), 0, 0));
        FilterPass::new(store, UNFILTERED, 0)
    }

    #[test]
    fn a_new_pass_waits_while_too_many_abandoned_ones_run() {
        let (threads, (_sender, commands)) = (PassThreads::default(), unbounded());
        threads.running.store(MOST_ABANDONED, Ordering::Relaxed);
        assert!(threads.run(pass(), &commands, &mut |_| true).is_some());
        threads.running.store(MOST_ABANDONED + 1, Ordering::Relaxed);
        // Commands are handled meanwhile, and may end the wait.
        assert!(threads.run(pass(), &commands, &mut |_| false).is_none());
        assert_eq!(threads.running.load(Ordering::Relaxed), MOST_ABANDONED + 1, "none was started");
        let events = Cell::new(0);
        let filtered = threads.run(pass(), &commands, &mut |_| {
            events.set(events.get() + 1);
            threads.running.store(MOST_ABANDONED, Ordering::Relaxed);
            true
        });
        assert!(filtered.is_some() && events.get() > 0);
        // A pass for an image to be saved starts whatever runs.
        threads.running.store(MOST_ABANDONED + 5, Ordering::Relaxed);
        assert!(threads.start(pass()).wait().is_ok());
    }
}
