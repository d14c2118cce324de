//! Whoever looks at a render while it runs, and steers it: the one way in for the live preview and
//! the progress bar. Nothing here computes; a render without an observer is the same to the last bit.

use std::sync::Arc;
use std::time::Instant;

use super::{Denoiser, Progress};
use crate::filter::{self, Filtered, PrpfSettings, Quality, RpfSettings, rpf};
use crate::image::Planes;
use crate::stats::Store;

/// Window of the grid stage whose failures drive samples; the paper's third.
const FAILURE_WINDOW: usize = 17;

/// Is told of every step of the loop, on the loop's own thread, and decides how it goes on.
///
/// Every closure that takes a [`Progress`] is an observer that only listens.
pub trait Observer {
    /// A step of a batch is rendered. Steps are short, see [`Self::step_seconds`].
    fn stepped(&mut self, progress: Progress, store: &Arc<Store>) -> Flow;

    /// Runs a filter pass, here or elsewhere. `None`: it was given up, and the loop returns.
    fn run_filter(&mut self, job: FilterJob) -> Option<Shown> {
        Some(job.run())
    }

    /// A filter pass of the loop is done.
    fn filtered(&mut self, _shown: &Shown) {}

    /// How long a step should take, in seconds; `None` leaves it to the loop.
    fn step_seconds(&self) -> Option<f64> {
        None
    }
}

impl<F: FnMut(Progress)> Observer for F {
    fn stepped(&mut self, progress: Progress, _: &Arc<Store>) -> Flow {
        self(progress);
        Flow::GoOn
    }
}

/// What an observer wants to happen after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    GoOn,
    /// Return to the caller, who may change settings and go on where it was.
    Leave,
}

/// A filter pass that can run on any thread.
pub struct FilterJob {
    pub store: Arc<Store>,
    pub denoiser: Denoiser,
    pub quality: Quality,
    pub seed: u64,
    /// Also find where interpolation of feature weights fails, which drives samples.
    pub interpolation: bool,
}

/// What a filter pass makes of the store.
#[derive(Clone)]
pub struct Shown {
    pub made_by: (Denoiser, Quality),
    pub filtered: Filtered,
    /// Where interpolation failed, and the share of pixels where it did not.
    pub failure: Option<Planes>,
    pub success: Option<f32>,
    /// Seconds that it took to find these two.
    pub maps_seconds: Option<f64>,
}

impl Shown {
    /// The map of where interpolation failed: the filter's own, or that of the grid stage alone.
    pub fn any_failure(&self) -> Option<&Planes> {
        self.filtered.interpolation_failure.as_ref().or(self.failure.as_ref())
    }
}

/// What can be made of a store by who asks for a filter. Where there is no sample for every pixel the image is a
/// coarse one, and `paper` and RPF would take pixels without samples for black ones.
pub fn fitting(store: &Store, denoiser: Denoiser, quality: Quality) -> (Denoiser, Quality) {
    let sparse = store.drawn() < store.pixels() as u64;
    if sparse && denoiser != Denoiser::None { (Denoiser::Prpf, Quality::Draft) } else { (denoiser, quality) }
}

impl FilterJob {
    pub fn run(&self) -> Shown {
        let filtered = filtered(&self.store, self.denoiser, self.quality, self.seed);
        let started = Instant::now();
        let grid = self.interpolation.then(|| {
            filter::prpf::interpolation_failure(&self.store, &PrpfSettings::paper(), FAILURE_WINDOW)
        });
        let maps_seconds = self.interpolation.then(|| started.elapsed().as_secs_f64());
        let (failure, success) = grid.unzip();
        let made_by = (self.denoiser, self.quality);
        Shown { made_by, filtered, failure, success, maps_seconds }
    }
}

/// The image that a store holds.
pub(super) fn filtered(store: &Store, denoiser: Denoiser, quality: Quality, seed: u64) -> Filtered {
    match denoiser {
        Denoiser::None => filter::unfiltered(store),
        Denoiser::Prpf => filter::filter(store, quality, seed),
        Denoiser::Rpf => rpf::filter(store, &RpfSettings::report(), seed),
    }
}
