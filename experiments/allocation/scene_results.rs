//! Holds the measurements of the experiment `allocation` on a scene.

use super::ablation::Ablation;
use crate::curves::{Curves, Point};

/// The measurements on a scene.
pub struct SceneResults {
    pub scene: String,
    /// Expected relMSE of the reference.
    pub reference_relmse: f64,
    pub curves: Curves,
    /// Ratio of the unfiltered error with the optimal allocation to that of uniform sampling.
    pub optimal_ratio: f64,
    pub ablations: Vec<(Ablation, Vec<Point>)>,
    /// File name of the picture of the sample map.
    pub picture: String,
}
