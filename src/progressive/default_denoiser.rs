//! The denoiser of a render that names none.

use super::budget::Budget;
use super::finalisation::assumed_seconds;
use crate::filter::{Cost, DEFAULTS_BY_COST, Denoiser};
use crate::memory::available_bytes;

/// Largest fraction of a time budget that the last pass takes, of each of [`DEFAULTS_BY_COST`] but the last. In the same time the draft of
/// `learned` leaves 0.8 of the error of `learned` where that takes a quarter, and as much at its limit; half of the error of `nlm` at a
/// quarter; and about as much as the draft of `nlm` at its own limit, where one or two samples per pixel are left (docs/loop.md).
const TIME_FRACTIONS: [f64; DEFAULTS_BY_COST.len() - 1] = [0.16, 0.33, 0.27];

/// Largest fraction of the available memory that the last pass takes.
const MEMORY_FRACTION: f64 = 0.5;

/// Samples per pixel of the image that the choice is for: processes share its pass.
const SPP: f64 = 2.0;

/// Returns the first of [`DEFAULTS_BY_COST`] whose pass takes not too much of a time budget or of the memory. `pixels`: those of the
/// image; `processes` share the pass.
pub fn default_denoiser(budget: &Budget, pixels: usize, processes: usize) -> &'static dyn Denoiser {
    let seconds = budget.seconds.unwrap_or(f64::INFINITY);
    let available = available_bytes();
    let is_affordable = |&(denoiser, fraction): &(&'static dyn Denoiser, f64)| {
        let bytes = (denoiser.cost().bytes * pixels) as f64;
        assumed_seconds(denoiser, 1, pixels as u64, SPP, false, processes, Cost::MEMORY_SECONDS)
            <= fraction * seconds
            && available.is_none_or(|available| bytes <= MEMORY_FRACTION * available)
    };
    let [.., fastest] = DEFAULTS_BY_COST;
    DEFAULTS_BY_COST
        .into_iter()
        .zip(TIME_FRACTIONS)
        .find(is_affordable)
        .map_or(fastest, |(denoiser, _)| denoiser)
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
            // The best one takes 7.6 µs for a pixel, its draft 5.5.
            assert_eq!(name(None, 100_000, 1), "learned standard");
            assert_eq!(name(Some(4.8), 100_000, 1), "learned standard");
            assert_eq!(name(Some(4.7), 100_000, 1), "learned draft");
            assert_eq!(name(Some(1.7), 100_000, 1), "learned draft");
            assert_eq!(name(Some(1.6), 100_000, 1), "nlm draft");
            assert_eq!(name(Some(4.7), 100_000, 2), "learned standard");
            assert_eq!(name(None, usize::MAX >> 16, 1), "nlm draft");
        });
    }
}
