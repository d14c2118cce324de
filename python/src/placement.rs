//! Where the samples of a render go: by maps of the denoiser, evenly, or by a given map.

use prpf::adaptive::{MapValues, SampleMap, Sampling};
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::value_error;
use crate::scene::Scene;

/// How samples are placed, and the map that they follow.
pub struct Placement {
    pub sampling: Sampling,
    pub sample_map: Option<SampleMap>,
}

impl Placement {
    /// Takes the arguments that place samples. `has_counts`: whether a function chooses the counts of batches.
    ///
    /// # Errors
    /// An unknown name, a map that cannot be followed, two arguments that place samples.
    pub fn new(
        sampling: Option<&str>,
        map: Option<&Bound<PyAny>>,
        values: &str,
        has_counts: bool,
        scene: &Scene,
    ) -> PyResult<Self> {
        let sample_map = map.map(|map| sample_map(map, values, scene)).transpose()?;
        let default = if sample_map.is_some() { "uniform" } else { "adaptive" };
        let sampling = self::sampling(sampling.unwrap_or(default))?;
        if sampling == Sampling::Adaptive && sample_map.is_some() {
            return Err(value_error("sampling: found adaptive with sample_map; accepted is one of them"));
        }
        if has_counts && sampling == Sampling::Uniform {
            return Err(value_error(
                "counts: found a function with uniform sampling; accepted is one with adaptive sampling",
            ));
        }
        Ok(Self { sampling, sample_map })
    }

    /// Returns the number of samples of the whole image, if a map gives it.
    pub fn total(&self) -> Option<u64> {
        self.sample_map.as_ref().and_then(SampleMap::total)
    }
}

/// Takes a map of the size of the render by which samples are placed.
///
/// # Errors
/// Another shape or type, values that cannot be followed, an unknown kind of values.
fn sample_map(map: &Bound<PyAny>, values: &str, scene: &Scene) -> PyResult<SampleMap> {
    let kind = match values {
        "relative" => MapValues::Relative,
        "absolute" => MapValues::Absolute,
        found => {
            return Err(value_error(format!(
                "sample_map_values: found `{found}`; accepted are relative and absolute"
            )));
        }
    };
    let (width, height) = scene.size();
    let values = arrays::plane("sample_map", map, [height, width])?;
    map.py()
        .detach(|| SampleMap::new(values, kind))
        .map_err(|error| value_error(format!("sample_map: {error}")))
}

/// Returns how samples are placed, by its name.
///
/// # Errors
/// An unknown name.
fn sampling(name: &str) -> PyResult<Sampling> {
    match name {
        "adaptive" => Ok(Sampling::Adaptive),
        "uniform" => Ok(Sampling::Uniform),
        _ => Err(value_error(format!("sampling: found `{name}`; accepted are adaptive and uniform"))),
    }
}
