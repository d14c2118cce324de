//! What surrounds a render loop in Python: a callback after every filter pass, signals, the state file.

use std::path::PathBuf;
use std::sync::Arc;

use prpf::progressive::{Checkpoint, Filtered, Host, Progress, Settings};
use prpf::render::Shard;
use prpf::state::{ImageMetadata, RenderState, Stream};
use prpf::stats;
use pyo3::prelude::*;

use crate::denoising::Denoised;
use crate::errors::state_error;
use crate::store::Store;

/// See `prpf.pyi`.
#[pyclass(frozen, get_all, module = "prpf")]
pub struct Pass {
    /// Counted from 0.
    index: usize,
    result: Py<Denoised>,
    store: Py<Store>,
}

/// See the module.
pub struct RenderHost {
    pub callback: Option<Py<PyAny>>,
    pub state: Option<PathBuf>,
    pub metadata: ImageMetadata,
    pub seed: u64,
    /// Passes so far.
    pub passes: usize,
    /// Whether the callback has asked for the end.
    pub is_stopped: bool,
    /// What ends the render and is raised after it.
    pub error: Option<PyErr>,
}

impl RenderHost {
    /// Calls the callback; returns whether it asks for the end.
    fn call(&self, callback: &Py<PyAny>, filtered: &Filtered, store: &Arc<stats::Store>) -> PyResult<bool> {
        Python::attach(|py| {
            let pass = Pass {
                index: self.passes,
                result: Py::new(py, Denoised::new(py, filtered.clone())?)?,
                store: Py::new(py, Store::wrap(store.clone(), self.seed))?,
            };
            callback.bind(py).call1((pass,))?.is_truthy()
        })
    }
}

impl Host for RenderHost {
    fn listen(&mut self, _progress: &Progress) {
        if self.error.is_none() {
            self.error = Python::attach(|py| py.check_signals()).err();
        }
    }

    fn complete_pass(&mut self, filtered: &Filtered, store: &Arc<stats::Store>) {
        if let (Some(callback), None) = (&self.callback, &self.error) {
            match self.call(callback, filtered, store) {
                Ok(stop) => self.is_stopped |= stop,
                Err(error) => self.error = Some(error),
            }
        }
        self.passes += 1;
    }

    fn is_interrupted(&self) -> bool {
        self.is_stopped || self.error.is_some()
    }

    fn checkpoint_interval(&self) -> Option<f64> {
        // Only the checkpoint at the end
        self.state.as_ref().map(|_| f64::INFINITY)
    }

    fn save(&mut self, settings: &Settings, checkpoint: Checkpoint) {
        let (Some(path), None) = (&self.state, &self.error) else { return };
        let state = RenderState {
            metadata: self.metadata.clone(),
            settings: settings.clone(),
            streams: vec![Stream::new(settings.seed, Shard::WHOLE)],
            checkpoint,
        };
        self.error = state.write(path).map_err(state_error).err();
    }
}
