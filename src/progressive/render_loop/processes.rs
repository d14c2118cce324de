//! The render loop of several processes.

use std::sync::Arc;

use super::RenderLoop;
use crate::progressive::filter_pass::{FilterPass, Filtered};
use crate::progressive::process_group::ProcessGroup;

impl<'a> RenderLoop<'a> {
    /// Divides the work among several processes, of which this is the first. A checkpoint has to be given before.
    pub fn with_processes(mut self, processes: &'a mut dyn ProcessGroup) -> Self {
        processes.begin(&self.checkpoint.store);
        self.processes = Some(processes);
        self
    }

    /// Runs a filter pass on this thread, with all processes if they can share the work.
    pub fn run_pass(&mut self, pass: FilterPass) -> Filtered {
        let Some(processes) = &mut self.processes else { return pass.run() };
        pass.run_with(|FilterPass { store, denoiser, seed, .. }| {
            processes.filter(*denoiser, store).unwrap_or_else(|| denoiser.filter(store, *seed))
        })
    }

    /// Brings the statistics of all processes together.
    pub(super) fn gather(&mut self) {
        if let (Some(processes), true) = (&mut self.processes, self.is_behind) {
            // Copies only while an earlier checkpoint is in use.
            processes.gather(Arc::make_mut(&mut self.checkpoint.store));
            self.is_behind = false;
        }
    }
}
