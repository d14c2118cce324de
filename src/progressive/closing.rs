//! What comes after the last batch: which filter pass it will be, and how long that and the writing take.
//! Supposed at first, then measured on some rows of the image.

use super::cost::{Cost, Pass};
use super::rehearsal::make_ready;
use super::{Denoiser, Hurried, Loop, Settings, observer};
use crate::filter::Quality;
use crate::stats::Store;

impl Loop<'_> {
    /// The last filter pass.
    pub(super) fn last_filter(&self) -> Pass {
        let Settings { denoiser, quality, .. } = self.settings;
        self.hurried.map_or_else(|| observer::fitting(&self.store, denoiser, quality), pass_in_a_hurry)
    }

    /// The time does not suffice for the last pass: it will be this one, if that is quicker. Whether it is.
    pub(super) fn hurry(&mut self, to: Hurried) -> bool {
        let asked = match (self.settings.denoiser, self.settings.quality) {
            (Denoiser::None, _) => Some(Hurried::Unfiltered),
            (Denoiser::Prpf, Quality::Draft) => Some(Hurried::Draft),
            _ => None,
        };
        let changes = asked.max(self.hurried) < Some(to);
        if changes {
            self.hurried = Some(to);
        }
        changes
    }

    /// Predicts what comes after the last batch without a rehearsal. By then every pixel should have a sample.
    pub(super) fn expect_unrehearsed(&mut self) {
        let Settings { denoiser, quality, .. } = self.settings;
        let pass = self.hurried.map_or((denoiser, quality), pass_in_a_hurry);
        let pixels = self.store.pixels();
        let spp = self.store.drawn() as f64 / pixels.max(1) as f64;
        self.schedule.expects(Cost::of(pass).at(spp).seconds(pixels, self.keep.is_some()));
    }

    /// Under a budget of time, measures on some rows what comes after the last batch, now and then.
    pub(super) fn rehearse(&mut self) {
        let elapsed = self.elapsed();
        self.choose_unrehearsed();
        let Some(left) = self.schedule.seconds_left(elapsed) else { return };
        if self.last_filter().0 == Denoiser::Rpf {
            // With the next samples it would be wrong.
            return;
        }
        // A rehearsal would have to fill the pixels without samples first, and takes time from them.
        let sparse = self.store.drawn() < self.store.pixels() as u64;
        if sparse || !self.rehearsal.is_due(elapsed, left, self.schedule.closing()) {
            return;
        }
        if self.rehearsal.is_missing() {
            make_ready(Cost::of(self.last_filter()).bytes * self.store.pixels());
        }
        self.rehearse_now(left);
        let left = self.schedule.seconds_left(self.elapsed()).unwrap_or(left);
        if self.rehearsal.is_doubtful(left) {
            self.rehearse_now(left);
        }
        if self.schedule.is_late(self.elapsed()) && self.hurry(Hurried::Draft) {
            self.expect_unrehearsed();
            self.rehearse_now(left);
        }
        if self.schedule.is_far_too_late(self.elapsed()) && self.hurry(Hurried::Unfiltered) {
            self.expect_unrehearsed();
            self.rehearse_now(left);
        }
        self.seconds.filter += self.elapsed() - elapsed;
    }

    /// Before the first rehearsal: whether there is time for the last pass as asked for, for a draft, or for none.
    pub(super) fn choose_unrehearsed(&mut self) {
        let elapsed = self.elapsed();
        if !self.rehearsal.is_missing() || self.schedule.seconds_left(elapsed).is_none() {
            return;
        }
        let drawn = self.store.drawn();
        let has_time = if drawn < self.store.pixels() as u64 {
            self.schedule.fills(elapsed, drawn)
        } else {
            // The pixels may have got their samples against expectation.
            self.hurried = None;
            self.expect_unrehearsed();
            let left = self.schedule.seconds_left(elapsed).unwrap_or(0.0);
            match self.settings.denoiser {
                Denoiser::Rpf => !self.schedule.is_late(elapsed),
                _ => self.rehearsal.is_due(elapsed, left, self.schedule.closing()),
            }
        };
        if !has_time && self.hurry(Hurried::Draft) {
            self.expect_unrehearsed();
        }
        if self.schedule.is_far_too_late(elapsed) && self.hurry(Hurried::Unfiltered) {
            self.expect_unrehearsed();
        }
    }

    fn rehearse_now(&mut self, left: f64) {
        let ((denoiser, quality), seed) = (self.last_filter(), self.settings.seed);
        let filter = |store: &Store| observer::filtered(store, denoiser, quality, seed);
        self.rehearsal.run(&self.store, left, filter, self.closing);
        self.schedule.rehearsed(self.rehearsal.closing_seconds);
    }
}

fn pass_in_a_hurry(hurried: Hurried) -> Pass {
    match hurried {
        Hurried::Draft => (Denoiser::Prpf, Quality::Draft),
        Hurried::Unfiltered => (Denoiser::None, Quality::Draft),
    }
}
