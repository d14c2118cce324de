//! The denoiser of a render that names none.

use super::budget::Budget;
use super::finalisation::assumed_seconds;
use crate::filter::{DENOISERS, Denoiser, FASTER_DEFAULT};
use crate::memory::available_bytes;

/// Largest fraction of a time budget that the last pass takes: `nlm` leaves about 1.15 times the error of the same samples,
/// and so does `learned` with an eighth less of them, which it costs at this limit.
const TIME_FRACTION: f64 = 0.2;

/// Largest fraction of the available memory that the last pass takes.
const MEMORY_FRACTION: f64 = 0.5;

/// Returns the denoiser with the least error, or the faster one where its pass would take too much of a time budget or of
/// the memory. `pixels`: those of the image.
pub fn default_denoiser(budget: &Budget, pixels: usize) -> &'static dyn Denoiser {
    let best = DENOISERS[0];
    let seconds = budget.seconds.unwrap_or(f64::INFINITY);
    let has_time = assumed_seconds(best, pixels as u64, 1.0, false) <= TIME_FRACTION * seconds;
    let bytes = (best.cost().bytes * pixels) as f64;
    let has_memory = available_bytes().is_none_or(|available| bytes <= MEMORY_FRACTION * available);
    if has_time && has_memory { best } else { FASTER_DEFAULT }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_budgets_and_large_images_get_the_faster_denoiser() {
        let name = |seconds, pixels| {
            default_denoiser(&Budget { seconds, ..Budget::default() }, pixels).name().to_string()
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be had");
        pool.install(|| {
            // The best one takes 9 µs for a pixel.
            assert_eq!(name(None, 100_000), "learned standard");
            assert_eq!(name(Some(4.6), 100_000), "learned standard");
            assert_eq!(name(Some(4.4), 100_000), "nlm standard");
            assert_eq!(name(None, usize::MAX >> 16), "nlm standard");
        });
    }
}
