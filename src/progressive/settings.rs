//! What the loop follows, and what a render with that takes.

use super::Budget;
use crate::adaptive::{self, PrioritySettings, Sampling};
use crate::filter::{Quality, rpf};
use crate::stats::{Layout, Store};

/// The reconstruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Denoiser {
    /// The mean of the samples.
    None,
    /// P-RPF, or what its quality stands for.
    Prpf,
    /// Random parameter filtering, on whole samples; it has no qualities. Between batches, where no error is
    /// to be reached, P-RPF's draft stands in.
    Rpf,
}

/// Everything the loop follows.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Settings {
    pub budget: Budget,
    pub sampling: Sampling,
    pub denoiser: Denoiser,
    pub quality: Quality,
    pub seed: u64,
    /// Floor per pixel.
    pub min_spp: u32,
    /// Ceiling per pixel; [`NO_CEILING`] is written as null.
    #[serde(with = "ceiling")]
    pub max_spp: u32,
    pub priority: PrioritySettings,
    /// Sample vectors kept per pixel at least; the denoiser may need more.
    pub reservoir: usize,
}

/// Floor per pixel of adaptive sampling.
pub const MIN_SPP: u32 = 4;

/// What `prpf render` follows where nothing else is asked for, without any budget.
impl Default for Settings {
    fn default() -> Self {
        Self {
            budget: Budget::default(),
            sampling: Sampling::Adaptive,
            denoiser: Denoiser::Prpf,
            quality: Quality::Standard,
            seed: 0,
            min_spp: MIN_SPP,
            max_spp: NO_CEILING,
            priority: PrioritySettings::default(),
            reservoir: 0,
        }
    }
}

/// Without a ceiling a pixel still cannot count beyond what indices hold.
pub const NO_CEILING: u32 = u32::MAX / 4;

mod ceiling {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::NO_CEILING;

    pub fn serialize<S: Serializer>(spp: &u32, serializer: S) -> Result<S::Ok, S::Error> {
        Some(*spp).filter(|&spp| spp < NO_CEILING).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(NO_CEILING))
    }
}

/// Sample vectors kept per pixel where mutual information is estimated: enough for the smallest of
/// its windows.
pub const RESERVOIR: usize = 8;

/// Sample vectors that a render with these settings keeps per pixel.
pub fn reservoir_capacity(settings: &Settings) -> usize {
    let needed = match (settings.denoiser, settings.quality) {
        (Denoiser::Rpf, _) => most_samples(settings),
        (Denoiser::Prpf, Quality::Paper) => RESERVOIR,
        _ => 0,
    };
    needed.max(settings.reservoir)
}

/// Samples that a pixel can get, as far as budgets limit it.
fn most_samples(settings: &Settings) -> usize {
    let of_mean = match settings.sampling {
        Sampling::Uniform => 1.0,
        Sampling::Adaptive => adaptive::CEILING,
    };
    let budget = settings.budget.spp.map_or(u32::MAX, |spp| (f64::from(spp) * of_mean) as u32);
    budget.min(settings.max_spp) as usize
}

impl Settings {
    /// Whether failures of interpolation are among what drives the samples.
    pub(super) fn drives_interpolation(&self) -> bool {
        self.denoiser != Denoiser::None
            && self.sampling == Sampling::Adaptive
            && self.priority.interpolation_failure > 0.0
    }
}

/// Memory that a render with these settings takes, per pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelMemory {
    /// Bytes of statistics.
    pub statistics: usize,
    /// Samples that are kept whole, at most.
    pub samples: usize,
    /// Bytes of each of them, with what the filter needs beside it.
    pub per_sample: usize,
}

impl PixelMemory {
    pub fn of(layout: &Layout, settings: &Settings) -> Self {
        let statistics = Store::bytes_per_pixel(layout, 0);
        let beside = if settings.denoiser == Denoiser::Rpf { rpf::BYTES_PER_SAMPLE } else { 0 };
        Self {
            statistics,
            samples: reservoir_capacity(settings),
            per_sample: Store::bytes_per_pixel(layout, 1) - statistics + beside,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_ceiling_is_written_as_null_and_read_back() {
        for (max_spp, written) in [(NO_CEILING, serde_json::Value::Null), (64, 64.into())] {
            let value = serde_json::to_value(Settings { max_spp, ..Settings::default() }).unwrap();
            assert_eq!(value["max_spp"], written);
            assert_eq!(serde_json::from_value::<Settings>(value).unwrap().max_spp, max_spp);
        }
    }
}
