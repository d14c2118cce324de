//! Observes the loop, publishes what it sees, and does what people ask: between two steps, so within a
//! tenth of a second or so.
//!
//! Settings change where the loop stands. What makes the samples wrong (another view, a restart) starts
//! a new loop with an empty store: a new *generation*. A filter pass runs on threads of its own and is
//! given up when a new generation begins, so that no movement of the camera waits for it.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crossbeam::channel::{RecvTimeoutError, TryRecvError};

use super::command::Command;
use super::hub::Hub;
use super::orbit_camera::OrbitCamera;
use super::pass::{Given, Pass, Passes};
use super::pixel_values::describe_pixel;
use super::publisher::COVERED_SPP;
use super::reporter::{Reporter, Subject};
use super::settings_change::SettingsChange;
use super::stage::{Picture, Stage};
use super::status::{CameraStatus, Phase};
use super::view::View;
use super::wishes::Wishes;
use crate::filter::Quality;
use crate::progressive::{
    Denoiser, Ended, FilterJob, Flow, Loop, Observer, Outcome, Progress, Region, Settings, Shown, StoppedBy,
    fitting, has_room, reservoir_capacity,
};
use crate::render::Renderer;
use crate::stats::Store;

/// How long a step of a batch takes: how soon a person is heard.
const STEP_SECONDS: f64 = 0.15;
/// The same while an image is young and a person may still be moving the camera.
const YOUNG_STEP_SECONDS: f64 = 0.05;
/// Until when an image is young, in seconds.
const YOUNG: f64 = 0.5;
/// How often an idle render looks whether it is interrupted.
const IDLE_POLL: Duration = Duration::from_millis(200);
/// Share of the time that filter passes for the eye alone may take.
const EXTRA_FILTER_SHARE: f64 = 0.04;
/// Such a pass waits until there are so many times the samples of the last one.
const EXTRA_FILTER_GROWTH: f64 = 1.4;

/// Images that are still being made to be saved while the render has gone on to others, at most: each holds a store.
const MOST_ASIDE: usize = 2;

/// An image that somebody wants saved, as it was when that was said.
struct Asked {
    store: Arc<Store>,
    settings: Settings,
}

/// See the module.
pub struct Director<'a> {
    stage: Stage<'a>,
    hub: Arc<Hub>,
    passes: Passes,
    reporter: Reporter,
    rig: Option<OrbitCamera>,
    wishes: Wishes,
    paused: bool,
    region: Option<[[f32; 2]; 2]>,
    extra_filter_seconds: f64,
    /// To be saved before anything else.
    asked: VecDeque<Asked>,
    /// Being made beside the render.
    aside: Vec<(Asked, Pass)>,
}

impl<'a> Director<'a> {
    /// Directs a render for all who look at `hub`.
    pub fn new(hub: Arc<Hub>, stage: Stage<'a>) -> Self {
        Self {
            reporter: Reporter::new(hub.clone()),
            hub,
            passes: Passes::default(),
            stage,
            rig: None,
            wishes: Wishes::default(),
            paused: false,
            region: None,
            extra_filter_seconds: 0.0,
            asked: VecDeque::new(),
            aside: Vec::new(),
        }
    }

    /// Renders until a budget is spent, or, if it stays, until it is interrupted: then there is no
    /// outcome. Must not be called where it could block a thread that others need.
    pub fn run(mut self) -> Option<Outcome> {
        let outcome = self.direct();
        for (asked, pass) in std::mem::take(&mut self.aside) {
            self.write(&asked, pass.wait().ok().as_ref());
        }
        outcome
    }

    fn direct(&mut self) -> Option<Outcome> {
        let mut start = self.stage.start;
        loop {
            let scene = self.stage.scene;
            let camera = self.rig.as_ref().map_or(&scene.camera, OrbitCamera::camera);
            let renderer = self.stage.renderer.with_camera(camera);
            let rig = self.rig.take().unwrap_or_else(|| {
                let (width, height) = renderer.resolution();
                let seen = renderer.seen_at(width / 2, height / 2).map(|p| p.as_dvec3());
                OrbitCamera::new(&scene.camera, seen, f64::from(renderer.diameter()) / 2.0)
            });
            self.rig = Some(rig);
            let mut circle =
                Loop::new(&renderer, &self.stage.settings, start, self.stage.interrupt, self.stage.reference);
            if let Some(closing) = self.stage.closing {
                circle = circle.closing_with(closing);
            }
            if let Some(keeping) = self.stage.keeping {
                circle = circle.keeping(keeping.every, keeping.keep);
            }
            if let Some(memory) = self.stage.resumed.take() {
                circle = circle.resuming(memory);
            }
            self.begin(&renderer);
            circle.favour(self.region_of(renderer.resolution()));
            loop {
                if self.rests(circle.store()) {
                    self.reporter.enter(Phase::Paused);
                    self.tell(circle.store(), true);
                    self.stand(&mut circle, true);
                    self.reporter.hasten();
                } else if let Ended::Finished(filtered, stopped_by) = circle.advance(self) {
                    self.finish(stopped_by, circle.store());
                    let interrupted = stopped_by == StoppedBy::Interrupt;
                    if interrupted || !self.stage.stays {
                        // Asked for during the last pass, or when it ended.
                        self.listen(circle.store());
                        self.save_what_is_asked();
                        if !self.wishes.any() {
                            return Some(circle.into_outcome(*filtered, stopped_by));
                        }
                    }
                    self.stand(&mut circle, false);
                }
                self.save_what_is_asked();
                if self.wishes.quit {
                    circle.keep_now();
                    return None;
                }
                if self.is_interrupted() {
                    // What there is of this image is wanted, whatever was asked for before.
                    self.wishes.begin();
                    continue;
                }
                if self.begins_anew(&renderer, &circle) {
                    if let Some(keeping) = self.stage.keeping.take() {
                        // What begins now must not replace what hours have made.
                        circle.keep_now();
                        let kept = (keeping.settle)();
                        let is_problem = kept.is_err();
                        let how = kept.err().unwrap_or("the state is kept as it was up to here".to_owned());
                        self.reporter.notice(format!("{how}; of what begins now none is kept"), is_problem);
                    }
                    break;
                }
                circle.change(&self.stage.settings);
                circle.favour(self.region_of(renderer.resolution()));
                (self.wishes.settings, self.wishes.region) = (false, false);
                self.reporter.enter(Phase::Rendering);
            }
            start = Instant::now();
        }
    }

    fn is_interrupted(&self) -> bool {
        self.stage.interrupt.load(Ordering::Relaxed)
    }

    /// Whether something is wanted that is done between two batches only.
    fn has_to_leave(&self) -> bool {
        self.wishes.any() || !self.asked.is_empty()
    }

    /// Whether a person wants no more samples for now. After a movement an image is still rendered once, or there
    /// would be none.
    fn rests(&self, store: &Store) -> bool {
        self.paused && !self.is_interrupted() && is_covered(store)
    }

    /// Stands still, at a pause until that is over, as long as nothing but images is asked for. No budget counts
    /// that time.
    fn stand(&mut self, circle: &mut Loop, at_a_pause: bool) {
        let (since, store) = (Instant::now(), circle.store().clone());
        if at_a_pause {
            // Nothing new comes until a person says so, which may be never.
            circle.keep_now();
        }
        let stands = |director: &Self| {
            let wishes = &director.wishes;
            (director.paused || !at_a_pause) && !wishes.breaks_off() && !wishes.goes_on_otherwise()
        };
        while stands(self) && !self.is_interrupted() {
            self.save_what_is_asked();
            if self.should_filter(&store) {
                self.filter_for_the_eye(&store);
            }
            let enough = |director: &Self| {
                !stands(director) || !director.asked.is_empty() || director.should_filter(&store)
            };
            self.wait(&store, enough);
        }
        self.listen(&store);
        circle.hold(since.elapsed());
    }

    /// Whether a new loop has to begin; the camera is moved then.
    fn begins_anew(&mut self, renderer: &Renderer, circle: &Loop) -> bool {
        let mut anew = self.wishes.restart || !circle.can_change_to(&self.stage.settings);
        if let Some(rig) = self.rig.as_mut() {
            let before = rig.camera().clone();
            let (width, height) = renderer.resolution();
            for step in self.wishes.moves.drain(..) {
                let inside = step
                    .focus_at
                    .map(|[x, y]| [x as usize, y as usize])
                    .filter(|[x, y]| *x < width && *y < height);
                let seen = inside.and_then(|[x, y]| renderer.seen_at(x, y));
                if step.focus_at.is_some() && seen.is_none() {
                    self.reporter.notice("nothing there to focus on".to_owned(), true);
                }
                rig.apply(&step, seen.map(|p| p.as_dvec3()));
            }
            // Nothing is lost by a movement to where it is.
            anew |= !rig.is_equivalent(&before);
        }
        anew
    }

    /// Starts a generation.
    fn begin(&mut self, renderer: &Renderer) {
        self.wishes.begin();
        self.reporter.begin(renderer.layout(), &self.stage.settings);
        self.extra_filter_seconds = 0.0;
    }

    fn finish(&mut self, stopped_by: StoppedBy, store: &Store) {
        // There is nothing left to pause.
        self.paused = false;
        self.reporter.finish(stopped_by);
        self.reporter.publish(store);
        self.tell(store, true);
    }

    fn region_of(&self, (width, height): (usize, usize)) -> Option<Region> {
        let pixels = |[a, b]: [f32; 2], size: usize| {
            [(a * size as f32).floor() as usize, ((b * size as f32).ceil() as usize).min(size)]
        };
        self.region.map(|[x, y]| Region { x: pixels(x, width), y: pixels(y, height) })
    }

    /// Obeys what can be obeyed at once and remembers the rest.
    fn obey(&mut self, command: Command, store: &Arc<Store>) {
        let steers = !matches!(command, Command::Wake | Command::Save | Command::Inspect { .. });
        if steers && self.is_interrupted() {
            // Whoever interrupts a render wants what there is of it, and not the start of another.
            return;
        }
        match command {
            Command::Wake => {}
            Command::Pause(paused) => {
                // There is nothing to pause when all is done.
                self.paused = paused && self.reporter.phase() != Phase::Finished;
                self.reporter.hasten();
            }
            Command::ChangeSettings(change) => self.set(change, store),
            Command::MoveCamera(step) => self.wishes.moves.push(step),
            Command::SetRegion(region) => {
                self.wishes.region |= region != self.region;
                self.region = region;
            }
            Command::Restart => self.wishes.restart = true,
            Command::Save => {
                self.wishes.saves.push(self.stage.settings.clone());
                self.ask_if_wished(store);
            }
            Command::Inspect { pixel, reply } => {
                // A page that does not read its answers misses them.
                let _ = reply.try_send(describe_pixel(pixel, store, self.reporter.shown()));
            }
        }
    }

    fn set(&mut self, change: SettingsChange, store: &Store) {
        let mut settings = self.stage.settings.clone();
        let another_filter = change.apply(&mut settings);
        if settings == self.stage.settings {
            return;
        }
        if reservoir_capacity(&settings) > store.capacity() {
            let (size, keeps) = ((store.width(), store.height()), self.stage.keeping.is_some());
            if let Err(no_room) = has_room(store.layout(), &settings, size, keeps) {
                return self.reporter.notice(no_room.to_string(), true);
            }
        }
        self.stage.settings = settings;
        if another_filter {
            self.reporter.forget_image();
        }
        self.reporter.change(&self.stage.settings);
        self.wishes.settings = true;
    }

    fn listen(&mut self, store: &Arc<Store>) {
        while let Ok(command) = self.hub.commands().try_recv() {
            self.obey(command, store);
        }
        if self.stage.stays && self.is_interrupted() {
            self.wishes.quit = true;
        }
        self.ask_if_wished(store);
        self.attend();
    }

    /// Deals with what goes on beside the render.
    fn attend(&mut self) {
        for (asked, pass) in std::mem::take(&mut self.aside) {
            match pass.made() {
                Err(TryRecvError::Empty) => self.aside.push((asked, pass)),
                made => self.write(&asked, made.ok().as_ref()),
            }
        }
        if let Some(problem) = self.stage.keeping.and_then(|keeping| (keeping.news)()) {
            self.reporter.notice(problem, true);
        }
    }

    /// Waits, at no cost, until `enough` or interrupted; frames are made for whoever is ready.
    fn wait(&mut self, store: &Arc<Store>, enough: impl Fn(&Self) -> bool) {
        while !enough(self) && !self.is_interrupted() {
            self.reporter.publish(store);
            self.tell(store, false);
            match self.hub.commands().recv_timeout(IDLE_POLL) {
                Ok(command) => self.obey(command, store),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => self.attend(),
            }
        }
    }

    fn tell(&mut self, store: &Store, at_once: bool) {
        let camera = self.rig.as_ref().map_or(CameraStatus::default(), |rig| CameraStatus {
            aperture: rig.camera().lens_radius,
            focus: rig.camera().focal_distance,
            distance: rig.distance(),
        });
        let (scene, settings) = (&self.stage.scene.source, &self.stage.settings);
        let subject = Subject { scene, settings, camera, region: self.region };
        self.reporter.tell(&subject, store, at_once);
    }

    /// Whether the image should be filtered for the eye, beside the passes that the loop makes.
    fn should_filter(&self, store: &Store) -> bool {
        let Some(progress) = self.reporter.progress() else { return false };
        let filters = self.stage.settings.denoiser != Denoiser::None;
        let shown = self.reporter.shown();
        let lacks_map =
            self.reporter.wants(is_of_grid) && shown.is_none_or(|shown| shown.any_failure().is_none());
        let lacks_image = filters && self.reporter.wants(View::is_filtered) && {
            let samples = progress.samples as f64;
            let grown = samples > EXTRA_FILTER_GROWTH * self.reporter.shown_samples() as f64;
            let affordable = self.extra_filter_seconds < EXTRA_FILTER_SHARE * progress.elapsed;
            shown.is_none() || affordable && (grown || self.region.is_some())
        };
        (lacks_image || lacks_map) && is_covered(store) && !self.passes.is_busy()
    }

    /// Filters for the eye: a draft, but for a finished image, which keeps its quality.
    fn filter_for_the_eye(&mut self, store: &Arc<Store>) {
        let (started, settings) = (Instant::now(), &self.stage.settings);
        let job = match self.reporter.phase() {
            Phase::Finished => self.job(store, settings, settings.quality),
            _ => {
                let mut job = self.job(store, settings, Quality::Draft);
                if job.denoiser == Denoiser::Rpf {
                    // It knows no drafts.
                    job.denoiser = Denoiser::Prpf;
                }
                job
            }
        };
        // Given up means that something is wished for.
        let _ = self.pass(job);
        self.extra_filter_seconds += started.elapsed().as_secs_f64();
    }

    /// Runs a filter pass and shows it; `None` if it was given up, or another filter was chosen meanwhile.
    fn pass(&mut self, job: FilterJob) -> Option<Shown> {
        let (store, denoiser) = (job.store.clone(), self.stage.settings.denoiser);
        let (commands, passes) = (self.hub.commands().clone(), self.passes.clone());
        let shown = self.while_filtering(&store, denoiser, |hear| passes.run(job, &commands, hear));
        shown.filter(|_| self.stage.settings.denoiser == denoiser)
    }

    /// Hears and tells while `run` waits for this filter's pass over `store`, and shows what that makes unless another
    /// filter was chosen meanwhile.
    fn while_filtering(
        &mut self,
        store: &Arc<Store>,
        denoiser: Denoiser,
        run: impl FnOnce(&mut dyn FnMut(Given) -> bool) -> Option<Shown>,
    ) -> Option<Shown> {
        let started = Instant::now();
        let before = self.reporter.enter(Phase::Filtering);
        self.tell(store, true);
        let shown = run(&mut |given| {
            match given {
                Given::Command(command) => self.obey(command, store),
                Given::Nothing => self.listen(store),
            }
            self.reporter.publish(store);
            !self.wishes.breaks_off()
        });
        self.reporter.enter(before);
        self.reporter.hasten();
        let fits = shown.as_ref().filter(|_| self.stage.settings.denoiser == denoiser);
        self.reporter.filtered(fits, started.elapsed().as_secs_f64(), store);
        shown
    }

    /// Whoever wants an image saved wants that of now, whatever comes next; after what makes the image another one,
    /// the first that is of it. To want the same twice is to want it once.
    fn ask_if_wished(&mut self, store: &Arc<Store>) {
        let is_there = is_covered(store) || self.reporter.phase() == Phase::Finished || self.wishes.quit;
        if self.wishes.begins_anew() || !is_there {
            return;
        }
        let is_kept = |settings: &Settings| reservoir_capacity(settings) <= store.capacity();
        for settings in std::mem::take(&mut self.wishes.saves) {
            let asked = Asked { store: store.clone(), settings };
            let is_same =
                |other: &Asked| Arc::ptr_eq(&other.store, &asked.store) && other.settings == asked.settings;
            if !is_kept(&asked.settings) && !is_kept(&self.stage.settings) {
                // A render that keeps what this filter needs is about to begin.
                self.wishes.saves.push(asked.settings);
            } else if !is_kept(&asked.settings) {
                let said =
                    "not saved: another filter was chosen before the samples that this one needs were there";
                self.reporter.notice(said.to_owned(), true);
            } else if !self.asked.iter().any(is_same) {
                self.asked.push_back(asked);
            }
        }
    }

    /// Saves it, at once or, where the render has to go on to another image meanwhile, as soon as it is made.
    fn save_what_is_asked(&mut self) {
        while let Some(asked) = self.asked.pop_front() {
            let made_by = fitting(&asked.store, asked.settings.denoiser, asked.settings.quality);
            let is_done = self.reporter.phase() == Phase::Finished
                && self.reporter.shown_samples() == asked.store.samples();
            let is_it = |shown: &&Shown| is_done && shown.made_by == made_by;
            if let Some(shown) = self.reporter.shown().filter(is_it).cloned() {
                self.write(&asked, Some(&shown));
            } else if self.aside.len() == MOST_ASIDE {
                self.reporter.notice("not saved: earlier images are still being made".to_owned(), true);
            } else {
                let pass = self.passes.start(self.job(&asked.store, &asked.settings, asked.settings.quality));
                let commands = self.hub.commands().clone();
                let (store, denoiser) = (asked.store.clone(), asked.settings.denoiser);
                match self.while_filtering(&store, denoiser, |hear| pass.hearing(&commands, hear)) {
                    Some(shown) => self.write(&asked, Some(&shown)),
                    None => self.aside.push((asked, pass)),
                }
                self.tell(&store, true);
            }
        }
    }

    /// Writes an image that was asked for, if it could be made.
    fn write(&mut self, asked: &Asked, made: Option<&Shown>) {
        let Asked { store, settings } = asked;
        let written = made.ok_or("the filter ended early".to_owned()).and_then(|shown| {
            let (filtered, made_by) = (&shown.filtered, shown.made_by);
            (self.stage.save)(&Picture { store, filtered, made_by, settings })
        });
        match written {
            Ok(paths) => {
                let names: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
                let spp = store.samples() as f64 / store.pixels().max(1) as f64;
                let said = format!("saved {}: {spp:.1} samples per pixel", names.join(" and "));
                self.reporter.notice(said, false);
            }
            Err(problem) => self.reporter.notice(format!("not saved: {problem}"), true),
        }
    }

    fn job(&self, store: &Arc<Store>, settings: &Settings, quality: Quality) -> FilterJob {
        let (denoiser, quality) = fitting(store, settings.denoiser, quality);
        FilterJob {
            store: store.clone(),
            denoiser,
            quality,
            seed: settings.seed,
            interpolation: self.reporter.wants(is_of_grid),
        }
    }
}

/// Whether every pixel has had its samples.
fn is_covered(store: &Store) -> bool {
    store.drawn() as f64 >= COVERED_SPP * store.pixels() as f64
}

/// Whether a view comes from the grid of feature weights, whatever the denoiser is.
fn is_of_grid(view: View) -> bool {
    view == View::Failure
}

impl Observer for Director<'_> {
    fn stepped(&mut self, progress: Progress, store: &Arc<Store>) -> Flow {
        (self.stage.listen)(progress);
        self.reporter.stepped(progress, store);
        self.tell(store, false);
        self.listen(store);
        if self.has_to_leave() {
            return Flow::Leave;
        }
        if self.should_filter(store) {
            self.filter_for_the_eye(store);
            if self.has_to_leave() {
                return Flow::Leave;
            }
        }
        if self.rests(store) { Flow::Leave } else { Flow::GoOn }
    }

    fn run_filter(&mut self, job: FilterJob) -> Option<Shown> {
        self.pass(job)
    }

    fn filtered(&mut self, shown: &Shown) {
        self.reporter.complete(shown);
    }

    fn step_seconds(&self) -> Option<f64> {
        let young = self.reporter.progress().is_none_or(|progress| progress.elapsed < YOUNG);
        Some(if young { YOUNG_STEP_SECONDS } else { STEP_SECONDS })
    }
}

#[cfg(test)]
mod tests;
