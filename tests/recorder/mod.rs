//! A host that records a render's checkpoints.

use prpf::progressive::{Checkpoint, Host, Progress, Settings};

/// A host with the checkpoints of a render.
#[derive(Default)]
pub struct Recorder {
    /// Seconds between two checkpoints; `None` records none.
    pub interval: Option<f64>,
    pub checkpoints: Vec<Checkpoint>,
    /// Whether the render is interrupted after its first step.
    pub interrupts: bool,
    /// Whether a step has been rendered.
    pub has_stepped: bool,
}

impl Recorder {
    /// Records as many checkpoints as possible.
    pub fn at_every_step() -> Self {
        Self { interval: Some(0.0), ..Self::default() }
    }
}

impl Host for Recorder {
    fn listen(&mut self, _: &Progress) {
        self.has_stepped = true;
    }

    fn is_interrupted(&self) -> bool {
        self.interrupts && self.has_stepped
    }

    fn checkpoint_interval(&self) -> Option<f64> {
        self.interval
    }

    fn save(&mut self, _: &Settings, checkpoint: Checkpoint) {
        self.checkpoints.push(checkpoint);
    }
}
