//! The loop: render a batch into the store, filter, decide where the next batch goes, until a budget
//! is spent. The only room that reads a clock.

mod estimate;
mod observer;
mod schedule;
mod steps;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::adaptive::{self, Allocation, Maps, PrioritySettings, Sampling};
use crate::filter::{self, Filtered, Quality};
use crate::image::Planes;
use crate::image::metrics::Pair;
use crate::render::Renderer;
use crate::stats::{Part, Store};

pub use estimate::ErrorEstimate;
use estimate::Snapshot;
pub use observer::{FilterJob, Flow, Observer, Shown};
pub use schedule::Budget;
use schedule::Schedule;
use steps::Steps;

/// The reconstruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Denoiser {
    /// The mean of the samples.
    None,
    /// P-RPF, or what its quality stands for.
    Prpf,
}

/// Everything the loop follows.
#[derive(Clone, Debug, serde::Serialize)]
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
}

/// One turn of the circle.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Batch {
    pub index: usize,
    /// Since the program's start, when the batch's image stood.
    pub seconds: f64,
    pub samples_total: u64,
    pub filter_seconds: f64,
    pub interpolation_success: Option<f32>,
    /// Relative MSE of the image shown *before* this batch, measured with the batch.
    pub estimated_error: Option<f64>,
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
    pub filtered: Filtered,
    pub store: Store,
    pub batches: Vec<Batch>,
    pub stopped_by: StoppedBy,
    pub seconds: Seconds,
    /// The latest estimate of the image's relMSE; of an image with fewer samples than the final one.
    pub estimated_error: Option<f64>,
    /// Squared relative error by 16×16 tile, likewise.
    pub tile_error: Option<Planes>,
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

/// How rendering a batch ended.
enum Rendered {
    Whole,
    Interrupted,
    Left,
}

/// The loop's own state.
pub struct Loop<'a> {
    renderer: &'a Renderer<'a>,
    settings: Settings,
    /// When the program started: what budgets of time count from.
    start: Instant,
    /// Set from outside to end the render after the current step.
    interrupt: &'a AtomicBool,
    /// What the filtered image is compared with after every batch: 3 planes.
    reference: Option<&'a Planes>,
    /// Shared only with a filter pass, and not for longer unless its observer gave it up.
    store: Arc<Store>,
    schedule: Schedule,
    batches: Vec<Batch>,
    seconds: Seconds,
    estimate: Option<ErrorEstimate>,
    /// What the next batch's maps are made from.
    shown: Option<Shown>,
    /// Pixels that get all samples, see [`Self::favour`].
    favoured: Option<Region>,
    /// Samples per second, of the latest step.
    rate: Option<f64>,
}

/// Columns x0 to x1 and rows y0 to y1 of the store, half open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    pub x: [usize; 2],
    pub y: [usize; 2],
}

/// Sample vectors kept per pixel where mutual information is estimated: enough for the smallest of
/// its windows.
pub const RESERVOIR: usize = 8;
/// Share of the time so far that reruns of the filter may have taken.
const RERUN_SHARE: f64 = 0.1;
/// Window of the grid stage whose failures drive samples; the paper's third.
const FAILURE_WINDOW: usize = 17;

fn reservoir_capacity(settings: &Settings) -> usize {
    match (settings.denoiser, settings.quality) {
        (Denoiser::Prpf, Quality::Paper) => RESERVOIR,
        _ => 0,
    }
}

fn drives_interpolation(settings: &Settings) -> bool {
    settings.denoiser == Denoiser::Prpf
        && settings.sampling == Sampling::Adaptive
        && settings.priority.interpolation_failure > 0.0
}

/// Bytes per pixel that a render with these settings keeps in its store.
pub fn store_bytes_per_pixel(layout: &crate::stats::Layout, settings: &Settings) -> usize {
    Store::bytes_per_pixel(layout, reservoir_capacity(settings))
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
            schedule: Schedule::new(
                &settings.budget,
                (width * height) as u64,
                settings.min_spp,
                settings.max_spp,
            ),
            store: Arc::new(store),
            batches: Vec::new(),
            seconds: Seconds::default(),
            estimate: None,
            shown: None,
            favoured: None,
            rate: None,
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
            let elapsed = self.start.elapsed().as_secs_f64();
            let error = self.estimate.as_ref().map(ErrorEstimate::at_most);
            let total = match self.schedule.next(elapsed, self.store.drawn(), error) {
                Ok(total) => total,
                Err(stopped_by) => break stopped_by,
            };
            let before = Snapshot::of(&self.store);
            let allocation = self.allocate(total);
            let rendered = self.render(&allocation, observer);
            if let Some(shown) = &self.shown {
                let new = ErrorEstimate::of(&shown.filtered.image, &before, &self.store, &allocation.probes);
                let old = self.estimate.take();
                self.estimate = match new {
                    Some(new) => Some(new.or_keep(old)),
                    None => old,
                };
            }
            match rendered {
                Rendered::Whole => {}
                Rendered::Interrupted => break StoppedBy::Interrupt,
                Rendered::Left => return Ended::Left,
            }
            let elapsed = self.start.elapsed().as_secs_f64();
            let error = self.estimate.as_ref().map(ErrorEstimate::at_most);
            if let Err(stopped_by) = self.schedule.next(elapsed, self.store.drawn(), error) {
                break stopped_by;
            }
            // With a budget of time the filter waits until there is something to decide and its share is
            // small again; with one of samples the clock has no say, so that the image is the same on
            // any machine.
            let timed = self.settings.budget.seconds.is_some() || self.favoured.is_some();
            let pixels = self.store.pixels() as u64;
            let decides = self.store.drawn() >= u64::from(self.settings.min_spp) * pixels;
            let affordable = self.shown.is_none() || self.seconds.filter < RERUN_SHARE * elapsed;
            if !timed || decides && affordable {
                let Some((shown, seconds)) = self.filter(Quality::Draft, true, observer) else {
                    return Ended::Left;
                };
                self.schedule.filtered(seconds);
                self.shown = Some(shown);
            }
        };
        let Some((shown, _)) = self.filter(self.settings.quality, false, observer) else {
            return Ended::Left;
        };
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
            estimated_error: self.estimate.as_ref().map(|e| e.image),
            tile_error: self.estimate.map(|e| e.tiles),
        }
    }

    /// Decides where the next samples go.
    fn allocate(&mut self, total: u64) -> Allocation {
        let started = Instant::now();
        let counts = self.store.counts(Part::Whole);
        let floor = self.settings.min_spp.min(self.settings.max_spp);
        let priority = match (self.settings.sampling, &self.shown) {
            (Sampling::Adaptive, Some(shown)) if counts.iter().all(|&n| n >= floor) => {
                let maps = Maps {
                    counts: &counts,
                    image: &shown.filtered.image,
                    filtered_variance: &shown.filtered.variance,
                    raw_variance: &filter::variance_of_mean(&self.store),
                    residual: &shown.filtered.residual,
                    interpolation_failure: shown.failure.as_ref(),
                };
                Some(adaptive::priority(maps, &self.settings.priority))
            }
            _ => None,
        };
        let (width, max_spp) = (self.store.width(), self.settings.max_spp);
        let key = self.settings.seed.rotate_left(32) ^ self.batches.len() as u64;
        let spread = |priority: Option<&[f32]>, have: &[u32], width: usize, total: u64| match priority {
            Some(priority) => adaptive::allocate(priority, have, width, total, max_spp, key),
            None => adaptive::uniform(total, have, max_spp),
        };
        let favoured = self.favoured.and_then(|region| region.share(&counts, width, total, &self.settings));
        let allocation = match favoured {
            Some((pixels, columns, total)) => {
                let of = |i: &usize| priority.as_ref().map_or(0.0, |priority| priority[*i]);
                let have: Vec<u32> = pixels.iter().map(|&i| counts[i]).collect();
                let inside: Option<Vec<f32>> = priority.is_some().then(|| pixels.iter().map(of).collect());
                let part = spread(inside.as_deref(), &have, columns, total);
                let mut whole =
                    Allocation { counts: vec![0; counts.len()], probes: vec![false; counts.len()] };
                pixels.iter().zip(part.counts).for_each(|(&i, n)| whole.counts[i] = n);
                whole
            }
            None => spread(priority.as_deref(), &counts, width, total),
        };
        self.seconds.allocate += started.elapsed().as_secs_f64();
        allocation
    }

    /// Renders a batch in steps short enough to be interrupted between.
    fn render(&mut self, allocation: &Allocation, observer: &mut dyn Observer) -> Rendered {
        let started = Instant::now();
        let mut held = Duration::ZERO;
        let pixels = self.store.pixels() as u64;
        let mut steps = Steps::new(&allocation.counts, self.store.width(), self.store.drawn() == 0);
        let mut ended = Rendered::Whole;
        let mut rendered = 0;
        while let Some(counts) = steps.next(self.step_samples(pixels, observer)) {
            let step_started = Instant::now();
            // Copies only if a filter pass that was given up still reads the store.
            self.renderer.render_batch(&counts, Arc::make_mut(&mut self.store));
            let new = counts.iter().map(|&n| u64::from(n)).sum::<u64>();
            self.rate = Some(new as f64 / step_started.elapsed().as_secs_f64().max(1e-6));
            rendered += new;
            let (samples, elapsed) = (self.store.samples(), self.start.elapsed().as_secs_f64());
            let progress = Progress {
                fraction: self.schedule.fraction(elapsed, samples),
                elapsed,
                samples,
                spp: samples as f64 / self.store.pixels().max(1) as f64,
                estimated_error: self.estimate.as_ref().map(|e| e.image),
            };
            match observer.stepped(progress, &self.store) {
                Flow::GoOn => {}
                Flow::Held(duration) => held += duration,
                Flow::Leave => ended = Rendered::Left,
            }
            if self.interrupt.load(Ordering::Relaxed) {
                ended = Rendered::Interrupted;
            }
            if !matches!(ended, Rendered::Whole) || self.schedule.is_late(elapsed) {
                break;
            }
        }
        self.start += held;
        let seconds = started.elapsed().saturating_sub(held).as_secs_f64();
        self.seconds.render += seconds;
        self.schedule.rendered(rendered, seconds);
        ended
    }

    /// Samples of the next step.
    fn step_samples(&self, pixels: u64, observer: &dyn Observer) -> u64 {
        let (least, most) = (pixels.div_ceil(steps::BLOCK), self.schedule.step_samples());
        match (observer.step_seconds(), self.rate) {
            (None, _) => most,
            // Nothing is known of the scene's speed: as little as makes an image.
            (Some(_), None) => least,
            (Some(seconds), Some(rate)) => ((seconds * rate) as u64).min(most).max(least),
        }
    }

    /// Filters and reports; between batches (`rerun`) with a look at interpolation where that drives
    /// samples. `None`: the observer gave it up.
    fn filter(&mut self, quality: Quality, rerun: bool, observer: &mut dyn Observer) -> Option<(Shown, f64)> {
        let started = Instant::now();
        let job = FilterJob {
            store: self.store.clone(),
            denoiser: self.settings.denoiser,
            quality,
            seed: self.settings.seed,
            interpolation: rerun && drives_interpolation(&self.settings),
        };
        let shown = observer.run_filter(job);
        let seconds = started.elapsed().as_secs_f64();
        self.seconds.filter += seconds;
        let mut shown = shown?;
        if !rerun && let Some(last) = &self.shown {
            let filtered = &mut shown.filtered;
            filtered.interpolation_failure =
                filtered.interpolation_failure.take().or_else(|| last.failure.clone());
            filtered.interpolation_success = filtered.interpolation_success.or(last.success);
        }
        let success = if rerun { shown.success } else { shown.filtered.interpolation_success };
        self.report(&shown.filtered, seconds, success);
        if let Some(batch) = self.batches.last() {
            observer.filtered(&shown, batch);
        }
        Some((shown, seconds))
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
            mse: against(Some(&filtered.image), |pair| pair.mse()),
            relmse: against(Some(&filtered.image), |pair| pair.relmse()),
            noisy_mse: against(noisy.as_ref(), |pair| pair.mse()),
            noisy_relmse: against(noisy.as_ref(), |pair| pair.relmse()),
        };
        self.batches.push(batch);
    }
}

impl Region {
    /// The region's pixels, its columns, and how many of `total` samples it gets now; `None` if it is
    /// empty or has had its budget.
    fn share(
        &self,
        counts: &[u32],
        width: usize,
        total: u64,
        settings: &Settings,
    ) -> Option<(Vec<usize>, usize, u64)> {
        let height = counts.len() / width.max(1);
        let [x0, x1] = self.x.map(|x| x.min(width));
        let [y0, y1] = self.y.map(|y| y.min(height));
        let pixels: Vec<usize> = (y0..y1).flat_map(|y| (x0..x1).map(move |x| y * width + x)).collect();
        let have: u64 = pixels.iter().map(|&i| u64::from(counts[i])).sum();
        let spp = settings.budget.spp.map_or(settings.max_spp, |spp| spp.min(settings.max_spp));
        let left = (u64::from(spp) * pixels.len() as u64).saturating_sub(have);
        // As batches of the whole image: the total doubles.
        let share = have.max(u64::from(settings.min_spp.max(1)) * pixels.len() as u64).min(left).min(total);
        (share > 0).then_some((pixels, x1 - x0, share))
    }
}
