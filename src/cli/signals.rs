//! SIGINT, SIGTERM and SIGHUP.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use super::mode::Mode;

/// Exit status after an interruption: 128 + SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// Handles SIGINT, SIGTERM and SIGHUP. While a scene is loaded, a signal ends the program at once. Otherwise a first one ends
/// the render soon, and a SIGINT after it the program at once.
pub(super) struct Signals {
    /// Whether a scene is being loaded: nothing is left to be written.
    loading: Arc<AtomicBool>,
    /// Whether this process has got a signal: the next one quits.
    own: Arc<AtomicBool>,
    /// Whether the render is to end soon. Signals to other processes of the render set it, too.
    interrupt: Arc<AtomicBool>,
}

impl Signals {
    fn new() -> Self {
        let new = |is_set| Arc::new(AtomicBool::new(is_set));
        Self { loading: new(true), own: new(false), interrupt: new(false) }
    }

    /// Begins to handle signals. `is_launched`: whether a launcher of several processes may pass on SIGUSR1, the one signal
    /// by which `mpirun` does not end them itself; it is taken as SIGTERM then.
    ///
    /// # Errors
    /// Those of the system.
    pub fn listen(mode: Mode, is_launched: bool) -> anyhow::Result<Self> {
        let signals = Self::new();
        // A signal is the way to close a preview.
        let closed = if mode == Mode::Preview { 0 } else { INTERRUPTED };
        // Supervisors repeat SIGTERM, as Slurm does before the time limit and at it; they have SIGKILL for more
        for (signal, can_quit) in [(SIGINT, true), (SIGTERM, false)] {
            signals.register(signal, closed, can_quit).context("listening to signals")?;
        }
        #[cfg(unix)]
        if is_launched {
            signals.register(signal_hook::consts::SIGUSR1, closed, false).context("listening to signals")?;
        }
        #[cfg(unix)]
        if !is_ignored(signal_hook::consts::SIGHUP) {
            // A terminal that is closed may send it twice: by the system and by the shell.
            signals.register(signal_hook::consts::SIGHUP, closed, false).context("listening to signals")?;
        }
        Ok(signals)
    }

    /// Handles one signal; `can_quit` if a second one ends the program.
    fn register(&self, signal: i32, closed: u8, can_quit: bool) -> std::io::Result<()> {
        flag::register_conditional_shutdown(signal, closed.into(), self.loading.clone())?;
        if can_quit {
            flag::register_conditional_shutdown(signal, INTERRUPTED.into(), self.own.clone())?;
        }
        flag::register(signal, self.own.clone())?;
        flag::register(signal, self.interrupt.clone())?;
        Ok(())
    }

    /// Begins to load another scene: a signal ends the program at once, as before the first sample.
    pub fn begin_loading(&self) {
        self.loading.store(true, Ordering::Relaxed);
    }

    /// Begins the render, which a signal does not end at once any more. Returns the flag that a first signal sets, and that
    /// the caller sets at a signal to another process of the render.
    pub fn begin_render(&self) -> &AtomicBool {
        self.loading.store(false, Ordering::Relaxed);
        &self.interrupt
    }
}

/// Returns whether the program was started with a signal ignored, as by `nohup`. Only Linux tells.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask & 1 << (signal - 1) != 0
}

#[cfg(all(test, unix))]
mod tests {
    use signal_hook::consts::SIGUSR2;
    use signal_hook::low_level::raise;

    use super::*;

    #[test]
    fn the_first_signal_after_one_to_another_process_does_not_quit() {
        let signals = Signals::new();
        signals.register(SIGUSR2, INTERRUPTED, true).unwrap();
        signals.begin_render().store(true, Ordering::Relaxed);
        assert!(!signals.own.load(Ordering::Relaxed));
        // Would end the test program if it counted as the second one.
        raise(SIGUSR2).unwrap();
        assert!(signals.own.load(Ordering::Relaxed));
    }
}
