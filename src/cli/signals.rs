//! SIGINT and SIGTERM.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use super::mode::Mode;

/// Exit status after an interruption: 128 + SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// Handles SIGINT and SIGTERM. Before the first sample, a signal ends the program at once. Later, a first one ends the
/// render soon, and a second one the program at once.
pub(super) struct Signals {
    /// Whether nothing has been rendered that would be lost.
    loading: Arc<AtomicBool>,
    interrupt: Arc<AtomicBool>,
}

impl Signals {
    /// Begins to handle signals.
    ///
    /// # Errors
    /// Those of the system.
    pub fn listen(mode: Mode) -> anyhow::Result<Self> {
        let signals =
            Self { loading: Arc::new(AtomicBool::new(true)), interrupt: Arc::new(AtomicBool::new(false)) };
        // A signal is the way to close a preview.
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

    /// Begins the render, which a signal does not end at once any more; returns the flag that a first signal sets.
    pub fn begin_render(&self) -> &AtomicBool {
        self.loading.store(false, Ordering::Relaxed);
        &self.interrupt
    }
}
