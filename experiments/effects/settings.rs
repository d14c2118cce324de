//! The settings of the experiment `effects`, from `effects.toml`.

use std::path::PathBuf;

use serde::Deserialize;

use super::variants::Effect;

/// The settings of the experiment.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The scene with all effects, relative to the repository.
    pub file: PathBuf,
    /// Approximate number of pixels of the film.
    pub pixels: f64,
    pub spp: u32,
    /// Number of runs, of which a time is the median.
    pub repeats: usize,
    pub effect: Vec<Effect>,
}
