//! What the loop knows, as data: enough to go on in another process as if it had never stopped.
//!
//! Times are no part of it but for the speed of sampling: with a budget of samples nothing else of the
//! past decides, and with one of time the clock starts anew with the program.

use std::sync::Arc;

use super::steps::{self, Grain};
use super::{Batch, Entry, ErrorEstimate, Loop, Settings, Shown};
use crate::adaptive::Allocation;
use crate::image::Planes;
use crate::stats::{Part, Store};

/// What the loop knows between two steps.
#[derive(Clone, Debug)]
pub struct Memory {
    pub store: Arc<Store>,
    pub batches: Vec<Batch>,
    pub estimate: Option<ErrorEstimate>,
    pub rerun: Option<Rerun>,
    /// The batch being rendered; `None` between a batch and the rerun of the filter that follows it.
    pub under_way: Option<UnderWay>,
    /// Samples and seconds of the latest steps.
    pub recent: (f64, f64),
}

/// What is done with a memory, and the settings that are followed: they are kept somewhere.
pub type Keep<'a> = &'a dyn Fn(&Settings, Memory);

/// No memory is kept for its time alone if the end, and with it another, is so near: a share of the time from one to
/// the next.
const NEAR_END: f64 = 0.25;

/// A batch of which a share is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct UnderWay {
    pub allocation: Allocation,
    /// In [0, 1].
    pub done: f64,
    pub grain: Grain,
}

impl UnderWay {
    /// Samples to come, of a batch that goes into `store`.
    fn left(&self, store: &Store) -> u64 {
        let counts = steps::between(&self.allocation.counts, store, self.grain, self.done, 1.0);
        counts.iter().map(|&n| u64::from(n)).sum()
    }
}

/// What a batch's maps are made from: the latest rerun of the filter.
#[derive(Clone, Debug, PartialEq)]
pub struct Rerun {
    /// As in [`crate::filter::Filtered`].
    pub image: Planes,
    pub variance: Planes,
    pub residual: Planes,
    /// As in [`Shown`].
    pub failure: Option<Planes>,
    pub success: Option<f32>,
    /// What the image was made of.
    pub made_of: Snapshot,
    /// Pixels that got samples regardless of their priority since.
    pub probes: Vec<bool>,
}

impl Rerun {
    /// `shown`: what the filter makes of `store`.
    pub(super) fn new(shown: Shown, store: &Store) -> Self {
        let Shown { filtered, failure, success, .. } = shown;
        Self {
            image: filtered.image,
            variance: filtered.variance,
            residual: filtered.residual,
            failure,
            success,
            made_of: Snapshot::of(store),
            probes: vec![false; store.pixels()],
        }
    }
}

/// What the store knew when an image was made of it, by halves.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Radiance: 3 planes each.
    pub mean: [Planes; 2],
    pub count: [Vec<u32>; 2],
}

impl Snapshot {
    pub(super) fn of(store: &Store) -> Self {
        Self {
            mean: [0, 1].map(|h| store.means(Part::Half(h), store.layout().radiance())),
            count: [0, 1].map(|h| store.counts(Part::Half(h))),
        }
    }
}

impl<'a> Loop<'a> {
    /// Hands over what it knows every so many seconds, between two steps, and when a budget is spent,
    /// before the last filter pass.
    pub fn keeping(mut self, seconds: f64, keep: Keep<'a>) -> Self {
        self.keep = Some((seconds, keep));
        self.expect_unrehearsed();
        self
    }

    /// Goes on from what another loop knew. With the same budget of samples the end is the same to the last
    /// bit as if that one had gone on; with a smaller one the batch that it was in is planned anew.
    ///
    /// # Panics
    /// If the store is not of the renderer's size and layout.
    pub fn resuming(mut self, memory: Memory) -> Self {
        let Memory { store, batches, estimate, rerun, under_way, recent } = memory;
        assert_eq!((store.width(), store.height()), self.renderer.resolution(), "a state of this image");
        assert_eq!(store.layout(), self.renderer.layout(), "a state of this scene");
        let budget = self.settings.budget.spp.map(|spp| u64::from(spp) * store.pixels() as u64);
        let fits =
            |batch: &UnderWay| budget.is_none_or(|budget| store.drawn() + batch.left(&store) <= budget);
        self.entry = match under_way.filter(fits) {
            Some(batch) => Entry::Within(batch),
            None if store.drawn() > 0 => Entry::After,
            None => Entry::Plan,
        };
        self.schedule.resume(recent);
        self.resumed_samples = store.samples();
        (self.store, self.batches, self.estimate, self.rerun) = (store, batches, estimate, rerun);
        self
    }

    /// Hands over what it knows between two calls of [`Self::advance`].
    pub fn keep_now(&mut self) {
        match std::mem::take(&mut self.entry) {
            Entry::Within(batch) => {
                self.keep(Some(&batch));
                self.entry = Entry::Within(batch);
            }
            entry => {
                self.keep(None);
                self.entry = entry;
            }
        }
    }

    pub(super) fn keep(&mut self, under_way: Option<&UnderWay>) {
        let Some((_, keep)) = self.keep else { return };
        let memory = Memory {
            store: self.store.clone(),
            batches: self.batches.clone(),
            estimate: self.estimate.clone(),
            rerun: self.rerun.clone(),
            under_way: under_way.cloned(),
            recent: self.schedule.recent(),
        };
        keep(&self.settings, memory);
        self.kept = self.elapsed();
    }

    /// `ahead`: seconds until it is asked again.
    pub(super) fn keep_if_due(&mut self, under_way: Option<&UnderWay>, ahead: f64) {
        let Some((every, _)) = self.keep else { return };
        let elapsed = self.elapsed();
        // It would still be on its way to the disk when the last one comes.
        let near_end = self.schedule.seconds_left(elapsed).is_some_and(|left| left < NEAR_END * every);
        if elapsed + ahead >= self.kept + every && !near_end {
            self.keep(under_way);
        }
    }
}
