//! Names the four configurations that are compared: uniform or adaptive sampling, unfiltered or filtered.

use prpf::adaptive::Sampling;

/// A sampling strategy, with or without the denoiser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Configuration {
    pub sampling: Sampling,
    pub filtered: bool,
}

/// All configurations, in the order of tables and plots.
pub const CONFIGURATIONS: [Configuration; 4] = [
    Configuration { sampling: Sampling::Uniform, filtered: false },
    Configuration { sampling: Sampling::Adaptive, filtered: false },
    Configuration { sampling: Sampling::Uniform, filtered: true },
    Configuration { sampling: Sampling::Adaptive, filtered: true },
];

/// Index in [`CONFIGURATIONS`] of plain path tracing.
pub const PLAIN: usize = 0;
/// Index of the program's default: adaptive and filtered.
pub const DEFAULT: usize = 3;

impl Configuration {
    pub fn name(self) -> &'static str {
        match (self.sampling, self.filtered) {
            (Sampling::Uniform, false) => "uniform, unfiltered",
            (Sampling::Adaptive, false) => "adaptive, unfiltered",
            (Sampling::Uniform, true) => "uniform, filtered",
            (Sampling::Adaptive, true) => "adaptive, filtered",
        }
    }
}
