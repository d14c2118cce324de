//! Drives a render loop for its viewers: publishes frames, and handles commands between two steps, which are at most about
//! 0.15 s apart.
//!
//! Changed settings apply where the loop is. A command that discards the samples (another view, a restart) starts a new
//! loop with an empty store: a new *generation*. A filter pass runs on threads of its own and is given up when a new
//! generation begins, so that no movement of the camera waits for it.

mod camera;
mod coarse_look;
mod coarse_passes;
mod commands;
mod generations;
mod image_requests;
mod region_passes;
mod viewer_passes;

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam::channel::RecvTimeoutError;

use self::region_passes::RegionPasses;
use super::background_pass::{BackgroundPass, PassThreads};
use super::bookmarks::Bookmarks;
use super::command::{Command, Rectangle};
use super::configuration::{Configuration, PreviewHost, recorded_blocks};
use super::controller_end::ControllerEnd;
use super::generation_record::GenerationRecord;
use super::history::{History, KeptRender};
use super::hub::Hub;
use super::image_request::ImageRequest;
use super::orbit_camera::OrbitCamera;
use super::pending::Pending;
use super::publisher;
use super::reporter::{Reporter, Subject};
use super::status::Phase;
use crate::filter::{DENOISERS, Denoiser, FilterResult};
use crate::progressive::{
    Action, Checkpoint, Conditions, Filtered, Host, Outcome, RenderLoop, Settings, StoppedBy,
};
use crate::stats::{BlockSet, Layout, Store};

/// Longest step of a batch, in seconds: commands are handled between two.
const STEP_SECONDS: f64 = 0.15;
/// The same in the first seconds of an image, when a user may still be moving the camera.
const EARLY_STEP_SECONDS: f64 = 0.05;
/// Length of that time, in seconds.
const EARLY: f64 = 0.5;
/// Time between two checks whether an idle render is interrupted.
const IDLE_POLL: Duration = Duration::from_millis(200);

/// The driver of a preview's render loop.
pub struct Controller<'a> {
    configuration: Configuration<'a>,
    hub: Arc<Hub>,
    pass_threads: PassThreads,
    reporter: Reporter,
    camera: Option<OrbitCamera>,
    /// Renders that commands have replaced, and the one that comes back.
    history: History,
    returning: Option<KeptRender>,
    /// Whether the current render has come back.
    has_returned: bool,
    /// A store that nobody needs any more: new memory would take longer to get than its samples to clear.
    spare: Option<Store>,
    /// Commands that wait for a store, or for a generation that is about to begin.
    deferred: VecDeque<Command>,
    denoisers: Vec<&'static dyn Denoiser>,
    bookmarks: Bookmarks,
    pending: Pending,
    is_paused: bool,
    region: Option<Rectangle>,
    region_passes: RegionPasses,
    /// Whether checkpoints are kept: those of the scene's own view until a new generation begins.
    keeps_checkpoints: bool,
    viewer_pass_seconds: f64,
    /// Images to be saved before anything else.
    requests: VecDeque<ImageRequest>,
    /// Images that are being made in the background, to be saved.
    background: Vec<(ImageRequest, BackgroundPass)>,
    /// Why images were not saved while the render ended: viewers may not hear of it.
    unsaved: Vec<String>,
}

/// The host of one generation.
struct GenerationHost<'h> {
    host: &'h mut dyn PreviewHost,
    keeps_checkpoints: bool,
}

impl Host for GenerationHost<'_> {
    fn encode_and_discard(&self, settings: &Settings, result: &FilterResult, rows: &Store) {
        self.host.encode_and_discard(settings, result, rows);
    }

    fn checkpoint_interval(&self) -> Option<f64> {
        self.host.checkpoint_interval().filter(|_| self.keeps_checkpoints)
    }

    fn save(&mut self, settings: &Settings, checkpoint: Checkpoint) {
        self.host.save(settings, checkpoint);
    }
}

/// How a generation ends.
enum GenerationEnd {
    /// With an image.
    Finished(Box<Outcome>),
    /// The preview is closed.
    Closed,
    /// Another one begins.
    Replaced,
    /// Another scene is opened.
    Opens(PathBuf, Box<KeptRender>),
}

impl<'a> Controller<'a> {
    /// Controls a render for all viewers of `hub`.
    pub fn new(hub: Arc<Hub>, configuration: Configuration<'a>) -> Self {
        let mut controller = Self {
            reporter: Reporter::new(hub.clone()),
            hub,
            pass_threads: PassThreads::default(),
            configuration,
            camera: None,
            history: History::default(),
            returning: None,
            has_returned: false,
            spare: None,
            deferred: VecDeque::new(),
            denoisers: DENOISERS.into_iter().filter(|denoiser| denoiser.missing().is_none()).collect(),
            bookmarks: Bookmarks::default(),
            pending: Pending::default(),
            is_paused: false,
            region: None,
            region_passes: RegionPasses::default(),
            keeps_checkpoints: true,
            viewer_pass_seconds: 0.0,
            requests: VecDeque::new(),
            background: Vec::new(),
            unsaved: Vec::new(),
        };
        controller.take_session();
        controller
    }

    /// Renders until a budget is spent or, if the preview stays, until it is interrupted or another scene is opened. Returns also
    /// why images were not saved that viewers have asked for in the end. Must not be called on a thread that others need.
    pub fn run(mut self) -> (ControllerEnd, Vec<String>) {
        for path in self.configuration.host.earlier_images() {
            self.hub.saves().add_earlier(path);
        }
        let mut start = self.next_start().unwrap_or(self.configuration.start);
        let end = loop {
            match self.run_generation(start) {
                GenerationEnd::Finished(outcome) => {
                    break ControllerEnd::Finished(outcome, self.current_camera().clone());
                }
                GenerationEnd::Closed => break ControllerEnd::Closed,
                GenerationEnd::Replaced => start = self.next_start().unwrap_or_else(Instant::now),
                GenerationEnd::Opens(scene, current) => {
                    break ControllerEnd::Opens(scene, Box::new(self.session(*current)));
                }
            }
        };
        for (request, pass) in std::mem::take(&mut self.background) {
            let filtered = pass.wait().ok();
            self.write_image(&request, filtered.as_ref().map(|filtered| (&filtered.result, filtered.side)));
        }
        (end, self.unsaved)
    }

    /// Renders one view with one set of samples.
    fn run_generation(&mut self, start: Instant) -> GenerationEnd {
        // Set up the camera and the loop
        self.has_returned = self.returning.is_some();
        let (checkpoint, record) = match self.returning.take() {
            Some(kept) => (Some(kept.checkpoint), kept.record),
            None => (self.configuration.checkpoint.take(), GenerationRecord::default()),
        };
        let is_new = checkpoint.is_none();
        let recorded = checkpoint.as_ref().map_or_else(
            || self.recorded_blocks(&self.configuration.settings),
            |found| found.store.layout().blocks(),
        );
        let renderer = self.configuration.renderer.with_camera(self.current_camera()).recording(recorded);
        self.set_up_camera(&renderer);
        // Another camera sees something else than the reference.
        let reference = self.configuration.reference.clone().filter(|_| self.sees_as_scene());
        self.begin_generation(&renderer, record, reference.clone());
        if is_new {
            self.look_coarsely(&renderer);
            if self.moves_camera(&renderer) {
                return GenerationEnd::Replaced;
            }
        }
        let render_loop = match checkpoint {
            Some(found) => RenderLoop::resume(&renderer, &self.configuration.settings, start, found),
            None => self.new_loop(&renderer, start),
        };
        let mut render_loop = render_loop.with_reference(reference.as_deref());

        loop {
            // Render, or wait at a pause
            if self.is_resting(render_loop.store()) {
                self.reporter.enter(Phase::Paused);
                self.report(render_loop.store(), true);
                self.wait_idle(&mut render_loop, true);
                self.reporter.hasten();
            } else if let Some((filtered, stopped_by)) = self.advance(&mut render_loop) {
                self.finish(stopped_by, render_loop.store());
                if self.is_interrupted() || !self.configuration.stays {
                    // Handle the commands that came during the last pass.
                    self.receive(render_loop.store());
                    self.save_requested_images();
                    if !self.pending.any() {
                        let outcome = render_loop.into_outcome(filtered, stopped_by);
                        return GenerationEnd::Finished(Box::new(outcome));
                    }
                }
                self.wait_idle(&mut render_loop, false);
            }

            // Carry out the commands that had to wait
            self.save_requested_images();
            if self.pending.quit {
                self.save_checkpoint(&mut render_loop);
                return GenerationEnd::Closed;
            }
            if self.is_interrupted() {
                // The image as it is now is wanted, whatever was commanded before.
                self.pending.clear_for_generation();
                continue;
            }
            if let Some(scene) = self.pending.scene.take() {
                self.save_checkpoint(&mut render_loop);
                let current = self.current_render(render_loop);
                return GenerationEnd::Opens(scene, Box::new(current));
            }
            if let Some(step) = self.pending.history.take() {
                self.save_checkpoint(&mut render_loop);
                self.return_to(step, render_loop);
                return GenerationEnd::Replaced;
            }
            let before = (self.camera.clone(), render_loop.settings().clone());
            if self.moves_camera(&renderer)
                || self.pending.restart
                || !self.configuration.settings.are_met_by(render_loop.store())
            {
                self.save_last_checkpoint(&mut render_loop);
                self.keep_render(render_loop, before);
                return GenerationEnd::Replaced;
            }
            render_loop.change(&self.configuration.settings);
            self.pending.settings = false;
            self.reporter.enter(Phase::Rendering);
        }
    }

    /// Performs one action of the loop after the other. Returns the last image, or `None` as soon as commands are pending
    /// or the render pauses.
    fn advance(&mut self, render_loop: &mut RenderLoop) -> Option<(Filtered, StoppedBy)> {
        // A camera that moves on needs no samples of a view that has been seen
        self.receive(render_loop.store());
        let is_seen = self.has_returned || self.reporter.has_shown_lately();
        if self.pending.starts_generation() && is_seen {
            return None;
        }
        loop {
            render_loop.set_region(self.active_region(render_loop.store()));
            let conditions = self.conditions();
            match render_loop.next_action(&conditions) {
                Action::Filter(denoiser) => {
                    let is_shown = self.shows_interim_passes();
                    let filtered = self.filter(render_loop.interim_pass(denoiser), is_shown)?;
                    render_loop.complete_interim(filtered);
                    self.reporter.progressed(render_loop.progress());
                }
                Action::Finish(stopped_by) => {
                    self.save_checkpoint(render_loop);
                    return Some((self.finalise(render_loop, &conditions, stopped_by)?, stopped_by));
                }
                action => {
                    render_loop.perform(action, &mut self.generation_host());
                    if matches!(action, Action::Render { .. }) && self.leaves_after_step(render_loop) {
                        return None;
                    }
                }
            }
        }
    }

    fn recorded_blocks(&self, settings: &Settings) -> BlockSet {
        recorded_blocks(settings, self.configuration.outputs)
    }

    /// Returns the layout of a new render with these settings.
    fn layout_for(&self, settings: &Settings) -> Layout {
        self.configuration.renderer.layout_of(self.recorded_blocks(settings))
    }

    fn generation_host(&mut self) -> GenerationHost<'_> {
        let keeps_checkpoints = self.keeps_checkpoints;
        GenerationHost { host: &mut *self.configuration.host, keeps_checkpoints }
    }

    fn conditions(&mut self) -> Conditions {
        let is_early = self.reporter.progress().is_none_or(|progress| progress.elapsed < EARLY);
        Conditions {
            is_interrupted: self.is_interrupted(),
            is_watched: true,
            longest_step: Some(if is_early { EARLY_STEP_SECONDS } else { STEP_SECONDS }),
            checkpoint_interval: self.generation_host().checkpoint_interval(),
        }
    }

    /// Reports a step, handles commands and filters for the viewers; returns whether the loop has to be left.
    fn leaves_after_step(&mut self, render_loop: &RenderLoop) -> bool {
        let (progress, store) = (render_loop.progress(), render_loop.store());
        self.configuration.host.listen(&progress);
        self.reporter.stepped(progress);
        self.receive(store);
        if self.pending.starts_generation() && self.reporter.has_shown_lately() {
            // Another render is wanted: an image of this one would only delay it
            return true;
        }
        self.reporter.publish_if_due(store);
        self.report(store, false);
        let has_to_leave = |controller: &Self| controller.pending.any() || !controller.requests.is_empty();
        if !has_to_leave(self) {
            self.filter_if_due(store);
        }
        has_to_leave(self) || self.is_resting(store)
    }

    fn is_interrupted(&self) -> bool {
        self.configuration.host.is_interrupted()
    }

    /// Returns whether the render is paused. After a movement an image is still rendered once, or there would be none.
    fn is_resting(&self, store: &Store) -> bool {
        self.is_paused && !self.is_interrupted() && self.is_covered(store)
    }

    /// Returns whether every pixel has samples that it ever gets.
    fn is_covered(&self, store: &Store) -> bool {
        publisher::is_covered(store, self.configuration.settings.sample_map.is_some())
    }

    /// Waits at a pause until it is over, or after the end, for a command that changes the samples. No budget counts that
    /// time.
    fn wait_idle(&mut self, render_loop: &mut RenderLoop, is_pause: bool) {
        let (since, store) = (Instant::now(), render_loop.store().clone());
        if is_pause {
            // A pause may last for ever.
            self.save_checkpoint(render_loop);
        }
        // Commands may wait for a generation that has begun meanwhile
        self.receive(&store);
        let is_idle = |controller: &Self| (controller.is_paused || !is_pause) && !controller.pending.any();
        while is_idle(self) && !self.is_interrupted() {
            self.save_requested_images();
            self.filter_if_due(&store);
            let has_work = |controller: &Self| {
                !is_idle(controller) || !controller.requests.is_empty() || controller.should_filter(&store)
            };
            self.wait(&store, has_work);
        }
        self.receive(&store);
        render_loop.hold(since.elapsed());
    }

    /// Waits until `has_work` or interrupted; frames are published to viewers that are ready.
    fn wait(&mut self, store: &Arc<Store>, has_work: impl Fn(&Self) -> bool) {
        while !has_work(self) && !self.is_interrupted() {
            self.reporter.publish(store);
            self.report(store, false);
            match self.hub.commands().recv_timeout(IDLE_POLL) {
                Ok(command) => self.handle(command, store),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => self.check_background(),
            }
        }
    }

    fn save_checkpoint(&mut self, render_loop: &mut RenderLoop) {
        render_loop.save(&mut self.generation_host());
    }

    /// Saves the last checkpoint of the scene's own view: a new generation must not replace it.
    fn save_last_checkpoint(&mut self, render_loop: &mut RenderLoop) {
        if self.generation_host().checkpoint_interval().is_some() {
            self.save_checkpoint(render_loop);
            let saved = self.configuration.host.wait_for_checkpoint();
            let is_problem = saved.is_err();
            let what = saved.err().unwrap_or("the state file keeps the render so far".to_owned());
            self.reporter.notice(format!("{what}; the new render is not saved to it"), is_problem);
        }
    }

    fn finish(&mut self, stopped_by: StoppedBy, store: &Store) {
        // There is nothing left to pause.
        self.is_paused = false;
        self.reporter.finish(stopped_by);
        self.reporter.publish(store);
        self.report(store, true);
    }

    /// Publishes the status; not too often unless it is urgent or `at_once`.
    fn report(&mut self, store: &Store, at_once: bool) {
        if !at_once && !self.reporter.is_report_due() {
            return;
        }
        let (scene, settings) = (&self.configuration.scene.source, &self.configuration.settings);
        let (denoisers, history) = (self.denoiser_infos(store), self.history_status(store));
        let bookmarks = self.listed_bookmarks();
        let camera = self.camera_status();
        let subject = Subject {
            scene,
            is_paused: self.is_paused,
            settings,
            denoisers,
            most_spp_kept: self.most_spp_kept(store),
            history,
            camera,
            bookmarks,
            region: self.region,
        };
        self.reporter.report(&subject, store);
    }
}

#[cfg(test)]
mod tests;
