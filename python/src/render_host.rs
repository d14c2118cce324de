//! What surrounds a render loop in Python: a callback after every filter pass, a rule for counts, signals, files.

use std::sync::Arc;

use prpf::RenderedImage;
use prpf::filter::FilterResult;
use prpf::output::ImageOutput;
use prpf::progressive::{Checkpoint, Filtered, Host, Progress, Settings};
use prpf::render::SampleSink;
use prpf::state::{CheckpointError, Checkpoints, ImageMetadata, SampleFile};
use prpf::stats;
use pyo3::exceptions::PyRuntimeWarning;
use pyo3::prelude::*;

use crate::arrays;
use crate::denoising::Denoised;
use crate::errors::{checkpoint_error, value_error};
use crate::render_files::RenderFiles;
use crate::store::Store;

/// See `__init__.pyi`.
#[pyclass(frozen, get_all, module = "prpf")]
pub struct Pass {
    /// Counted from 0.
    index: usize,
    result: Py<Denoised>,
    store: Py<Store>,
}

/// See the module.
pub struct RenderHost<'a> {
    callback: Option<Py<PyAny>>,
    /// The function that chooses the counts of a batch.
    counts: Option<Py<PyAny>>,
    files: &'a RenderFiles,
    /// The state file.
    checkpoints: Option<Checkpoints>,
    /// The file that gets every sample.
    samples: Option<SampleFile>,
    metadata: ImageMetadata,
    seed: u64,
    /// Passes so far.
    passes: usize,
    /// The latest pass, until the counts that follow it are chosen.
    latest: Option<Py<Pass>>,
    /// Whether the callback has asked for the end.
    is_stopped: bool,
    /// A signal or an exception that ends the render and is raised after it.
    interruption: Option<PyErr>,
}

impl<'a> RenderHost<'a> {
    /// Surrounds a render of the image `metadata` by the samples of `seed`. States go to `checkpoints`, sample vectors to `samples`.
    pub fn new(
        callback: Option<Py<PyAny>>,
        counts: Option<Py<PyAny>>,
        files: &'a RenderFiles,
        checkpoints: Option<Checkpoints>,
        samples: Option<SampleFile>,
        metadata: ImageMetadata,
        seed: u64,
    ) -> Self {
        Self {
            callback,
            counts,
            files,
            checkpoints,
            samples,
            metadata,
            seed,
            passes: 0,
            latest: None,
            is_stopped: false,
            interruption: None,
        }
    }

    /// Writes the image, and ends the files of states and samples. Returns what has ended the render early, then why files
    /// could not be written.
    pub fn finish(self, image: &RenderedImage) -> Vec<PyErr> {
        let output = self.files.write_output(image).err();
        let state = self.checkpoints.and_then(|checkpoints| checkpoints.wait().err());
        let state = state.map(|error| checkpoint_error(&error));
        let samples = self.files.finish_samples(self.samples).err();
        // During the last pass nobody listened
        let interruption = self.interruption.or_else(|| Python::attach(|py| py.check_signals()).err());
        [interruption, state, samples, output].into_iter().flatten().collect()
    }

    /// Hands a pass over to the callback and to the choice of counts.
    fn hand_over(&mut self, filtered: &Filtered, store: &Arc<stats::Store>) -> PyResult<()> {
        // Copied while other threads run
        let filtered = filtered.clone();
        let store = Store::wrap(store.clone(), self.metadata.clone(), self.seed);
        Python::attach(|py| {
            let pass = Pass {
                index: self.passes,
                result: Py::new(py, Denoised::new(py, filtered)?)?,
                store: Py::new(py, store)?,
            };
            let pass = Py::new(py, pass)?;
            if let Some(callback) = &self.callback {
                self.is_stopped |= callback.bind(py).call1((pass.clone_ref(py),))?.is_truthy()?;
            }
            // Kept no longer than needed: the store is copied if it changes meanwhile.
            self.latest = self.counts.is_some().then_some(pass);
            Ok(())
        })
    }

    /// Calls the choice of counts; returns its counts.
    fn choose(
        &self,
        counts: &Py<PyAny>,
        pass: Py<Pass>,
        size: [usize; 2],
        planned: &[u32],
    ) -> PyResult<Vec<u32>> {
        let total = |counts: &[u32]| counts.iter().map(|&count| u64::from(count)).sum::<u64>();
        let (most, planned) = (total(planned), planned.to_vec());
        let chosen = Python::attach(|py| {
            let planned = arrays::map(py, planned, size[1])?;
            let chosen = counts.bind(py).call1((pass, planned))?;
            arrays::counts("counts", &chosen, size)
        })?;
        let sum = total(&chosen);
        if !(1..=most).contains(&sum) {
            return Err(value_error(format!(
                "counts: found {sum} samples in all; accepted are 1 to {most}, those of the planned batch"
            )));
        }
        Ok(chosen)
    }
}

impl Host for RenderHost<'_> {
    fn listen(&mut self, _progress: &Progress) {
        let problem = self.checkpoints.as_mut().and_then(Checkpoints::problem);
        if self.interruption.is_none() {
            let heard = Python::attach(|py| {
                problem.map_or(Ok(()), |problem| warn_of(py, &problem))?;
                py.check_signals()
            });
            self.interruption = heard.err();
        }
    }

    fn complete_pass(&mut self, filtered: &Filtered, store: &Arc<stats::Store>) {
        if self.interruption.is_none() && (self.callback.is_some() || self.counts.is_some()) {
            self.interruption = self.hand_over(filtered, store).err();
        }
        self.passes += 1;
    }

    fn choose_counts(&mut self, store: &Arc<stats::Store>, planned: Vec<u32>) -> Vec<u32> {
        let (Some(counts), Some(pass), None) = (&self.counts, self.latest.take(), &self.interruption) else {
            return planned;
        };
        match self.choose(counts, pass, [store.height(), store.width()], &planned) {
            Ok(chosen) => chosen,
            Err(error) => {
                self.interruption = Some(error);
                planned
            }
        }
    }

    fn is_interrupted(&self) -> bool {
        self.is_stopped || self.interruption.is_some()
    }

    fn sample_sink(&mut self) -> Option<&mut dyn SampleSink> {
        self.samples.as_mut().map(|file| file as &mut dyn SampleSink)
    }

    fn encode_and_discard(&self, settings: &Settings, result: &FilterResult, rows: &stats::Store) {
        self.files.encode_output_and_discard(&ImageOutput::interim(result, rows, settings, &self.metadata));
        self.checkpoints.iter().for_each(|checkpoints| checkpoints.write_and_discard(settings, rows));
    }

    fn checkpoint_interval(&self) -> Option<f64> {
        self.checkpoints.as_ref().map(Checkpoints::interval)
    }

    fn save(&mut self, settings: &Settings, checkpoint: Checkpoint) {
        // What a signal or an exception has ended is saved, too
        if let Some(checkpoints) = &self.checkpoints {
            checkpoints.save(settings, checkpoint);
        }
    }
}

/// Warns of a state that could not be written.
///
/// # Errors
/// The warning, where Python makes exceptions of warnings.
fn warn_of(py: Python, problem: &CheckpointError) -> PyResult<()> {
    let message = format!("{problem}; the render goes on");
    py.import("warnings")?.call_method1("warn", (message, py.get_type::<PyRuntimeWarning>()))?;
    Ok(())
}
