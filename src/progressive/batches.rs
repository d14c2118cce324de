//! A batch: the maps say where it goes, and step by step it goes into the store.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use super::schedule::Plan;
use super::steps::{self, Grain};
use super::{Entry, ErrorEstimate, Flow, Loop, Observer, Progress, Rerun, UnderWay};
use crate::adaptive::{self, Allocation, Maps, Sampling};
use crate::filter;
use crate::stats::Part;

/// A step takes about this long at most, in seconds, so that whoever listens hears something and an
/// interruption is heard.
const LONGEST_STEP: f64 = 1.0;
/// An interrupted batch is finished if that takes no longer than this, in seconds.
const GRACE: f64 = 1.0;

/// How the rendering of a batch ended.
pub(super) enum Rendered {
    /// With its last sample, or by the clock.
    Done,
    /// By an interruption; what is left of it is kept.
    Interrupted,
    /// The observer wants to leave; what is left of it comes next.
    Left,
}

impl Loop<'_> {
    /// A batch as planned.
    pub(super) fn allocate(&mut self, plan: Plan) -> UnderWay {
        let grain = if self.store.drawn() == 0 { Grain::Pixel } else { Grain::Block };
        UnderWay { allocation: self.spread(plan.samples), done: 0.0, grain }
    }

    /// Decides where so many samples go.
    fn spread(&mut self, total: u64) -> Allocation {
        let started = Instant::now();
        // Those that were rejected count: a pixel that rejects all of them must not hold up the others.
        let drawn = self.store.next_indices();
        let floor = self.settings.min_spp.min(self.settings.max_spp);
        let priority = match (self.settings.sampling, &self.rerun) {
            (Sampling::Adaptive, Some(rerun)) => {
                let maps = Maps {
                    counts: &self.store.counts(Part::Whole),
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
        // Other pixels by chance in every batch.
        let key = self.settings.seed.rotate_left(32) ^ self.store.drawn();
        let spread = |priority: Option<&[f32]>, have: &[u32], width: usize, total: u64| match priority {
            Some(priority) => adaptive::allocate_above(floor, priority, have, width, total, max_spp, key),
            None => adaptive::uniform(total, have, max_spp, key),
        };
        let width = self.store.width();
        // First of all, the whole is an image.
        let favoured = self.favoured.filter(|_| drawn.iter().all(|&n| n > 0)).and_then(|region| {
            let share = region.share(&drawn, width, total, &self.settings)?;
            Some(share.allocate(&drawn, priority.as_deref(), spread))
        });
        let allocation = favoured.unwrap_or_else(|| spread(priority.as_deref(), &drawn, width, total));
        self.seconds.allocate += started.elapsed().as_secs_f64();
        allocation
    }

    /// Renders what is left of a batch.
    pub(super) fn render(&mut self, mut batch: UnderWay, observer: &mut dyn Observer) -> Rendered {
        let rendered = self.render_steps(&mut batch, observer);
        match rendered {
            Rendered::Done => {}
            Rendered::Left => {
                self.entry = Entry::Within(batch);
                return rendered;
            }
            Rendered::Interrupted => {
                // Without the estimate that follows: who goes on will make it of the whole batch.
                self.keep(Some(&batch));
                self.entry = Entry::Within(batch.clone());
            }
        }
        self.check(&batch.allocation.probes);
        rendered
    }

    /// Gives up what is left of a batch: its maps are made as if it ended here.
    pub(super) fn replan(&mut self) {
        if let Entry::Within(batch) = &mut self.entry {
            let probes = std::mem::take(&mut batch.allocation.probes);
            self.entry = Entry::After;
            self.check(&probes);
        }
    }

    /// Renders in steps, between which the clock, an interruption or the observer may end the batch.
    fn render_steps(&mut self, batch: &mut UnderWay, observer: &mut dyn Observer) -> Rendered {
        let total: u64 = batch.allocation.counts.iter().map(|&n| u64::from(n)).sum();
        while batch.done < 1.0 {
            let started = Instant::now();
            let before = self.store.drawn();
            let Some(share) = self.schedule.step(self.elapsed(), before, total) else { break };
            let longest = observer.step_seconds().unwrap_or(LONGEST_STEP);
            let next = (batch.done + share.min(self.schedule.short_step(longest, total))).min(1.0);
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
                fraction: self.schedule.fraction(elapsed, self.store.drawn()),
                elapsed,
                samples,
                spp: samples as f64 / self.store.pixels().max(1) as f64,
                estimate: self.estimate.as_ref().map(ErrorEstimate::in_short),
            };
            match observer.stepped(progress, &self.store) {
                Flow::GoOn => {}
                Flow::Leave => return Rendered::Left,
            }
            if batch.done < 1.0 {
                let rest = self.schedule.seconds_for((1.0 - batch.done) * total as f64);
                if self.interrupt.load(Ordering::Relaxed) && rest > GRACE {
                    return Rendered::Interrupted;
                }
                self.keep_if_due(Some(batch), 0.0);
            }
        }
        Rendered::Done
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
        // A forged state may hold an image that is none.
        if let Some(new) = new.filter(|new| new.image.is_finite()) {
            self.estimate = Some(new.or_keep(self.estimate.take()));
        }
    }
}
