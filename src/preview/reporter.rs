//! What is told of a render to all who look: images when they are ready for some, and in words where it
//! stands.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::hub::Hub;
use super::publisher::Publisher;
use super::status::{CameraStatus, Notice, Phase, Statistics, Status};
use super::view::View;
use crate::progressive::{
    Estimated, Forecast, Point, Progress, Settings, Shown, StoppedBy, forecast, memory_bytes,
};
use crate::stats::{Layout, Part, Store};

/// Time between two reports, at least.
const STATUS_INTERVAL: Duration = Duration::from_millis(250);
/// Time over which samples per second are counted, in seconds.
const RATE_WINDOW: f64 = 2.0;
/// Notices that are told again, for whoever missed the reports between two that they read.
const NOTICES: usize = 6;

/// What a report says beside how the render goes.
pub struct Subject<'a> {
    pub scene: &'a str,
    pub settings: &'a Settings,
    pub camera: CameraStatus,
    pub region: Option<[[f32; 2]; 2]>,
}

/// See the module.
pub struct Reporter {
    hub: Arc<Hub>,
    publisher: Publisher,
    phase: Phase,
    stopped_by: Option<StoppedBy>,
    /// The newest filter pass of this generation, and samples then.
    shown: Option<Shown>,
    shown_samples: u64,
    progress: Option<Progress>,
    /// Elapsed seconds and samples, of the last [`RATE_WINDOW`].
    pace: VecDeque<(f64, u64)>,
    /// The same after the first step.
    first: Option<(f64, u64)>,
    filter_seconds: f64,
    /// The latest estimate of this image's error, and all of them against time.
    estimate: Option<Estimated>,
    curve: Vec<Point>,
    /// The latest [`NOTICES`], newest last.
    notices: VecDeque<Notice>,
    /// When was told last; `None` where there is something to tell at once.
    told: Option<Instant>,
}

impl Reporter {
    pub fn new(hub: Arc<Hub>) -> Self {
        Self {
            publisher: Publisher::new(hub.clone()),
            hub,
            phase: Phase::Rendering,
            stopped_by: None,
            shown: None,
            shown_samples: 0,
            progress: None,
            pace: VecDeque::new(),
            first: None,
            filter_seconds: 0.0,
            estimate: None,
            curve: Vec::new(),
            notices: VecDeque::new(),
            told: None,
        }
    }

    /// Starts a generation with other samples.
    pub fn begin(&mut self, layout: &Layout, settings: &Settings) {
        self.publisher.begin(layout, settings);
        self.enter(Phase::Rendering);
        self.forget_image();
        self.shown_samples = 0;
        self.progress = None;
        self.pace.clear();
        self.first = None;
        self.filter_seconds = 0.0;
        self.told = None;
    }

    /// Follows other settings.
    pub fn change(&mut self, settings: &Settings) {
        self.publisher.rescale(settings);
        self.told = None;
    }

    /// Another filter's image, and its errors, are none of the next.
    pub fn forget_image(&mut self) {
        self.estimate = None;
        self.curve.clear();
        self.shown = None;
    }

    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The render is in this phase from now on; that of before.
    pub fn enter(&mut self, phase: Phase) -> Phase {
        if phase == Phase::Rendering {
            self.stopped_by = None;
        }
        std::mem::replace(&mut self.phase, phase)
    }

    /// The render has ended.
    pub fn finish(&mut self, stopped_by: StoppedBy) {
        self.enter(Phase::Finished);
        self.stopped_by = Some(stopped_by);
    }

    pub fn progress(&self) -> Option<&Progress> {
        self.progress.as_ref()
    }

    /// The newest filter pass.
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref()
    }

    /// Samples that the newest filter pass had.
    pub fn shown_samples(&self) -> u64 {
        self.shown_samples
    }

    /// Whether anyone looks at one of certain views.
    pub fn wants(&self, of_these: impl Fn(View) -> bool) -> bool {
        View::ALL.into_iter().any(|view| of_these(view) && self.hub.wants(view))
    }

    /// There is something that a person should know.
    pub fn notice(&mut self, text: String, is_problem: bool) {
        let number = self.notices.back().map_or(0, |last| last.number) + 1;
        self.notices.push_back(Notice { number, text, is_problem });
        if self.notices.len() > NOTICES {
            self.notices.pop_front();
        }
        self.hasten();
    }

    /// What is told next is told at once.
    pub fn hasten(&mut self) {
        self.told = None;
    }

    /// A step is rendered.
    pub fn stepped(&mut self, progress: Progress, store: &Store) {
        self.enter(Phase::Rendering);
        self.progress = Some(progress);
        self.pace.push_back((progress.elapsed, progress.samples));
        while self.pace.len() > 2 && progress.elapsed - self.pace[0].0 > RATE_WINDOW {
            self.pace.pop_front();
        }
        self.first.get_or_insert((progress.elapsed, progress.samples));
        if let Some(estimate) = progress.estimate.filter(|new| self.estimate != Some(*new)) {
            // A better estimate of the same image takes the place of the first.
            if self.estimate.is_some_and(|old| !old.is_hidden && old.samples == estimate.samples) {
                self.curve.pop();
            }
            self.estimate = Some(estimate);
            if let Some(seconds) = self.seconds_of(estimate.samples)
                && !estimate.is_hidden
            {
                self.curve.push(Point { seconds, error: estimate.error });
            }
        }
        self.publisher.stepped();
        if self.publisher.is_due() {
            self.publish(store);
        }
    }

    /// As long as so many samples take here, those of a state that was resumed included.
    fn seconds_of(&self, samples: u64) -> Option<f64> {
        let ((first_seconds, first_samples), progress) = self.first.zip(self.progress)?;
        let own = progress.samples.checked_sub(first_samples).filter(|&own| own > 0)?;
        Some((progress.elapsed - first_seconds) * samples as f64 / own as f64)
    }

    /// How the error goes on from here.
    fn forecast(&self) -> Option<Forecast> {
        let found = forecast(&self.curve)?;
        let now = self.seconds_of(self.progress?.samples)?;
        Some(Forecast { halving_seconds: found.halving_after(now), ..found })
    }

    /// A filter pass has ended after so many seconds; `None` if it was given up.
    pub fn filtered(&mut self, shown: Option<&Shown>, seconds: f64, store: &Store) {
        self.filter_seconds += seconds;
        if let Some(shown) = shown {
            self.complete(shown);
            self.shown_samples = store.samples();
            self.publisher.filtered();
            self.publish(store);
        }
    }

    /// The newest filter pass, with the maps that the loop has added. The map of the grid stays until there is
    /// another: not every pass makes one.
    pub fn complete(&mut self, shown: &Shown) {
        let mut shown = shown.clone();
        if shown.any_failure().is_none()
            && let Some(old) = self.shown.take()
        {
            shown.failure = old.filtered.interpolation_failure.or(old.failure);
            shown.success = old.success;
        }
        self.shown = Some(shown);
    }

    /// Makes images for whoever is ready.
    pub fn publish(&mut self, store: &Store) {
        self.publisher.publish(store, self.shown.as_ref(), self.progress.as_ref());
    }

    /// Tells how the render goes, not too often unless `at_once`.
    pub fn tell(&mut self, subject: &Subject, store: &Store, at_once: bool) {
        // An idle render has nothing new to tell.
        let idle = matches!(self.phase, Phase::Finished | Phase::Paused);
        if !at_once && self.told.is_some_and(|told| idle || told.elapsed() < STATUS_INTERVAL) {
            return;
        }
        self.told = Some(Instant::now());
        let status = Status {
            r#type: "status",
            scene: subject.scene,
            width: store.width(),
            height: store.height(),
            generation: self.publisher.generation(),
            phase: self.phase,
            stopped_by: self.stopped_by,
            settings: subject.settings,
            views: self.publisher.views(),
            statistics: self.statistics(store),
            curve: &self.curve,
            forecast: self.forecast(),
            camera: subject.camera,
            region: subject.region,
            notices: &self.notices,
        };
        // Numbers that JSON cannot hold do not occur: all are finite or absent.
        self.hub.publish_status(serde_json::to_string(&status).unwrap_or_default());
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
            filter_fraction: if seconds > 0.0 { (self.filter_seconds / seconds).min(1.0) } else { 0.0 },
            memory_bytes: memory_bytes("VmRSS"),
            estimate: self.estimate,
        }
    }
}
