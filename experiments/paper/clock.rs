//! Where a filter's time goes, by its stages.

use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use prpf::filter::stages::Stage;

thread_local! {
    /// The stage that this thread is in, and since when.
    static CURRENT: Cell<Option<(Stage, Instant)>> = const { Cell::new(None) };
}

/// Sums of the time of stages, over all threads that begin them.
#[derive(Default)]
pub struct Clock {
    nanoseconds: [AtomicU64; 3],
}

impl Clock {
    /// Takes the time of the stage that ends on this thread with the beginning of another.
    pub fn observe(&self, stage: Stage) {
        let now = Instant::now();
        if let Some((ended, since)) = CURRENT.replace(Some((stage, now)))
            && let Some(place) = place(ended)
        {
            self.nanoseconds[place].fetch_add((now - since).as_nanos() as u64, Ordering::Relaxed);
        }
    }

    /// Shares of neighbourhoods, weights and filtering in their sum.
    pub fn shares(&self) -> [f64; 3] {
        let times = self.nanoseconds.each_ref().map(|time| time.load(Ordering::Relaxed) as f64);
        let total: f64 = times.iter().sum();
        times.map(|time| time / total.max(1.0))
    }

    /// Seconds of computing weights, over all threads that begin it.
    pub fn weight_seconds(&self) -> f64 {
        self.nanoseconds[1].load(Ordering::Relaxed) as f64 * 1e-9
    }
}

fn place(stage: Stage) -> Option<usize> {
    match stage {
        Stage::Neighbourhoods => Some(0),
        Stage::Weights => Some(1),
        Stage::Filtering => Some(2),
        Stage::Other => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_to_the_stage_that_it_passes_in() {
        let clock = Clock::default();
        clock.observe(Stage::Weights);
        std::thread::sleep(std::time::Duration::from_millis(2));
        clock.observe(Stage::Other);
        std::thread::sleep(std::time::Duration::from_millis(2));
        clock.observe(Stage::Other);
        assert_eq!(clock.shares(), [0.0, 1.0, 0.0]);
        assert!(clock.weight_seconds() >= 2e-3);
    }
}
