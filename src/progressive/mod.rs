//! The loop: render a batch into the store, filter, decide where the next batch goes, until a budget
//! is spent. The only room that reads a clock.

mod estimate;
mod schedule;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::adaptive::{self, Allocation, Maps, PrioritySettings, Sampling};
use crate::filter::{self, Filtered, PrpfSettings, Quality};
use crate::image::Planes;
use crate::image::metrics::Pair;
use crate::render::Renderer;
use crate::stats::{Part, Store};

pub use estimate::ErrorEstimate;
use estimate::Snapshot;
pub use schedule::Budget;
use schedule::Schedule;

/// The reconstruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
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
    pub samples: u64,
    pub spp: f64,
    pub estimated_error: Option<f64>,
}

/// What a batch's maps are made from.
struct Shown {
    filtered: Filtered,
    failure: Option<Planes>,
    success: Option<f32>,
}

/// The loop's own state.
pub struct Loop<'a> {
    renderer: &'a Renderer<'a>,
    settings: &'a Settings,
    /// When the program started: what budgets of time count from.
    start: Instant,
    /// Set from outside to end the render after the current step.
    interrupt: &'a AtomicBool,
    /// What the filtered image is compared with after every batch: 3 planes.
    reference: Option<&'a Planes>,
    store: Store,
    schedule: Schedule,
    batches: Vec<Batch>,
    seconds: Seconds,
    estimate: Option<ErrorEstimate>,
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
        settings: &'a Settings,
        start: Instant,
        interrupt: &'a AtomicBool,
        reference: Option<&'a Planes>,
    ) -> Self {
        let (width, height) = renderer.resolution();
        let store =
            Store::new(width, height, renderer.layout().clone(), reservoir_capacity(settings), settings.seed);
        Self {
            renderer,
            settings,
            start,
            interrupt,
            reference,
            schedule: Schedule::new(
                &settings.budget,
                (width * height) as u64,
                settings.min_spp,
                settings.max_spp,
            ),
            store,
            batches: Vec::new(),
            seconds: Seconds::default(),
            estimate: None,
        }
    }

    /// Runs until a budget is spent. `listen` hears of every step.
    pub fn run(mut self, listen: &mut dyn FnMut(Progress)) -> Outcome {
        let mut shown: Option<Shown> = None;
        let stopped_by = loop {
            let elapsed = self.start.elapsed().as_secs_f64();
            let error = self.estimate.as_ref().map(ErrorEstimate::at_most);
            let total = match self.schedule.next(elapsed, self.store.drawn(), error) {
                Ok(total) => total,
                Err(stopped_by) => break stopped_by,
            };
            let before = Snapshot::of(&self.store);
            let allocation = self.allocate(shown.as_ref(), total);
            let interrupted = self.render(&allocation, listen);
            if let Some(shown) = &shown {
                let new = ErrorEstimate::of(&shown.filtered.image, &before, &self.store, &allocation.probes);
                let old = self.estimate.take();
                self.estimate = match new {
                    Some(new) => Some(new.or_keep(old)),
                    None => old,
                };
            }
            if interrupted {
                break StoppedBy::Interrupt;
            }
            let elapsed = self.start.elapsed().as_secs_f64();
            let error = self.estimate.as_ref().map(ErrorEstimate::at_most);
            if let Err(stopped_by) = self.schedule.next(elapsed, self.store.drawn(), error) {
                break stopped_by;
            }
            // With a budget of time the filter waits until there is something to decide and its share is
            // small again; with one of samples the clock has no say, so that the image is the same on
            // any machine.
            let timed = self.settings.budget.seconds.is_some();
            let pixels = self.store.pixels() as u64;
            let decides = self.store.drawn() >= u64::from(self.settings.min_spp) * pixels;
            let affordable = shown.is_none() || self.seconds.filter < RERUN_SHARE * elapsed;
            if !timed || decides && affordable {
                shown = Some(self.rerun());
            }
        };
        let (mut filtered, seconds) = self.filter(self.settings.quality);
        if let Some(shown) = shown {
            filtered.interpolation_failure = filtered.interpolation_failure.or(shown.failure);
            filtered.interpolation_success = filtered.interpolation_success.or(shown.success);
        }
        self.report(&filtered, seconds, filtered.interpolation_success);
        Outcome {
            filtered,
            store: self.store,
            batches: self.batches,
            stopped_by,
            seconds: self.seconds,
            estimated_error: self.estimate.as_ref().map(|e| e.image),
            tile_error: self.estimate.map(|e| e.tiles),
        }
    }

    /// Decides where the next samples go.
    fn allocate(&mut self, shown: Option<&Shown>, total: u64) -> Allocation {
        let started = Instant::now();
        let counts = self.store.counts(Part::Whole);
        let floor = self.settings.min_spp.min(self.settings.max_spp);
        let allocation = match (self.settings.sampling, shown) {
            (Sampling::Adaptive, Some(shown)) if counts.iter().all(|&n| n >= floor) => {
                let maps = Maps {
                    counts: &counts,
                    image: &shown.filtered.image,
                    filtered_variance: &shown.filtered.variance,
                    raw_variance: &filter::variance_of_mean(&self.store),
                    residual: &shown.filtered.residual,
                    interpolation_failure: shown.failure.as_ref(),
                };
                let priority = adaptive::priority(maps, &self.settings.priority);
                let key = self.settings.seed.rotate_left(32) ^ self.batches.len() as u64;
                adaptive::allocate(&priority, &counts, self.store.width(), total, self.settings.max_spp, key)
            }
            _ => adaptive::uniform(total, &counts, self.settings.max_spp),
        };
        self.seconds.allocate += started.elapsed().as_secs_f64();
        allocation
    }

    /// Renders a batch in steps short enough to be interrupted between; true if it was.
    fn render(&mut self, allocation: &Allocation, listen: &mut dyn FnMut(Progress)) -> bool {
        let started = Instant::now();
        let total: u64 = allocation.counts.iter().map(|&n| u64::from(n)).sum();
        let steps = self.schedule.steps(total);
        let mut interrupted = false;
        let mut rendered = 0;
        for step in 0..steps {
            // Step k brings every pixel to the k-th share of its batch, rounded down to pairs.
            let share =
                |n: u32, k: u64| if k == steps { u64::from(n) } else { (u64::from(n) * k / steps) & !1 };
            let counts: Vec<u32> =
                allocation.counts.iter().map(|&n| (share(n, step + 1) - share(n, step)) as u32).collect();
            self.renderer.render_batch(&counts, &mut self.store);
            rendered += counts.iter().map(|&n| u64::from(n)).sum::<u64>();
            let (samples, elapsed) = (self.store.samples(), self.start.elapsed().as_secs_f64());
            listen(Progress {
                fraction: self.schedule.fraction(elapsed, samples),
                samples,
                spp: samples as f64 / self.store.pixels().max(1) as f64,
                estimated_error: self.estimate.as_ref().map(|e| e.image),
            });
            interrupted = self.interrupt.load(Ordering::Relaxed);
            if interrupted || self.schedule.is_late(elapsed) {
                break;
            }
        }
        let seconds = started.elapsed().as_secs_f64();
        self.seconds.render += seconds;
        self.schedule.rendered(rendered, seconds);
        interrupted
    }

    /// Filters between batches, with less effort than at the end.
    fn rerun(&mut self) -> Shown {
        let (filtered, mut seconds) = self.filter(Quality::Draft);
        let started = Instant::now();
        let grid = drives_interpolation(self.settings).then(|| {
            filter::prpf::interpolation_failure(&self.store, &PrpfSettings::paper(), FAILURE_WINDOW)
        });
        let grid_seconds = started.elapsed().as_secs_f64();
        self.seconds.filter += grid_seconds;
        seconds += grid_seconds;
        let (failure, success) = grid.unzip();
        self.schedule.filtered(seconds);
        self.report(&filtered, seconds, success);
        Shown { filtered, failure, success }
    }

    fn filter(&mut self, quality: Quality) -> (Filtered, f64) {
        let started = Instant::now();
        let filtered = match self.settings.denoiser {
            Denoiser::None => filter::unfiltered(&self.store),
            Denoiser::Prpf => filter::filter(&self.store, quality, self.settings.seed),
        };
        let seconds = started.elapsed().as_secs_f64();
        self.seconds.filter += seconds;
        (filtered, seconds)
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
