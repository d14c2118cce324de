//! How many samples the next batch has, and when to stop. Pure arithmetic: times are told.
//!
//! With a budget of samples alone the schedule depends on counts alone, so that the image is the same
//! on any machine. Batches double the total up to a largest size, so the filter's share of the time
//! falls and stays small.

use super::StoppedBy;

/// Limits of a render; the first one reached ends it. `None` is off.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Budget {
    /// Samples per pixel, on average.
    pub spp: Option<u32>,
    /// Seconds since the program's start, until the image is written.
    pub seconds: Option<f64>,
    /// Estimated relMSE.
    pub target_error: Option<f64>,
}

/// The first batch is at most this many samples per pixel unless the floor is higher; more would be
/// spread blindly.
const PILOT_SPP: u64 = 8;
/// No batch is larger than this many samples per pixel, so that there is news now and then.
const LARGEST_BATCH_SPP: u64 = 64;
/// A step of a batch has at most this many samples per pixel; between steps it can be interrupted.
const STEP_SPP: u64 = 4;
/// With a budget of time, this much of the time that is left is planned for; the rest is for what
/// was predicted wrongly.
const PLANNED_SHARE: f64 = 0.9;
/// A batch that would take less time than this share of the budget is not worth starting.
const SHORTEST_SHARE: f64 = 0.01;
/// What the final filter pass and the writing may take, in reruns and seconds.
const FINAL_FILTER_RERUNS: f64 = 4.0;
const WRITE_SECONDS_PER_PIXEL: f64 = 6e-7;

/// See the module.
#[derive(Clone, Debug)]
pub struct Schedule {
    budget: Budget,
    pixels: u64,
    min_spp: u64,
    max_spp: u64,
    /// Samples per second, of the latest batch.
    rate: Option<f64>,
    /// Seconds of the latest rerun of the filter.
    rerun: f64,
}

impl Schedule {
    pub fn new(budget: &Budget, pixels: u64, min_spp: u32, max_spp: u32) -> Self {
        let (min_spp, max_spp) = (u64::from(min_spp), u64::from(max_spp));
        Self { budget: *budget, pixels, min_spp, max_spp, rate: None, rerun: 0.0 }
    }

    /// A batch of `samples` took so long.
    pub fn rendered(&mut self, samples: u64, seconds: f64) {
        self.rate = Some(samples as f64 / seconds.max(1e-6));
    }

    /// A rerun of the filter took so long.
    pub fn filtered(&mut self, seconds: f64) {
        self.rerun = seconds;
    }

    /// Samples of the next batch, or what ended the render.
    pub fn next(&self, elapsed: f64, samples: u64, error: Option<f64>) -> Result<u64, StoppedBy> {
        let most = |spp: u64| spp.saturating_mul(self.pixels).saturating_sub(samples);
        let left = match self.budget.spp {
            Some(spp) => most(u64::from(spp).min(self.max_spp)),
            None => most(self.max_spp),
        };
        if left == 0 {
            return Err(StoppedBy::Spp);
        }
        if let (Some(target), Some(error)) = (self.budget.target_error, error)
            && error <= target
        {
            return Err(StoppedBy::TargetError);
        }
        let batch = if samples == 0 { self.pilot() } else { samples.min(LARGEST_BATCH_SPP * self.pixels) };
        let batch = batch.min(left);
        match self.affordable(elapsed) {
            // The first batch comes whatever it costs: there has to be an image.
            Some(affordable) if samples > 0 && affordable < batch => {
                let shortest = SHORTEST_SHARE * self.budget.seconds.unwrap_or(0.0) * self.rate.unwrap_or(0.0);
                if (affordable as f64) < shortest.max(1.0) { Err(StoppedBy::Time) } else { Ok(affordable) }
            }
            _ => Ok(batch),
        }
    }

    /// Follows another budget from now on.
    pub fn change(&mut self, budget: &Budget) {
        self.budget = *budget;
    }

    /// Samples of a step of a batch, at most.
    pub fn step_samples(&self) -> u64 {
        STEP_SPP * self.pixels
    }

    /// Whether what is left must go to the last filter pass and the writing.
    pub fn is_late(&self, elapsed: f64) -> bool {
        self.budget.seconds.is_some_and(|seconds| elapsed + self.closing_seconds() >= seconds)
    }

    /// Share of the nearest budget that is spent.
    pub fn fraction(&self, elapsed: f64, samples: u64) -> f64 {
        let by_spp =
            self.budget.spp.map(|spp| samples as f64 / (f64::from(spp) * self.pixels as f64).max(1.0));
        let by_time = self.budget.seconds.map(|seconds| elapsed / seconds);
        by_spp.into_iter().chain(by_time).fold(0.0, f64::max).min(1.0)
    }

    fn pilot(&self) -> u64 {
        if self.budget.seconds.is_some() {
            // Nothing is known of the scene's speed yet, so the floor has to wait.
            return self.pixels;
        }
        let quarter = self.budget.spp.map_or(PILOT_SPP, |spp| u64::from(spp) / 4);
        let spp = (quarter & !1).min(PILOT_SPP).max(self.min_spp).max(1);
        spp * self.pixels
    }

    /// Samples that the time left allows for.
    fn affordable(&self, elapsed: f64) -> Option<u64> {
        let (seconds, rate) = (self.budget.seconds?, self.rate?);
        let left = (seconds - elapsed - self.closing_seconds()).max(0.0);
        Some((PLANNED_SHARE * left * rate) as u64)
    }

    /// What comes after the last batch.
    fn closing_seconds(&self) -> f64 {
        FINAL_FILTER_RERUNS * self.rerun + WRITE_SECONDS_PER_PIXEL * self.pixels as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batches(spp: u32) -> Vec<u64> {
        let budget = Budget { spp: Some(spp), ..Budget::default() };
        let schedule = Schedule::new(&budget, 100, 4, u32::MAX);
        let mut samples = 0;
        let mut sizes = Vec::new();
        while let Ok(batch) = schedule.next(0.0, samples, None) {
            samples += batch;
            sizes.push(batch / 100);
        }
        sizes
    }

    #[test]
    fn batches_double_the_total_and_end_exactly() {
        assert_eq!(batches(1), [1]);
        assert_eq!(batches(8), [4, 4]);
        assert_eq!(batches(32), [8, 8, 16]);
        assert_eq!(batches(128), [8, 8, 16, 32, 64]);
        assert_eq!(batches(200), [8, 8, 16, 32, 64, 64, 8]);
    }

    #[test]
    fn a_target_error_that_is_reached_ends_the_render() {
        let budget = Budget { target_error: Some(0.01), ..Budget::default() };
        let schedule = Schedule::new(&budget, 100, 4, u32::MAX);
        assert_eq!(schedule.next(0.0, 800, Some(0.02)), Ok(800));
        assert_eq!(schedule.next(0.0, 1600, Some(0.01)), Err(StoppedBy::TargetError));
    }

    #[test]
    fn with_a_budget_of_time_batches_fit_what_is_left() {
        let budget = Budget { seconds: Some(10.0), ..Budget::default() };
        let mut schedule = Schedule::new(&budget, 1000, 4, u32::MAX);
        assert_eq!(schedule.next(0.5, 0, None), Ok(1000));
        schedule.rendered(1000, 1.0);
        schedule.filtered(0.1);
        assert_eq!(schedule.next(1.6, 1000, None), Ok(1000));
        let last = schedule.next(8.0, 4000, None).unwrap();
        assert!(last > 1000 && last < 1600, "{last}");
        assert_eq!(schedule.next(9.7, 6000, None), Err(StoppedBy::Time));
        assert!(schedule.is_late(9.7) && !schedule.is_late(9.0));
    }
}
