//! Measures how a filter's time splits into its stages.

use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use prpf::filter::stages::Stage;

/// Names of the stages, in the order of [`StageTimer::fractions`].
pub const STAGES: [&str; 3] = ["neighbourhoods", "weights", "filtering"];

thread_local! {
    /// The stage that this thread is in, and its start.
    static CURRENT: Cell<Option<(Stage, Instant)>> = const { Cell::new(None) };
}

/// Times of the stages, summed over all threads.
#[derive(Default)]
pub struct StageTimer {
    nanoseconds: [AtomicU64; 3],
}

impl StageTimer {
    /// Starts a stage on this thread, and adds the time of the previous one.
    pub fn start(&self, stage: Stage) {
        let now = Instant::now();
        if let Some((ended, since)) = CURRENT.replace(Some((stage, now)))
            && let Some(index) = index(ended)
        {
            self.nanoseconds[index].fetch_add((now - since).as_nanos() as u64, Ordering::Relaxed);
        }
    }

    /// Fractions of the stages in the sum of their times.
    pub fn fractions(&self) -> [f64; 3] {
        let times = self.nanoseconds.each_ref().map(|time| time.load(Ordering::Relaxed) as f64);
        let total: f64 = times.iter().sum();
        times.map(|time| time / total.max(1.0))
    }

    /// Seconds spent in computing weights, summed over all threads.
    pub fn weight_seconds(&self) -> f64 {
        self.nanoseconds[1].load(Ordering::Relaxed) as f64 * 1e-9
    }
}

/// Index of a stage in [`STAGES`].
fn index(stage: Stage) -> Option<usize> {
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
    fn time_counts_for_the_stage_that_it_passes_in() {
        let timer = StageTimer::default();
        timer.start(Stage::Weights);
        std::thread::sleep(std::time::Duration::from_millis(2));
        timer.start(Stage::Other);
        std::thread::sleep(std::time::Duration::from_millis(2));
        timer.start(Stage::Other);
        assert_eq!(timer.fractions(), [0.0, 1.0, 0.0]);
        assert!(timer.weight_seconds() >= 2e-3);
    }
}
