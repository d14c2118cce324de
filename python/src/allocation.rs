//! Allocation: from the maps of a result to priorities, and from priorities to the next sample counts.

use numpy::PyUntypedArrayMethods;
use prpf::adaptive::{self, FilterMaps, NO_CEILING, PrioritySettings};
use pyo3::prelude::*;

use crate::arguments;
use crate::arrays;
use crate::denoising::Denoised;
use crate::errors::value_error;
use crate::store::Store;

/// Computes the priority of each pixel from the maps of a result.
#[pyfunction]
#[pyo3(signature = (store, result, *, filtered_variance=None, raw_variance=None, interpolation_failure=None,
                    residual=None))]
pub fn priority(
    py: Python,
    store: &Store,
    result: &Denoised,
    filtered_variance: Option<f32>,
    raw_variance: Option<f32>,
    interpolation_failure: Option<f32>,
    residual: Option<f32>,
) -> PyResult<Py<PyAny>> {
    // Take the weights
    let default = PrioritySettings::default();
    let weight = |name: &str, weight: Option<f32>, default: f32| match weight {
        Some(weight) if weight.is_finite() && weight >= 0.0 => Ok(weight),
        Some(weight) => {
            Err(value_error(format!("{name}: found {weight}; accepted is a finite weight from 0 up")))
        }
        None => Ok(default),
    };
    let settings = PrioritySettings {
        filtered_variance: weight("filtered_variance", filtered_variance, default.filtered_variance)?,
        raw_variance: weight("raw_variance", raw_variance, default.raw_variance)?,
        interpolation_failure: weight(
            "interpolation_failure",
            interpolation_failure,
            default.interpolation_failure,
        )?,
        residual: weight("residual", residual, default.residual)?,
        ..default
    };

    // Take the maps
    let store = &*store.statistics(py);
    let (width, height) = (store.width(), store.height());
    let size = Some([width, height]);
    let image = arrays::planes("result.image", result.image.bind(py), size, 3)?;
    let variance = arrays::planes("result.variance", result.variance.bind(py), size, 3)?;
    let map = |name: &str, map: &Py<PyAny>| {
        let map = map.bind(py).call_method1("reshape", (height, width, 1))?;
        arrays::planes(name, &map, size, 1)
    };
    let residual = map("result.residual", &result.residual)?;
    let failure = result.interpolation_failure.as_ref();
    let failure = failure.map(|failure| map("result.interpolation_failure", failure)).transpose()?;
    let priority = py.detach(|| {
        let maps = FilterMaps {
            image: &image,
            variance: &variance,
            residual: &residual,
            interpolation_failure: failure.as_ref(),
        };
        adaptive::priority(store, maps, &settings)
    });
    arrays::map(py, priority, width)
}

/// Computes the sample counts of the next batch.
#[pyfunction]
#[pyo3(signature = (store, priority, samples, *, min_spp=0, max_spp=None))]
pub fn allocate(
    py: Python,
    store: &Store,
    priority: &Bound<PyAny>,
    #[pyo3(from_py_with = arguments::whole)] samples: u64,
    #[pyo3(from_py_with = arguments::whole)] min_spp: u32,
    #[pyo3(from_py_with = arguments::whole_or_none)] max_spp: Option<u32>,
) -> PyResult<Py<PyAny>> {
    let statistics = store.statistics(py);
    let (width, height) = (statistics.width(), statistics.height());
    let accepted = format!("a prpf.Denoised, or an array of numbers from 0 up of shape ({height}, {width})");
    let priority = match priority.cast::<Denoised>() {
        Ok(result) => self::priority(py, store, result.get(), None, None, None, None)?.into_bound(py),
        Err(_) => priority.clone(),
    };
    let priority = arrays::reals("priority", &priority, &[2], &accepted)?;
    if priority.shape() != [height, width] {
        return Err(arrays::wrong_shape("priority", priority.shape(), &accepted));
    }
    let priority = arrays::borrow("priority", &priority)?;
    let priority = priority.as_slice()?;
    let bounds = [min_spp, max_spp.unwrap_or(NO_CEILING)];
    let counts = py
        .detach(|| adaptive::next_counts(&statistics, priority, samples, bounds, store.seed))
        .map_err(value_error)?;
    arrays::map(py, counts, width)
}
