//! What surrounds a render loop in Python: a callback after every filter pass, a rule for counts, signals, the state file.

use std::sync::Arc;

use prpf::RenderedImage;
use prpf::progressive::{Checkpoint, Filtered, Host, Progress, Settings};
use prpf::render::SampleSink;
use prpf::state::{ImageMetadata, SampleFile};
use prpf::stats;
use pyo3::prelude::*;

use crate::arrays;
use crate::denoising::Denoised;
use crate::errors::value_error;
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
    /// Why the state could not be written. The render does not end by it.
    state_error: Option<PyErr>,
}

impl<'a> RenderHost<'a> {
    /// Surrounds a render of the image `metadata` by the samples of `seed`, which go to the file `samples` as well.
    pub fn new(
        callback: Option<Py<PyAny>>,
        counts: Option<Py<PyAny>>,
        files: &'a RenderFiles,
        samples: Option<SampleFile>,
        metadata: ImageMetadata,
        seed: u64,
    ) -> Self {
        Self {
            callback,
            counts,
            files,
            samples,
            metadata,
            seed,
            passes: 0,
            latest: None,
            is_stopped: false,
            interruption: None,
            state_error: None,
        }
    }

    /// Writes the image, and ends the file of samples. Returns what has ended the render early, then why files could not be
    /// written.
    pub fn finish(self, image: &RenderedImage) -> Vec<PyErr> {
        let samples = self.files.finish_samples(self.samples).err();
        let output = self.files.write_output(image).err();
        // During the last pass nobody listened
        let interruption = self.interruption.or_else(|| Python::attach(|py| py.check_signals()).err());
        [interruption, self.state_error, samples, output].into_iter().flatten().collect()
    }

    /// Hands a pass over to the callback and to the choice of counts.
    fn hand_over(&mut self, filtered: &Filtered, store: &Arc<stats::Store>) -> PyResult<()> {
        Python::attach(|py| {
            let pass = Pass {
                index: self.passes,
                result: Py::new(py, Denoised::new(py, filtered.clone())?)?,
                store: Py::new(py, Store::wrap(store.clone(), self.metadata.clone(), self.seed))?,
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
        Python::attach(|py| {
            let most: u64 = planned.iter().map(|&count| u64::from(count)).sum();
            let planned = arrays::map(py, planned.to_vec(), size[1])?;
            let chosen = counts.bind(py).call1((pass, planned))?;
            let chosen = arrays::counts("counts", &chosen, size)?;
            let sum: u64 = chosen.iter().map(|&count| u64::from(count)).sum();
            if !(1..=most).contains(&sum) {
                return Err(value_error(format!(
                    "counts: found {sum} samples in all; accepted are 1 to {most}, those of the planned batch"
                )));
            }
            Ok(chosen)
        })
    }
}

impl Host for RenderHost<'_> {
    fn listen(&mut self, _progress: &Progress) {
        if self.interruption.is_none() {
            self.interruption = Python::attach(|py| py.check_signals()).err();
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

    fn checkpoint_interval(&self) -> Option<f64> {
        // Only the checkpoint at the end
        self.files.has_state().then_some(f64::INFINITY)
    }

    fn save(&mut self, settings: &Settings, checkpoint: Checkpoint) {
        // What a signal or an exception has ended is saved, too
        self.state_error = self.files.write_state(&self.metadata, settings, checkpoint).err();
    }
}
