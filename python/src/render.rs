//! The whole render loop.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use prpf::adaptive::{MapValues, NO_CEILING, PrioritySettings, SampleMap, Sampling};
use prpf::files::error_message;
use prpf::filter::by_name;
use prpf::image::OutputFormat;
use prpf::output::paths::{are_distinct, replaces_no_state, replaces_state};
use prpf::progressive::{Budget, Filtered, Outcome, PassRecord, RecordedStatistics, Settings};
use prpf::render::Shard;
use prpf::state::{ImageMetadata, RenderState, SampleFile, Stream};
use prpf::stats::BlockSet;
use prpf::{RenderBuilder, RenderedImage};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments;
use crate::arrays;
use crate::denoising::Denoised;
use crate::errors::{Error, file_error, image_error, render_error, state_error, value_error};
use crate::paths::can_be_written;
use crate::render_host::RenderHost;
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
                    min_spp=4, max_spp=None, reservoir=0, statistics="all", reference=None, callback=None, counts=None,
                    output=None, state=None, resume=None, samples=None))]
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
    #[pyo3(from_py_with = arguments::whole)] min_spp: u32,
    #[pyo3(from_py_with = arguments::whole_or_none)] max_spp: Option<u32>,
    #[pyo3(from_py_with = arguments::whole)] reservoir: usize,
    statistics: &str,
    reference: Option<&Bound<PyAny>>,
    #[pyo3(from_py_with = arguments::function_or_none)] callback: Option<Py<PyAny>>,
    #[pyo3(from_py_with = arguments::function_or_none)] counts: Option<Py<PyAny>>,
    output: Option<PathBuf>,
    state: Option<PathBuf>,
    resume: Option<PathBuf>,
    samples: Option<PathBuf>,
) -> PyResult<Render> {
    // Check the arguments before minutes of rendering
    let sample_map = sample_map.map(|map| self::sample_map(map, sample_map_values, scene)).transpose()?;
    let default = if sample_map.is_some() { "uniform" } else { "adaptive" };
    let sampling = self::sampling(sampling.unwrap_or(default))?;
    if sampling == Sampling::Adaptive && sample_map.is_some() {
        return Err(value_error("sampling: found adaptive with sample_map; accepted is one of them"));
    }
    if counts.is_some() && sampling == Sampling::Uniform {
        return Err(value_error(
            "counts: found a function with uniform sampling; accepted is one with adaptive sampling",
        ));
    }
    if let (Some(spp), Some(_)) = (spp, sample_map.as_ref().and_then(SampleMap::total)) {
        return Err(value_error(format!(
            "spp: found {spp} with absolute counts, which give the number of samples; accepted is one of them"
        )));
    }
    let settings = Settings {
        budget: Budget { spp, seconds: time, target_error },
        sampling,
        sample_map,
        denoiser: by_name(denoiser).map_err(value_error)?,
        seed,
        min_spp,
        max_spp: max_spp.unwrap_or(NO_CEILING),
        reservoir,
        priority: priority_settings(counts.is_some()),
        statistics: statistics_kept(statistics)?,
    };
    if let Some(path) = &output {
        OutputFormat::from_path(path).map_err(image_error)?;
    }
    check_files(&scene.scene, [&output, &samples], &state)?;
    let reference = reference.map(|reference| arrays::rgb("reference", reference)).transpose()?;

    // Render
    let rendered = py.detach(|| {
        let mut builder = RenderBuilder::new(&scene.scene).settings(settings.clone());
        if let Some(reference) = &reference {
            builder = builder.reference(reference);
        }
        let renderer = scene.renderer(seed);
        let metadata = ImageMetadata::new(&scene.scene, &renderer);
        if let Some(path) = resume {
            let found = RenderState::read(&path).map_err(state_error)?;
            let stream = Stream::new(seed, Shard::WHOLE);
            // A file of sample vectors has every dimension
            let asked = if samples.is_some() { BlockSet::ALL } else { BlockSet::NONE };
            found
                .can_resume(&metadata, stream, renderer.layout(), &settings, asked)
                .map_err(|error| Error::new_err(format!("{}: {error}", path.display())))?;
            builder = builder.resume(found.checkpoint);
        }
        let begin = |path: &PathBuf| SampleFile::begin(path, renderer.layout());
        let mut host = RenderHost {
            samples: samples
                .as_ref()
                .map(begin)
                .transpose()
                .map_err(|error| cannot_write(&samples, error))?,
            callback,
            counts,
            state,
            metadata,
            seed,
            passes: 0,
            latest: None,
            is_stopped: false,
            error: None,
        };
        let rendered = builder.run_with(&mut host).map_err(render_error)?;
        let finished = host.samples.map_or(Ok(()), SampleFile::finish);
        match host.error {
            Some(error) => Err(error),
            None => finished.map(|()| rendered).map_err(|error| cannot_write(&samples, error)),
        }
    })?;
    if let Some(path) = &output {
        py.detach(|| rendered.write(path)).map_err(image_error)?;
    }
    Render::new(py, rendered)
}

/// Checks that the files to write are different ones that can be written, and replace nothing but earlier outputs.
///
/// # Errors
/// The first one that cannot.
fn check_files(
    scene: &prpf::scene::Scene,
    outputs: [&Option<PathBuf>; 2],
    state: &Option<PathBuf>,
) -> PyResult<()> {
    let mut files: Vec<&Path> = outputs.into_iter().flatten().map(PathBuf::as_path).collect();
    files.iter().try_for_each(|path| replaces_no_state(path)).map_err(value_error)?;
    state.as_deref().map_or(Ok(false), replaces_state).map_err(value_error)?;
    files.extend(state.as_deref());
    are_distinct(scene.files.iter().map(PathBuf::as_path), &files).map_err(value_error)?;
    files.into_iter().try_for_each(can_be_written)
}

/// The exception of a file of samples that cannot be written.
fn cannot_write(path: &Option<PathBuf>, error: io::Error) -> PyErr {
    let name = path.as_deref().unwrap_or(Path::new("")).display();
    file_error(error.kind(), format!("{name}: cannot write the samples: {}", error_message(&error)))
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
    SampleMap::new(values, kind).map_err(|error| value_error(format!("sample_map: {error}")))
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
