//! Runs a method on a store and measures its time.

use prpf::filter::{self, Denoiser, FilterResult, PrpfSettings, RpfSettings, nlm, prpf as pixelwise, rpf};
use prpf::image::Planes;
use prpf::stats::Store;

use super::stage_timer::{STAGES, StageTimer};
use crate::ledger::Values;
use crate::sampling::timed;

/// A method that makes an image from samples.
#[derive(Clone, Debug)]
pub enum Method {
    Unfiltered,
    /// Pixel-based random parameter filtering.
    Prpf(PrpfSettings),
    /// Cross-filtered non-local means, the program's default.
    Nlm,
    /// Random parameter filtering.
    Rpf(RpfSettings),
}

impl Method {
    /// Reservoir capacity for `spp` samples per pixel: RPF's, or one that suffices for all other methods.
    pub fn capacity(&self, spp: u32) -> usize {
        if matches!(self, Method::Rpf(_)) { spp as usize } else { pixelwise::RESERVOIR }
    }

    /// Filters a store. Returns the image, the seconds, the fraction of interpolated pixels and, for methods with the
    /// paper's stages, the fractions of their time.
    pub fn run(&self, store: &Store, seed: u64) -> (Planes, Values) {
        let timer = StageTimer::default();
        let (FilterResult { image, interpolation, .. }, seconds) = timed(|| self.filter(store, seed, &timer));
        let mut values = Values::from([("seconds".to_owned(), seconds)]);
        if let Some(interpolation) = interpolation {
            values.insert("interpolated".to_owned(), f64::from(interpolation.success));
        }
        if matches!(self, Method::Prpf(_) | Method::Rpf(_)) {
            for (name, fraction) in STAGES.iter().zip(timer.fractions()) {
                values.insert((*name).to_owned(), fraction);
            }
            values.insert("weight seconds".to_owned(), timer.weight_seconds());
        }
        (image, values)
    }

    fn filter(&self, store: &Store, seed: u64, timer: &StageTimer) -> FilterResult {
        let observe = |stage| timer.start(stage);
        match self {
            Method::Unfiltered => filter::unfiltered(store),
            Method::Nlm => nlm::STANDARD.filter(store, seed),
            Method::Prpf(settings) => pixelwise::filter_observed(store, settings, seed, &observe),
            Method::Rpf(settings) => rpf::filter_observed(store, settings, seed, &observe),
        }
    }
}
