//! The complete state of a render as plain data: resumed in another process, it goes on as if it had never stopped.
//!
//! Its only time is the sampling speed: a budget of samples needs no other, and a time budget starts anew with the
//! program. `state` writes it to a file.

use std::sync::Arc;

use super::error_estimate::ErrorEstimate;
use super::filter_pass::Filtered;
use super::record::{PassRecord, excessive_ratio};
use super::settings::Settings;
use super::speed::Speed;
use super::steps::{self, Grain};
use crate::adaptive::Sampling;
use crate::filter::{DenoiserName, Interpolation};
use crate::image::Planes;
use crate::stats::Store;

/// The complete state of a render.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    pub store: Arc<Store>,
    pub position: Position,
    /// All filter passes so far.
    pub passes: Vec<PassRecord>,
    /// The latest interim pass, whose maps decide where samples go.
    pub interim: Option<InterimPass>,
    pub speed: Speed,
}

/// Where the loop stands.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Position {
    /// Before a batch is planned.
    #[default]
    Plan,
    /// Within a batch.
    Render(SampleBatch),
    /// After a batch, before the interim pass that may follow it.
    Filter,
}

/// A batch of samples, of which a fraction is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleBatch {
    /// Samples of each pixel.
    pub counts: Vec<u32>,
    /// In [0, 1].
    pub done: f64,
    pub grain: Grain,
}

impl SampleBatch {
    /// Returns the samples of the whole batch.
    pub fn samples(&self) -> u64 {
        self.counts.iter().map(|&n| u64::from(n)).sum()
    }

    /// Returns the samples per pixel to add to come from the fraction that is done to the fraction `to`.
    pub(super) fn step(&self, store: &Store, to: f64) -> Vec<u32> {
        steps::between(&self.counts, store, self.grain, self.done, to)
    }
}

/// The latest interim pass: its image, its maps, and its error.
#[derive(Clone, Debug, PartialEq)]
pub struct InterimPass {
    pub made_by: DenoiserName,
    /// As in [`crate::filter::FilterResult`].
    pub image: Planes,
    pub variance: Planes,
    pub residual: Planes,
    pub interpolation: Option<Interpolation>,
    pub estimate: Option<ErrorEstimate>,
}

impl InterimPass {
    /// Takes what the loop needs of a pass.
    pub(super) fn new(Filtered { result, estimate, .. }: Filtered) -> Self {
        Self {
            made_by: result.made_by,
            image: result.image,
            variance: result.variance,
            residual: result.residual,
            interpolation: result.interpolation,
            estimate,
        }
    }
}

impl Checkpoint {
    /// The beginning of a render.
    pub fn new(store: Store) -> Self {
        Self {
            store: Arc::new(store),
            position: Position::default(),
            passes: Vec::new(),
            interim: None,
            speed: Speed::default(),
        }
    }

    /// Forgets the image of another denoiser than that of the passes to come, and what was expected of samples by its maps.
    pub(super) fn forget_image(&mut self) {
        self.interim = None;
        self.passes.iter_mut().for_each(|pass| pass.expected_ratio = None);
    }

    /// Returns how the next samples are placed: uniformly also if adaptive sampling is expected not to be worth its time.
    pub(super) fn sampling(&self, settings: &Settings) -> Sampling {
        if excessive_ratio(&self.passes, settings).is_some() { Sampling::Uniform } else { settings.sampling }
    }
}
