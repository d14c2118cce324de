//! The prediction of the finalisation: the last filter pass, and the encoding and writing of the image.
//!
//! The time is first assumed from the denoiser's cost, then calibrated on some rows of the image (see `calibration`). The
//! prediction is the mean of the latest calibrations plus their mean deviation from it. A calibration that takes much longer than
//! expected and by which hardly any time is left is repeated at once, and the shorter of both counts: another program may have been
//! in its way, or it took new memory.

use super::time_constants::{
    CALIBRATION_FRACTION, CALIBRATION_USE, CALIBRATIONS, CHECKPOINT_SECONDS, DOUBTED_EXCESS,
    FIRST_CALIBRATION_EXCESS, FIRST_DEVIATION, LAST_CALIBRATION,
};
use crate::filter::Denoiser;
use crate::filter::sparse_filtering::core_seconds;

/// Ratio of an image's rows to those on which a calibration is made.
pub(super) const ROW_RATIO: usize = 16;

/// Times of one calibration, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationTimes {
    /// Of the filter pass, extrapolated to the whole image.
    pub filter: f64,
    /// Of the whole finalisation, likewise.
    pub total: f64,
    /// Of gathering the statistics of several processes, which is part of `total`; a repetition has nothing left to gather.
    pub gathering: f64,
    /// That the calibration itself took.
    pub spent: f64,
}

/// The predicted time of the finalisation.
#[derive(Clone, Debug, Default)]
pub struct Finalisation {
    /// The denoiser of the calibrations.
    denoiser: Option<&'static dyn Denoiser>,
    /// What the calibrations say, and what those before the latest one said.
    prediction: Prediction,
    before: Prediction,
    /// Seconds of the finalisation that were expected before the latest calibration, and that were left for samples.
    expected: f64,
    left: f64,
    /// The latest calibration; its `filter` is replaced by that of a whole pass.
    latest: Option<CalibrationTimes>,
    /// Least measured seconds: other programs lengthen a measurement and never shorten it.
    least: Option<f64>,
    /// Seconds of all calibrations.
    spent: f64,
    /// Whether nothing has happened since the latest calibration, and whether that one repeated another.
    is_fresh: bool,
    is_repetition: bool,
}

/// What the calibrations of one denoiser say.
#[derive(Clone, Copy, Debug, Default)]
struct Prediction {
    /// Predicted seconds, mean deviation from it, and number of calibrations behind both.
    mean: f64,
    deviation: f64,
    averaged: f64,
    /// Whether the last calibration before the end has been made.
    is_last_made: bool,
}

impl Prediction {
    fn seconds(&self) -> f64 {
        self.mean + self.deviation
    }

    /// Adds a calibration of the whole finalisation, in seconds.
    fn add(&mut self, total: f64) {
        self.averaged += 1.0;
        // The first one takes longer than the others: its data is in no cache.
        let warm = (self.averaged - 1.0).max(1.0);
        let weight = 1.0 / warm.min(CALIBRATIONS);
        let deviation = if warm > 1.0 { (total - self.mean).abs() } else { FIRST_DEVIATION * total };
        self.deviation += weight * (deviation - self.deviation);
        self.mean += weight * (total - self.mean);
    }
}

/// Returns the seconds assumed for a finalisation of `pixels` pixels until one is measured. `spp`: samples per pixel;
/// `side` of the squares that are filtered; `saves`: whether a checkpoint is written; `processes` share the pass if they can, from two
/// samples per pixel on; `memory_seconds`: seconds of one core for a byte of new memory.
pub(super) fn assumed_seconds(
    denoiser: &dyn Denoiser,
    side: usize,
    pixels: u64,
    spp: f64,
    saves: bool,
    processes: usize,
    memory_seconds: f64,
) -> f64 {
    let times = if denoiser.cost().is_per_sample { spp } else { 1.0 };
    let checkpoint = if saves { CHECKPOINT_SECONDS } else { 0.0 };
    let processes = if denoiser.parts().is_some() && side == 1 && spp >= 2.0 { processes } else { 1 };
    let threads = rayon::current_num_threads() * processes;
    pixels as f64 * (times * core_seconds(denoiser, side, spp, memory_seconds) / threads as f64 + checkpoint)
}

impl Finalisation {
    /// Returns the denoiser whose finalisation has been measured, once calibrated.
    pub fn calibrated_denoiser(&self) -> Option<&'static dyn Denoiser> {
        self.denoiser.filter(|_| self.is_calibrated())
    }

    /// Returns whether it has been calibrated.
    pub fn is_calibrated(&self) -> bool {
        self.latest.is_some()
    }

    /// Returns the predicted seconds, once calibrated.
    pub fn seconds(&self) -> f64 {
        self.prediction.seconds()
    }

    /// Returns the seconds that it takes if no other program is in its way, once calibrated.
    pub fn least_seconds(&self) -> f64 {
        self.least.unwrap_or(0.0)
    }

    /// Returns the seconds of the last filter pass, once calibrated.
    pub fn filter_seconds(&self) -> Option<f64> {
        self.latest.map(|latest| latest.filter)
    }

    /// Adds a calibration of the denoiser that is predicted for; `expected`: seconds of the finalisation by what was known before;
    /// `left`: seconds that were left for samples by that. If nothing has happened since another one, it is a repetition of it, and
    /// the shorter of both counts.
    pub fn add(&mut self, mut times: CalibrationTimes, expected: f64, left: f64) {
        self.spent += times.spent;
        let doubted = self.latest.filter(|_| self.is_fresh && self.prediction.averaged > 0.0);
        self.is_repetition = doubted.is_some();
        if let Some(doubted) = doubted {
            self.prediction = self.before;
            self.left -= doubted.spent;
            times.gathering = doubted.gathering;
            times.total += doubted.gathering;
            if doubted.total < times.total {
                times = doubted;
            }
        } else {
            (self.before, self.expected, self.left) = (self.prediction, expected, left);
        }
        self.latest = Some(times);
        self.is_fresh = true;
        self.record(times.total);
        self.prediction.is_last_made |= self.is_last(self.left);
        self.prediction.add(times.total);
    }

    /// Replaces the extrapolated seconds of the last filter pass by those of a pass over the whole image.
    pub fn correct(&mut self, filter_seconds: f64) {
        let Some(latest) = &mut self.latest else { return };
        let excess = latest.filter - filter_seconds;
        latest.filter = filter_seconds;
        latest.total -= excess;
        let total = latest.total;
        self.record(total);
        let prediction = &mut self.prediction;
        prediction.mean = (prediction.mean - excess).max(0.0);
        prediction.deviation = 0.0;
        // A measured pass counts as a full set of calibrations.
        prediction.averaged = prediction.averaged.max(CALIBRATIONS);
    }

    /// Predicts for this denoiser. If it is another one than before, the next calibration alone predicts.
    pub fn predict_for(&mut self, denoiser: &'static dyn Denoiser) {
        if self.denoiser.replace(denoiser) == Some(denoiser) {
            return;
        }
        (self.prediction, self.least) = (Prediction::default(), None);
    }

    /// Records a measured time of the whole finalisation, in seconds.
    fn record(&mut self, total: f64) {
        self.least = Some(self.least.unwrap_or(f64::INFINITY).min(total.max(0.0)));
    }

    /// Marks the latest calibration as taken into account.
    pub fn age(&mut self) {
        self.is_fresh = false;
    }

    /// Returns whether nothing has happened since the latest calibration.
    pub fn is_fresh(&self) -> bool {
        self.is_fresh
    }

    /// Returns whether another calibration is due, with `left` seconds left for samples and a finalisation of `predicted`
    /// seconds.
    pub fn is_due(&self, elapsed: f64, left: f64, predicted: f64) -> bool {
        let first = FIRST_CALIBRATION_EXCESS * predicted / ROW_RATIO as f64;
        let next = self.latest.map_or(first, |latest| latest.spent);
        let is_affordable = self.latest.is_none() || self.spent + next <= CALIBRATION_FRACTION * elapsed;
        left > CALIBRATION_USE * next
            && (is_affordable || !self.prediction.is_last_made && self.is_last(left))
    }

    /// Returns whether the latest calibration has to be repeated at once: it took longer than expected, and by it hardly any time is
    /// left.
    pub fn is_doubtful(&self, left: f64) -> bool {
        let is_slow = self.latest.is_some_and(|latest| latest.total > DOUBTED_EXCESS * self.expected);
        is_slow && !self.is_repetition && self.is_last(left)
    }

    /// Returns whether so little time is left that a calibration is the last one before the end.
    fn is_last(&self, left: f64) -> bool {
        left <= LAST_CALIBRATION * self.latest.map_or(0.0, |latest| latest.total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::nlm;

    fn calibration(total: f64, spent: f64) -> CalibrationTimes {
        CalibrationTimes { filter: 0.9 * total, total, gathering: 0.0, spent }
    }

    /// A finalisation after calibrations that were all expected to give one second.
    fn calibrated(times: &[(f64, f64)], left: f64) -> Finalisation {
        let mut finalisation = Finalisation::default();
        for &(total, spent) in times {
            finalisation.age();
            finalisation.add(calibration(total, spent), 1.0, left);
        }
        finalisation
    }

    #[test]
    fn later_calibrations_replace_the_first_and_a_whole_pass_replaces_all() {
        let seconds = |finalisation: &Finalisation| finalisation.seconds();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(near(seconds(&calibrated(&[(5.0, 1.0)], 9.0)), 5.5), "the first is doubted");
        assert!(near(seconds(&calibrated(&[(5.0, 1.0), (1.0, 1.0)], 9.0)), 1.1), "the first is forgotten");
        let mut three = calibrated(&[(5.0, 1.0), (1.0, 1.0), (2.0, 1.0)], 9.0);
        assert!(near(three.seconds(), 1.5 + 0.55), "mean and deviation");
        // 1.8 seconds were extrapolated; a measured pass has no deviation.
        assert!(near(three.least_seconds(), 1.0));
        three.correct(1.5);
        assert!(near(three.seconds(), 1.2) && near(three.least_seconds(), 1.0));
        assert_eq!(three.filter_seconds(), Some(1.5));
        three.correct(0.0);
        assert!(near(three.seconds(), 0.0), "nothing takes less than no time");
        assert!(near(three.least_seconds(), 0.2), "what is left of two seconds without the pass");
    }

    #[test]
    fn the_first_calibration_comes_if_enough_time_is_left_for_it_to_be_of_use() {
        let none = Finalisation::default();
        // It takes 3 ∕ 16 of 0.8 seconds.
        assert!(none.is_due(0.0, 0.31, 0.8) && !none.is_due(9.0, 0.29, 0.8));
    }

    #[test]
    fn calibrations_take_their_fraction_of_the_time_and_no_more() {
        let once = calibrated(&[(0.8, 0.1)], 9.0);
        let due = |elapsed, left| once.is_due(elapsed, left, 0.8);
        assert!(!due(9.0, 9.0) && due(11.0, 9.0) && !due(11.0, 0.1));
    }

    #[test]
    fn one_more_calibration_comes_before_the_end() {
        let once = calibrated(&[(0.8, 0.1)], 9.0);
        assert!(!once.is_due(2.5, 1.0, 0.8) && once.is_due(2.6, 0.7, 0.8));
        let first = |expected| {
            let mut finalisation = Finalisation::default();
            finalisation.add(calibration(0.8, 0.1), expected, 9.0);
            finalisation
        };
        assert!(!first(0.5).is_doubtful(1.0) && first(0.5).is_doubtful(-3.0), "the first one may be far off");
        assert!(!first(0.7).is_doubtful(-3.0), "it is as expected");
        let twice = calibrated(&[(0.8, 0.1), (0.8, 0.2)], 9.0);
        assert!(!twice.is_doubtful(-3.0), "so is the second");
        let mut late = once;
        late.age();
        late.add(calibration(0.8, 0.1), 0.8, 0.7);
        assert!(!late.is_due(2.6, 0.7, 0.8), "the last one is made");
        late.predict_for(&nlm::DRAFT);
        late.add(calibration(0.8, 0.1), 0.8, 9.0);
        assert!(late.is_due(2.6, 0.7, 0.8), "that of another denoiser");
        let near_end = calibrated(&[(0.8, 0.1)], 0.7);
        assert!(!near_end.is_due(2.6, 0.7, 0.8), "the first one is the last, too");
    }

    #[test]
    fn a_calibration_that_took_longer_than_expected_is_repeated_once_and_the_shorter_one_counts() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        let once = calibrated(&[(1.0, 0.1)], 9.0);
        let after = |next: &[CalibrationTimes], left: f64| {
            let mut finalisation = once.clone();
            finalisation.age();
            for times in next {
                finalisation.add(*times, 1.1, left);
            }
            finalisation
        };
        let (slow, usual) = (calibration(3.2, 0.3), calibration(1.0, 0.1));
        let doubted = after(&[slow], 0.8);
        assert!(doubted.is_doubtful(-1.6) && doubted.seconds() > 3.0);
        assert!(!doubted.is_doubtful(4.0), "there is time for another one later");
        assert!(!after(&[calibration(1.3, 0.1)], 0.8).is_doubtful(0.5), "about as expected");
        let repeated = after(&[slow, usual], 0.8);
        assert!(near(repeated.seconds(), 1.1), "as if the slow one had not been made");
        assert!(near(repeated.spent, 0.5), "but its time was spent");
        let slower = after(&[slow, calibration(4.0, 0.4)], 0.8);
        assert!(near(slower.seconds(), doubted.seconds()) && !slower.is_doubtful(-1.6));

        // A repetition has nothing left to gather
        let gathered = CalibrationTimes { total: 3.7, gathering: 0.5, ..slow };
        assert!(near(after(&[gathered, usual], 0.8).seconds(), 1.65));

        // Where the slow one left hardly any time and its repetition does not, another one is due later
        let mut early = after(&[slow, usual], 2.0);
        early.age();
        assert!(early.is_due(3.0, 0.9, 1.0));
        let mut last = repeated;
        last.age();
        assert!(!last.is_due(3.0, 0.7, 1.0));
    }

    #[test]
    fn a_faster_denoisers_prediction_replaces_that_of_a_slower_one() {
        let mut finalisation = calibrated(&[(5.0, 1.0), (4.0, 1.0)], 9.0);
        finalisation.predict_for(&nlm::DRAFT);
        finalisation.add(calibration(0.1, 0.1), 0.1, 9.0);
        assert!((finalisation.seconds() - 0.11).abs() < 1e-9);
    }

    #[test]
    fn what_is_assumed_grows_with_the_samples_only_where_these_are_filtered_one_by_one() {
        let seconds = |denoiser: &dyn Denoiser, spp| assumed_seconds(denoiser, 1, 1000, spp, false, 1, 2e-9);
        use crate::filter::rpf;
        assert!((seconds(&rpf::RPF, 8.0) / seconds(&rpf::RPF, 4.0) - 2.0).abs() < 1e-9);
        assert_eq!(seconds(&nlm::DRAFT, 8.0), seconds(&nlm::DRAFT, 4.0));
        let checkpoint =
            assumed_seconds(&nlm::DRAFT, 1, 1000, 4.0, true, 1, 2e-9) - seconds(&nlm::DRAFT, 4.0);
        assert!((checkpoint - 2e-3).abs() < 1e-9);
        let of_two = |denoiser: &dyn Denoiser| assumed_seconds(denoiser, 1, 1000, 4.0, false, 2, 2e-9);
        assert!((of_two(&nlm::DRAFT) - seconds(&nlm::DRAFT, 4.0) / 2.0).abs() < 1e-12);
        assert_eq!(of_two(&rpf::RPF), seconds(&rpf::RPF, 4.0), "not shared");
        let of_few = assumed_seconds(&nlm::DRAFT, 1, 1000, 1.0, false, 2, 2e-9);
        assert_eq!(of_few, seconds(&nlm::DRAFT, 1.0), "too few samples to share");
    }
}
