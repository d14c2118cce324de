//! The whole render loop.

use std::path::PathBuf;
use std::sync::Arc;

use prpf::RenderedImage;
use prpf::adaptive::PrioritySettings;
use prpf::filter::by_name;
use prpf::progressive::{Filtered, Outcome, PassRecord, RecordedStatistics, Settings};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments;
use crate::arrays;
use crate::denoising::Denoised;
use crate::errors::{chain, value_error};
use crate::limits::Limits;
use crate::placement::Placement;
use crate::render_files::RenderFiles;
use crate::render_job::RenderJob;
use crate::scene::Scene;
use crate::store::Store;

/// See `__init__.pyi`.
#[pyclass(frozen, get_all, module = "prpf")]
pub struct Render {
    result: Py<Denoised>,
    store: Py<Store>,
    passes: Vec<Py<PyDict>>,
    stopped_by: String,
    /// Of rendering, filtering and allocation.
    seconds: Py<PyDict>,
}

impl Render {
    fn new(py: Python, RenderedImage { outcome, metadata }: RenderedImage) -> PyResult<Self> {
        let seconds = PyDict::new(py);
        seconds.set_item("render", outcome.seconds.render)?;
        seconds.set_item("filter", outcome.seconds.filter)?;
        seconds.set_item("calibrate", outcome.seconds.calibrate)?;
        seconds.set_item("allocate", outcome.seconds.allocate)?;
        let last = outcome.passes.last().map_or(0.0, |pass| pass.filter_seconds);
        let Outcome { result, side, estimate, .. } = outcome;
        let filtered = Filtered { result, side, estimate, seconds: last };
        Ok(Self {
            passes: outcome.passes.iter().map(|pass| record(py, pass)).collect::<PyResult<_>>()?,
            result: Py::new(py, Denoised::new(py, filtered)?)?,
            store: Py::new(py, Store::wrap(Arc::new(outcome.store), metadata, outcome.settings.seed))?,
            stopped_by: outcome.stopped_by.to_string(),
            seconds: seconds.unbind(),
        })
    }
}

/// Returns the record of a pass under the names of the report.
fn record(py: Python, pass: &PassRecord) -> PyResult<Py<PyDict>> {
    let record = PyDict::new(py);
    record.set_item("index", pass.index)?;
    record.set_item("seconds", pass.seconds)?;
    record.set_item("samples_total", pass.samples_total)?;
    record.set_item("filter_seconds", pass.filter_seconds)?;
    record.set_item("interpolation_success", pass.interpolation_success)?;
    record.set_item("expected_ratio", pass.expected_ratio)?;
    record.set_item("estimated_error", pass.estimated_error)?;
    record.set_item("estimated_unfiltered_error", pass.estimated_unfiltered_error)?;
    record.set_item("mse", pass.mse)?;
    record.set_item("relmse", pass.relmse)?;
    record.set_item("noisy_mse", pass.noisy_mse)?;
    record.set_item("noisy_relmse", pass.noisy_relmse)?;
    Ok(record.unbind())
}

#[pymethods]
impl Render {
    fn __repr__(&self) -> String {
        format!("<prpf.Render of {} passes, stopped by {}>", self.passes.len(), self.stopped_by)
    }
}

/// Renders, filters and allocates until a budget is spent.
#[pyfunction]
#[pyo3(signature = (scene, *, spp=None, time=None, target_error=None, sampling=None, sample_map=None,
                    sample_map_values="relative", denoiser="learned", seed=0,
                    min_spp=None, max_spp=None, reservoir=0, statistics=None, reference=None, callback=None, counts=None,
                    output=None, state=None, state_every=40.0, resume=None, samples=None))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub fn render(
    py: Python,
    scene: &Scene,
    #[pyo3(from_py_with = arguments::whole_or_none)] spp: Option<u32>,
    time: Option<f64>,
    target_error: Option<f64>,
    sampling: Option<&str>,
    sample_map: Option<&Bound<PyAny>>,
    sample_map_values: &str,
    denoiser: &str,
    #[pyo3(from_py_with = arguments::whole)] seed: u64,
    #[pyo3(from_py_with = arguments::whole_or_none)] min_spp: Option<u32>,
    #[pyo3(from_py_with = arguments::whole_or_none)] max_spp: Option<u32>,
    #[pyo3(from_py_with = arguments::whole)] reservoir: usize,
    statistics: Option<&str>,
    reference: Option<&Bound<PyAny>>,
    #[pyo3(from_py_with = arguments::function_or_none)] callback: Option<Py<PyAny>>,
    #[pyo3(from_py_with = arguments::function_or_none)] counts: Option<Py<PyAny>>,
    output: Option<PathBuf>,
    state: Option<PathBuf>,
    state_every: f64,
    resume: Option<PathBuf>,
    samples: Option<PathBuf>,
) -> PyResult<Py<Render>> {
    // Check the arguments before minutes of rendering
    let placement = Placement::new(sampling, sample_map, sample_map_values, counts.is_some(), scene)?;
    let limits = Limits { spp, seconds: time, target_error, min_spp, max_spp };
    let [min_spp, max_spp] = limits.bounds();
    let settings = Settings {
        budget: limits.budget(&placement, scene)?,
        sampling: placement.sampling,
        sample_map: placement.sample_map,
        denoiser: by_name(denoiser).map_err(value_error)?,
        seed,
        min_spp,
        max_spp,
        reservoir,
        priority: priority_settings(counts.is_some()),
        statistics: RecordedStatistics::All,
    };
    settings.validate().map_err(value_error)?;
    let statistics = statistics.map(statistics_kept).transpose()?;
    let files = py.detach(|| RenderFiles::new(&scene.scene, output, state, state_every, resume, samples))?;
    let reference = reference.map(|reference| arrays::rgb("reference", reference)).transpose()?;

    // Render
    let job = RenderJob { scene, settings, statistics, files, reference, callback, counts };
    let (rendered, errors) = py.detach(|| job.run())?;
    let render = Py::new(py, Render::new(py, rendered)?)?;
    let Some(error) = chain(py, errors) else { return Ok(render) };
    // An exception of a callback may be of a class that takes no attributes
    let _ = error.value(py).setattr("render", render);
    Err(error)
}

/// Returns the settings of priorities. Where a function chooses counts, every batch follows a pass: ours would do without
/// where it expects little of them.
fn priority_settings(has_counts: bool) -> PrioritySettings {
    let default = PrioritySettings::default();
    if has_counts { PrioritySettings { max_ratio: 1.0, ..default } } else { default }
}

/// Returns which statistics a render keeps, by its name.
///
/// # Errors
/// An unknown name.
fn statistics_kept(name: &str) -> PyResult<RecordedStatistics> {
    match name {
        "all" => Ok(RecordedStatistics::All),
        "needed" => Ok(RecordedStatistics::Needed),
        _ => Err(value_error(format!("statistics: found `{name}`; accepted are all and needed"))),
    }
}
