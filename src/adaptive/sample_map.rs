//! Places samples by a given map of counts per pixel instead of by the maps of a filter.
//!
//! Takes a map, the samples that pixels have, and the number of samples of a batch; gives the samples of each pixel,
//! such that total counts come as near to the map's proportions as samples that are taken allow. A map that does not
//! depend on the samples it places leaves the image unbiased.

use std::sync::Arc;

use super::allocate::{round, uniform};

/// The meaning of a map's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MapValues {
    /// Ratios: the mean of the counts is that of the budget.
    Relative,
    /// Numbers of samples, each rounded to the nearest integer.
    Absolute,
}

/// A map of the counts that pixels are to have, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleMap {
    values: Arc<[f32]>,
    kind: MapValues,
}

/// The largest number of samples that an `f32` counts exactly.
const MAX_COUNT: f32 = (1 << 24) as f32;

/// Values that are no map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SampleMapError {
    #[error("found {found} at pixel {pixel}; accepted are {accepted}")]
    Value { found: f32, pixel: usize, accepted: &'static str },
    #[error("found no pixel that gets a sample; accepted is a map with a value {0}")]
    Empty(&'static str),
}

/// Files hold only what the values mean.
impl serde::Serialize for SampleMap {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.kind.serialize(serializer)
    }
}

impl SampleMap {
    /// Makes a map of one value for each pixel.
    ///
    /// # Errors
    /// A value that is negative or not finite, a count above 2²⁴, no value that gives a sample.
    pub fn new(mut values: Vec<f32>, kind: MapValues) -> Result<Self, SampleMapError> {
        let (largest, accepted, least) = match kind {
            MapValues::Relative => (f32::MAX, "finite numbers from 0 up", "above 0"),
            MapValues::Absolute => (MAX_COUNT, "numbers from 0 to 16777216", "of at least 0.5"),
        };
        let is_valid = |value: f32| (0.0..=largest).contains(&value);
        if let Some(pixel) = values.iter().position(|&value| !is_valid(value)) {
            return Err(SampleMapError::Value { found: values[pixel], pixel, accepted });
        }
        if kind == MapValues::Absolute {
            values.iter_mut().for_each(|value| *value = value.round());
        }
        if values.iter().all(|&value| value == 0.0) {
            return Err(SampleMapError::Empty(least));
        }
        Ok(Self { values: values.into(), kind })
    }

    /// The values, counts rounded.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns the samples of the whole image; `None` if the values are ratios.
    pub fn total(&self) -> Option<u64> {
        (self.kind == MapValues::Absolute).then(|| self.values.iter().map(|&value| value as u64).sum())
    }

    /// Returns the samples that pixels with `have` samples lack; `None` if the values are ratios. No pixel exceeds `max_spp`.
    pub fn lacking(&self, have: &[u32], max_spp: u32) -> Option<u64> {
        let lacks =
            |(&value, have): (&f32, &u32)| u64::from((value as u32).min(max_spp).saturating_sub(*have));
        (self.kind == MapValues::Absolute).then(|| self.values.iter().zip(have).map(lacks).sum())
    }

    /// Returns the values without what a ceiling cuts off from counts.
    pub fn below(&self, max_spp: u32) -> Vec<f32> {
        match self.kind {
            MapValues::Relative => self.values.to_vec(),
            MapValues::Absolute => self.values.iter().map(|value| value.min(max_spp as f32)).collect(),
        }
    }

    /// Returns a map of these values with other counts; ratios stay.
    #[must_use]
    pub fn map_counts(self, count: impl Fn(u32) -> u32) -> Self {
        match self.kind {
            MapValues::Relative => self,
            MapValues::Absolute => {
                let values = self.values.iter().map(|&value| count(value as u32) as f32).collect();
                Self { values, ..self }
            }
        }
    }

    /// Returns whether more than half of the pixels get no samples.
    pub fn leaves_most_out(&self) -> bool {
        2 * self.values.iter().filter(|&&value| value == 0.0).count() > self.values.len()
    }

    /// Returns the ratio of the largest to the mean value.
    pub fn peak(&self) -> f64 {
        let largest = self.values.iter().copied().fold(0.0, f32::max);
        f64::from(largest) / (sum(&self.values) / self.values.len() as f64)
    }

    /// Returns the number of samples by which counts grow. Ratios grow by pairs, so that both halves of a pixel's samples
    /// grow equally.
    pub fn unit(&self) -> u32 {
        match self.kind {
            MapValues::Relative => 2,
            MapValues::Absolute => 1,
        }
    }
}

/// Distributes `total` samples in units of `unit` so that the total counts, including the samples that pixels already have
/// (`have`), become proportional to `map`. Pixels with more than their proportion get none. No pixel exceeds `max_spp`;
/// samples that find no place for that reason, and the rest of a division by `unit`, are distributed uniformly, in pixels
/// where the map is not 0 if these have room. `width` is that of the image; `key` selects among equal pixels. Returns the
/// samples of each pixel.
pub fn follow(
    map: &[f32],
    unit: u32,
    have: &[u32],
    width: usize,
    total: u64,
    max_spp: u32,
    key: u64,
) -> Vec<u32> {
    let units = total / u64::from(unit);
    let have_units = |i: usize| f64::from(have[i]) / f64::from(unit);
    let room = |i: usize| f64::from(max_spp.saturating_sub(have[i]) / unit);

    // Find the scale of the map, and the pixels that are below their proportion
    let mut open: Vec<usize> = (0..map.len()).filter(|&i| map[i] > 0.0).collect();
    let mut scale = 0.0;
    while units > 0 && !open.is_empty() {
        let taken: f64 = open.iter().map(|&i| have_units(i)).sum();
        let proportions: f64 = open.iter().map(|&i| f64::from(map[i])).sum();
        scale = (units as f64 + taken) / proportions;
        let before = open.len();
        open.retain(|&i| scale * f64::from(map[i]) > have_units(i));
        if open.len() == before {
            break;
        }
    }

    // Round what these pixels lack
    let mut targets = vec![0.0; map.len()];
    open.iter().for_each(|&i| targets[i] = (scale * f64::from(map[i]) - have_units(i)).min(room(i)));
    let mut counts = round(&targets, width, units, room);
    counts.iter_mut().for_each(|n| *n *= unit);

    // Place the rest
    for includes_empty in [false, true] {
        let placed: u64 = counts.iter().map(|&n| u64::from(n)).sum();
        if placed == total {
            break;
        }
        let is_open = |i: usize| includes_empty || map[i] > 0.0;
        let now = |i: usize| if is_open(i) { have[i] + counts[i] } else { max_spp };
        let now: Vec<u32> = (0..map.len()).map(now).collect();
        let rest = uniform(total - placed, &now, max_spp, key);
        counts.iter_mut().zip(rest).for_each(|(n, rest)| *n += rest);
    }
    counts
}

fn sum(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: u32 = u32::MAX / 4;

    /// Values from 0 to 1, several of them 0.
    fn ratios(pixels: usize) -> Vec<f32> {
        (0..pixels).map(|i| (i * 37 % 29).saturating_sub(4) as f32 / 24.0).collect()
    }

    #[test]
    fn rounds_of_any_size_lead_to_the_proportions() {
        let map = ratios(40 * 30);
        let mut have = vec![0; map.len()];
        for total in [1200, 1201, 2400, 4801, 28_799, 19_200] {
            let counts = follow(&map, 2, &have, 40, total, NONE, total);
            assert_eq!(counts.iter().map(|&n| u64::from(n)).sum::<u64>(), total);
            have.iter_mut().zip(counts).for_each(|(have, n)| *have += n);
        }
        let scale = have.iter().sum::<u32>() as f64 / sum(&map);
        for (&n, &value) in have.iter().zip(&map) {
            assert!((f64::from(n) - scale * f64::from(value)).abs() <= 3.0, "{n} {value} {scale}");
            assert!(value > 0.0 || n == 0);
        }
        assert!(have.iter().filter(|&n| n % 2 == 1).count() <= 3, "counts grow by pairs");
    }

    #[test]
    fn a_surplus_of_some_pixels_makes_up_for_no_lack_of_others() {
        let map = SampleMap::new(vec![10.0, 50.0, 0.0], MapValues::Absolute).unwrap();
        assert_eq!(map.lacking(&[100, 0, 7], NONE), Some(50));
        assert_eq!((map.lacking(&[0; 3], 20), map.below(20)), (Some(30), vec![10.0, 20.0, 0.0]));
        assert_eq!(follow(&map.below(20), 1, &[0; 3], 3, 30, 20, 1), [10, 20, 0]);
        assert_eq!(follow(map.values(), 1, &[100, 0, 7], 3, 50, NONE, 1), [0, 50, 0]);
        let ratios = SampleMap::new(vec![1.0, 2.0], MapValues::Relative).unwrap();
        assert_eq!((ratios.lacking(&[0; 2], 9), ratios.below(1)), (None, vec![1.0, 2.0]));
    }

    #[test]
    fn counts_are_reached_exactly_in_several_rounds() {
        let values = (0..50 * 20).map(|i| (i * 31 % 23) as f32 + 0.3).collect();
        let map = SampleMap::new(values, MapValues::Absolute).unwrap();
        let total = map.total().unwrap();
        let mut have = vec![0; 1000];
        for part in [1000, 1777, 3501, total - 6278] {
            let counts = follow(map.values(), map.unit(), &have, 50, part, NONE, 1);
            have.iter_mut().zip(counts).for_each(|(have, n)| *have += n);
        }
        assert!(have.iter().zip(map.values()).all(|(&n, &value)| n as f32 == value));
    }

    #[test]
    fn pixels_with_more_than_their_proportion_get_nothing() {
        let counts = follow(&[1.0, 1.0, 1.0, 0.0], 1, &[10, 0, 0, 0], 4, 8, NONE, 0);
        assert_eq!(counts, [0, 4, 4, 0]);
    }

    #[test]
    fn samples_beyond_a_ceiling_find_another_place() {
        assert_eq!(follow(&[9.0, 1.0, 0.0], 1, &[0; 3], 3, 6, 4, 0), [4, 2, 0]);
        assert_eq!(follow(&[9.0, 1.0, 0.0], 1, &[0; 3], 3, 10, 4, 0), [4, 4, 2]);
        assert_eq!(follow(&[0.0; 2], 2, &[0; 2], 2, 6, 100, 0), [3, 3]);
    }

    #[test]
    fn values_that_are_no_map_are_refused() {
        let error = |values: &[f32], kind| SampleMap::new(values.to_vec(), kind).unwrap_err().to_string();
        for value in [-1.0, f32::NAN, f32::INFINITY] {
            assert!(
                error(&[1.0, value], MapValues::Relative).starts_with(&format!("found {value} at pixel 1"))
            );
        }
        assert!(error(&[0.0; 3], MapValues::Relative).contains("no pixel"));
        assert!(error(&[0.4; 3], MapValues::Absolute).contains("no pixel"));
        assert!(error(&[1e8], MapValues::Absolute).contains("16777216"));
    }

    #[test]
    fn counts_are_divided_and_ratios_are_not() {
        let map = |kind| SampleMap::new(vec![4.0, 1.0], kind).unwrap();
        assert_eq!(map(MapValues::Absolute).map_counts(|n| n / 2).values(), [2.0, 0.0]);
        assert_eq!(map(MapValues::Relative).map_counts(|n| n / 2).values(), [4.0, 1.0]);
        assert_eq!(map(MapValues::Relative).peak(), 1.6);
    }
}
