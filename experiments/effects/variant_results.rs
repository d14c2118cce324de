//! Holds the measurements of the experiment `effects` on a variant of the scene.

use super::variants::Variant;
use crate::ledger::Values;

/// The measurements of a variant of the scene.
pub struct VariantResults {
    pub variant: Variant,
    /// The library's names of the effects that the variant calls for.
    pub effects: Vec<&'static str>,
    pub values: Values,
}

/// Seed of the samples.
pub const SEED: u64 = 0;
/// File name of the picture of the scene with all effects.
pub const PICTURE: &str = "all.png";

/// Names of measured quantities.
pub mod quantity {
    pub const DIMENSIONS: &str = "dimensions";
    pub const RANDOM: &str = "random dimensions";
    pub const PAIRS: &str = "pairs";
    pub const RENDER: &str = "render seconds";
    pub const NLM: &str = "nlm seconds";
    pub const PRPF: &str = "prpf seconds";
    pub const STATISTICS: &str = "bytes per pixel of statistics";
    pub const RESERVOIR: &str = "bytes per pixel of the reservoir";
}
