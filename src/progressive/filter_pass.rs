//! A filter pass of the loop: a denoiser over a store, as a job for any thread.

use std::sync::Arc;
use std::time::Instant;

use super::error_estimate::{ErrorEstimate, HalfImages};
use super::process_group::{ProcessGroup, filter_together};
use crate::filter::prpf::{self, FAILURE_WINDOW};
use crate::filter::{Denoiser, FilterResult, Interpolation, PrpfSettings, sparse_filtering};
use crate::stats::Store;

/// A filter pass that is ready to run.
#[derive(Clone, Debug)]
pub struct FilterPass {
    pub store: Arc<Store>,
    pub denoiser: &'static dyn Denoiser,
    pub seed: u64,
    /// Least side of the squares that are filtered, in pixels, where the denoiser can: 1 for pixels, unless samples are few.
    pub least_side: usize,
    pub failure_map: FailureMap,
    /// Whether the error is estimated by images of the halves of the samples, if the denoiser is judged by them: more closely,
    /// for the time of two passes on an excerpt of the image.
    pub has_half_images: bool,
}

/// Where the map of interpolation failures comes from if the denoiser does not interpolate itself. It then drives no
/// samples.
#[derive(Clone, Debug)]
pub enum FailureMap {
    /// P-RPF's sparse grid over the same store.
    Compute,
    /// An earlier pass, if that has one.
    Carry(Option<Interpolation>),
}

/// The output of a filter pass.
#[derive(Clone, Debug)]
pub struct Filtered {
    pub result: FilterResult,
    /// Side of the squares that were filtered, in pixels; 1 if pixels were.
    pub side: usize,
    /// The error of its image.
    pub estimate: Option<ErrorEstimate>,
    /// Seconds of the pass, those of map and estimate included.
    pub seconds: f64,
}

impl FilterPass {
    /// Returns a pass over pixels, unless samples are few, without a map of failures of its own and without half images.
    pub fn new(store: Arc<Store>, denoiser: &'static dyn Denoiser, seed: u64) -> Self {
        let failure_map = FailureMap::Carry(None);
        Self { store, denoiser, seed, least_side: 1, failure_map, has_half_images: false }
    }

    /// Runs the pass on rayon's current thread pool.
    pub fn run(self) -> Filtered {
        self.run_with(None)
    }

    /// Runs the pass, with several processes as far as they can share the work.
    pub(super) fn run_with(self, mut processes: Option<&mut (dyn ProcessGroup + '_)>) -> Filtered {
        let started = Instant::now();
        let Self { store, denoiser, seed, least_side, failure_map, has_half_images } = self;
        let side = sparse_filtering::side(denoiser, &store, least_side);
        let mut result = match &mut processes {
            Some(processes) if side == 1 && processes.can_share(denoiser, &store) => {
                processes.filter(denoiser)
            }
            _ => sparse_filtering::filter(denoiser, &store, side, seed),
        };
        if result.interpolation.is_none() {
            result.interpolation = match failure_map {
                FailureMap::Carry(interpolation) => interpolation,
                FailureMap::Compute => {
                    Some(prpf::interpolation(&store, &PrpfSettings::paper(), FAILURE_WINDOW))
                }
            };
        }
        let half_image = |half: &Store| filter_together(processes.as_deref_mut(), denoiser, half, seed);
        let estimate_error = || {
            let halves = if has_half_images { HalfImages::new(denoiser, &store, half_image) } else { None };
            ErrorEstimate::new(&result, &store, halves.as_ref())
        };
        // What the error maps of squares are worth is not known
        let estimate = if side == 1 { estimate_error() } else { None };
        Filtered { result, side, estimate, seconds: started.elapsed().as_secs_f64() }
    }
}
