//! The loop: render a batch into the store, filter, decide where the next batch goes, until a budget
//! is spent. The only room that reads a clock.

mod estimate;
mod memory;
mod observer;
mod region;
mod rehearsal;
mod schedule;
mod steps;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::adaptive::{self, Allocation, Maps, PrioritySettings, Sampling};
use crate::filter::{self, Filtered, Quality, rpf};
use crate::image::Planes;
use crate::image::metrics::Pair;
use crate::render::Renderer;
use crate::stats::{Layout, Part, Store};

pub use estimate::{ErrorEstimate, TILE};
pub use memory::{Keep, Memory, Rerun, Snapshot, UnderWay};
pub use observer::{FilterJob, Flow, Observer, Shown};
pub use region::Region;
use rehearsal::Rehearsal;
pub use schedule::Budget;
use schedule::{Plan, Schedule};
pub use steps::Grain;

/// The reconstruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Denoiser {
    /// The mean of the samples.
    None,
    /// P-RPF, or what its quality stands for.
    Prpf,
    /// Random parameter filtering, on whole samples; it has no qualities. Between batches, where no error is
    /// to be reached, P-RPF's draft stands in.
    Rpf,
}

/// Everything the loop follows.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Settings {
    pub budget: Budget,
    pub sampling: Sampling,
    pub denoiser: Denoiser,
    pub quality: Quality,
    pub seed: u64,
    /// Floor per pixel.
    pub min_spp: u32,
    /// Ceiling per pixel.
    pub max_spp: u32,
    pub priority: PrioritySettings,
    /// Sample vectors kept per pixel at least; the denoiser may need more.
    pub reservoir: usize,
}

/// One turn of the circle.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Batch {
    pub index: usize,
    /// Since the program's start, when the batch's image stood.
    pub seconds: f64,
    pub samples_total: u64,
    pub filter_seconds: f64,
    pub interpolation_success: Option<f32>,
    /// Latest estimate of the relative MSE, of an image shown *before* this batch.
    pub estimated_error: Option<f64>,
    /// Samples that that image was made of.
    pub estimated_error_samples: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relmse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noisy_mse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noisy_relmse: Option<f64>,
}

/// What ended a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StoppedBy {
    Spp,
    Time,
    TargetError,
    Interrupt,
}

/// Where the time went, in seconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seconds {
    pub render: f64,
    pub filter: f64,
    pub allocate: f64,
}

/// A finished render.
pub struct Outcome {
    /// The image. Its interpolation failures are those of the last rerun where the filter itself does
    /// not interpolate.
    pub filtered: Filtered,
    pub store: Store,
    pub batches: Vec<Batch>,
    pub stopped_by: StoppedBy,
    pub seconds: Seconds,
    /// The latest estimate of the image's relMSE; of an image with fewer samples than the final one.
    pub estimate: Option<ErrorEstimate>,
}

/// A sign of life, after every step of a batch.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Share of the nearest budget that is spent, in [0, 1].
    pub fraction: f64,
    /// Seconds since the start, those not counted in which the render was held.
    pub elapsed: f64,
    pub samples: u64,
    pub spp: f64,
    pub estimated_error: Option<f64>,
}

/// How [`Loop::advance`] ended.
pub enum Ended {
    /// A budget is spent; the last filter pass.
    Finished(Box<Filtered>, StoppedBy),
    /// The observer wanted to leave.
    Left,
}

/// Where a call of [`Loop::advance`] enters the circle.
#[derive(Default)]
enum Entry {
    /// Before a batch is planned.
    #[default]
    Plan,
    /// Within a batch that another process began.
    Within(UnderWay),
    /// After a batch that another process rendered.
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
    /// Set from outside to end the render after the current batch.
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
    schedule: Schedule,
    rehearsal: Rehearsal,
    batches: Vec<Batch>,
    seconds: Seconds,
    /// Seconds of all reruns of the filter, and of the latest one of interim quality.
    reruns: f64,
    interim_seconds: Option<f64>,
    estimate: Option<ErrorEstimate>,
    rerun: Option<Rerun>,
    /// Pixels that get all samples, see [`Self::favour`].
    favoured: Option<Region>,
}

/// Sample vectors kept per pixel where mutual information is estimated: enough for the smallest of
/// its windows.
pub const RESERVOIR: usize = 8;
/// Share of the time that reruns of the filter may take under a budget of time.
const RERUN_SHARE: f64 = 0.1;
/// The one before the last batch may take this share by itself, however short the budget: without it
/// nothing is known of the error of an image like the last one.
const LAST_RERUN_SHARE: f64 = 0.08;
/// A rerun must be followed by at least this many times its time for the samples that it directs.
const LEAST_USE_OF_RERUN: f64 = 3.0;
/// Window of the grid stage whose failures drive samples; the paper's third.
const FAILURE_WINDOW: usize = 17;

/// Sample vectors that a render with these settings keeps per pixel.
pub fn reservoir_capacity(settings: &Settings) -> usize {
    let needed = match (settings.denoiser, settings.quality) {
        (Denoiser::Rpf, _) => most_samples(settings),
        (Denoiser::Prpf, Quality::Paper) => RESERVOIR,
        _ => 0,
    };
    needed.max(settings.reservoir)
}

/// Samples that a pixel can get, as far as budgets limit it.
fn most_samples(settings: &Settings) -> usize {
    let of_mean = match settings.sampling {
        Sampling::Uniform => 1.0,
        Sampling::Adaptive => adaptive::CEILING,
    };
    let budget = settings.budget.spp.map_or(u32::MAX, |spp| (f64::from(spp) * of_mean) as u32);
    budget.min(settings.max_spp) as usize
}

fn drives_interpolation(settings: &Settings) -> bool {
    settings.denoiser != Denoiser::None
        && settings.sampling == Sampling::Adaptive
        && settings.priority.interpolation_failure > 0.0
}

/// Memory that a render with these settings takes, per pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelMemory {
    /// Bytes of statistics.
    pub statistics: usize,
    /// Samples that are kept whole, at most.
    pub samples: usize,
    /// Bytes of each of them, with what the filter needs beside it.
    pub per_sample: usize,
}

impl PixelMemory {
    pub fn of(layout: &Layout, settings: &Settings) -> Self {
        let statistics = Store::bytes_per_pixel(layout, 0);
        let beside = if settings.denoiser == Denoiser::Rpf { rpf::BYTES_PER_SAMPLE } else { 0 };
        Self {
            statistics,
            samples: reservoir_capacity(settings),
            per_sample: Store::bytes_per_pixel(layout, 1) - statistics + beside,
        }
    }
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
        let store =
            Store::new(width, height, renderer.layout().clone(), reservoir_capacity(settings), settings.seed);
        Self {
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
            rehearsal: Rehearsal::default(),
            batches: Vec::new(),
            seconds: Seconds::default(),
            reruns: 0.0,
            interim_seconds: None,
            estimate: None,
            rerun: None,
            favoured: None,
        }
    }

    /// What the caller will do with the image counts as part of a budget of time: it is rehearsed on
    /// some rows of the image, so that the loop knows how long it takes.
    pub fn closing_with(mut self, closing: Closing<'a>) -> Self {
        self.closing = Some(closing);
        self
    }

    /// Hands over what it knows every so many seconds, between two steps, and when a budget is spent,
    /// before the last filter pass.
    pub fn keeping(mut self, seconds: f64, keep: Keep<'a>) -> Self {
        self.keep = Some((seconds, keep));
        self
    }

    /// Goes on from what another loop knew. With a budget of samples the end is the same to the last
    /// bit as if that one had gone on.
    ///
    /// # Panics
    /// If the store is not of the renderer's size and layout.
    pub fn resuming(mut self, memory: Memory) -> Self {
        let Memory { store, batches, estimate, rerun, under_way, recent } = memory;
        assert_eq!((store.width(), store.height()), self.renderer.resolution(), "a state of this image");
        assert_eq!(store.layout(), self.renderer.layout(), "a state of this scene");
        self.entry = match under_way {
            Some(batch) => Entry::Within(batch),
            None if store.drawn() > 0 => Entry::After,
            None => Entry::Plan,
        };
        self.schedule.resume(recent);
        (self.store, self.batches, self.estimate, self.rerun) = (store, batches, estimate, rerun);
        self
    }

    fn keep(&mut self, under_way: Option<&UnderWay>) {
        let Some((_, keep)) = self.keep else { return };
        keep(Memory {
            store: self.store.clone(),
            batches: self.batches.clone(),
            estimate: self.estimate.clone(),
            rerun: self.rerun.clone(),
            under_way: under_way.cloned(),
            recent: self.schedule.recent(),
        });
        self.kept = self.elapsed();
    }

    fn keep_if_due(&mut self, under_way: Option<&UnderWay>) {
        if self.keep.is_some_and(|(seconds, _)| self.elapsed() >= self.kept + seconds) {
            self.keep(under_way);
        }
    }

    /// Follows other settings from now on. The seed and what the reservoir keeps stay as they are.
    pub fn change(&mut self, settings: &Settings) {
        self.schedule.change(&settings.budget);
        self.settings = Settings { seed: self.settings.seed, ..settings.clone() };
    }

    /// Whether the samples so far can be filtered as these settings ask for.
    pub fn can_change_to(&self, settings: &Settings) -> bool {
        reservoir_capacity(settings) <= self.store.capacity()
    }

    /// Gives a region all samples until each of its pixels has the budget's on average, or until the
    /// region is taken back. The estimate of the image's error stands still meanwhile.
    pub fn favour(&mut self, region: Option<Region>) {
        self.favoured = region;
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
        let stopped_by = loop {
            let batch = match std::mem::take(&mut self.entry) {
                Entry::After => None,
                Entry::Within(batch) => Some(batch),
                Entry::Plan => match self.plan() {
                    Ok(plan) => Some(self.begin(plan)),
                    Err(stopped_by) => break stopped_by,
                },
            };
            if let Some(batch) = batch {
                let (probes, left) = self.render(batch, observer);
                self.check(&probes);
                if left {
                    return Ended::Left;
                }
                self.keep_if_due(None);
            }
            if self.interrupt.load(Ordering::Relaxed) {
                break StoppedBy::Interrupt;
            }
            match self.plan() {
                Err(stopped_by) => break stopped_by,
                Ok(next) => {
                    if let Some(quality) = self.rerun_due(self.rerun.is_some(), next.last)
                        && !self.rerun(quality, observer)
                    {
                        return Ended::Left;
                    }
                }
            }
        };
        self.keep(None);
        let (denoiser, quality) = self.last_filter();
        let Some((mut shown, seconds)) = self.filter(denoiser, quality, false, observer) else {
            return Ended::Left;
        };
        if let Some(last) = &self.rerun {
            let filtered = &mut shown.filtered;
            filtered.interpolation_failure =
                filtered.interpolation_failure.take().or_else(|| last.failure.clone());
            filtered.interpolation_success = filtered.interpolation_success.or(last.success);
        }
        self.report(&shown.filtered, seconds, shown.filtered.interpolation_success);
        observer.filtered(&shown);
        Ended::Finished(Box::new(shown.filtered), stopped_by)
    }

    /// Ends the render with what [`Self::advance`] gave.
    pub fn into_outcome(self, filtered: Filtered, stopped_by: StoppedBy) -> Outcome {
        Outcome {
            filtered,
            store: Arc::unwrap_or_clone(self.store),
            batches: self.batches,
            stopped_by,
            seconds: self.seconds,
            estimate: self.estimate,
        }
    }

    fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn plan(&self) -> Result<Plan, StoppedBy> {
        let error = self.estimate.as_ref().map(ErrorEstimate::at_most);
        self.schedule.next(self.elapsed(), self.store.drawn(), error)
    }

    /// Holds the samples since an image was shown against it.
    fn check(&mut self, probes: &[bool]) {
        if self.interim_denoiser() != self.settings.denoiser {
            // The error of another filter's image says nothing on that of the last.
            return;
        }
        let Some(Rerun { image, made_of, probes: all, .. }) = &mut self.rerun else { return };
        all.iter_mut().zip(probes).for_each(|(all, &new)| *all |= new);
        let new = ErrorEstimate::of(image, made_of, &self.store, all);
        if let Some(new) = new {
            self.estimate = Some(new.or_keep(self.estimate.take()));
        }
    }

    /// The last filter pass: a filter that takes pixels without samples for black ones is of no use
    /// where the time was too short for one sample per pixel.
    fn last_filter(&self) -> (Denoiser, Quality) {
        let sparse = self.store.drawn() < self.store.pixels() as u64;
        match (self.settings.denoiser, self.settings.quality) {
            (Denoiser::Rpf, _) | (Denoiser::Prpf, Quality::Paper) if sparse => {
                (Denoiser::Prpf, Quality::Standard)
            }
            chosen => chosen,
        }
    }

    /// The filter between batches.
    fn interim_denoiser(&self) -> Denoiser {
        match self.settings.denoiser {
            Denoiser::Rpf if self.settings.budget.target_error.is_none() => Denoiser::Prpf,
            denoiser => denoiser,
        }
    }

    /// Its effort.
    fn interim_quality(&self) -> Quality {
        match self.settings.quality {
            // The draft's error is not the paper's, and it is the paper's that has to reach the target.
            Quality::Paper if self.settings.budget.target_error.is_some() => Quality::Paper,
            _ => Quality::Draft,
        }
    }

    /// Whether the filter runs again before the next batch, and with what effort. Before the last
    /// batch it is that of the end, so that the error which the batch measures is that of such an image.
    fn rerun_due(&self, again: bool, last: bool) -> Option<Quality> {
        let interim = self.interim_quality();
        let ending = match self.settings.denoiser {
            Denoiser::Rpf => interim,
            _ => self.settings.quality,
        };
        if self.favoured.is_some() && again && self.reruns > RERUN_SHARE * self.elapsed() {
            // A region's batches are small.
            return None;
        }
        let Some(left) = self.schedule.seconds_left(self.elapsed()) else {
            // The clock has no say, so that the image is the same on any machine.
            return Some(if last { ending } else { interim });
        };
        let budget = self.settings.budget.seconds.unwrap_or(0.0);
        let ending_seconds = self.rehearsal.filter_seconds;
        let interim_seconds = self.interim_seconds.unwrap_or(ending_seconds).min(ending_seconds);
        let of_use = |seconds: f64| LEAST_USE_OF_RERUN * seconds <= left;
        if !again {
            // There has to be something to decide; then the first comes whatever its share.
            let decides = self.store.drawn() >= u64::from(self.settings.min_spp) * self.store.pixels() as u64;
            return (decides && of_use(interim_seconds)).then_some(interim);
        }
        if last {
            let fits = |seconds: f64| of_use(seconds) && seconds <= LAST_RERUN_SHARE * budget;
            let choices = [(ending, ending_seconds), (interim, interim_seconds)];
            return choices.into_iter().find_map(|(quality, seconds)| fits(seconds).then_some(quality));
        }
        // What the one before the last batch will take is kept for it.
        let spent = self.reruns + interim_seconds;
        let fits = spent <= RERUN_SHARE * self.elapsed() && spent + ending_seconds <= RERUN_SHARE * budget;
        (fits && of_use(interim_seconds)).then_some(interim)
    }

    /// Under a budget of time, measures on some rows what comes after the last batch, now and then.
    fn rehearse(&mut self) {
        let elapsed = self.elapsed();
        let Some(left) = self.schedule.seconds_left(elapsed) else { return };
        // Pixels without samples have to be filled first, which the last pass will not have to.
        let filled = self.store.drawn() >= self.store.pixels() as u64;
        if !filled || !self.rehearsal.is_due(elapsed, left) {
            return;
        }
        let ((denoiser, quality), seed) = (self.last_filter(), self.settings.seed);
        let filter = |store: &Store| observer::filtered(store, denoiser, quality, seed);
        self.rehearsal.run(&self.store, left, filter, self.closing);
        self.schedule.rehearsed(self.rehearsal.closing_seconds);
        self.seconds.filter += self.elapsed() - elapsed;
    }

    /// Decides where the next samples go.
    fn allocate(&mut self, total: u64) -> Allocation {
        let started = Instant::now();
        let counts = self.store.counts(Part::Whole);
        let floor = self.settings.min_spp.min(self.settings.max_spp);
        let priority = match (self.settings.sampling, &self.rerun) {
            (Sampling::Adaptive, Some(rerun)) if counts.iter().all(|&n| n >= floor) => {
                let maps = Maps {
                    counts: &counts,
                    image: &rerun.image,
                    filtered_variance: &rerun.variance,
                    raw_variance: &filter::variance_of_mean(&self.store),
                    residual: &rerun.residual,
                    interpolation_failure: rerun.failure.as_ref(),
                };
                Some(adaptive::priority(maps, &self.settings.priority))
            }
            _ => None,
        };
        let max_spp = self.settings.max_spp;
        let key = self.settings.seed.rotate_left(32) ^ self.batches.len() as u64;
        let spread = |priority: Option<&[f32]>, have: &[u32], width: usize, total: u64| match priority {
            Some(priority) => adaptive::allocate(priority, have, width, total, max_spp, key),
            None => adaptive::uniform(total, have, max_spp),
        };
        let width = self.store.width();
        let favoured = self.favoured.and_then(|region| {
            let part = region.part(&counts, width, total, &self.settings)?;
            Some(part.allocate(&counts, priority.as_deref(), spread))
        });
        let allocation = favoured.unwrap_or_else(|| spread(priority.as_deref(), &counts, width, total));
        self.seconds.allocate += started.elapsed().as_secs_f64();
        allocation
    }

    fn begin(&mut self, plan: Plan) -> UnderWay {
        let grain = if self.store.drawn() == 0 { Grain::Pixel } else { Grain::Line };
        UnderWay { allocation: self.allocate(plan.samples), done: 0.0, grain }
    }

    /// Renders what is left of a batch in steps, between which the clock or the observer may end it;
    /// the batch's probes, and whether it was the observer.
    fn render(&mut self, mut batch: UnderWay, observer: &mut dyn Observer) -> (Vec<bool>, bool) {
        let total: u64 = batch.allocation.counts.iter().map(|&n| u64::from(n)).sum();
        while batch.done < 1.0 {
            let started = Instant::now();
            let before = self.store.drawn();
            let Some(share) = self.schedule.step(self.elapsed(), before, total) else { break };
            let short = observer.step_seconds().map(|seconds| self.schedule.short_step(seconds, total));
            let next = (batch.done + short.map_or(share, |short| short.min(share))).min(1.0);
            let counts = steps::between(&batch.allocation.counts, &self.store, batch.grain, batch.done, next);
            // Copies only if a filter pass that was given up still reads the store.
            self.renderer.render_batch(&counts, Arc::make_mut(&mut self.store));
            batch.done = next;
            let seconds = started.elapsed().as_secs_f64();
            self.seconds.render += seconds;
            self.schedule.rendered(self.store.drawn() - before, seconds);
            self.rehearse();
            let (samples, elapsed) = (self.store.samples(), self.elapsed());
            let progress = Progress {
                fraction: self.schedule.fraction(elapsed, samples),
                elapsed,
                samples,
                spp: samples as f64 / self.store.pixels().max(1) as f64,
                estimated_error: self.estimate.as_ref().map(|e| e.image),
            };
            match observer.stepped(progress, &self.store) {
                Flow::GoOn => {}
                Flow::Held(duration) => self.start += duration,
                Flow::Leave => return (batch.allocation.probes, true),
            }
            if batch.done < 1.0 {
                self.keep_if_due(Some(&batch));
            }
        }
        (batch.allocation.probes, false)
    }

    /// Filters between batches; false if the observer gave it up.
    fn rerun(&mut self, quality: Quality, observer: &mut dyn Observer) -> bool {
        let interpolation = drives_interpolation(&self.settings);
        let filtered = self.filter(self.interim_denoiser(), quality, interpolation, observer);
        let Some((shown, filter_seconds)) = filtered else {
            return false;
        };
        let started = Instant::now();
        let rerun = Rerun::new(shown.clone(), &self.store);
        let snapshot_seconds = started.elapsed().as_secs_f64();
        self.seconds.filter += snapshot_seconds;
        let seconds = filter_seconds + snapshot_seconds;
        self.reruns += seconds;
        if quality == self.interim_quality() {
            self.interim_seconds = Some(seconds);
        } else if self.rehearsal.filter_seconds > 0.0 {
            // What the whole takes is better known now than by some of its rows.
            self.schedule.corrected(self.rehearsal.filter_seconds - filter_seconds);
        }
        self.report(&shown.filtered, filter_seconds, shown.success);
        observer.filtered(&shown);
        self.rerun = Some(rerun);
        true
    }

    /// What a filter pass makes of the store, and its seconds; `None` if the observer gave it up.
    fn filter(
        &mut self,
        denoiser: Denoiser,
        quality: Quality,
        interpolation: bool,
        observer: &mut dyn Observer,
    ) -> Option<(Shown, f64)> {
        let started = Instant::now();
        let seed = self.settings.seed;
        let job = FilterJob { store: self.store.clone(), denoiser, quality, seed, interpolation };
        let shown = observer.run_filter(job);
        let seconds = started.elapsed().as_secs_f64();
        self.seconds.filter += seconds;
        Some((shown?, seconds))
    }

    fn report(&mut self, filtered: &Filtered, filter_seconds: f64, interpolation_success: Option<f32>) {
        let noisy = self.reference.map(|_| self.store.means(Part::Whole, self.store.layout().radiance()));
        let against = |image: Option<&Planes>, metric: fn(&Pair) -> f64| {
            image
                .zip(self.reference)
                .and_then(|(image, reference)| Some(metric(&Pair::new(image, reference).ok()?)))
        };
        let batch = Batch {
            index: self.batches.len(),
            seconds: self.start.elapsed().as_secs_f64(),
            samples_total: self.store.samples(),
            filter_seconds,
            interpolation_success,
            estimated_error: self.estimate.as_ref().map(|e| e.image),
            estimated_error_samples: self.estimate.as_ref().map(|e| e.samples),
            mse: against(Some(&filtered.image), |pair| pair.mse()),
            relmse: against(Some(&filtered.image), |pair| pair.relmse()),
            noisy_mse: against(noisy.as_ref(), |pair| pair.mse()),
            noisy_relmse: against(noisy.as_ref(), |pair| pair.relmse()),
        };
        self.batches.push(batch);
    }
}
