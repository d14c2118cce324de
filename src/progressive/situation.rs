//! Everything that decides the next action of a render, as plain data.

use super::finalisation::{Finalisation, assumed_seconds};
use super::record::Seconds;
use super::schedule::Schedule;
use super::settings::Settings;
use super::speed::Speed;
use crate::adaptive::Sampling;
use crate::filter::sparse_filtering::{TIME_FRACTION, can_filter_squares};
use crate::filter::{Denoiser, UNFILTERED, draft_of, nlm};
use crate::render::RejectedSample;

/// The host's requests at a moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conditions {
    pub is_interrupted: bool,
    /// Whether somebody looks at the images between batches.
    pub is_watched: bool,
    /// Seconds that a step may take; `None` leaves it to the loop.
    pub longest_step: Option<f64>,
    /// Seconds between two checkpoints; `None` if none are kept.
    pub checkpoint_interval: Option<f64>,
}

/// A checkpoint's position without its data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mark {
    Plan,
    /// Within a batch of `samples` samples, of which the fraction `done` is rendered.
    Render {
        done: f64,
        samples: u64,
    },
    Filter,
}

/// What the loop has measured of itself. No part of a checkpoint: another machine measures anew.
#[derive(Clone, Debug, Default)]
pub struct Measurements {
    pub seconds: Seconds,
    /// Seconds of all interim passes, and of the latest one by the interim denoiser.
    pub interim_total: f64,
    pub interim_seconds: Option<f64>,
    pub finalisation: Finalisation,
    /// The first sample that the store has rejected.
    pub first_rejected: Option<RejectedSample>,
    /// When the latest checkpoint was saved, in seconds since the start.
    pub saved_at: f64,
    /// Whether nothing has changed since.
    pub is_saved: bool,
}

/// The inputs of a decision.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    pub settings: &'a Settings,
    /// How the next samples are placed.
    pub sampling: Sampling,
    pub pixels: u64,
    /// Samples so far, rejected ones included.
    pub samples: u64,
    /// Samples with which every pixel has those of a map of counts.
    pub map_end: Option<u64>,
    /// Pixels without samples.
    pub empty_pixels: u64,
    pub mark: Mark,
    /// Whether there has been an interim pass.
    pub has_interim: bool,
    /// Estimated relMSE of the latest interim image, and whether it is by the denoiser of the final image.
    pub error: Option<f64>,
    pub has_final_image: bool,
    /// Whether a region is rendered first.
    pub has_region: bool,
    /// Whether images between batches are compared with a reference.
    pub has_reference: bool,
    /// Processes that render the image together.
    pub processes: usize,
    pub speed: Speed,
    pub measurements: &'a Measurements,
    /// Seconds since the start.
    pub elapsed: f64,
    pub conditions: Conditions,
}

impl Situation<'_> {
    /// Returns the schedule at this moment.
    pub(super) fn schedule(&self) -> Schedule<'_> {
        let finalisation = &self.measurements.finalisation;
        let schedule = if finalisation.is_calibrated() {
            self.schedule_with(finalisation.seconds())
        } else {
            self.assumed_schedule(self.fallback().unwrap_or(self.settings.denoiser))
        };
        // Squares in place of the draft of nlm take longer
        let least_spp = self.least_spp();
        if least_spp == 1.0 || !self.filters_squares(least_spp) {
            return schedule;
        }
        let squares = self.seconds_of_squares(self.settings.sparse_denoiser());
        self.schedule_with(schedule.finalisation.max(squares))
    }

    /// Returns whether some pixels have no sample yet. By a map, some never get any.
    pub(super) fn is_sparse(&self) -> bool {
        self.samples < self.pixels || self.empty_pixels > 0 && self.settings.sample_map.is_none()
    }

    /// Returns whether squares of pixels are filtered where fewer than this many samples per pixel are few. A map or a region
    /// chooses pixels.
    fn filters_squares(&self, least_spp: f64) -> bool {
        let has_chosen = self.has_region || self.settings.sample_map.is_some();
        let is_sparse = self.samples > 0 && (self.samples as f64) < least_spp * self.pixels as f64;
        is_sparse && !has_chosen && can_filter_squares(self.settings.sparse_denoiser())
    }

    /// Returns the samples per pixel below which the last pass filters squares of pixels: more in place of the draft of `nlm`,
    /// which does not know the noise of one sample.
    pub(super) fn least_spp(&self) -> f64 {
        let Settings { budget, sample_map, .. } = self.settings;
        let is_short = budget.seconds.is_some() && sample_map.is_none() && !self.has_region;
        if is_short && self.planned_denoiser() == &nlm::DRAFT as &dyn Denoiser { 2.0 } else { 1.0 }
    }

    /// Returns whether the time budget ends before every pixel has a sample, though the last pass filters squares.
    fn ends_sparse(&self) -> bool {
        let squares = self.schedule_with(self.seconds_of_squares(self.settings.sparse_denoiser()));
        self.filters_squares(1.0) && !squares.fills(self.elapsed, self.samples)
    }

    /// Returns the denoiser of the last pass: a faster one where time is short, a draft where samples are few.
    pub(super) fn final_denoiser(&self) -> &'static dyn Denoiser {
        let (planned, asked) = (self.planned_denoiser(), self.settings.denoiser);
        if planned == UNFILTERED {
            return UNFILTERED;
        }
        let sparse = self.settings.sparse_denoiser();
        let squares = self.schedule_with(self.seconds_of_squares(sparse));
        if self.filters_squares(self.least_spp()) && !squares.is_late(self.elapsed) {
            return sparse;
        }
        if self.is_sparse() && planned == asked { draft_of(asked) } else { planned }
    }

    /// Returns the other denoiser that the time budget calls for.
    pub(super) fn fallback(&self) -> Option<&'static dyn Denoiser> {
        let planned = self.planned_denoiser();
        can_fall_back(self.settings.denoiser, planned).then_some(planned)
    }

    /// Returns the denoiser for which time is kept. Before the first calibration it follows from what is assumed, at every
    /// moment anew: the pixels may have got their samples sooner than expected.
    pub(super) fn planned_denoiser(&self) -> &'static dyn Denoiser {
        let asked = self.settings.denoiser;
        let Measurements { finalisation, .. } = self.measurements;
        if finalisation.is_calibrated() || self.settings.budget.seconds.is_none() || self.samples == 0 {
            return finalisation.fallback.unwrap_or(asked);
        }
        let ends_sparse = self.ends_sparse();
        let has_time = |denoiser: &&'static dyn Denoiser| {
            let schedule = self.assumed_schedule(*denoiser);
            let is_filled = ends_sparse || !self.is_sparse() || schedule.fills(self.elapsed, self.samples);
            is_filled && !schedule.is_late(self.elapsed)
        };
        let first = if ends_sparse { self.settings.sparse_denoiser() } else { asked };
        let mut choices = [first, draft_of(asked), asked.stand_in()].into_iter();
        let planned = choices.find(has_time).unwrap_or(asked.stand_in());
        let is_far_too_late = self.assumed_schedule(planned).is_far_too_late(self.elapsed);
        if is_far_too_late { UNFILTERED } else { planned }
    }

    /// Returns the schedule with the assumed time of a finalisation by this denoiser.
    fn assumed_schedule(&self, denoiser: &'static dyn Denoiser) -> Schedule<'_> {
        let saves = self.conditions.checkpoint_interval.is_some();
        let has_squares = self.ends_sparse() && can_filter_squares(denoiser);
        let of_pixels = || self.assumed_seconds(denoiser, saves);
        self.schedule_with(if has_squares { self.seconds_of_squares(denoiser) } else { of_pixels() })
    }

    /// Returns the assumed time of a finalisation by this denoiser. `saves`: whether a checkpoint is written.
    pub(super) fn assumed_seconds(&self, denoiser: &dyn Denoiser, saves: bool) -> f64 {
        let spp = self.samples as f64 / self.pixels.max(1) as f64;
        assumed_seconds(denoiser, self.pixels, spp, saves, self.processes)
    }

    /// Returns the assumed time of a finalisation that filters squares of pixels, which several processes do not share.
    fn seconds_of_squares(&self, denoiser: &dyn Denoiser) -> f64 {
        let saves = self.conditions.checkpoint_interval.is_some();
        let [all, unfiltered] =
            [denoiser, UNFILTERED].map(|denoiser| assumed_seconds(denoiser, self.pixels, 1.0, saves, 1));
        unfiltered + TIME_FRACTION * (all - unfiltered)
    }

    fn schedule_with(&self, finalisation: f64) -> Schedule<'_> {
        Schedule {
            budget: &self.settings.budget,
            pixels: self.pixels,
            min_spp: self.settings.min_spp.into(),
            max_spp: self.settings.max_spp.into(),
            map_end: self.map_end,
            speed: self.speed,
            finalisation,
        }
    }
}

/// Returns whether a pass by `current` can be replaced by the `faster` one.
pub(super) fn can_fall_back(current: &'static dyn Denoiser, faster: &'static dyn Denoiser) -> bool {
    current != faster && current != UNFILTERED
}
