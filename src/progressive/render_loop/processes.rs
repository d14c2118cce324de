//! The render loop of several processes.

use std::sync::Arc;

use super::RenderLoop;
use crate::filter::Denoiser;
use crate::progressive::filter_pass::{FilterPass, Filtered};
use crate::progressive::process_group::ProcessGroup;
use crate::stats::StatisticsExtent;

impl<'a> RenderLoop<'a> {
    /// Divides the work among several processes, of which this is the first. A checkpoint has to be given before.
    pub fn with_processes(mut self, processes: &'a mut dyn ProcessGroup) -> Self {
        processes.begin(&self.checkpoint.store);
        self.processes = Some(processes);
        self
    }

    /// Runs a filter pass on this thread, with all processes if they can share the work.
    pub fn run_pass(&mut self, pass: FilterPass) -> Filtered {
        pass.run_with(self.processes.as_deref_mut())
    }

    /// Brings statistics of all processes together.
    pub(super) fn gather(&mut self, extent: StatisticsExtent) {
        if let (Some(processes), true) = (&mut self.processes, self.gathered < Some(extent)) {
            // Copies only while an earlier checkpoint is in use.
            processes.gather(Arc::make_mut(&mut self.checkpoint.store), extent);
            self.gathered = Some(extent);
        }
    }

    /// Brings together what this process reads in a filter pass, shared if possible, and after it.
    pub(super) fn gather_for_pass(&mut self, denoiser: &'static dyn Denoiser, has_half_images: bool) {
        self.gather(if denoiser.parts().is_some() && !(has_half_images && denoiser.is_judged_by_halves()) {
            StatisticsExtent::Radiance
        } else {
            StatisticsExtent::All
        });
        let store = &self.checkpoint.store;
        if self.processes.as_ref().is_some_and(|processes| !processes.can_share(denoiser, store)) {
            self.gather(StatisticsExtent::All);
        }
    }
}
