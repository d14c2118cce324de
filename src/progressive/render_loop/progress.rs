//! How far a render has come, for progress bars and pages.

use super::RenderLoop;
use crate::progressive::error_estimate::ErrorEstimate;
use crate::progressive::forecast::{Point, forecast};
use crate::progressive::record::Progress;
use crate::progressive::situation::Conditions;

impl RenderLoop<'_> {
    /// Returns how far the render has come.
    pub fn progress(&self) -> Progress {
        let situation = self.situation(&Conditions::default());
        let samples = self.samples.valid;
        let by_budget = situation.schedule().fraction(situation.elapsed, situation.samples);
        Progress {
            fraction: self.target_fraction().map_or(by_budget, |by_target| by_budget.max(by_target)),
            elapsed: situation.elapsed,
            samples,
            spp: samples as f64 / self.store().pixels().max(1) as f64,
            estimate: self.estimate().map(ErrorEstimate::summary),
        }
    }

    /// Returns the fraction of the samples that lead to the target error, by the error's own rate; `None` without a target,
    /// or before the first estimate.
    fn target_fraction(&self) -> Option<f64> {
        let (target, estimate) = (self.settings.budget.target_error?, self.estimate()?);
        // Time is proportional to samples, and the power does not depend on the unit.
        let points: Vec<Point> = self.checkpoint.passes.iter().filter_map(|pass| pass.point(1.0)).collect();
        let growth = forecast(&points, points.last()?)?.growth_to(estimate.value, target);
        Some((self.samples.valid as f64 / (growth * estimate.samples as f64)).min(1.0))
    }
}
