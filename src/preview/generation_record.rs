//! What viewers are told of one generation: its image, its progress, its errors over time.

use std::collections::VecDeque;

use super::view::View;
use crate::filter::{DenoiserName, FilterResult};
use crate::image::Planes;
use crate::image::enlargement::smoothed;
use crate::progressive::{EstimateSummary, Point, Progress};

/// A filtered image of squares of pixels, and maps of its pass: a value for each square.
pub struct CoarseImage {
    pub squares: Planes,
    pub maps: Vec<(View, Planes)>,
    /// Side of the squares in pixels.
    pub side: usize,
    /// Size of the whole image, in pixels.
    pub size: (usize, usize),
    /// The image in full size, if a part of it has been filtered pixel by pixel.
    pub detailed: Option<Planes>,
    /// Samples behind it, per pixel.
    pub spp: f64,
}

impl CoarseImage {
    /// Returns the image in full size, to paste a part into it.
    pub fn detailed_mut(&mut self) -> &mut Planes {
        self.detailed.get_or_insert_with(|| smoothed(&self.squares, self.side, self.size))
    }
}

/// The record of a generation.
#[derive(Default)]
pub struct GenerationRecord {
    /// The newest filter result, and its number of samples, 0 without one.
    pub shown: Option<FilterResult>,
    pub shown_samples: u64,
    /// Side of the squares that it was filtered in, in pixels: 1 for pixels.
    pub shown_side: usize,
    /// The newest coarse image, which stands in for it.
    pub coarse: Option<CoarseImage>,
    pub progress: Option<Progress>,
    /// Elapsed seconds and samples of the latest steps.
    pub recent: VecDeque<(f64, u64)>,
    /// The same after the first step.
    pub first: Option<(f64, u64)>,
    pub filter_seconds: f64,
    /// The estimated error of the newest image, and those of all images against time.
    pub estimate: Option<EstimateSummary>,
    pub curve: Vec<(DenoiserName, Point)>,
}

impl GenerationRecord {
    /// Returns the seconds that `samples` samples take here, those of a resumed state included.
    pub fn seconds_of(&self, samples: u64) -> Option<f64> {
        let ((first_seconds, first_samples), progress) = self.first.zip(self.progress)?;
        let own = progress.samples.checked_sub(first_samples).filter(|&own| own > 0)?;
        Some((progress.elapsed - first_seconds) * samples as f64 / own as f64)
    }

    /// Drops the image of another denoiser, and its errors.
    pub fn forget_image(&mut self) {
        self.estimate = None;
        self.curve.clear();
        (self.shown, self.shown_samples) = (None, 0);
        self.coarse = None;
    }
}
