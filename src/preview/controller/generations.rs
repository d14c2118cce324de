//! Renders that commands replace: they are kept, and can be had back.

use std::time::{Duration, Instant};

use super::Controller;
use crate::preview::history::{HistoryStep, KeptRender};
use crate::preview::orbit_camera::OrbitCamera;
use crate::preview::status::{DenoiserInfo, HistoryStatus, Phase};
use crate::progressive::{RenderLoop, Settings, memory_needed};
use crate::stats::Store;

impl Controller<'_> {
    /// Returns when the clock of the next generation starts: that of a render that comes back goes on.
    pub(super) fn next_start(&self) -> Instant {
        let seconds = self.returning.as_ref().map_or(0.0, KeptRender::seconds);
        let now = Instant::now();
        now.checked_sub(Duration::from_secs_f64(seconds)).unwrap_or(now)
    }

    /// Keeps a render that a command replaces, with its camera and settings.
    pub(super) fn keep_render(
        &mut self,
        render_loop: RenderLoop,
        (camera, settings): (Option<OrbitCamera>, Settings),
    ) {
        let render = self.kept_render(render_loop, camera, settings);
        self.keeps_checkpoints = false;
        self.history.keep(render);
    }

    /// Lets the render before or after this one come back.
    pub(super) fn return_to(&mut self, step: HistoryStep, render_loop: RenderLoop) {
        let settings = render_loop.settings().clone();
        let current = self.kept_render(render_loop, self.camera.clone(), settings);
        let next = self.history.exchange(step, current);
        self.camera = next.camera.clone();
        self.configuration.settings = next.settings.clone();
        self.keeps_checkpoints = next.keeps_checkpoints;
        self.returning = Some(next);
    }

    fn kept_render(
        &mut self,
        render_loop: RenderLoop,
        camera: Option<OrbitCamera>,
        settings: Settings,
    ) -> KeptRender {
        KeptRender {
            camera,
            settings,
            checkpoint: render_loop.into_checkpoint(),
            is_finished: self.reporter.phase() == Phase::Finished,
            record: self.reporter.take_record(),
            keeps_checkpoints: self.keeps_checkpoints,
        }
    }

    /// Returns the denoisers that this machine has, with what choosing each costs.
    pub(super) fn denoiser_infos(&self, store: &Store) -> Vec<DenoiserInfo> {
        let keeps = self.keeps_checkpoints && self.configuration.host.checkpoint_interval().is_some();
        let info = |&denoiser| {
            let settings = Settings { denoiser, ..self.configuration.settings.clone() };
            let size = (store.width(), store.height());
            DenoiserInfo {
                name: denoiser.name(),
                summary: denoiser.summary(),
                begins_anew: settings.reservoir_capacity() > store.capacity(),
                memory_bytes: memory_needed(store.layout(), &settings, size, keeps),
            }
        };
        self.denoisers.iter().map(info).collect()
    }

    pub(super) fn history_status(&self, store: &Store) -> HistoryStatus {
        HistoryStatus {
            undo: self.history.description(HistoryStep::Undo),
            redo: self.history.description(HistoryStep::Redo),
            has_room: self.history.has_room(store),
        }
    }
}
