//! Holds the values measured on a scene, by run and quantity.

use std::collections::BTreeMap;

use crate::ledger::Values;

/// The measurements on a scene.
#[derive(Clone, Debug)]
pub struct SceneResults {
    pub name: String,
    /// Whether it is one of the paper's scenes, or a stand-in for one.
    pub from_paper: bool,
    /// Samples per pixel of the runs of RPF.
    pub rpf_spp: Vec<u32>,
    pub runs: BTreeMap<String, Values>,
}

impl SceneResults {
    /// A value; NaN if it was not measured.
    pub fn get(&self, run: &str, quantity: &str) -> f64 {
        self.runs.get(run).and_then(|values| values.get(quantity)).copied().unwrap_or(f64::NAN)
    }

    /// A value of a method at a sample count.
    pub fn at(&self, method: &str, spp: u32, quantity: &str) -> f64 {
        self.get(&format!("{method} {spp}"), quantity)
    }

    /// Ratio of the filter times of RPF and P-RPF.
    pub fn speed_up(&self, spp: u32) -> f64 {
        self.at(RPF, spp, "seconds") / self.at(PRPF, spp, "seconds")
    }
}

/// Names of methods. A run is named `METHOD SPP`.
pub const UNFILTERED: &str = "unfiltered";
pub const PRPF: &str = "prpf";
pub const NLM: &str = "nlm";
pub const RPF: &str = "rpf";
/// The error of the reference.
pub const REFERENCE: &str = "reference";
/// P-RPF with and without upsampling of weights.
pub const UPSAMPLING: &str = "upsampling";
/// Samples beyond the similarity threshold in a selection by pixels.
pub const OUTSIDE: &str = "outside";
/// P-RPF and `nlm` on the whole image.
pub const WHOLE: &str = "whole";
/// A method in the time of RPF: `equal time METHOD`.
pub const EQUAL_TIME: &str = "equal time";
/// Another interpretation of a paper: `interpretation NAME`.
pub const INTERPRETATION: &str = "interpretation";
