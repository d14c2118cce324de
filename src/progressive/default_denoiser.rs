//! The denoiser of a render that names none.

use super::budget::Budget;
use super::finalisation::assumed_seconds;
use crate::filter::{DEFAULTS, Denoiser};
use crate::memory::available_bytes;

/// Largest fraction of a time budget that the last pass takes. At this limit `learned` costs an eighth of the samples, about as
/// much error as `nlm` has more. The draft of `nlm` has 0.59 of the error of `nlm` in the same time at half of its limit, 0.88 at
/// three quarters, and as much at the limit.
const TIME_FRACTION: f64 = 0.2;

/// Largest fraction of the available memory that the last pass takes.
const MEMORY_FRACTION: f64 = 0.5;

/// Returns the first of [`DEFAULTS`] whose pass takes not too much of a time budget or of the memory. `pixels`: those of the
/// image; `processes` share the pass.
pub fn default_denoiser(budget: &Budget, pixels: usize, processes: usize) -> &'static dyn Denoiser {
    let seconds = budget.seconds.unwrap_or(f64::INFINITY);
    let available = available_bytes();
    let is_affordable = |denoiser: &&'static dyn Denoiser| {
        let bytes = (denoiser.cost().bytes * pixels) as f64;
        assumed_seconds(*denoiser, pixels as u64, 1.0, false, processes) <= TIME_FRACTION * seconds
            && available.is_none_or(|available| bytes <= MEMORY_FRACTION * available)
    };
    let [.., fastest] = DEFAULTS;
    DEFAULTS.into_iter().find(is_affordable).unwrap_or(fastest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_budgets_and_large_images_get_a_faster_denoiser() {
        let name = |seconds, pixels, processes| {
            let budget = Budget { seconds, ..Budget::default() };
            default_denoiser(&budget, pixels, processes).name().to_string()
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be had");
        pool.install(|| {
            // The best one takes 9 µs for a pixel.
            assert_eq!(name(None, 100_000, 1), "learned standard");
            assert_eq!(name(Some(4.6), 100_000, 1), "learned standard");
            assert_eq!(name(Some(4.4), 100_000, 1), "nlm standard");
            assert_eq!(name(Some(2.9), 100_000, 1), "nlm draft");
            assert_eq!(name(Some(4.4), 100_000, 2), "learned standard");
            assert_eq!(name(None, usize::MAX >> 16, 1), "nlm draft");
        });
    }
}
