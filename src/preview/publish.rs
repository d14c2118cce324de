//! Makes frames for whoever is ready, in time with what they cost.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::frame::{Frame, Stamp};
use super::hub::Hub;
use super::status::Described;
use super::view::View;
use crate::progressive::{Progress, Settings, Shown};
use crate::stats::{Layout, Part, Store};

/// Time between two images, at least: more often is not seen.
const INTERVAL: Duration = Duration::from_millis(100);
/// The same at most, however long they take to make.
const LONGEST_INTERVAL: Duration = Duration::from_millis(200);
/// Share of the time that making frames should take.
const SHARE: f64 = 0.04;
/// Samples per pixel from which on every pixel has some: they come in pairs.
pub const COVERED_SPP: f64 = 2.0;
/// Steps of a generation whose images are all shown: the coarse ones.
const EAGER_STEPS: u64 = 4;

/// See the module.
pub struct Publisher {
    hub: Arc<Hub>,
    generation: u32,
    sequence: u32,
    views: Vec<Described>,
    /// Steps and filter passes of this generation.
    steps: u64,
    passes: u64,
    /// For each view, the step or pass that its newest frame shows.
    published: [Option<u64>; View::ALL.len()],
    latest: Instant,
    /// What the latest frames took.
    cost: Duration,
}

impl Publisher {
    pub fn new(hub: Arc<Hub>) -> Self {
        Self {
            hub,
            generation: 0,
            sequence: 0,
            views: Vec::new(),
            steps: 0,
            passes: 0,
            published: [None; View::ALL.len()],
            latest: Instant::now(),
            cost: Duration::ZERO,
        }
    }

    /// Starts a generation with other samples.
    pub fn begin(&mut self, layout: &Layout, settings: &Settings) {
        self.generation += 1;
        (self.steps, self.passes) = (0, 0);
        self.published = Default::default();
        let described = |view: View| Described { view, scale: view.scale(settings) };
        self.views = View::ALL.into_iter().filter(|view| view.exists(layout)).map(described).collect();
    }

    /// Lets scales follow other settings.
    pub fn rescale(&mut self, settings: &Settings) {
        self.views.iter_mut().for_each(|described| described.scale = described.view.scale(settings));
    }

    pub fn generation(&self) -> u32 {
        self.generation
    }

    /// The views that this render has.
    pub fn views(&self) -> &[Described] {
        &self.views
    }

    /// There are new samples.
    pub fn stepped(&mut self) {
        self.steps += 1;
    }

    /// There is a new filter pass.
    pub fn filtered(&mut self) {
        self.passes += 1;
    }

    /// Whether it is time for another image.
    pub fn is_due(&self) -> bool {
        let rest = self.cost.div_f64(SHARE).clamp(INTERVAL, LONGEST_INTERVAL);
        self.steps <= EAGER_STEPS || self.latest.elapsed() >= rest
    }

    /// Publishes what has changed of what is wanted.
    pub fn publish(&mut self, store: &Store, shown: Option<&Shown>, progress: Option<&Progress>) {
        let version = |view: View| if view.is_filtered() { self.passes } else { self.steps };
        let wanted: Vec<View> = self
            .views
            .iter()
            .map(|described| described.view)
            .filter(|&view| self.hub.wants(view) && self.published[view.index()] != Some(version(view)))
            .collect();
        // Without a sample there is nothing to see.
        if wanted.is_empty() || self.steps == 0 {
            return;
        }
        let started = Instant::now();
        let spp = progress.map_or(0.0, |p| p.spp);
        let counts = (spp < COVERED_SPP).then(|| store.counts(Part::Whole));
        for view in wanted {
            let Some(planes) = view.planes(store, shown) else { continue };
            self.published[view.index()] = Some(if view.is_filtered() { self.passes } else { self.steps });
            self.sequence = self.sequence.wrapping_add(1);
            let stamp = Stamp {
                generation: self.generation,
                sequence: self.sequence,
                spp: spp as f32,
                seconds: progress.map_or(0.0, |p| p.elapsed) as f32,
            };
            let counts = counts.as_deref().filter(|_| view != View::Samples);
            self.hub.publish(Frame::new(view, &planes, counts, stamp));
            // Only now is there something new to see in place of the old.
            self.hub.forget_before(self.generation);
        }
        self.cost = started.elapsed();
        self.latest = Instant::now();
    }
}
