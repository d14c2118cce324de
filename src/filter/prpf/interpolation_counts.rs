//! Counts where interpolation of weights succeeds and fails over the passes.

use super::settings::PrpfSettings;
use crate::filter::common::interleaved_planes::InterleavedPlanes;
use crate::filter::result::Interpolation;
use crate::image::Planes;

/// Failures and successes of interpolation.
pub struct InterpolationCounts {
    /// Failures of each pixel.
    failures: Planes,
    passes: usize,
    /// Pixels between nodes, over all passes.
    between: usize,
    interpolated: usize,
}

impl InterpolationCounts {
    pub fn new(width: usize, height: usize) -> Self {
        Self { failures: Planes::new(width, height, 1), passes: 0, between: 0, interpolated: 0 }
    }

    /// Adds a pass. The last plane of `weights` holds the sums of interpolation weights, which are infinite
    /// at nodes.
    pub fn add(&mut self, weights: &InterleavedPlanes, settings: &PrpfSettings) {
        self.passes += 1;
        let width = weights.width().max(1);
        for (y, failures) in self.failures.data_mut().chunks_mut(width).enumerate() {
            for (failure, &sum) in failures.iter_mut().zip(weights.row(weights.count() - 1, y)) {
                let failed = sum <= settings.interpolation_threshold;
                *failure += f32::from(failed);
                self.between += usize::from(sum.is_finite());
                self.interpolated += usize::from(sum.is_finite() && !failed);
            }
        }
    }

    /// Returns the mean over the passes. Without pixels between nodes the success is 1.
    pub fn finish(mut self) -> Interpolation {
        self.failures.data_mut().iter_mut().for_each(|f| *f /= self.passes.max(1) as f32);
        let success = if self.between > 0 { self.interpolated as f32 / self.between as f32 } else { 1.0 };
        Interpolation { failure: self.failures, success }
    }
}
