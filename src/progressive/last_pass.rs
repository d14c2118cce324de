//! Chooses the last filter pass: its denoiser, and whether it filters pixels or squares of them. Where time or samples are short, one that
//! is faster or needs fewer samples takes the place of the one that is asked for.
//!
//! Takes a situation; the times are those of the calibration, or in proportion to it, or assumed.

use super::finalisation::assumed_seconds;
use super::schedule::Schedule;
use super::situation::Situation;
use super::time_constants::{ASSUMED_EXCESS, FIRST_SAMPLES_EXCESS};
use crate::filter::sparse_filtering::side_for;
use crate::filter::{Denoiser, UNFILTERED, draft_of};

/// Sides of the squares that are filtered where time is short, in pixels. Larger ones save little.
const SIDES: [usize; 4] = [2, 3, 4, 6];

/// Samples per pixel above which an unfiltered image takes the place of one of squares, which loses all detail. Not measured.
const MOST_SPP: f64 = 16.0;

/// A filter pass that can be the last one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LastPass {
    pub denoiser: &'static dyn Denoiser,
    /// Least side of the squares that are filtered, in pixels: 1 for pixels, unless samples are few.
    pub least_side: usize,
}

impl LastPass {
    pub(super) fn over_pixels(denoiser: &'static dyn Denoiser) -> Self {
        Self { denoiser, least_side: 1 }
    }
}

impl Situation<'_> {
    /// Returns the last pass: under a time budget the best one for which there will be time and samples, or at least no broken budget;
    /// an unfiltered image where there is none. Before the first calibration it follows from what is assumed, at every moment anew;
    /// a calibrated denoiser gives way to a slower one only if there are too few samples for it.
    pub(super) fn last_pass(&self) -> LastPass {
        let asked = self.settings.denoiser;
        if self.settings.budget.seconds.is_none() || self.samples == 0 {
            let denoiser =
                if self.samples > 0 && self.has_unsampled_pixels() { draft_of(asked) } else { asked };
            return LastPass::over_pixels(denoiser);
        }
        let passes = self.passes_over_pixels().chain(self.passes_over_squares());
        let unfiltered = LastPass::over_pixels(UNFILTERED);
        let earliest_end = self.elapsed + self.seconds_of(unfiltered);
        let is_far_too_late =
            |pass: &LastPass| self.schedule_of(*pass).is_far_too_late(self.elapsed, earliest_end);
        let best = passes.clone().find(|&pass| self.has_time(pass));
        best.or_else(|| passes.clone().find(|pass| !is_far_too_late(pass))).unwrap_or(unfiltered)
    }

    /// Returns the passes over pixels, the best first. Once one is calibrated, none is slower than that one but the last, by the denoiser of
    /// squares: it may need fewer samples.
    fn passes_over_pixels(&self) -> impl Iterator<Item = LastPass> + Clone {
        let (asked, current) = (self.settings.denoiser, self.current_pass());
        let drafts = [draft_of(asked), asked.stand_in()].map(LastPass::over_pixels);
        std::iter::once(current)
            .chain(drafts)
            .filter(move |&pass| !self.is_slower(pass))
            .chain(std::iter::once(self.by_square_denoiser()))
    }

    fn by_square_denoiser(&self) -> LastPass {
        LastPass::over_pixels(self.settings.square_denoiser())
    }

    /// Returns whether a pass is assumed to take longer than the one that has been calibrated.
    pub(super) fn is_slower(&self, pass: LastPass) -> bool {
        let is_calibrated = self.measurements.finalisation.is_calibrated();
        is_calibrated && self.assumed_seconds_of(pass) > self.assumed_seconds_of(self.current_pass())
    }

    /// Returns the passes over squares, the finest first; none where an unfiltered image is better.
    fn passes_over_squares(&self) -> impl Iterator<Item = LastPass> + Clone {
        let denoiser = self.settings.square_denoiser();
        let has_few_samples = self.samples as f64 <= MOST_SPP * self.pixels as f64;
        let sides: &[usize] = if has_few_samples && denoiser.least_spp() > 0.0 { &SIDES } else { &[] };
        sides.iter().map(move |&least_side| LastPass { denoiser, least_side })
    }

    /// Returns the pass that has been calibrated, or is to be.
    fn current_pass(&self) -> LastPass {
        let calibrated = self.measurements.finalisation.calibrated_denoiser();
        LastPass::over_pixels(calibrated.unwrap_or(self.settings.denoiser))
    }

    /// Returns the schedule with this last pass.
    pub(super) fn schedule_of(&self, pass: LastPass) -> Schedule<'_> {
        Schedule {
            budget: &self.settings.budget,
            pixels: self.pixels,
            min_spp: self.settings.min_spp.into(),
            max_spp: self.settings.max_spp.into(),
            map_end: self.map_end,
            speed: self.speed,
            finalisation: self.seconds_of(pass),
            allocation: self.measurements.allocation_seconds,
        }
    }

    /// Returns whether a pass ends in time, and if it filters pixels, whether these will have the samples that it needs.
    fn has_time(&self, pass: LastPass) -> bool {
        let (schedule, finalisation) = (self.schedule_of(pass), &self.measurements.finalisation);
        // A map or a region chooses pixels, which get their samples
        let is_chosen = self.has_region || self.settings.sample_map.is_some();
        let elapsed = if self.conditions.is_interrupted { f64::INFINITY } else { self.elapsed };
        let will_have_samples = || {
            // No pass needs more samples than the budgets allow
            let needed =
                (pass.denoiser.least_spp().max(1.0) * self.pixels as f64).min(schedule.most() as f64);
            let samples = self.samples as f64;
            let to_come = (schedule.samples_at_end(elapsed, self.samples) - samples).max(0.0);
            // The first samples take longer than the others
            let excess = if self.samples < 2 * self.pixels { FIRST_SAMPLES_EXCESS } else { 1.0 };
            samples + excess * to_come >= needed
        };
        // Repeated calibrations may raise the prediction a little: a pass that was expected in time is given up far beyond it only
        let is_calibrated = finalisation.is_calibrated() && pass == self.current_pass();
        let is_late = if is_calibrated {
            schedule.is_far_too_late(self.elapsed, self.elapsed)
        } else {
            schedule.is_late(self.elapsed)
        };
        !is_late && (pass.least_side > 1 || is_chosen || will_have_samples())
    }

    /// Returns the seconds of the finalisation with this pass: as calibrated, or in proportion to the calibrated one, or assumed.
    pub(super) fn seconds_of(&self, pass: LastPass) -> f64 {
        let (finalisation, current) = (&self.measurements.finalisation, self.current_pass());
        let assumed = self.assumed_seconds_of(pass);
        match finalisation.is_calibrated() {
            true if pass == current => finalisation.seconds(),
            true => {
                let calibrated =
                    if self.is_slower(pass) { finalisation.seconds() } else { finalisation.least_seconds() };
                calibrated * assumed / self.assumed_seconds_of(current)
            }
            false if pass == self.by_square_denoiser() => ASSUMED_EXCESS * assumed,
            false => assumed,
        }
    }

    /// Returns the seconds assumed for the finalisation with this pass.
    fn assumed_seconds_of(&self, pass: LastPass) -> f64 {
        let (spp, saves) = (self.spp(), self.conditions.checkpoint_interval.is_some());
        let side = if pass.least_side > 1 { pass.least_side.max(side_for(spp)) } else { 1 };
        let memory_seconds = self.measurements.memory_seconds();
        assumed_seconds(pass.denoiser, side, self.pixels, spp, saves, self.processes, memory_seconds)
    }
}
