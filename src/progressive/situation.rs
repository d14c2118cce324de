//! Everything that decides the next action of a render, as plain data.

use super::finalisation::{Finalisation, assumed_seconds};
use super::record::Seconds;
use super::schedule::Schedule;
use super::settings::Settings;
use super::speed::Speed;
use crate::adaptive::Sampling;
use crate::filter::{Denoiser, UNFILTERED};
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
        if finalisation.is_calibrated() {
            return self.schedule_with(finalisation.seconds());
        }
        self.assumed_schedule(self.fallback().unwrap_or(self.settings.denoiser))
    }

    /// Returns whether some pixels have no sample yet. By a map, some never get any.
    pub(super) fn is_sparse(&self) -> bool {
        self.samples < self.pixels || self.empty_pixels > 0 && self.settings.sample_map.is_none()
    }

    /// Returns the denoiser of the last pass: a faster one where time is short, a coarser one where samples are few.
    pub(super) fn final_denoiser(&self) -> &'static dyn Denoiser {
        let asked = self.settings.denoiser;
        let suited = if self.is_sparse() { asked.stand_in() } else { asked };
        self.fallback().unwrap_or(suited)
    }

    /// Returns the faster denoiser that the time budget calls for. Before the first calibration it follows from what is
    /// assumed, at every moment anew: the pixels may have got their samples sooner than expected.
    pub(super) fn fallback(&self) -> Option<&'static dyn Denoiser> {
        let Measurements { finalisation, .. } = self.measurements;
        if finalisation.is_calibrated() || self.settings.budget.seconds.is_none() || self.samples == 0 {
            return finalisation.fallback;
        }
        let asked = self.settings.denoiser;
        let schedule = self.assumed_schedule(asked);
        let has_time = if self.is_sparse() {
            schedule.fills(self.elapsed, self.samples)
        } else if asked.cost().is_per_sample {
            !schedule.is_late(self.elapsed)
        } else {
            let left = schedule.seconds_left(self.elapsed).unwrap_or(0.0);
            finalisation.is_due(self.elapsed, left, schedule.finalisation)
        };
        let stand_in = asked.stand_in();
        let fallback = (!has_time && can_fall_back(asked, stand_in)).then_some(stand_in);
        let current = fallback.unwrap_or(asked);
        let is_far_too_late = self.assumed_schedule(current).is_far_too_late(self.elapsed);
        if is_far_too_late && can_fall_back(current, UNFILTERED) { Some(UNFILTERED) } else { fallback }
    }

    /// Returns the schedule with the assumed time of a finalisation by this denoiser.
    fn assumed_schedule(&self, denoiser: &'static dyn Denoiser) -> Schedule<'_> {
        let saves = self.conditions.checkpoint_interval.is_some();
        self.schedule_with(self.assumed_seconds(denoiser, saves))
    }

    /// Returns the assumed time of a finalisation by this denoiser. `saves`: whether a checkpoint is written.
    pub(super) fn assumed_seconds(&self, denoiser: &dyn Denoiser, saves: bool) -> f64 {
        let spp = self.samples as f64 / self.pixels.max(1) as f64;
        assumed_seconds(denoiser, self.pixels, spp, saves, self.processes)
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
