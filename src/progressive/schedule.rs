//! How many samples the next batch has, and when to stop. Pure arithmetic: times are told.
//!
//! Batches double the total up to a largest size, so the filter's share of the time falls and stays
//! small. The last one is a quarter of the whole: what it says of the image's error is said of an
//! image with three quarters of the samples. With a budget of samples alone the schedule depends on
//! counts alone, so that the image is the same on any machine; with one of time, batches are rendered
//! in steps that get shorter towards the end, and what comes after the last of them is predicted.

use super::StoppedBy;

/// Limits of a render; the first one reached ends it. `None` is off.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Budget {
    /// Samples per pixel, on average.
    pub spp: Option<u32>,
    /// Seconds since the program's start, until the image is written.
    pub seconds: Option<f64>,
    /// Estimated relMSE.
    pub target_error: Option<f64>,
}

/// A batch to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    pub samples: u64,
    /// Whether it spends the budget.
    pub last: bool,
}

/// The first batch is at most this many samples per pixel unless the floor is higher; more would be
/// spread blindly.
const PILOT_SPP: u64 = 8;
/// No batch is larger than this many samples per pixel, so that there is news now and then.
const LARGEST_BATCH_SPP: u64 = 64;
/// The last batch is this part of all samples.
const LAST_PART: u64 = 4;
/// With fewer samples per pixel in all, a part of them says too little of the error to be kept for it.
const LEAST_SPP_WITH_LAST_PART: u64 = 16;
/// A step of a batch has at most this many samples per pixel.
const STEP_SPP: u64 = 4;
/// Share of the pixels that the first step under a budget of time renders, whatever it costs: there
/// has to be an image.
const FIRST_STEP: f64 = 1.0 / 16.0;
/// Samples per pixel that make the coarsest image.
const LEAST_IMAGE: f64 = 1.0 / 8.0;
/// Under a budget of time a step takes at most this long, in seconds, and no step is begun that would
/// have to be shorter than this.
const STEP_SECONDS: (f64, f64) = (0.01, 0.25);
/// A step takes at most this share of what is left for samples.
const STEP_SHARE: f64 = 0.5;
/// Share of a budget of time that is left over for what was predicted wrongly. A budget that is missed
/// by a hundredth is broken, and one of which a twentieth is left is wasted: this is between.
const MARGIN: f64 = 0.02;
/// Later than by the larger of so many seconds and of such a share, a budget of time is broken.
const TOLERANCE: (f64, f64) = (0.1, 0.01);
/// The last batch under a budget of time is planned larger than what it should hold, by this factor:
/// the clock ends it.
const LAST_EXCESS: f64 = 1.25;
/// Memory of the sampling rate, in seconds: other programs come and go.
const RATE_MEMORY: f64 = 0.5;
/// As many of the latest rehearsals make the prediction of what comes after the last batch.
const REHEARSALS: f64 = 2.0;
/// Share by which a rehearsal may be wrong, as long as no other confirms it (measured on 0.9 megapixels: 0.1 to 0.2).
const DOUBT: f64 = 0.1;

/// See the module.
#[derive(Clone, Debug)]
pub struct Schedule {
    budget: Budget,
    pixels: u64,
    min_spp: u64,
    max_spp: u64,
    /// Samples and seconds of the latest steps, older ones fading.
    recent: (f64, f64),
    /// Predicted seconds of what comes after the last batch.
    closing: f64,
    /// Mean deviation of rehearsals from that.
    deviation: f64,
    rehearsals: f64,
}

impl Schedule {
    pub fn new(budget: &Budget, pixels: u64, min_spp: u32, max_spp: u32) -> Self {
        let (min_spp, max_spp) = (u64::from(min_spp), u64::from(max_spp));
        Self {
            budget: *budget,
            pixels,
            min_spp,
            max_spp,
            recent: (0.0, 0.0),
            closing: 0.0,
            deviation: 0.0,
            rehearsals: 0.0,
        }
    }

    /// A step of `samples` took so long.
    pub fn rendered(&mut self, samples: u64, seconds: f64) {
        let fade = (-seconds / RATE_MEMORY).exp();
        let (old_samples, old_seconds) = self.recent;
        self.recent = (fade * old_samples + samples as f64, fade * old_seconds + seconds);
    }

    /// Samples and seconds of the latest steps.
    pub fn recent(&self) -> (f64, f64) {
        self.recent
    }

    /// Takes over the latest steps of another render of the same scene.
    pub fn resume(&mut self, recent: (f64, f64)) {
        self.recent = recent;
    }

    /// What comes after the last batch would take so long now.
    pub fn rehearsed(&mut self, seconds: f64) {
        self.rehearsals += 1.0;
        // The first one took longer than the others will: the caches knew nothing of it.
        let warm = (self.rehearsals - 1.0).max(1.0);
        let weight = 1.0 / warm.min(REHEARSALS);
        let deviation = if warm > 1.0 { (seconds - self.closing).abs() } else { DOUBT * seconds };
        self.deviation += weight * (deviation - self.deviation);
        self.closing += weight * (seconds - self.closing);
    }

    /// A whole filter pass of the final quality took so much less than it would have by rehearsal.
    pub fn corrected(&mut self, seconds: f64) {
        self.closing = (self.closing - seconds).max(0.0);
        self.deviation = 0.0;
        // That is no less than what a first rehearsal says.
        self.rehearsals = self.rehearsals.max(REHEARSALS);
    }

    /// What comes after the last batch is something else from now on, and supposed to take so long: the next
    /// rehearsal alone tells of it.
    pub fn expects(&mut self, seconds: f64) {
        (self.closing, self.deviation, self.rehearsals) = (seconds, 0.0, 0.0);
    }

    /// The next batch, or what ended the render.
    pub fn next(&self, elapsed: f64, samples: u64, error: Option<f64>) -> Result<Plan, StoppedBy> {
        let most = |spp: u64| spp.saturating_mul(self.pixels).saturating_sub(samples);
        let left = most(self.budget.spp.map_or(self.max_spp, |spp| u64::from(spp).min(self.max_spp)));
        if left == 0 {
            return Err(StoppedBy::Spp);
        }
        if let (Some(target), Some(error)) = (self.budget.target_error, error)
            && error <= target
        {
            return Err(StoppedBy::TargetError);
        }
        if samples == 0 {
            let pilot = self.pilot();
            return Ok(Plan { samples: pilot.min(left), last: pilot >= left });
        }
        let batch = samples.min(LARGEST_BATCH_SPP * self.pixels).min(left);
        let Some(seconds) = self.seconds_left(elapsed) else {
            let plan = self.before_last(samples, left, batch);
            // Where nothing says how many samples there will be, no batch is known to be the last.
            return Ok(if self.budget.spp.is_some() { plan } else { Plan { samples: batch, last: false } });
        };
        // The first batch comes whatever it costs.
        if seconds < STEP_SECONDS.0 {
            return Err(StoppedBy::Time);
        }
        let affordable = (seconds * self.rate().unwrap_or(0.0)) as u64;
        let plan = self.before_last(samples, left.min(affordable.max(1)), batch);
        let samples =
            if plan.last { (LAST_EXCESS * plan.samples as f64).ceil() as u64 } else { plan.samples };
        Ok(Plan { samples: samples.clamp(1, left), ..plan })
    }

    /// A batch of the size wished for, cut where the last part begins. `left`: samples to the end.
    fn before_last(&self, samples: u64, left: u64, wished: u64) -> Plan {
        let spp = (samples + left) / self.pixels;
        if spp < LEAST_SPP_WITH_LAST_PART {
            return Plan { samples: wished.min(left), last: wished >= left };
        }
        let last = (spp / LAST_PART).min(LARGEST_BATCH_SPP);
        // Even, so that both halves of a pixel can grow alike.
        let begins = ((spp - last) & !1) * self.pixels;
        let to_last = begins.saturating_sub(samples);
        // What little may be missing is not worth a batch of its own.
        if to_last < last * self.pixels / LAST_PART {
            return Plan { samples: left, last: true };
        }
        Plan { samples: wished.min(to_last), last: false }
    }

    /// Share of a batch of `batch` samples that the next step renders; `None` where what is left of the
    /// time must go to what comes after. `samples` so far.
    pub fn step(&self, elapsed: f64, samples: u64, batch: u64) -> Option<f64> {
        let most = (STEP_SPP * self.pixels) as f64;
        let share = |of: f64| of.min(most) / batch.max(1) as f64;
        let Some(seconds) = self.seconds_left(elapsed) else {
            return Some(share(most));
        };
        let (shortest, longest) = STEP_SECONDS;
        match self.rate() {
            None => Some(FIRST_STEP),
            Some(_) if samples > 0 && seconds < shortest => None,
            Some(rate) => Some(share(rate * (STEP_SHARE * seconds).clamp(shortest, longest))),
        }
    }

    /// Share of a batch of `batch` samples that takes about so long, and at least what makes an image: a
    /// pair of samples in every block of 4×4 pixels.
    pub fn short_step(&self, seconds: f64, batch: u64) -> f64 {
        let least = LEAST_IMAGE * self.pixels as f64;
        self.rate().map_or(least, |rate| (rate * seconds).max(least)) / batch.max(1) as f64
    }

    /// How long so many samples take, lately.
    pub fn seconds_for(&self, samples: f64) -> f64 {
        self.rate().map_or(0.0, |rate| samples / rate)
    }

    /// Follows another budget, floor and ceiling per pixel from now on.
    pub fn change(&mut self, budget: &Budget, min_spp: u32, max_spp: u32) {
        self.budget = *budget;
        (self.min_spp, self.max_spp) = (min_spp.into(), max_spp.into());
    }

    /// Seconds that what comes after the last batch will take, as far as is known.
    pub fn closing(&self) -> f64 {
        self.closing + self.deviation
    }

    /// Seconds left for samples, with a budget of time.
    pub fn seconds_left(&self, elapsed: f64) -> Option<f64> {
        self.budget.seconds.map(|seconds| (1.0 - MARGIN) * seconds - self.closing() - elapsed)
    }

    /// Whether what comes after the last batch would end beyond the budget if it began now.
    pub fn is_late(&self, elapsed: f64) -> bool {
        self.budget.seconds.is_some_and(|seconds| elapsed + self.closing() > seconds)
    }

    /// Whether that would break the budget so plainly that an image without it is better.
    pub fn is_far_too_late(&self, elapsed: f64) -> bool {
        let (seconds, share) = TOLERANCE;
        let tolerance = self.budget.seconds.map_or(f64::INFINITY, |budget| (share * budget).max(seconds));
        self.is_late(elapsed) && self.closing() > tolerance
    }

    /// Whether, under a budget of time, every pixel can get a sample, with so many samples so far.
    pub fn fills(&self, elapsed: f64, samples: u64) -> bool {
        self.seconds_left(elapsed).is_none_or(|seconds| {
            samples as f64 + seconds.max(0.0) * self.rate().unwrap_or(0.0) >= self.pixels as f64
        })
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

    /// Samples per second, lately.
    fn rate(&self) -> Option<f64> {
        let (samples, seconds) = self.recent;
        (samples > 0.0).then(|| samples / seconds.max(1e-6))
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
        while let Ok(plan) = schedule.next(0.0, samples, None) {
            samples += plan.samples;
            sizes.push(plan.samples / 100);
            assert_eq!(plan.last, samples == u64::from(spp) * 100, "{spp}: {sizes:?}");
        }
        sizes
    }

    #[test]
    fn batches_double_the_total_and_the_last_is_a_quarter() {
        assert_eq!(batches(1), [1]);
        assert_eq!(batches(8), [4, 4]);
        assert_eq!(batches(19), [4, 4, 6, 5]);
        assert_eq!(batches(32), [8, 8, 8, 8]);
        assert_eq!(batches(128), [8, 8, 16, 32, 32, 32]);
        assert_eq!(batches(200), [8, 8, 16, 32, 64, 22, 50]);
    }

    #[test]
    fn a_target_error_that_is_reached_ends_the_render() {
        let budget = Budget { target_error: Some(0.01), ..Budget::default() };
        let schedule = Schedule::new(&budget, 100, 4, u32::MAX);
        assert_eq!(schedule.next(0.0, 800, Some(0.02)), Ok(Plan { samples: 800, last: false }));
        assert_eq!(schedule.next(0.0, 1600, Some(0.01)), Err(StoppedBy::TargetError));
    }

    /// A render by a clock that only the schedule's own steps move: when its samples end, how many
    /// batches there were, and how much more than `closing` is kept back then.
    fn simulate(budget: f64, rate: f64, closing: f64) -> (f64, usize, f64) {
        let budget = Budget { seconds: Some(budget), ..Budget::default() };
        let mut schedule = Schedule::new(&budget, 1000, 4, u32::MAX);
        let (mut elapsed, mut samples, mut batches, mut doubt) = (0.1, 0, 0, 0.0);
        while let Ok(plan) = schedule.next(elapsed, samples, None) {
            let mut done = 0.0;
            while done < 1.0 {
                let Some(share) = schedule.step(elapsed, samples, plan.samples) else { break };
                let n = (share.min(1.0 - done) * plan.samples as f64).ceil();
                done += share;
                samples += n as u64;
                elapsed += n / rate;
                schedule.rendered(n as u64, n / rate);
            }
            batches += 1;
            doubt = schedule.closing() - closing;
            schedule.rehearsed(closing);
        }
        (elapsed, batches, doubt)
    }

    #[test]
    fn time_is_spent_to_the_last_step_and_not_beyond() {
        for (budget, rate, closing) in [(3.0, 1e4, 0.5), (10.0, 1e3, 2.0), (10.0, 1e6, 0.1), (60.0, 1e5, 3.0)]
        {
            let (end, batches, doubt) = simulate(budget, rate, closing);
            let aim = 0.98 * budget - closing - doubt;
            assert!((end - aim).abs() <= 0.011, "{budget} {rate} {closing}: {end}");
            assert!((3..200).contains(&batches), "{batches}");
            let least = DOUBT * closing * 0.5f64.powi(batches as i32 - 3);
            assert!(doubt <= least + 1e-9, "doubt fades by half with each rehearsal: {doubt} of {closing}");
        }
    }

    #[test]
    fn later_rehearsals_replace_the_first_and_a_whole_pass_replaces_all() {
        let budget = Budget { seconds: Some(10.0), ..Budget::default() };
        let mut schedule = Schedule::new(&budget, 1000, 4, u32::MAX);
        let left = |schedule: &Schedule| schedule.seconds_left(4.0).unwrap();
        schedule.rehearsed(5.0);
        assert!((left(&schedule) - (9.8 - 5.5 - 4.0)).abs() < 1e-9, "there is doubt about the first");
        schedule.rehearsed(1.0);
        assert!((left(&schedule) - (9.8 - 1.1 - 4.0)).abs() < 1e-9, "the first one is forgotten");
        schedule.rehearsed(2.0);
        assert!((left(&schedule) - (9.8 - 1.5 - 0.55 - 4.0)).abs() < 1e-9, "mean and deviation");
        // By rehearsal 1.2 seconds, and 0.9 in truth; nothing deviates from a truth.
        schedule.corrected(1.2 - 0.9);
        assert!((left(&schedule) - (9.8 - 1.2 - 4.0)).abs() < 1e-9);
        schedule.corrected(5.0);
        assert!((left(&schedule) - (9.8 - 4.0)).abs() < 1e-9, "nothing takes less than no time");
    }

    #[test]
    fn it_is_known_early_whether_every_pixel_gets_a_sample_and_whether_a_quicker_filter_helps() {
        let budget = Budget { seconds: Some(4.0), ..Budget::default() };
        let mut schedule = Schedule::new(&budget, 1_000_000, 4, u32::MAX);
        schedule.expects(3.0);
        schedule.rendered(100_000, 0.1);
        assert!(schedule.fills(0.01, 100_000), "0.9 seconds for 0.9 million samples");
        assert!(!schedule.fills(0.1, 100_000) && !schedule.is_late(0.1));
        assert!(schedule.is_late(1.1));
        schedule.rehearsed(1.5);
        assert!(schedule.fills(0.1, 100_000) && !schedule.is_late(1.1));
        schedule.expects(3.0);
        assert!(!schedule.fills(0.1, 100_000) && schedule.is_late(1.1));
        assert!(!schedule.is_far_too_late(0.9) && schedule.is_far_too_late(1.1));
        schedule.expects(0.09);
        assert!(schedule.is_late(5.0) && !schedule.is_far_too_late(5.0), "a tenth of a second is nothing");
        let without = Schedule::new(&Budget::default(), 1_000_000, 4, u32::MAX);
        assert!(without.fills(9.0, 0) && !without.is_late(9.0) && !without.is_far_too_late(9.0));
    }

    #[test]
    fn a_budget_that_is_spent_before_the_first_sample_still_gets_a_sixteenth_of_them() {
        let budget = Budget { seconds: Some(0.1), ..Budget::default() };
        let mut schedule = Schedule::new(&budget, 1600, 4, u32::MAX);
        let plan = schedule.next(5.0, 0, None).unwrap();
        assert_eq!(plan.samples, 1600);
        assert_eq!(schedule.step(5.0, 0, plan.samples), Some(1.0 / 16.0));
        schedule.rendered(100, 0.1);
        assert_eq!(schedule.step(5.1, 100, plan.samples), None);
        assert_eq!(schedule.next(5.1, 100, None), Err(StoppedBy::Time));
    }
}
