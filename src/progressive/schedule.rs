//! The size of the next batch and of its next step, and when a budget is spent. Pure arithmetic: times are given.
//!
//! Batches double the total up to a largest size, so that the filter's fraction of the time falls and stays small. The
//! last one is a quarter of the whole, directed by a pass that knows the other three. With a
//! budget of samples alone the schedule depends on counts alone, so that the image is the same on any machine; under a
//! time budget batches are rendered in steps that get shorter towards the end, and the time of the finalisation is
//! predicted.

use super::budget::Budget;
use super::speed::Speed;
use super::stopped_by::StoppedBy;
use super::time_constants::{
    LAST_BATCH_EXCESS, LONGEST_TIMED_STEP, MARGIN, SHORTEST_TIMED_STEP, SLACK, STEP_FRACTION, TOLERANCE,
};

/// A batch to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    pub samples: u64,
    /// Whether it spends the budget.
    pub is_last: bool,
}

/// Most samples per pixel of the first batch, unless the floor is higher: no maps direct them yet.
const PILOT_SPP: u64 = 8;
/// Most samples per pixel of any batch, so that there are results now and then.
const LARGEST_BATCH_SPP: u64 = 64;
/// Ratio of a budget of samples to its first batch.
const PILOT_RATIO: u64 = 4;
/// Ratio of all samples to those of the last batch.
const LAST_RATIO: u64 = 4;
/// Ratio of the last batch to the smallest rest before it that is a batch of its own.
const REST_RATIO: u64 = 4;
/// Least growth of the samples towards a target error, relative to those so far: the estimate may be off.
const LEAST_GROWTH: f64 = 0.25;
/// Power of the samples by which the error of a filtered image typically falls.
const TYPICAL_POWER: f64 = 0.7;
/// Fewest samples per pixel, in all, with a last batch of that size.
const LEAST_SPP_WITH_LAST_BATCH: u64 = 16;
/// Most samples per pixel of a step.
const STEP_SPP: u64 = 4;
/// Fraction of the batch that the first step under a time budget renders, whatever it costs: there has to be an image.
const FIRST_STEP: f64 = 1.0 / 16.0;
/// Samples per pixel of the first image: a pair in every second block of 4×4 pixels, no coarser than what a viewer saw of a moving
/// camera before it.
pub(super) const LEAST_IMAGE: f64 = 1.0 / 16.0;
/// Samples per pixel of the shortest step after it: what a step costs beside its samples stays small.
const LEAST_STEP: f64 = 1.0 / 32.0;

/// The budgets and what is known of the speed, at a moment.
#[derive(Clone, Copy, Debug)]
pub struct Schedule<'a> {
    pub budget: &'a Budget,
    pub pixels: u64,
    /// Floor and ceiling per pixel.
    pub min_spp: u64,
    pub max_spp: u64,
    /// Samples with which every pixel has those of a map of counts.
    pub map_end: Option<u64>,
    pub speed: Speed,
    /// Predicted seconds of the finalisation.
    pub finalisation: f64,
    /// Seconds that the latest batch took to be allocated.
    pub allocation: f64,
}

impl Schedule<'_> {
    /// Returns the most samples that the budgets allow.
    pub fn most(&self) -> u64 {
        let spp = self.budget.spp.map_or(self.max_spp, |spp| u64::from(spp).min(self.max_spp));
        self.map_end.unwrap_or(spp.saturating_mul(self.pixels))
    }

    /// Returns whether an image with this error reaches the target.
    pub fn reaches_target(&self, error: Option<f64>) -> bool {
        self.budget.target_error.zip(error).is_some_and(|(target, error)| error <= target)
    }

    /// Returns the next batch, or the budget that is spent. `samples` so far, rejected ones included; `error`: estimated
    /// relMSE of their image, or of an image of fewer.
    ///
    /// # Errors
    /// The budget that is spent.
    pub fn next_batch(&self, elapsed: f64, samples: u64, error: Option<f64>) -> Result<Plan, StoppedBy> {
        let left = self.most().saturating_sub(samples);
        if left == 0 {
            return Err(StoppedBy::Spp);
        }
        if samples == 0 {
            let pilot = self.pilot();
            return Ok(Plan { samples: pilot.min(left), is_last: pilot >= left });
        }
        // A first batch that was given up is planned as large again.
        let batch = samples
            .max(self.pilot())
            .min(LARGEST_BATCH_SPP * self.pixels)
            .min(self.samples_to_target(samples, error))
            .min(left);
        let Some(seconds) = self.seconds_left(elapsed) else {
            let plan = self.before_last(samples, left, batch);
            // Where nothing says how many samples there will be, no batch is known to be the last.
            return Ok(if self.budget.spp.is_some() {
                plan
            } else {
                Plan { samples: batch, is_last: false }
            });
        };
        // The first batch comes whatever it costs.
        if seconds < SHORTEST_TIMED_STEP + self.allocation {
            return Err(StoppedBy::Time);
        }
        let affordable = (seconds * self.speed.rate().unwrap_or(0.0)) as u64;
        let plan = self.before_last(samples, left.min(affordable.max(1)), batch);
        let samples =
            if plan.is_last { (LAST_BATCH_EXCESS * plan.samples as f64).ceil() as u64 } else { plan.samples };
        Ok(Plan { samples: samples.clamp(1, left), ..plan })
    }

    /// Returns the samples that lead to the target error, at least [`LEAST_GROWTH`] of those so far.
    fn samples_to_target(&self, samples: u64, error: Option<f64>) -> u64 {
        let Some((target, error)) = self.budget.target_error.zip(error) else { return u64::MAX };
        let growth = (error / target).powf(1.0 / TYPICAL_POWER) - 1.0;
        let pairs = (samples as f64 * growth.max(LEAST_GROWTH) / self.pixels as f64 / 2.0).ceil() as u64;
        pairs.saturating_mul(2).saturating_mul(self.pixels)
    }

    /// Returns a batch of the wanted size, cut where the last batch begins. `left`: samples to the end.
    fn before_last(&self, samples: u64, left: u64, wanted: u64) -> Plan {
        let spp = (samples + left) / self.pixels;
        if spp < LEAST_SPP_WITH_LAST_BATCH {
            return Plan { samples: wanted.min(left), is_last: wanted >= left };
        }
        let last = (spp / LAST_RATIO).min(LARGEST_BATCH_SPP);
        // Even, so that both halves of a pixel can grow alike.
        let begins = ((spp - last) & !1) * self.pixels;
        let to_last = begins.saturating_sub(samples);
        // A small rest is not worth a batch of its own.
        if to_last < last * self.pixels / REST_RATIO {
            return Plan { samples: left, is_last: true };
        }
        Plan { samples: wanted.min(to_last), is_last: false }
    }

    /// Returns the fraction of a batch of `batch` samples that the next step renders; `None` where the time that is left
    /// belongs to the finalisation. `samples` so far.
    pub fn step(&self, elapsed: f64, samples: u64, batch: u64) -> Option<f64> {
        let most = (STEP_SPP * self.pixels) as f64;
        let fraction = |samples: f64| samples.min(most) / batch.max(1) as f64;
        let Some(seconds) = self.seconds_left(elapsed) else {
            return Some(fraction(most));
        };
        match self.speed.rate() {
            None => Some(FIRST_STEP),
            Some(_) if samples > 0 && seconds < SHORTEST_TIMED_STEP => None,
            Some(rate) => {
                let seconds = (STEP_FRACTION * seconds).clamp(SHORTEST_TIMED_STEP, LONGEST_TIMED_STEP);
                Some(fraction(rate * seconds))
            }
        }
    }

    /// Returns the fraction of a batch of `batch` samples that takes about `seconds` seconds, and after `samples` samples; at
    /// least what makes a coarse image if these are none.
    pub fn short_step(&self, seconds: f64, samples: u64, batch: u64) -> f64 {
        let least = if samples == 0 { LEAST_IMAGE } else { LEAST_STEP } * self.pixels as f64;
        self.speed.rate().map_or(least, |rate| (rate * seconds).max(least)) / batch.max(1) as f64
    }

    /// Returns the seconds left for samples under a time budget.
    pub fn seconds_left(&self, elapsed: f64) -> Option<f64> {
        self.budget.seconds.map(|seconds| (1.0 - MARGIN) * seconds - self.finalisation - elapsed)
    }

    /// Returns whether the finalisation would end beyond the time budget, and the [`SLACK`] after it, if it began now.
    pub fn is_late(&self, elapsed: f64) -> bool {
        self.budget.seconds.is_some_and(|seconds| elapsed + self.finalisation > seconds + SLACK)
    }

    /// Returns whether the finalisation would break the budget, or if that cannot be kept, end much later than the `earliest_end`.
    pub fn is_far_too_late(&self, elapsed: f64, earliest_end: f64) -> bool {
        let (least, fraction) = TOLERANCE;
        self.budget.seconds.is_some_and(|seconds| {
            elapsed + self.finalisation > seconds.max(earliest_end) + least.max(fraction * seconds)
        })
    }

    /// Returns the samples that there will be when the budgets are spent, after `samples` samples.
    pub fn samples_at_end(&self, elapsed: f64, samples: u64) -> f64 {
        let seconds = self.seconds_left(elapsed).map_or(0.0, |seconds| seconds.max(0.0));
        (samples as f64 + seconds * self.speed.rate().unwrap_or(0.0)).min(self.most() as f64)
    }

    /// Returns the fraction of the nearest budget that is spent, in [0, 1].
    pub fn fraction(&self, elapsed: f64, samples: u64) -> f64 {
        let has_end = self.budget.spp.is_some() || self.map_end.is_some();
        let by_spp = has_end.then(|| samples as f64 / (self.most() as f64).max(1.0));
        let by_time = self.budget.seconds.map(|seconds| elapsed / seconds);
        by_spp.into_iter().chain(by_time).fold(0.0, f64::max).min(1.0)
    }

    fn pilot(&self) -> u64 {
        if self.budget.seconds.is_some() {
            // Nothing is known of the scene's speed yet, so the floor has to wait.
            return self.pixels;
        }
        let quarter = self.budget.spp.map_or(PILOT_SPP, |spp| u64::from(spp) / PILOT_RATIO);
        let spp = (quarter & !1).min(PILOT_SPP).max(self.min_spp).max(1);
        spp * self.pixels
    }
}

#[cfg(test)]
mod tests;
