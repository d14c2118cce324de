//! The settings of the experiment `filters`, from `filters.toml`.

use serde::Deserialize;

use crate::test_scene::Size;

/// The settings of the experiment.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Scenes, grouped by the models that they show.
    pub views: Vec<Vec<String>>,
    pub size: Size,
    /// Samples per pixel, ascending.
    pub spp: Vec<u32>,
    pub seeds: u64,
}
