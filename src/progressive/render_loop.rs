//! The render loop: holds the checkpoint and the measurements, and performs actions on them.
//!
//! [`super::next_action`] decides. A driver asks the loop for the next action and lets the loop perform it; filter passes
//! the driver runs itself, on any thread.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::action::{Action, next_action};
use super::allocation::allocate_batch;
use super::calibration::calibrate;
use super::checkpoint::{Checkpoint, Position, SampleBatch};
use super::clock::Clock;
use super::error_estimate::ErrorEstimate;
use super::filter_pass::Filtered;
use super::host::Host;
use super::last_pass::LastPass;
use super::process_group::{ProcessGroup, Rendered, SampleTotals, filter_together};
use super::record::Outcome;
use super::schedule::Plan;
use super::settings::Settings;
use super::situation::{Conditions, Mark, Measurements, Situation};
use super::steps::Grain;
use super::stopped_by::StoppedBy;
use super::time_constants::{PREPARED, PROBE_BYTES};
use crate::filter::{Denoiser, FilterResult, UNFILTERED};
use crate::image::Planes;
use crate::memory;
use crate::render::Renderer;
use crate::stats::{Rectangle, StatisticsExtent, Store};

mod passes;
mod processes;
mod progress;

/// The state of a render and its measurements, on which actions are performed.
pub struct RenderLoop<'a> {
    renderer: &'a Renderer<'a>,
    settings: Settings,
    clock: Clock,
    checkpoint: Checkpoint,
    measurements: Measurements,
    /// The processes that take the samples, if there are several.
    processes: Option<&'a mut dyn ProcessGroup>,
    /// Samples so far.
    samples: SampleTotals,
    /// Samples with which every pixel has those of a map of counts.
    map_end: Option<u64>,
    /// What the checkpoint's store has of the statistics of all processes, its latest samples included.
    gathered: Option<StatisticsExtent>,
    /// The region that is rendered first.
    region: Option<Rectangle>,
    /// Samples of the store that an earlier run took.
    resumed_samples: u64,
    /// The image that every filtered one is compared with: 3 planes.
    reference: Option<&'a Planes>,
}

impl<'a> RenderLoop<'a> {
    /// Starts a new render. `start`: when the program started, from which time budgets count.
    pub fn new(renderer: &'a Renderer<'a>, settings: &Settings, start: Instant) -> Self {
        let (width, height) = renderer.resolution();
        let (layout, capacity) = (renderer.layout().clone(), settings.reservoir_capacity());
        let store = Store::new(width, height, layout, capacity, settings.seed);
        Self::resume(renderer, settings, start, Checkpoint::new(store))
    }

    /// Goes on from a checkpoint. With the same budget of samples, or the same map of counts, the image is the same to the
    /// last bit as if that render had gone on. The rest of an unfinished batch that exceeds these is planned anew.
    ///
    /// # Panics
    /// If the checkpoint is not of the renderer's size and layout.
    pub fn resume(
        renderer: &'a Renderer<'a>,
        settings: &Settings,
        start: Instant,
        mut checkpoint: Checkpoint,
    ) -> Self {
        let store = &checkpoint.store;
        assert_eq!((store.width(), store.height()), renderer.resolution(), "a checkpoint of this image");
        assert_eq!(store.layout(), renderer.layout(), "a checkpoint of this scene");
        let samples = SampleTotals::new(store);
        if matches!(&checkpoint.position, Position::Render(batch) if is_too_large(batch, store, settings)) {
            checkpoint.position = Position::Filter;
        }
        let known = [settings.denoiser.name(), settings.interim_denoiser().name()];
        if checkpoint.interim.as_ref().is_some_and(|interim| !known.contains(&interim.made_by)) {
            checkpoint.forget_image();
        }
        let clock = Clock::new(start);
        let map_end = map_end(settings, &checkpoint.store);
        Self {
            renderer,
            settings: settings.clone(),
            clock,
            checkpoint,
            measurements: Measurements { saved_at: clock.elapsed(), ..Measurements::default() },
            processes: None,
            resumed_samples: samples.valid,
            samples,
            map_end,
            gathered: Some(StatisticsExtent::All),
            region: None,
            reference: None,
        }
    }

    /// Compares every filtered image with a reference of the same size.
    pub fn with_reference(mut self, reference: Option<&'a Planes>) -> Self {
        self.reference = reference;
        self
    }

    /// Applies new settings from now on. The seed stays, and so does the size of the reservoir.
    pub fn change(&mut self, settings: &Settings) {
        let old = self.settings.clone();
        self.settings = Settings { seed: old.seed, ..settings.clone() };
        let new = &self.settings;
        if *new == old {
            return;
        }
        let Measurements { finalisation, interim_seconds, .. } = &mut self.measurements;
        if (new.budget, new.denoiser) != (old.budget, old.denoiser) {
            *finalisation = Default::default();
        }
        let pass = |s: &Settings| (s.denoiser, s.sampling, s.budget.target_error.is_some());
        if pass(new) != pass(&old) {
            *interim_seconds = None;
        }
        let shown = |s: &Settings| (s.denoiser.name().method, s.interim_denoiser());
        let is_other_image = shown(new) != shown(&old);
        self.map_end = map_end(&self.settings, &self.checkpoint.store);
        self.give_up_batch();
        if is_other_image {
            self.checkpoint.forget_image();
        }
    }

    /// Gives a region all samples until each of its pixels has the budget's on average, or until the region is taken
    /// back; most of them as long as other pixels have none.
    pub fn set_region(&mut self, region: Option<Rectangle>) {
        if region != self.region {
            self.region = region;
            self.give_up_batch();
            // The region does not wait for an interim pass.
            self.checkpoint.position = Position::Plan;
        }
    }

    /// Excludes time that has just passed from all budgets.
    pub fn hold(&mut self, duration: Duration) {
        self.clock.hold(duration);
    }

    /// Returns the settings that the loop follows.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Ends the loop, which [`Self::resume`] lets go on.
    pub fn into_checkpoint(self) -> Checkpoint {
        self.checkpoint
    }

    /// Returns the pixel statistics. With several processes they are those of the latest pass, batch or checkpoint that this
    /// process needed them for, as far as it did: those of a pass that all share are [`StatisticsExtent::Radiance`].
    pub fn store(&self) -> &Arc<Store> {
        &self.checkpoint.store
    }

    /// Returns the next action.
    pub fn next_action(&self, conditions: &Conditions) -> Action {
        next_action(&self.situation(conditions))
    }

    /// Performs an action that needs no filter pass.
    ///
    /// # Panics
    /// By [`Action::Filter`] and [`Action::Finish`], for which there are [`Self::interim_pass`] and
    /// [`Self::final_pass`].
    pub fn perform(&mut self, action: Action, host: &mut dyn Host) {
        if !matches!(action, Action::Save) {
            self.measurements.is_saved = false;
        }
        if !matches!(action, Action::Calibrate(_)) {
            self.measurements.finalisation.age();
        }
        match action {
            Action::Allocate(plan) => self.allocate(plan, host),
            Action::Render { to } => self.render(to, host),
            Action::EndBatch => self.checkpoint.position = Position::Filter,
            Action::Calibrate(denoiser) => self.calibrate(denoiser, host),
            Action::Save => self.save(host),
            Action::Filter(_) | Action::Finish(_) => unreachable!("the driver runs filter passes"),
        }
    }

    /// Returns the estimated error of the latest interim image.
    fn estimate(&self) -> Option<&ErrorEstimate> {
        self.checkpoint.interim.as_ref()?.estimate.as_ref()
    }

    /// Hands a checkpoint to the host.
    pub fn save(&mut self, host: &mut dyn Host) {
        if host.checkpoint_interval().is_some() {
            self.gather(StatisticsExtent::All);
            host.save(&self.settings, self.checkpoint.clone());
        }
        (self.measurements.saved_at, self.measurements.is_saved) = (self.clock.elapsed(), true);
    }

    /// Ends the render with the result of [`Self::final_pass`].
    pub fn finish(mut self, filtered: Filtered, stopped_by: StoppedBy) -> Outcome {
        self.complete_final(&filtered);
        self.into_outcome(filtered, stopped_by)
    }

    /// Ends the render with the image of [`Self::complete_final`].
    pub fn into_outcome(self, filtered: Filtered, stopped_by: StoppedBy) -> Outcome {
        let processes = self.processes.map_or_else(Vec::new, |processes| processes.records());
        let Checkpoint { store, passes, .. } = self.checkpoint;
        Outcome {
            result: filtered.result,
            side: filtered.side,
            own_samples: self.samples.valid - self.resumed_samples,
            store: Arc::unwrap_or_clone(store),
            passes,
            stopped_by,
            seconds: self.measurements.seconds,
            first_rejected: self.measurements.first_rejected,
            estimate: filtered.estimate,
            settings: self.settings,
            processes,
        }
    }

    fn situation(&self, conditions: &Conditions) -> Situation<'_> {
        let Checkpoint { store, position, interim, speed, .. } = &self.checkpoint;
        Situation {
            settings: &self.settings,
            sampling: self.checkpoint.sampling(&self.settings),
            pixels: store.pixels() as u64,
            samples: self.samples.taken,
            map_end: self.map_end,
            empty_pixels: self.samples.empty_pixels,
            mark: match position {
                Position::Plan => Mark::Plan,
                Position::Render(batch) => Mark::Render { done: batch.done, samples: batch.samples() },
                Position::Filter => Mark::Filter,
            },
            has_interim: interim.is_some(),
            error: self.estimate().map(|estimate| estimate.value),
            interim_is_by_final_denoiser: interim.as_ref().is_some_and(|interim| {
                // In place of a denoiser that fails the last image is unfiltered, too
                [self.settings.denoiser.name(), UNFILTERED.name()].contains(&interim.made_by)
            }),
            has_region: self.region.is_some(),
            has_reference: self.reference.is_some(),
            processes: self.processes.as_ref().map_or(1, |processes| processes.count()),
            speed: *speed,
            measurements: &self.measurements,
            elapsed: self.clock.elapsed(),
            conditions: *conditions,
        }
    }

    /// Begins a batch.
    fn allocate(&mut self, plan: Plan, host: &mut dyn Host) {
        self.gather(StatisticsExtent::Radiance);
        let started = Instant::now();
        // Later the allocator may hold free pages, which are faster than new ones
        let is_new = self.samples.taken == 0 && self.measurements.memory_seconds.is_none();
        if self.settings.budget.seconds.is_some() && is_new {
            self.measurements.memory_seconds = memory::prepare(PROBE_BYTES);
        }
        let grain = if self.samples.taken == 0 { Grain::Pixel } else { Grain::Block };
        let planned = allocate_batch(&self.checkpoint, self.region, &self.settings, plan.samples);
        let counts = host.choose_counts(&self.checkpoint.store, planned);
        if let Some(processes) = &mut self.processes {
            processes.begin_batch(&counts);
        }
        self.checkpoint.position = Position::Render(SampleBatch { counts, done: 0.0, grain });
        let seconds = started.elapsed().as_secs_f64();
        self.measurements.seconds.allocate += seconds;
        self.measurements.allocation_seconds = seconds;
    }

    /// Renders the batch up to a fraction.
    fn render(&mut self, to: f64, host: &mut dyn Host) {
        let started = Instant::now();
        let Checkpoint { store, position: Position::Render(batch), speed, .. } = &mut self.checkpoint else {
            unreachable!("a step is part of a batch")
        };
        let counts = batch.step(store, to);
        let Rendered { samples, first_rejected } = if let Some(processes) = &mut self.processes {
            self.gathered = None;
            processes.render(&counts)
        } else {
            // Copies only while a filter pass that was given up still reads the store.
            let store = Arc::make_mut(store);
            let first_rejected = match host.sample_sink() {
                Some(sink) => self.renderer.render_recorded(&counts, store, sink),
                None => self.renderer.render_batch(&counts, store),
            };
            Rendered { samples: SampleTotals::new(store), first_rejected }
        };
        batch.done = to;
        let seconds = started.elapsed().as_secs_f64();
        speed.add(samples.taken - self.samples.taken, seconds);
        self.samples = samples;
        self.measurements.seconds.render += seconds;
        self.measurements.first_rejected = self.measurements.first_rejected.or(first_rejected);
    }

    /// Ends an unfinished batch, so that the next one is planned anew.
    fn give_up_batch(&mut self) {
        if matches!(self.checkpoint.position, Position::Render(_)) {
            self.measurements.is_saved = false;
            self.checkpoint.position = Position::Filter;
        }
    }

    /// Measures the finalisation by this denoiser.
    fn calibrate(&mut self, denoiser: &'static dyn Denoiser, host: &dyn Host) {
        let elapsed = self.clock.elapsed();
        self.gather(StatisticsExtent::All);
        // The last pass begins with it, too
        let gathering = self.clock.elapsed() - elapsed;
        let situation = self.situation(&Conditions::default());
        let left = situation.schedule().seconds_left(situation.elapsed).unwrap_or(f64::INFINITY);
        let expected = situation.seconds_of(LastPass::over_pixels(denoiser));
        if !self.measurements.finalisation.is_calibrated() {
            let bytes_per_pixel = (PREPARED * denoiser.cost().bytes as f64) as usize;
            match &mut self.processes {
                Some(processes) if denoiser.parts().is_some() => processes.prepare_memory(bytes_per_pixel),
                _ => {
                    memory::prepare(bytes_per_pixel * self.store().pixels());
                }
            }
        }
        self.measurements.finalisation.predict_for(denoiser);
        let Self { settings, checkpoint: Checkpoint { store, .. }, processes, .. } = self;
        let output = |result: &FilterResult, rows: &Store| host.encode_and_discard(settings, result, rows);
        let filter = |rows: &Store| filter_together(processes.as_deref_mut(), denoiser, rows, settings.seed);
        let times = calibrate(store, gathering, filter, output);
        self.measurements.finalisation.add(times, expected, left);
        self.measurements.seconds.calibrate += self.clock.elapsed() - elapsed;
    }
}

/// Returns whether the rest of a batch exceeds the budget of samples, or in some pixel the ceiling or the map of counts: it was
/// planned for another one.
fn is_too_large(batch: &SampleBatch, store: &Store, settings: &Settings) -> bool {
    let sum = |counts: &[u32]| counts.iter().map(|&n| u64::from(n)).sum::<u64>();
    let (have, rest) = (store.next_indices(), batch.step(store, 1.0));
    let then: Vec<u32> = have.iter().zip(&rest).map(|(have, n)| have + n).collect();
    if then.iter().zip(&rest).any(|(&then, &rest)| rest > 0 && then > settings.max_spp) {
        return true;
    }
    let map = settings.followed_map(store.pixels());
    let lacking = |counts: &[u32]| map?.lacking(counts, settings.max_spp);
    match (lacking(&have), lacking(&then)) {
        // Every sample that exceeds no pixel's count is one that is lacking no more.
        (Some(now), Some(then)) => now - then < sum(&rest),
        _ => settings.budget.spp.is_some_and(|spp| sum(&then) > u64::from(spp) * store.pixels() as u64),
    }
}

/// Returns the samples with which every pixel has those of a map of counts, if the settings have one.
fn map_end(settings: &Settings, store: &Store) -> Option<u64> {
    let have = store.next_indices();
    let lacking = settings.followed_map(store.pixels())?.lacking(&have, settings.max_spp)?;
    Some(have.iter().map(|&n| u64::from(n)).sum::<u64>() + lacking)
}
