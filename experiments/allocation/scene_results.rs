//! Holds the measurements of the experiment `allocation` on a scene.

use super::ablation::Ablation;
use super::own_loop::OwnLoop;
use crate::curves::{Curves, Point};

/// The measurements on a scene.
#[derive(Default)]
pub struct SceneResults {
    pub scene: String,
    /// See [`TestScene`](crate::test_scene::TestScene).
    pub is_public: bool,
    /// Expected relMSE of the reference.
    pub reference_relmse: f64,
    pub curves: Curves,
    /// Ratio of the unfiltered error with the optimal allocation to that of uniform sampling.
    pub optimal_ratio: f64,
    /// The images of each selection of maps.
    pub ablations: Vec<(Ablation, Vec<Point>)>,
    pub own_loop: OwnLoop,
    /// File name of the picture of the sample map.
    pub picture: String,
}
