//! The numbers of a run, found by scene, what was measured, and quantity.

use std::collections::BTreeMap;

use crate::ledger::Values;

/// A scene of the run.
#[derive(Clone, Debug)]
pub struct Measured {
    pub name: String,
    pub of_paper: bool,
    /// Samples per pixel that random parameter filtering was run at.
    pub rpf_spp: Vec<u32>,
    pub runs: BTreeMap<String, Values>,
}

impl Measured {
    /// A number; NaN if it was not measured.
    pub fn get(&self, run: &str, quantity: &str) -> f64 {
        self.runs.get(run).and_then(|values| values.get(quantity)).copied().unwrap_or(f64::NAN)
    }

    /// A number of a method at a sample count.
    pub fn at(&self, method: &str, spp: u32, quantity: &str) -> f64 {
        self.get(&format!("{method} {spp}"), quantity)
    }

    /// How many times faster P-RPF filters than RPF.
    pub fn speed_up(&self, spp: u32) -> f64 {
        self.at(RPF, spp, "seconds") / self.at(PRPF, spp, "seconds")
    }
}

/// Names of methods in runs.
pub const UNFILTERED: &str = "unfiltered";
pub const PRPF: &str = "prpf";
pub const STANDARD: &str = "standard";
pub const RPF: &str = "rpf";
/// Names of other runs.
pub const REFERENCE: &str = "reference";
pub const UPSAMPLING: &str = "upsampling";
pub const OUTSIDE: &str = "outside";
pub const WHOLE: &str = "whole";
/// At equal time: followed by a method's name.
pub const EQUAL: &str = "equal time";
/// Another reading: followed by its name.
pub const READING: &str = "reading";
