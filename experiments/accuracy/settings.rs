//! The settings of the experiment `accuracy`, from `accuracy.toml`.

use serde::Deserialize;

use super::filter_costs;
use crate::test_scene::Size;

/// The settings of the experiment.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    pub scenes: Vec<String>,
    pub size: Size,
    /// The relMSEs whose times are reported.
    pub targets: Vec<f64>,
    pub curves: CurveSettings,
    pub target_errors: TargetErrorSettings,
    pub interim_passes: InterimPassSettings,
    pub filters: filter_costs::Settings,
}

/// Curves of error against time.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurveSettings {
    /// Samples per pixel, ascending.
    pub spp: Vec<u32>,
    pub seeds: u64,
}

/// Renders that end by their estimated error.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetErrorSettings {
    /// relMSEs.
    pub targets: Vec<f64>,
    /// Most samples per pixel.
    pub max_spp: u32,
    pub seeds: u64,
}

/// Renders with fewer interim passes.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterimPassSettings {
    pub spp: u32,
    /// Numbers of batches per interim pass.
    pub every: Vec<usize>,
    pub seeds: u64,
}
