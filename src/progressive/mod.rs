//! The loop: render a batch into the store, filter, decide where the next batch goes, until a budget
//! is spent.
//!
//! It owns the clock that budgets count by: nothing below this room reads one.

mod account;
mod batches;
mod closing;
mod cost;
mod estimate;
mod forecast;
mod memory;
mod observer;
mod passes;
mod region;
mod rehearsal;
mod room;
mod schedule;
mod settings;
mod steps;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::filter::Filtered;
use crate::image::Planes;
use crate::render::Renderer;
use crate::stats::Store;

pub use account::{Batch, Ended, Hurried, Outcome, Progress, Seconds, StoppedBy};
use batches::Rendered;
pub use estimate::{ErrorEstimate, Estimated, TILE};
pub use forecast::{Forecast, Point, forecast};
pub use memory::{Keep, Memory, Rerun, Snapshot, UnderWay};
pub use observer::{FilterJob, Flow, Observer, Shown, fitting};
pub use region::Region;
use rehearsal::Rehearsal;
pub use room::{NoRoom, has_room, memory_bytes};
pub use schedule::Budget;
use schedule::{Plan, Schedule};
pub use settings::{Denoiser, MIN_SPP, NO_CEILING, PixelMemory, RESERVOIR, Settings, reservoir_capacity};
pub use steps::Grain;

/// Where a call of [`Loop::advance`] enters the circle.
#[derive(Default)]
enum Entry {
    /// Before a batch is planned.
    #[default]
    Plan,
    /// Within a batch that was left, or that another process began.
    Within(UnderWay),
    /// After a batch, before the maps are made of it.
    After,
}

/// What the caller does with the image at the end.
pub type Closing<'a> = &'a dyn Fn(&Filtered, &Store);

/// The loop's own state.
pub struct Loop<'a> {
    renderer: &'a Renderer<'a>,
    settings: Settings,
    /// When the program started: what budgets of time count from.
    start: Instant,
    /// Set from outside to end the render: after the current batch if that is soon, else after a step of it.
    interrupt: &'a AtomicBool,
    /// What the filtered image is compared with after every batch: 3 planes.
    reference: Option<&'a Planes>,
    closing: Option<Closing<'a>>,
    /// Seconds from one memory that is kept to the next, and what keeps it.
    keep: Option<(f64, Keep<'a>)>,
    /// When it was kept last.
    kept: f64,
    entry: Entry,
    /// Shared only with a filter pass, and not for longer unless its observer gave it up.
    store: Arc<Store>,
    /// Samples of it that an earlier run made.
    resumed_samples: u64,
    schedule: Schedule,
    rehearsal: Rehearsal,
    batches: Vec<Batch>,
    seconds: Seconds,
    /// Seconds of all reruns of the filter, and of the latest one of interim quality.
    reruns: f64,
    interim_seconds: Option<f64>,
    /// What it took last to find where interpolation fails.
    maps_seconds: Option<f64>,
    estimate: Option<ErrorEstimate>,
    rerun: Option<Rerun>,
    /// What the last filter pass will be, because there is no time for what was asked for.
    hurried: Option<Hurried>,
    /// Pixels that get all samples, see [`Self::favour`].
    favoured: Option<Region>,
}

impl<'a> Loop<'a> {
    pub fn new(
        renderer: &'a Renderer<'a>,
        settings: &Settings,
        start: Instant,
        interrupt: &'a AtomicBool,
        reference: Option<&'a Planes>,
    ) -> Self {
        let (width, height) = renderer.resolution();
        let (layout, capacity) = (renderer.layout().clone(), reservoir_capacity(settings));
        let store = Store::new(width, height, layout, capacity, settings.seed);
        let mut new = Self {
            renderer,
            settings: settings.clone(),
            start,
            interrupt,
            reference,
            closing: None,
            keep: None,
            kept: start.elapsed().as_secs_f64(),
            entry: Entry::default(),
            schedule: Schedule::new(
                &settings.budget,
                (width * height) as u64,
                settings.min_spp,
                settings.max_spp,
            ),
            store: Arc::new(store),
            resumed_samples: 0,
            rehearsal: Rehearsal::default(),
            batches: Vec::new(),
            seconds: Seconds::default(),
            reruns: 0.0,
            interim_seconds: None,
            maps_seconds: None,
            estimate: None,
            rerun: None,
            hurried: None,
            favoured: None,
        };
        new.expect_unrehearsed();
        new
    }

    /// What the caller will do with the image counts as part of a budget of time: it is rehearsed on
    /// some rows of the image, so that the loop knows how long it takes.
    pub fn closing_with(mut self, closing: Closing<'a>) -> Self {
        self.closing = Some(closing);
        self
    }

    /// Follows other settings from now on. The seed and what the reservoir keeps stay as they are.
    pub fn change(&mut self, settings: &Settings) {
        let settings = Settings { seed: self.settings.seed, ..settings.clone() };
        if settings == self.settings {
            return;
        }
        self.replan();
        let shown = |of: &Self| (of.settings.denoiser, of.interim_denoiser(), of.interim_quality());
        let shown_before = shown(self);
        let decisive = |s: &Settings| (s.budget, s.denoiser, s.quality);
        if decisive(&settings) != decisive(&self.settings) {
            self.hurried = None;
            self.rehearsal = Rehearsal::default();
        }
        self.schedule.change(&settings.budget, settings.min_spp, settings.max_spp);
        let rerun = |s: &Settings| (s.denoiser, s.quality, s.sampling, s.budget.target_error.is_some());
        if rerun(&settings) != rerun(&self.settings) {
            (self.interim_seconds, self.maps_seconds) = (None, None);
        }
        self.settings = settings;
        if shown(self) != shown_before {
            // Another filter's image, and its error, are none of this one's.
            (self.estimate, self.rerun) = (None, None);
        }
        if self.rehearsal.is_missing() {
            self.expect_unrehearsed();
        }
    }

    /// Whether the samples so far can be filtered as these settings ask for.
    pub fn can_change_to(&self, settings: &Settings) -> bool {
        reservoir_capacity(settings) <= self.store.capacity()
    }

    /// Gives a region all samples until each of its pixels has the budget's on average, or until the
    /// region is taken back. The estimate of the image's error stands still meanwhile.
    pub fn favour(&mut self, region: Option<Region>) {
        if region != self.favoured {
            self.replan();
            self.favoured = region;
        }
    }

    /// Time in which the render stood still between calls, which no budget counts.
    pub fn hold(&mut self, duration: Duration) {
        self.start += duration;
    }

    /// Everything known of the pixels.
    pub fn store(&self) -> &Arc<Store> {
        &self.store
    }

    /// Runs until a budget is spent. The observer is told of every step.
    pub fn run(mut self, observer: &mut dyn Observer) -> Outcome {
        loop {
            if let Ended::Finished(filtered, stopped_by) = self.advance(observer) {
                return self.into_outcome(*filtered, stopped_by);
            }
        }
    }

    /// Runs until a budget is spent or the observer wants to leave; may be called again, after
    /// changes or not, and goes on where it was.
    pub fn advance(&mut self, observer: &mut dyn Observer) -> Ended {
        if self.store.drawn() > 0 {
            // Of another process or other settings: their last pass may not fit any more.
            self.choose_unrehearsed();
        }
        let stopped_by = loop {
            // The maps decide where the next batch goes.
            let batch = match std::mem::take(&mut self.entry) {
                Entry::Plan => match self.plan() {
                    Ok(plan) => Some(self.allocate(plan)),
                    Err(stopped_by) => break stopped_by,
                },
                Entry::Within(batch) => Some(batch),
                Entry::After => None,
            };
            // The batch goes into the store.
            if let Some(batch) = batch {
                match self.render(batch, observer) {
                    Rendered::Done => self.keep_if_due(None, 0.0),
                    Rendered::Interrupted => return self.end(StoppedBy::Interrupt, observer),
                    Rendered::Left => return Ended::Left,
                }
            }
            if self.interrupt.load(Ordering::Relaxed) {
                break StoppedBy::Interrupt;
            }
            // The filter makes an image and maps of it.
            match self.plan() {
                Ok(next) => {
                    if let Some(quality) = self.rerun_due(next.last) {
                        // A pass can take longer than a state should be old.
                        self.keep_if_due(None, self.pass_seconds(quality));
                        if !self.rerun(quality, observer) {
                            self.entry = Entry::After;
                            return Ended::Left;
                        }
                    }
                }
                Err(stopped_by) => break stopped_by,
            }
        };
        self.keep(None);
        self.end(stopped_by, observer)
    }

    fn end(&mut self, stopped_by: StoppedBy, observer: &mut dyn Observer) -> Ended {
        // As where a state has samples, but no time is left.
        self.choose_unrehearsed();
        match self.last_pass(observer) {
            Some(filtered) => Ended::Finished(Box::new(filtered), stopped_by),
            None => Ended::Left,
        }
    }

    /// Ends the render with what [`Self::advance`] gave.
    pub fn into_outcome(self, filtered: Filtered, stopped_by: StoppedBy) -> Outcome {
        Outcome {
            last_filter: self.last_filter(),
            filtered,
            own_samples: self.store.samples() - self.resumed_samples,
            store: Arc::unwrap_or_clone(self.store),
            batches: self.batches,
            stopped_by,
            seconds: self.seconds,
            estimate: self.estimate,
            hurried: self.hurried,
            settings: self.settings,
        }
    }

    fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn plan(&self) -> Result<Plan, StoppedBy> {
        let error = self.estimate.as_ref().map(ErrorEstimate::at_most);
        self.schedule.next(self.elapsed(), self.store.drawn(), error)
    }
}

#[cfg(test)]
mod tests;
