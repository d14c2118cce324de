//! The settings of the experiment `allocation`, from `allocation.toml`.

use serde::Deserialize;

use crate::test_scene::Size;

/// The settings of the experiment.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    pub scenes: Vec<String>,
    pub size: Size,
    /// Samples per pixel of the curves, ascending.
    pub spp: Vec<u32>,
    /// Samples per pixel of more uniform images: adaptive ones take longer.
    pub more_uniform_spp: Vec<u32>,
    pub seeds: u64,
    pub maps: MapSettings,
    pub own_loop: OwnLoopSettings,
}

/// P-RPF in its own loop, with and without its maps.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnLoopSettings {
    pub spp: u32,
    pub seeds: u64,
    pub ablation_seeds: u64,
}

/// The ablation of priority maps.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapSettings {
    pub spp: u32,
    pub seeds: u64,
}
