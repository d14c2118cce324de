//! Holds the measurements of the experiment `accuracy` on a scene.

use super::filter_costs::Cost;
use super::target_errors::TargetRun;
use crate::curves::{Curves, Point};

/// The measurements on a scene.
#[derive(Default)]
pub struct SceneResults {
    pub scene: String,
    /// Whether no constant was chosen on the scene.
    pub is_public: bool,
    /// Expected relMSE of the reference.
    pub reference_relmse: f64,
    pub curves: Curves,
    /// By index of [`filter_costs::Settings::variants`](super::filter_costs::Settings::variants).
    pub filters: Vec<Cost>,
    /// By index of `interim_passes.every`.
    pub interim_passes: Vec<Vec<Point>>,
    pub target_runs: Vec<TargetRun>,
}
