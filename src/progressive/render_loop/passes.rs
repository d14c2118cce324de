//! The filter passes of the render loop: what a driver has to run, and what the loop learns from the result.

use super::RenderLoop;
use crate::adaptive::Sampling;
use crate::filter::Denoiser;
use crate::filter::sparse_filtering::side;
use crate::progressive::allocation::expected_ratio;
use crate::progressive::budget::Budget;
use crate::progressive::checkpoint::{Checkpoint, InterimPass, Position};
use crate::progressive::filter_pass::{FailureMap, FilterPass, Filtered};
use crate::progressive::last_pass::LastPass;
use crate::progressive::record::PassRecord;
use crate::progressive::situation::Conditions;
use crate::progressive::stopped_by::StoppedBy;
use crate::stats::StatisticsExtent;

impl RenderLoop<'_> {
    /// Returns the filter pass of [`Action::Filter`](crate::progressive::Action::Filter).
    pub fn interim_pass(&mut self, denoiser: &'static dyn Denoiser) -> FilterPass {
        let Budget { seconds, target_error, .. } = self.settings.budget;
        let has_half_images = target_error.is_some() && seconds.is_none();
        self.gather_for_pass(denoiser, has_half_images);
        self.pass(denoiser, FailureMap::Carry(None), has_half_images)
    }

    /// Takes the result of [`Self::interim_pass`]: its maps decide where the next samples go.
    pub fn complete_interim(&mut self, filtered: Filtered) {
        let (made_by, seconds) = (filtered.result.made_by, filtered.seconds);
        self.record(&filtered);
        self.checkpoint.interim = Some(InterimPass::new(filtered));
        self.checkpoint.position = Position::Plan;
        self.predict_ratio();

        // Learn from the time that the pass took
        let last = self.measurements.finalisation.calibrated_denoiser();
        let is_last = last.is_some_and(|last| last.name() == made_by && side(last, self.store(), 1) == 1);
        let measured = &mut self.measurements;
        measured.is_saved = false;
        measured.interim_total += seconds;
        if made_by == self.settings.interim_denoiser().name() {
            measured.interim_seconds = Some(seconds);
        }
        if is_last {
            // A pass over the whole image replaces the extrapolation from some rows.
            measured.finalisation.correct(seconds);
        }
    }

    /// Predicts by the first pass with enough samples whether adaptive sampling is worth its time.
    fn predict_ratio(&mut self) {
        let Self { checkpoint: Checkpoint { store, passes, interim, .. }, settings, samples, .. } = self;
        let floor = u64::from(settings.judged_spp()) * store.pixels() as u64;
        let is_predicted = passes.iter().any(|pass| pass.expected_ratio.is_some());
        if settings.sampling == Sampling::Uniform || is_predicted || samples.taken < floor {
            return;
        }
        if let (Some(pass), Some(interim)) = (passes.last_mut(), interim) {
            pass.expected_ratio = Some(expected_ratio(store, interim, settings));
        }
    }

    /// Returns the filter pass of [`Action::Finish`](crate::progressive::Action::Finish).
    pub fn final_pass(&mut self, conditions: &Conditions, stopped_by: StoppedBy) -> FilterPass {
        self.gather(StatisticsExtent::All);
        let earlier = self.checkpoint.interim.as_ref().and_then(|interim| interim.interpolation.clone());
        let has_half_images = self.settings.budget.seconds.is_none() && stopped_by != StoppedBy::Interrupt;
        // No more samples come, whatever ends the render
        let conditions = Conditions { is_interrupted: stopped_by != StoppedBy::Time, ..*conditions };
        let LastPass { denoiser, least_side } = self.situation(&conditions).last_pass();
        let pass = self.pass(denoiser, FailureMap::Carry(earlier), has_half_images);
        FilterPass { least_side, ..pass }
    }

    /// Takes the result of [`Self::final_pass`], with which the render may end, or go on after a change.
    pub fn complete_final(&mut self, filtered: &Filtered) {
        self.record(filtered);
    }

    fn pass(
        &self,
        denoiser: &'static dyn Denoiser,
        failure_map: FailureMap,
        has_half_images: bool,
    ) -> FilterPass {
        let pass = FilterPass::new(self.store().clone(), denoiser, self.settings.seed);
        FilterPass { failure_map, has_half_images, ..pass }
    }

    fn record(&mut self, filtered: &Filtered) {
        self.measurements.seconds.filter += filtered.seconds;
        let pass = PassRecord {
            index: self.checkpoint.passes.len(),
            seconds: self.clock.elapsed(),
            samples_total: self.samples.valid,
            ..PassRecord::new(filtered, self.reference, self.store())
        };
        self.checkpoint.passes.push(pass);
    }
}
