//! Observes the loop, publishes what it sees, and does what people ask: between two steps, so within a
//! tenth of a second or so.
//!
//! Settings change where the loop stands. What makes the samples wrong (another view, a restart) starts
//! a new loop with an empty store: a new *generation*. A filter pass runs on threads of its own and is
//! given up when a new generation begins, so that no movement of the camera waits for it.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossbeam::channel::RecvTimeoutError;

use super::camera::Rig;
use super::curve::{self, Point};
use super::hub::Hub;
use super::pass::{Given, Passes};
use super::protocol::{Change, Command, Move};
use super::publish::Publisher;
use super::status::{Lens, Notice, Phase, Statistics, Status, memory_bytes};
use super::values;
use crate::filter::{Filtered, Quality};
use crate::geometry::Accel;
use crate::image::Planes;
use crate::progressive::{
    Closing, Denoiser, Ended, FilterJob, Flow, Loop, Observer, Outcome, Progress, Region, Settings, Shown,
    StoppedBy,
};
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stats::{Part, Store};

/// How long a step of a batch takes: how soon a person is heard.
const STEP_SECONDS: f64 = 0.15;
/// The same while an image is young and a person may still be moving the camera.
const YOUNG_STEP_SECONDS: f64 = 0.05;
/// Until when an image is young, in seconds.
const YOUNG: f64 = 0.5;
/// How often an idle render looks whether it is interrupted.
const IDLE_POLL: Duration = Duration::from_millis(200);
/// Time between two reports, at least.
const STATUS_INTERVAL: Duration = Duration::from_millis(250);
/// Samples per pixel from which on every pixel has some: they come in pairs.
const COVERED_SPP: f64 = 2.0;
/// Share of the time that filter passes for the eye alone may take.
const EXTRA_FILTER_SHARE: f64 = 0.04;
/// Such a pass waits until there are so many times the samples of the last one.
const EXTRA_FILTER_GROWTH: f64 = 1.4;
/// Time over which samples per second are counted, in seconds.
const RATE_WINDOW: f64 = 2.0;

/// An image to be written.
pub struct Picture<'a> {
    pub store: &'a Store,
    pub filtered: &'a Filtered,
    pub settings: &'a Settings,
    /// What positions in the store were divided by.
    pub diameter: f32,
}

/// Writes a picture; says where, or in one line why not.
pub type Save<'a> = Box<dyn FnMut(&Picture) -> Result<Vec<PathBuf>, String> + 'a>;

/// What a render is directed by from the start.
pub struct Stage<'a> {
    pub scene: &'a Scene,
    pub accel: &'a Accel<'a>,
    pub settings: Settings,
    pub reference: Option<&'a Planes>,
    /// What is done with the image at the end, for the loop to rehearse.
    pub closing: Option<Closing<'a>>,
    /// When the program started.
    pub start: Instant,
    pub interrupt: &'a AtomicBool,
    /// Stay when a budget is spent, until interrupted; else end there.
    pub stays: bool,
    pub save: Save<'a>,
    /// Hears of every step.
    pub listen: Box<dyn FnMut(Progress) + 'a>,
}

/// See the module.
pub struct Director<'a> {
    stage: Stage<'a>,
    hub: Arc<Hub>,
    passes: Passes,
    publisher: Publisher,
    rig: Option<Rig>,
    wishes: Wishes,
    paused: bool,
    region: Option<[[f32; 2]; 2]>,
    phase: Phase,
    stopped_by: Option<StoppedBy>,
    /// The newest filter pass of this generation, and samples then.
    shown: Option<Shown>,
    shown_samples: u64,
    progress: Option<Progress>,
    /// Elapsed seconds and samples, of the last [`RATE_WINDOW`].
    pace: VecDeque<(f64, u64)>,
    filter_seconds: f64,
    extra_filter_seconds: f64,
    held: Duration,
    curve: Vec<Point>,
    notice: Notice,
    told: Option<Instant>,
}

/// What was asked for and cannot be done within a step.
#[derive(Default)]
struct Wishes {
    moves: Vec<Move>,
    restart: bool,
    settings: bool,
    region: bool,
    save: bool,
    quit: bool,
}

impl Wishes {
    fn any(&self) -> bool {
        self.begins_anew() || self.settings || self.region || self.save
    }

    /// Whether the samples so far are of no use any more.
    fn begins_anew(&self) -> bool {
        !self.moves.is_empty() || self.restart || self.quit
    }
}

impl<'a> Director<'a> {
    /// Directs a render for all who look at `hub`.
    pub fn new(hub: Arc<Hub>, stage: Stage<'a>) -> Self {
        Self {
            publisher: Publisher::new(hub.clone()),
            hub,
            passes: Passes::default(),
            stage,
            rig: None,
            wishes: Wishes::default(),
            paused: false,
            region: None,
            phase: Phase::Rendering,
            stopped_by: None,
            shown: None,
            shown_samples: 0,
            progress: None,
            pace: VecDeque::new(),
            filter_seconds: 0.0,
            extra_filter_seconds: 0.0,
            held: Duration::ZERO,
            curve: Vec::new(),
            notice: Notice::default(),
            told: None,
        }
    }

    /// Renders until a budget is spent, or, if it stays, until it is interrupted: then there is no
    /// outcome. Must not be called where it could block a thread that others need.
    pub fn run(mut self) -> Option<Outcome> {
        let mut start = self.stage.start;
        loop {
            let (scene, accel) = (self.stage.scene, self.stage.accel);
            let camera = self.rig.as_ref().map_or(&scene.camera, Rig::camera);
            let renderer = Renderer::with_camera(scene, camera, accel, self.stage.settings.seed);
            let rig = self.rig.take().unwrap_or_else(|| {
                let (width, height) = renderer.resolution();
                let seen = renderer.seen_at(accel, width / 2, height / 2).map(|p| p.as_dvec3());
                Rig::new(&scene.camera, &scene.film, seen, f64::from(renderer.diameter()) / 2.0)
            });
            self.rig = Some(rig);
            let mut circle =
                Loop::new(&renderer, &self.stage.settings, start, self.stage.interrupt, self.stage.reference);
            if let Some(closing) = self.stage.closing {
                circle = circle.closing_with(closing);
            }
            self.begin(&renderer);
            circle.favour(self.region_of(renderer.resolution()));
            loop {
                match circle.advance(&mut self) {
                    Ended::Finished(filtered, stopped_by) => {
                        let over = stopped_by == StoppedBy::Interrupt || !self.stage.stays;
                        self.finish(stopped_by, circle.store());
                        if over && !self.wishes.any() {
                            let kept = stopped_by != StoppedBy::Interrupt || !self.stage.stays;
                            return kept.then(|| circle.into_outcome(*filtered, stopped_by));
                        }
                        let since = Instant::now();
                        while !self.wishes.begins_anew() && !self.wishes.settings && !self.wishes.region {
                            self.save_if_wished(circle.store(), &renderer);
                            self.wait(circle.store(), |director| director.wishes.any());
                        }
                        circle.hold(since.elapsed());
                    }
                    Ended::Left => circle.hold(std::mem::take(&mut self.held)),
                }
                if self.wishes.quit {
                    return None;
                }
                self.save_if_wished(circle.store(), &renderer);
                if self.begins_anew(&renderer, &circle) {
                    break;
                }
                circle.change(&self.stage.settings);
                circle.favour(self.region_of(renderer.resolution()));
                (self.wishes.settings, self.wishes.region) = (false, false);
                self.phase = Phase::Rendering;
                self.stopped_by = None;
            }
            start = Instant::now();
        }
    }

    /// Whether a new loop has to begin; the camera is moved then.
    fn begins_anew(&mut self, renderer: &Renderer, circle: &Loop) -> bool {
        let anew = self.wishes.begins_anew() || !circle.can_change_to(&self.stage.settings);
        if let Some(rig) = self.rig.as_mut().filter(|_| anew) {
            let (width, height) = renderer.resolution();
            for step in self.wishes.moves.drain(..) {
                let inside = step
                    .focus_at
                    .map(|[x, y]| [x as usize, y as usize])
                    .filter(|[x, y]| *x < width && *y < height);
                let seen = inside.and_then(|[x, y]| renderer.seen_at(self.stage.accel, x, y));
                if step.focus_at.is_some() && seen.is_none() {
                    self.notice.next("nothing there to focus on".to_owned(), true);
                }
                rig.apply(&step, seen.map(|p| p.as_dvec3()));
            }
        }
        anew
    }

    /// Starts a generation.
    fn begin(&mut self, renderer: &Renderer) {
        self.wishes = Wishes { save: self.wishes.save, ..Wishes::default() };
        self.publisher.begin(renderer.layout(), &self.stage.settings);
        self.phase = Phase::Rendering;
        self.stopped_by = None;
        self.shown = None;
        self.shown_samples = 0;
        self.progress = None;
        self.pace.clear();
        self.filter_seconds = 0.0;
        self.extra_filter_seconds = 0.0;
        self.held = Duration::ZERO;
        self.curve.clear();
        self.told = None;
    }

    fn finish(&mut self, stopped_by: StoppedBy, store: &Arc<Store>) {
        self.phase = Phase::Finished;
        self.stopped_by = Some(stopped_by);
        self.publish(store);
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
        match command {
            Command::Look => {}
            Command::Pause(paused) => {
                self.paused = paused;
                self.told = None;
            }
            Command::Set(change) => self.set(change),
            Command::Camera(step) => self.wishes.moves.push(step),
            Command::Favour(region) => {
                self.region = region;
                self.wishes.region = true;
            }
            Command::Restart => self.wishes.restart = true,
            Command::Save => self.wishes.save = true,
            Command::Inspect { pixel, reply } => {
                // A page that does not read its answers misses them.
                let _ = reply.try_send(values::at(pixel, store, self.shown.as_ref()));
            }
        }
    }

    fn set(&mut self, change: Change) {
        let settings = &mut self.stage.settings;
        let on = |value: f64| Some(value).filter(|v| *v > 0.0);
        if let Some(denoiser) = change.denoiser.filter(|d| *d != settings.denoiser) {
            settings.denoiser = denoiser;
            // Its errors are those of another image.
            self.curve.clear();
            self.shown = None;
        }
        settings.sampling = change.sampling.unwrap_or(settings.sampling);
        settings.quality = change.quality.unwrap_or(settings.quality);
        if let Some(spp) = change.spp {
            settings.budget.spp = Some(spp).filter(|spp| *spp > 0);
        }
        if let Some(seconds) = change.seconds {
            settings.budget.seconds = on(seconds);
        }
        if let Some(error) = change.target_error {
            settings.budget.target_error = on(error);
        }
        self.publisher.rescale(settings);
        self.wishes.settings = true;
        self.told = None;
    }

    fn listen(&mut self, store: &Arc<Store>) {
        while let Ok(command) = self.hub.commands().try_recv() {
            self.obey(command, store);
        }
        if self.stage.stays && self.stage.interrupt.load(Ordering::Relaxed) {
            self.wishes.quit = true;
        }
    }

    /// Waits, at no cost, until `enough` or interrupted; frames are made for whoever is ready.
    fn wait(&mut self, store: &Arc<Store>, enough: impl Fn(&Self) -> bool) {
        while !enough(self) && !self.stage.interrupt.load(Ordering::Relaxed) {
            self.publish(store);
            self.tell(store, false);
            match self.hub.commands().recv_timeout(IDLE_POLL) {
                Ok(command) => self.obey(command, store),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
        }
        self.listen(store);
    }

    fn publish(&mut self, store: &Arc<Store>) {
        let progress = self.progress;
        let is_final = self.phase == Phase::Finished;
        self.publisher.publish(store, self.shown.as_ref(), progress.as_ref(), is_final);
    }

    fn tell(&mut self, store: &Store, at_once: bool) {
        if !at_once && self.told.is_some_and(|told| told.elapsed() < STATUS_INTERVAL) {
            return;
        }
        // An idle render has nothing new to tell.
        let idle = matches!(self.phase, Phase::Finished | Phase::Paused);
        if !at_once && idle && self.told.is_some() {
            return;
        }
        self.told = Some(Instant::now());
        let statistics = self.statistics(store);
        let camera = self.rig.as_ref().map_or(Lens::default(), |rig| Lens {
            aperture: rig.camera().lens_radius,
            focus: rig.camera().focal_distance,
            distance: rig.distance(),
        });
        let status = Status {
            r#type: "status",
            scene: &self.stage.scene.source,
            width: store.width(),
            height: store.height(),
            generation: self.publisher.generation(),
            phase: self.phase,
            stopped_by: self.stopped_by,
            settings: &self.stage.settings,
            views: self.publisher.views(),
            statistics,
            curve: &self.curve,
            forecast: curve::forecast(&self.curve),
            camera,
            region: self.region,
            notice: &self.notice,
        };
        // Numbers that JSON cannot hold do not occur: all are finite or absent.
        self.hub.tell(serde_json::to_string(&status).unwrap_or_default());
    }

    fn statistics(&self, store: &Store) -> Statistics {
        let counts = store.counts(Part::Whole);
        let (first, last) = (self.pace.front(), self.pace.back());
        let rate = first.zip(last).map_or(0.0, |(a, b)| (b.1 - a.1) as f64 / (b.0 - a.0).max(1e-6));
        let seconds = self.progress.map_or(0.0, |p| p.elapsed);
        Statistics {
            seconds,
            fraction: self.progress.map_or(0.0, |p| p.fraction),
            samples: store.samples(),
            mean: store.samples() as f64 / counts.len().max(1) as f64,
            min: counts.iter().copied().min().unwrap_or(0),
            max: counts.iter().copied().max().unwrap_or(0),
            samples_per_second: if self.phase == Phase::Rendering { rate } else { 0.0 },
            filter_share: if seconds > 0.0 { (self.filter_seconds / seconds).min(1.0) } else { 0.0 },
            memory_bytes: memory_bytes(),
            error: self.curve.last().map(|point| point.error),
        }
    }

    fn note(&mut self, progress: Progress) {
        (self.stage.listen)(progress);
        self.progress = Some(progress);
        self.pace.push_back((progress.elapsed, progress.samples));
        while self.pace.len() > 2 && progress.elapsed - self.pace[0].0 > RATE_WINDOW {
            self.pace.pop_front();
        }
        if let Some(error) = progress.estimated_error.map(|e| e.max(0.0))
            && self.curve.last().is_none_or(|last| last.error != error)
        {
            self.curve.push(Point { seconds: progress.elapsed, error });
        }
    }

    /// Whether the image should be filtered for the eye, beside the passes that the loop makes.
    fn should_filter(&self, progress: &Progress) -> bool {
        let wanted = self.stage.settings.denoiser == Denoiser::Prpf && self.publisher.wants_filtered();
        let grown = progress.samples as f64 > EXTRA_FILTER_GROWTH * self.shown_samples as f64;
        let affordable = self.extra_filter_seconds < EXTRA_FILTER_SHARE * progress.elapsed;
        let due = self.shown.is_none() || affordable && (grown || self.region.is_some());
        wanted && due && progress.spp >= COVERED_SPP && !self.passes.is_busy()
    }

    /// Runs a filter pass and shows it; `None` if it was given up.
    fn pass(&mut self, job: FilterJob) -> Option<Shown> {
        let (started, store) = (Instant::now(), job.store.clone());
        let before = std::mem::replace(&mut self.phase, Phase::Filtering);
        self.tell(&store, false);
        let (commands, passes) = (self.hub.commands().clone(), self.passes.clone());
        let shown = passes.run(job, &commands, |given| {
            match given {
                Given::Command(command) => self.obey(command, &store),
                Given::Nothing => self.listen(&store),
            }
            self.publish(&store);
            !self.wishes.begins_anew()
        });
        self.phase = before;
        self.filter_seconds += started.elapsed().as_secs_f64();
        if let Some(shown) = &shown {
            self.shown = Some(shown.clone());
            self.shown_samples = store.samples();
            self.publisher.filtered();
            self.publish(&store);
        }
        shown
    }

    fn save_if_wished(&mut self, store: &Arc<Store>, renderer: &Renderer) {
        if !std::mem::take(&mut self.wishes.save) {
            return;
        }
        let finished = self.phase == Phase::Finished;
        let shown = match self.shown.clone().filter(|_| finished) {
            Some(shown) => Some(shown),
            None => self.pass(self.job(store, self.stage.settings.quality)),
        };
        match shown {
            Some(shown) => {
                let (settings, filtered) = (&self.stage.settings, &shown.filtered);
                let picture = Picture { store, filtered, settings, diameter: renderer.diameter() };
                match (self.stage.save)(&picture) {
                    Ok(paths) => {
                        let names: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
                        self.notice.next(format!("saved {}", names.join(" and ")), false);
                    }
                    Err(problem) => self.notice.next(format!("not saved: {problem}"), true),
                }
            }
            None => {
                self.notice.next("not saved: the view changed before the filter was done".to_owned(), true)
            }
        }
        self.tell(store, true);
    }

    fn job(&self, store: &Arc<Store>, quality: Quality) -> FilterJob {
        FilterJob {
            store: store.clone(),
            denoiser: self.stage.settings.denoiser,
            quality,
            seed: self.stage.settings.seed,
            interpolation: false,
        }
    }
}

impl Observer for Director<'_> {
    fn stepped(&mut self, progress: Progress, store: &Arc<Store>) -> Flow {
        self.phase = Phase::Rendering;
        self.note(progress);
        self.publisher.stepped();
        if self.publisher.is_due() {
            self.publish(store);
        }
        self.tell(store, false);
        self.listen(store);
        if self.wishes.any() {
            return Flow::Leave;
        }
        if self.should_filter(&progress) {
            let started = Instant::now();
            // Given up means that something is wished for.
            let _ = self.pass(self.job(store, Quality::Draft));
            self.extra_filter_seconds += started.elapsed().as_secs_f64();
            if self.wishes.any() {
                return Flow::Leave;
            }
        }
        // After a movement a paused image is still rendered once, or there would be none.
        if self.paused && progress.spp >= COVERED_SPP {
            let since = Instant::now();
            self.phase = Phase::Paused;
            self.tell(store, true);
            self.wait(store, |director| !director.paused || director.wishes.any());
            self.told = None;
            if self.wishes.any() {
                self.held += since.elapsed();
                return Flow::Leave;
            }
            return Flow::Held(since.elapsed());
        }
        Flow::GoOn
    }

    fn run_filter(&mut self, job: FilterJob) -> Option<Shown> {
        self.pass(job)
    }

    fn filtered(&mut self, shown: &Shown) {
        // With the maps that the loop has added.
        self.shown = Some(shown.clone());
    }

    fn step_seconds(&self) -> Option<f64> {
        let young = self.progress.is_none_or(|progress| progress.elapsed < YOUNG);
        Some(if young { YOUNG_STEP_SECONDS } else { STEP_SECONDS })
    }
}
