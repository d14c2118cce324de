//! The clock of a render: seconds since the program started, without the time in which the render was held.

use std::time::{Duration, Instant};

/// A clock that starts with the program and can be held.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
    held: Duration,
}

impl Clock {
    /// A clock that counts from `start`, when the program started.
    pub fn new(start: Instant) -> Self {
        Self { start, held: Duration::ZERO }
    }

    /// Returns the seconds since the start, time on hold excluded.
    pub fn elapsed(&self) -> f64 {
        self.start.elapsed().saturating_sub(self.held).as_secs_f64()
    }

    /// Excludes a duration that has just passed.
    pub fn hold(&mut self, duration: Duration) {
        self.held += duration;
    }
}
