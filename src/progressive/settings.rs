//! Holds and checks the settings of a render, and derives the statistics and sample vectors that they call for.

use super::budget::Budget;
use crate::adaptive::{self, NO_CEILING, PrioritySettings, SampleMap, Sampling};
use crate::filter::{
    DEFAULT, DEFAULTS_BY_COST, Denoiser, MissingData, SampleVectors, UNFILTERED, draft_without_vectors,
};
use crate::stats::{BlockSet, Layout, Store};

/// The settings of a render loop.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Settings {
    pub budget: Budget,
    pub sampling: Sampling,
    /// The map that uniform sampling follows, of the render's size; one of another size is ignored. In files, only the
    /// meaning of its values.
    #[serde(default, skip_deserializing)]
    pub sample_map: Option<SampleMap>,
    /// In files: `denoiser`, and `quality` for one that has presets.
    #[serde(flatten)]
    pub denoiser: &'static dyn Denoiser,
    pub seed: u64,
    /// Floor per pixel.
    pub min_spp: u32,
    /// Ceiling per pixel; [`NO_CEILING`] is written as null.
    #[serde(with = "ceiling")]
    pub max_spp: u32,
    pub priority: PrioritySettings,
    /// Least number of sample vectors per pixel in the reservoir; the denoiser may need more.
    pub reservoir: usize,
    pub statistics: RecordedStatistics,
}

/// The dimensions of which a render keeps statistics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RecordedStatistics {
    /// Those that the denoiser, the allocation of samples and the outputs read; all if sample vectors are kept, which have
    /// the same dimensions.
    #[default]
    Needed,
    /// Every one that the scene's effects call for.
    All,
}

/// Floor per pixel of adaptive sampling.
pub const MIN_SPP: u32 = 4;

/// The settings of `prpf render` without options, and without a budget.
impl Default for Settings {
    fn default() -> Self {
        Self {
            budget: Budget::default(),
            sampling: Sampling::Adaptive,
            sample_map: None,
            denoiser: DEFAULT,
            seed: 0,
            min_spp: MIN_SPP,
            max_spp: NO_CEILING,
            priority: PrioritySettings::default(),
            reservoir: 0,
            statistics: RecordedStatistics::Needed,
        }
    }
}

mod ceiling {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::adaptive::NO_CEILING;

    pub fn serialize<S: Serializer>(spp: &u32, serializer: S) -> Result<S::Ok, S::Error> {
        Some(*spp).filter(|&spp| spp < NO_CEILING).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(NO_CEILING))
    }
}

/// Settings that no render can follow.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{field}: found {found}; accepted is {accepted}")]
pub struct SettingsError {
    pub field: &'static str,
    pub found: String,
    pub accepted: String,
}

/// Largest blur of the maps, in pixels.
const MOST_BLUR: f32 = 100.0;

impl Settings {
    /// Checks that the settings are in range and do not contradict each other.
    ///
    /// # Errors
    /// The first field that is wrong.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let error = |field, found: &dyn ToString, accepted: String| {
            Err(SettingsError { field, found: found.to_string(), accepted })
        };
        let Budget { spp, seconds, target_error } = self.budget;
        if spp == Some(0) {
            return error("spp", &0, "a number from 1 up, or none".to_owned());
        }
        for (field, value) in [("seconds", seconds), ("target_error", target_error)] {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
                return error(field, &value, "a finite number above 0, or none".to_owned());
            }
        }
        if self.max_spp == 0 || self.min_spp > self.max_spp {
            return error("max_spp", &self.max_spp, format!("a number from {} up", self.min_spp.max(1)));
        }
        let has_end = spp.is_some() || seconds.is_some() || self.max_spp < NO_CEILING;
        if target_error.is_some()
            && !has_end
            && self.sampling == Sampling::Uniform
            && self.sample_map.as_ref().is_some_and(|map| map.total().is_none() && map.leaves_most_out())
        {
            let found = "a map without samples for more than half of the pixels, whose error is not known";
            return error("target_error", &found, "another budget or a ceiling beside it".to_owned());
        }
        let weights = [
            ("filtered_variance", self.priority.filtered_variance),
            ("raw_variance", self.priority.raw_variance),
            ("interpolation_failure", self.priority.interpolation_failure),
            ("residual", self.priority.residual),
        ];
        if let Some((field, weight)) =
            weights.into_iter().find(|(_, weight)| !(weight.is_finite() && *weight >= 0.0))
        {
            return error(field, &weight, "a finite weight from 0 up".to_owned());
        }
        let constants = [
            ("blur", self.priority.blur, MOST_BLUR),
            ("epsilon", self.priority.epsilon, f32::MAX),
            ("cap_quantile", self.priority.cap_quantile, 1.0),
            ("max_ratio", self.priority.max_ratio, f32::MAX),
        ];
        match constants.into_iter().find(|(_, value, most)| !(0.0..=*most).contains(value)) {
            Some((field, value, most)) => error(field, &value, format!("a number from 0 to {most}")),
            None => Ok(()),
        }
    }

    /// Returns the samples per pixel from which on a pass says whether adaptive sampling is worth its time: both halves have some.
    pub(super) fn judged_spp(&self) -> u32 {
        self.min_spp.max(2)
    }

    /// Returns the denoiser of passes between batches. Where an error is to be reached, it is the error of the method's
    /// own image.
    pub fn interim_denoiser(&self) -> &'static dyn Denoiser {
        let (asked, stand_in) = (self.denoiser, self.denoiser.stand_in());
        let is_other_method = stand_in.name().method != asked.name().method;
        if self.budget.target_error.is_some() && is_other_method { asked } else { stand_in }
    }

    /// Returns the denoiser that filters squares of pixels in a last pass, or the pixels if they have too few samples for another one: the
    /// method's draft, and under a time budget that of `learned` in place of the default denoisers.
    pub fn square_denoiser(&self) -> &'static dyn Denoiser {
        let [_, draft, ..] = DEFAULTS_BY_COST;
        let is_default = self.budget.seconds.is_some() && DEFAULTS_BY_COST.contains(&self.denoiser);
        if is_default { draft } else { draft_without_vectors(self.denoiser) }
    }

    /// Returns the sample vectors per pixel that a render with these settings keeps at most.
    pub fn reservoir_capacity(&self) -> usize {
        let needed = match self.denoiser.reads().sample_vectors {
            SampleVectors::None => 0,
            SampleVectors::Reservoir(size) => size,
            SampleVectors::All { .. } => self.most_samples(),
        };
        needed.max(self.reservoir)
    }

    /// Returns whether a store has what a render with these settings keeps of its samples.
    pub fn are_met_by(&self, store: &Store) -> bool {
        self.reservoir_capacity() <= store.capacity()
            && MissingData::check_layout(store.layout(), self.denoiser).is_ok()
    }

    /// Returns the blocks of dimensions of which the render keeps statistics; `outputs` are those that the outputs read.
    pub fn recorded_blocks(&self, outputs: BlockSet) -> BlockSet {
        if self.statistics == RecordedStatistics::All || self.reservoir_capacity() > 0 {
            return BlockSet::ALL;
        }
        // What is filtered with: the denoiser, and what takes its place where time or samples are short.
        let denoisers = [self.denoiser, self.denoiser.stand_in(), self.square_denoiser(), UNFILTERED];
        denoisers.iter().flat_map(|denoiser| denoiser.reads().blocks).copied().collect::<BlockSet>() | outputs
    }

    /// Returns the map that the samples of an image of `pixels` pixels follow.
    pub(super) fn followed_map(&self, pixels: usize) -> Option<&SampleMap> {
        let map = self.sample_map.as_ref().filter(|map| map.values().len() == pixels)?;
        (self.sampling == Sampling::Uniform).then_some(map)
    }

    /// Returns the samples that a pixel can get, as far as budgets limit them.
    fn most_samples(&self) -> usize {
        let ratio = self.ratio_to_mean();
        let budget = self.budget.spp.map_or(u32::MAX, |spp| (f64::from(spp) * ratio).ceil() as u32);
        budget.min(self.max_spp) as usize
    }

    /// Returns the largest ratio of a pixel's samples to their mean over the image.
    fn ratio_to_mean(&self) -> f64 {
        match (self.sampling, &self.sample_map) {
            (Sampling::Uniform, None) => 1.0,
            (Sampling::Uniform, Some(map)) => map.peak(),
            (Sampling::Adaptive, _) => adaptive::MAX_RATIO_TO_MEAN,
        }
    }

    /// Returns the largest budget, in samples per pixel, of which reservoirs of this capacity keep the sample vectors that the
    /// denoiser needs; `None` if there is no largest one.
    pub fn most_spp_kept(&self, capacity: usize) -> Option<u32> {
        let keeps_all = matches!(self.denoiser.reads().sample_vectors, SampleVectors::All { .. });
        let is_limited = keeps_all && capacity < self.max_spp as usize;
        is_limited.then(|| (capacity as f64 / self.ratio_to_mean()) as u32)
    }
}

/// The memory of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelMemory {
    /// Bytes of statistics.
    pub statistics: usize,
    /// Most sample vectors in the reservoir.
    pub sample_vectors: usize,
    /// Bytes of each, with those that the denoiser needs beside it.
    pub per_sample_vector: usize,
}

impl PixelMemory {
    /// Computes the memory of a pixel in a render with these settings.
    pub fn new(layout: &Layout, settings: &Settings) -> Self {
        let statistics = Store::bytes_per_pixel(layout, 0);
        let beside = match settings.denoiser.reads().sample_vectors {
            SampleVectors::All { bytes_beside } => bytes_beside,
            SampleVectors::None | SampleVectors::Reservoir(_) => 0,
        };
        Self {
            statistics,
            sample_vectors: settings.reservoir_capacity(),
            per_sample_vector: Store::bytes_per_pixel(layout, 1) - statistics + beside,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adaptive::MapValues;
    use crate::filter::{DENOISERS, rpf};

    #[test]
    fn settings_out_of_range_are_named() {
        let budget = |spp, seconds| Budget { spp, seconds, target_error: None };
        let of = |budget, min_spp, max_spp| Settings { budget, min_spp, max_spp, ..Settings::default() };
        let field = |settings: Settings| settings.validate().err().map(|error| error.field);
        assert_eq!(field(Settings::default()), None);
        assert_eq!(field(of(budget(Some(8), Some(1.0)), 4, 8)), None);
        assert_eq!(field(of(budget(Some(0), None), 0, 8)), Some("spp"));
        assert_eq!(field(of(budget(None, Some(0.0)), 4, 8)), Some("seconds"));
        assert_eq!(field(of(budget(None, Some(f64::NAN)), 4, 8)), Some("seconds"));
        assert_eq!(field(of(budget(None, None), 4, 2)), Some("max_spp"));
        // Error that nothing tells of does not end a render
        let map = |values: [f32; 4]| SampleMap::new(values.to_vec(), MapValues::Relative).ok();
        let to_target = |spp, sample_map| {
            let budget = Budget { spp, target_error: Some(0.01), seconds: None };
            field(Settings { sample_map, sampling: Sampling::Uniform, ..of(budget, 4, NO_CEILING) })
        };
        assert_eq!(to_target(None, map([0.0, 0.0, 0.0, 1.0])), Some("target_error"));
        assert_eq!(to_target(None, map([0.0, 0.0, 1.0, 1.0])), None);
        assert_eq!(to_target(Some(9), map([0.0, 0.0, 0.0, 1.0])), None);
        let priority = PrioritySettings { residual: -1.0, ..PrioritySettings::default() };
        assert_eq!(field(Settings { priority, ..Settings::default() }), Some("residual"));
        let priority = PrioritySettings { cap_quantile: 9.0, ..PrioritySettings::default() };
        assert_eq!(field(Settings { priority, ..Settings::default() }), Some("cap_quantile"));
        let priority = PrioritySettings { blur: f32::NAN, ..PrioritySettings::default() };
        assert_eq!(field(Settings { priority, ..Settings::default() }), Some("blur"));
    }

    #[test]
    fn the_largest_budget_that_is_kept_fits_into_the_reservoir() {
        for (sampling, most) in [(Sampling::Uniform, 64), (Sampling::Adaptive, 8)] {
            let budget = |spp| Budget { spp: Some(spp), ..Budget::default() };
            let of =
                |spp| Settings { denoiser: &rpf::RPF, sampling, budget: budget(spp), ..Settings::default() };
            assert_eq!(of(1).most_spp_kept(64), Some(most));
            assert!(of(most).reservoir_capacity() <= 64 && of(most + 1).reservoir_capacity() > 64);
            assert_eq!(Settings { max_spp: 64, ..of(1) }.most_spp_kept(64), None);
        }
        assert_eq!(Settings::default().most_spp_kept(0), None);
    }

    #[test]
    fn settings_are_written_with_the_names_of_denoiser_and_preset() {
        for denoiser in DENOISERS {
            let settings = Settings { denoiser, ..Settings::default() };
            let value = serde_json::to_value(&settings).unwrap();
            assert_eq!(value["denoiser"], denoiser.name().method);
            assert_eq!(value.get("quality").and_then(|q| q.as_str()), denoiser.name().preset);
            assert_eq!(serde_json::from_value::<Settings>(value).unwrap(), settings);
        }
    }

    #[test]
    fn no_ceiling_is_written_as_null_and_read_back() {
        for (max_spp, written) in [(NO_CEILING, serde_json::Value::Null), (64, 64.into())] {
            let value = serde_json::to_value(Settings { max_spp, ..Settings::default() }).unwrap();
            assert_eq!(value["max_spp"], written);
            assert_eq!(serde_json::from_value::<Settings>(value).unwrap().max_spp, max_spp);
        }
    }
}
