//! What SIGINT and SIGTERM do to a render.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use super::render::Mode;

/// Exit status after a person's interruption: 128 + SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// Before the first sample, a signal ends the program at once. Later, a first one ends the loop soon, and a second
/// one the program at once.
pub(super) struct Signals {
    /// Whether there is nothing yet that would be lost.
    loading: Arc<AtomicBool>,
    interrupt: Arc<AtomicBool>,
}

impl Signals {
    /// # Errors
    /// Those of the system.
    pub fn listen(mode: Mode) -> anyhow::Result<Self> {
        let signals =
            Self { loading: Arc::new(AtomicBool::new(true)), interrupt: Arc::new(AtomicBool::new(false)) };
        // That is how a preview is closed.
        let closed = if mode == Mode::Preview { 0 } else { INTERRUPTED };
        for signal in [SIGINT, SIGTERM] {
            flag::register_conditional_shutdown(signal, closed.into(), signals.loading.clone())
                .and_then(|_| {
                    let again = signals.interrupt.clone();
                    flag::register_conditional_shutdown(signal, INTERRUPTED.into(), again)
                })
                .and_then(|_| flag::register(signal, signals.interrupt.clone()))
                .context("listening to signals")?;
        }
        Ok(signals)
    }

    /// From now on there is something to lose. What a first signal sets.
    pub fn begin(&self) -> &AtomicBool {
        self.loading.store(false, Ordering::Relaxed);
        &self.interrupt
    }
}
