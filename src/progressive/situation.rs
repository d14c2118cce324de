//! Everything that decides the next action of a render, as plain data.

use super::finalisation::{Finalisation, assumed_seconds};
use super::record::Seconds;
use super::schedule::Schedule;
use super::settings::Settings;
use super::speed::Speed;
use super::time_constants::LEAST_MEMORY_SECONDS;
use crate::adaptive::Sampling;
use crate::filter::{Cost, Denoiser};
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
    /// Seconds that the latest batch took to be allocated.
    pub allocation_seconds: f64,
    /// Seconds of one core for a byte of new memory, once measured.
    pub memory_seconds: Option<f64>,
    /// The first sample that the store has rejected.
    pub first_rejected: Option<RejectedSample>,
    /// When the latest checkpoint was saved, in seconds since the start.
    pub saved_at: f64,
    /// Whether nothing has changed since.
    pub is_saved: bool,
}

impl Measurements {
    /// Returns the seconds of one core for a byte of new memory: as measured, or as assumed where they are not known or more. Short budgets
    /// would otherwise be spent on waiting for what may come faster by then. At least `LEAST_MEMORY_SECONDS`.
    pub fn memory_seconds(&self) -> f64 {
        let measured = self.memory_seconds.unwrap_or(f64::INFINITY);
        measured.clamp(LEAST_MEMORY_SECONDS, Cost::MEMORY_SECONDS)
    }
}

/// The inputs of a decision.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    pub settings: &'a Settings,
    /// How the next samples are placed.
    pub sampling: Sampling,
    pub pixels: u64,
    /// Samples taken so far, rejected ones included.
    pub samples: u64,
    /// Samples with which every pixel has those of a map of counts.
    pub map_end: Option<u64>,
    /// Pixels without samples.
    pub empty_pixels: u64,
    pub mark: Mark,
    /// Whether there has been an interim pass.
    pub has_interim: bool,
    /// Estimated relMSE of the latest interim image.
    pub error: Option<f64>,
    /// Whether that image is by the denoiser of the final image, or unfiltered because that one failed.
    pub interim_is_by_final_denoiser: bool,
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
        self.schedule_of(self.last_pass())
    }

    /// Returns whether some pixels have no sample yet. Where a map chooses the pixels, some never get any.
    pub(super) fn has_unsampled_pixels(&self) -> bool {
        self.samples < self.pixels || self.empty_pixels > 0 && self.settings.sample_map.is_none()
    }

    /// Returns the assumed seconds of an interim pass by this denoiser.
    pub(super) fn assumed_interim_seconds(&self, denoiser: &dyn Denoiser) -> f64 {
        let memory_seconds = self.measurements.memory_seconds();
        assumed_seconds(denoiser, 1, self.pixels, self.spp(), false, self.processes, memory_seconds)
    }

    /// Returns the samples per pixel taken so far.
    pub(super) fn spp(&self) -> f64 {
        self.samples as f64 / self.pixels.max(1) as f64
    }
}
