//! Renders that commands replace, or another scene: they are kept, and can be had back.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::Controller;
use super::region_passes::RegionPasses;
use crate::adaptive::Sampling;
use crate::image::Planes;
use crate::memory::format_bytes;
use crate::preview::generation_record::GenerationRecord;
use crate::preview::history::{HistoryStep, KeptRender, MOST_KEPT};
use crate::preview::orbit_camera::OrbitCamera;
use crate::preview::scene_sessions::{SceneRenders, SceneSession};
use crate::preview::status::{DenoiserInfo, HistoryStatus, MostSpp, Phase};
use crate::progressive::{Checkpoint, RenderLoop, Settings, memory_needed};
use crate::render::Renderer;
use crate::stats::Store;

/// Seconds of a render from which the notice stays that it cannot be had back.
const LONG_RENDER: f64 = 30.0;

impl Controller<'_> {
    /// Takes what was made of this scene before another one was opened.
    pub(super) fn take_session(&mut self) {
        if let Some(notice) = self.configuration.notice.take() {
            self.reporter.notice(notice, true);
        }
        let Some(session) = self.configuration.session.take() else { return };
        if session.hash != self.configuration.scene.hash {
            let text = "the scene's files have changed: its earlier renders were discarded";
            return self.reporter.notice(text.to_owned(), true);
        }
        self.bookmarks = session.bookmarks;
        if let Some(SceneRenders { history, current }) = session.renders {
            self.history = history;
            self.take_back(current);
        }
    }

    /// Returns what was made of this scene, for the time when it is opened again.
    pub(super) fn session(&mut self, current: KeptRender) -> SceneSession {
        SceneSession {
            hash: self.configuration.scene.hash.clone(),
            bookmarks: std::mem::take(&mut self.bookmarks),
            renders: Some(SceneRenders { history: std::mem::take(&mut self.history), current }),
        }
    }

    /// Returns when the clock of a render that comes back started; `None` if none does.
    pub(super) fn next_start(&self) -> Option<Instant> {
        let seconds = self.returning.as_ref()?.seconds();
        Instant::now().checked_sub(Duration::from_secs_f64(seconds))
    }

    pub(super) fn begin_generation(
        &mut self,
        renderer: &Renderer,
        record: GenerationRecord,
        reference: Option<Arc<Planes>>,
    ) {
        self.pending.clear_for_generation();
        self.reporter.begin(renderer.layout(), &self.configuration.settings, record, reference);
        self.viewer_pass_seconds = 0.0;
        self.region_passes = RegionPasses::default();
    }

    /// Keeps a render that a command replaces, with its camera and settings.
    pub(super) fn keep_render(
        &mut self,
        render_loop: RenderLoop,
        (camera, settings): (Option<OrbitCamera>, Settings),
    ) {
        let render = self.kept_render(render_loop, camera, settings);
        self.keeps_checkpoints = false;
        let dropped = self.history.keep(render);
        self.notice_discarded(&dropped);
        // No pass of theirs may still read their stores.
        self.spare = dropped.into_iter().filter_map(|render| Arc::into_inner(render.checkpoint.store)).next();
    }

    /// Tells which renders worth keeping cannot be had back any more.
    fn notice_discarded(&mut self, dropped: &[KeptRender]) {
        let lost: Vec<_> =
            dropped.iter().filter(|render| render.is_worth_it()).map(KeptRender::description).collect();
        if lost.is_empty() {
            return;
        }
        let limit = self.history.byte_limit().map(|limit| format!(", in {} of memory", format_bytes(limit)));
        let text = format!(
            "cannot be had back any more: {}. At most {MOST_KEPT} renders are kept{}",
            lost.join(", "),
            limit.unwrap_or_default()
        );
        self.reporter.notice(text, dropped.iter().any(|render| render.seconds() >= LONG_RENDER));
    }

    /// Starts the loop of a new render: with the spare store, if that fits.
    pub(super) fn new_loop<'r>(&mut self, renderer: &'r Renderer<'r>, start: Instant) -> RenderLoop<'r> {
        let settings = &self.configuration.settings;
        let fits = |store: &Store| {
            (store.width(), store.height()) == renderer.resolution()
                && store.layout() == renderer.layout()
                && store.capacity() == settings.reservoir_capacity()
        };
        match self.spare.take().filter(fits) {
            Some(mut store) => {
                store.clear();
                RenderLoop::resume(renderer, settings, start, Checkpoint::new(store))
            }
            None => RenderLoop::new(renderer, settings, start),
        }
    }

    /// Lets the render before or after this one come back.
    pub(super) fn return_to(&mut self, step: HistoryStep, render_loop: RenderLoop) {
        let current = self.current_render(render_loop);
        let next = self.history.exchange(step, current);
        self.take_back(next);
    }

    /// Lets a render be the next generation.
    fn take_back(&mut self, render: KeptRender) {
        self.camera = render.camera.clone();
        self.configuration.settings = render.settings.clone();
        self.keeps_checkpoints = render.keeps_checkpoints;
        self.returning = Some(render);
    }

    /// Returns the current render, which ends.
    pub(super) fn current_render(&mut self, render_loop: RenderLoop) -> KeptRender {
        let settings = render_loop.settings().clone();
        self.kept_render(render_loop, self.camera.clone(), settings)
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
            // One that came back may be left before it is finished again.
            is_kept_if_short: self.has_returned || self.reporter.phase() == Phase::Finished,
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
                begins_anew: !settings.are_met_by(store),
                memory_bytes: memory_needed(&self.layout_for(&settings), &settings, size, keeps),
            }
        };
        self.denoisers.iter().map(info).collect()
    }

    pub(super) fn most_spp_kept(&self, store: &Store) -> MostSpp {
        let most = |sampling| {
            let settings = Settings { sampling, ..self.configuration.settings.clone() };
            settings.most_spp_kept(store.capacity())
        };
        MostSpp { uniform: most(Sampling::Uniform), adaptive: most(Sampling::Adaptive) }
    }

    pub(super) fn history_status(&self, store: &Store) -> HistoryStatus {
        HistoryStatus {
            undo: self.history.description(HistoryStep::Undo),
            redo: self.history.description(HistoryStep::Redo),
            has_room: self.history.has_room(store),
        }
    }
}
