//! Denoisers: filtering a store, and the maps of the result.

use std::io;
use std::path::PathBuf;

use prpf::filter::learned::{self, WeightFileError};
use prpf::filter::{CancellablePool, DENOISERS, FilterResult, by_name, can_filter, draft_if_sparse};
use prpf::progressive::{ErrorEstimate, FilterPass, Filtered};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::{Error, file_error, open_failure, value_error};
use crate::store::Store;

/// See `__init__.pyi`.
#[pyclass(frozen, get_all, module = "prpf")]
pub struct Denoised {
    made_by: String,
    pub image: Py<PyAny>,
    halves: (Py<PyAny>, Py<PyAny>),
    pub variance: Py<PyAny>,
    error: Py<PyAny>,
    pub residual: Py<PyAny>,
    risk: Py<PyAny>,
    pub interpolation_failure: Option<Py<PyAny>>,
    estimate: Option<Py<Estimate>>,
    /// Of the filter pass.
    seconds: f64,
}

/// See `__init__.pyi`.
#[pyclass(frozen, get_all, module = "prpf")]
pub struct Estimate {
    relmse: f64,
    low: f64,
    high: f64,
    tiles: Py<PyAny>,
}

impl Denoised {
    /// Hands a result over to Python.
    pub fn new(py: Python, Filtered { result, estimate, seconds, .. }: Filtered) -> PyResult<Self> {
        let width = result.image.width();
        let map = |planes: prpf::image::Planes| arrays::map(py, planes.into_data(), width);
        let [first, second] = result.halves;
        Ok(Self {
            made_by: result.made_by.to_string(),
            image: arrays::image(py, result.image)?,
            halves: (arrays::image(py, first)?, arrays::image(py, second)?),
            variance: arrays::image(py, result.variance)?,
            error: map(result.error)?,
            residual: map(result.residual)?,
            risk: arrays::image(py, result.risk)?,
            interpolation_failure: result.interpolation.map(|found| map(found.failure)).transpose()?,
            estimate: estimate.map(|estimate| Py::new(py, Estimate::new(py, estimate)?)).transpose()?,
            seconds,
        })
    }
}

impl Estimate {
    fn new(py: Python, estimate: ErrorEstimate) -> PyResult<Self> {
        let [low, high] = estimate.interval();
        let columns = estimate.tiles.width();
        let tiles = arrays::map(py, estimate.tiles.into_data(), columns)?;
        Ok(Self { relmse: estimate.value, low, high, tiles })
    }
}

#[pymethods]
impl Denoised {
    fn __repr__(&self) -> String {
        format!("<prpf.Denoised by {}>", self.made_by)
    }
}

#[pymethods]
impl Estimate {
    fn __repr__(&self) -> String {
        format!("<prpf.Estimate relMSE {:.4} ({:.4} to {:.4})>", self.relmse, self.low, self.high)
    }
}

/// Returns the names of all denoisers.
#[pyfunction]
pub fn denoisers() -> Vec<String> {
    DENOISERS.iter().map(|denoiser| denoiser.name().to_string()).collect()
}

/// Filters by other weights of the learned filter.
#[pyfunction]
pub fn use_weights(py: Python, path: PathBuf) -> PyResult<()> {
    let message = |error: &WeightFileError| format!("{}: {error}", path.display());
    py.detach(|| learned::use_weights(&path)).map_err(|error| match &error {
        WeightFileError::Read(_) => {
            file_error(open_failure(&path).unwrap_or(io::ErrorKind::Other), message(&error))
        }
        WeightFileError::InUse => value_error(message(&error)),
        _ => Error::new_err(message(&error)),
    })
}

/// Filters a store.
#[pyfunction]
#[pyo3(signature = (store, denoiser="learned"))]
pub fn denoise(py: Python, store: &Store, denoiser: &str) -> PyResult<Denoised> {
    let denoiser = by_name(denoiser).map_err(value_error)?;
    let statistics = store.statistics(py);
    let denoiser = py.detach(|| {
        can_filter(denoiser, &statistics).map_err(value_error)?;
        PyResult::Ok(draft_if_sparse(&statistics, denoiser))
    })?;
    let pass = FilterPass { has_half_images: true, ..FilterPass::new(statistics, denoiser, store.seed) };
    let mut pool = py
        .detach(|| CancellablePool::new(rayon::current_num_threads()))
        .map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
    let mut interrupt = None;
    let mut is_interrupted = || {
        interrupt = interrupt.take().or_else(|| Python::attach(|py| py.check_signals()).err());
        interrupt.is_some()
    };
    match py.detach(|| pool.run(|| pass.run(), &mut is_interrupted)) {
        Some(Filtered { result: FilterResult { failure: Some(failure), .. }, .. }) => {
            Err(PyRuntimeError::new_err(failure))
        }
        Some(filtered) => Denoised::new(py, filtered),
        None => Err(interrupt.expect("only an interrupt cancels a pass")),
    }
}
