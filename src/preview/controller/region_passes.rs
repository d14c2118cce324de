//! Filter passes over the priority region alone, so that a viewer sees it get better long before a pass over the whole image is
//! worth its time.

use std::sync::Arc;
use std::time::Instant;

use super::Controller;
use crate::filter::{UNFILTERED, draft_of};
use crate::image::Planes;
use crate::preview::generation_record::CoarseImage;
use crate::preview::view::View;
use crate::progressive::Settings;
use crate::stats::{Rectangle, Store};

/// A pass waits until the region has this many times the samples of the one before.
const GROWTH: f64 = 1.4;
/// Largest fraction of the render's time that these passes take, beside the first.
const TIME_FRACTION: f64 = 0.1;
/// Pixels around the region that contribute to it, where all pixels have samples.
const MARGIN: usize = 32;

/// The passes over the current region.
#[derive(Clone, Copy, Default)]
pub struct RegionPasses {
    /// The region's samples behind the newest image that shows it in full resolution.
    samples: u64,
    /// How long the passes took, in seconds.
    seconds: f64,
}

impl RegionPasses {
    /// Takes note of an image of this many of the region's samples.
    pub fn include(&mut self, samples: u64) {
        self.samples = samples;
    }

    /// Returns whether a pass is due over this many samples, `elapsed` seconds after the render's start.
    fn is_due(&self, samples: u64, elapsed: f64) -> bool {
        samples as f64 > GROWTH * self.samples as f64 && self.seconds <= TIME_FRACTION * elapsed
    }
}

impl Controller<'_> {
    /// Returns the priority region in pixels of a store; `None` if it is empty.
    pub(super) fn pixel_region(&self, store: &Store) -> Option<Rectangle> {
        let pixels = |[a, b]: [f32; 2], size: usize| {
            [(a * size as f32).floor() as usize, ((b * size as f32).ceil() as usize).min(size)]
        };
        let [x, y] = self.region?;
        let image = Rectangle::whole(store.width(), store.height());
        Rectangle { x: pixels(x, store.width()), y: pixels(y, store.height()) }.intersection(&image)
    }

    /// Returns the region that the render loop is to render first: none while a pause or a save waits until every pixel has
    /// samples.
    pub(super) fn active_region(&self, store: &Store) -> Option<Rectangle> {
        let is_awaited = self.is_paused || !self.pending.saves.is_empty();
        self.pixel_region(store).filter(|_| !is_awaited || self.is_covered(store))
    }

    /// Returns the number of samples of the region.
    pub(super) fn region_samples(&self, store: &Store) -> u64 {
        let Some(Rectangle { x: [x0, x1], y: [y0, y1] }) = self.pixel_region(store) else { return 0 };
        let taken = |y: usize| (x0..x1).map(move |x| u64::from(store.rows()[y].next_index(x)));
        (y0..y1).flat_map(taken).sum()
    }

    /// Returns the region if a pass over it is due: all its pixels have samples, and it is shown within an image of fewer
    /// samples than there are. A draft must not be pasted into an image of all samples, which may be the last one.
    pub(super) fn region_to_filter(&self, store: &Store) -> Option<Rectangle> {
        let region = self.pixel_region(store)?;
        let elapsed = self.reporter.progress()?.elapsed;
        let filters = self.configuration.settings.denoiser != UNFILTERED;
        let is_shown = self.reporter.has_image() && self.reporter.wants(|view| view == View::Filtered);
        let is_newer = self.reporter.shown_samples() < store.samples();
        let is_due = filters
            && is_shown
            && is_newer
            && !self.pass_threads.is_busy()
            && self.region_passes.is_due(self.region_samples(store), elapsed)
            && store.empty_pixels(&region) == 0;
        is_due.then_some(region)
    }

    /// Replaces the region in a coarse image by what passes over it have made.
    pub(super) fn keep_region(&self, coarse: &mut CoarseImage, store: &Store) {
        let is_made = self.region_passes.samples > 0;
        let earlier = self.reporter.coarse().and_then(|earlier| earlier.detailed.as_ref());
        if let Some((region, earlier)) = self.pixel_region(store).zip(earlier).filter(|_| is_made) {
            paste(coarse.detailed_mut(), &region, earlier, &region);
        }
    }

    /// Filters the region for the viewers, by the draft of the chosen method.
    pub(super) fn filter_region(&mut self, store: &Arc<Store>, region: &Rectangle) {
        let started = Instant::now();
        let settings = self.configuration.settings.clone();
        // Empty pixels around it would count as black.
        let margin = if self.is_covered(store) { MARGIN } else { 0 };
        let part = region.grown(margin, &Rectangle::whole(store.width(), store.height()));
        let samples = self.region_samples(store);
        let draft = Settings { denoiser: draft_of(settings.denoiser), ..settings.clone() };
        let pass = self.viewer_pass(&Arc::new(store.select_rectangle(&part, settings.seed)), &draft);
        let (commands, threads) = (self.hub.commands().clone(), self.pass_threads.clone());
        let filtered = threads.run(pass, &commands, &mut |event| self.goes_on_filtering(event, store));
        let seconds = started.elapsed().as_secs_f64();
        self.region_passes.seconds += seconds;
        let Some(filtered) = filtered.filter(|_| self.has_method_of(&settings)) else { return };
        // Meanwhile another region may have been chosen.
        if self.pixel_region(store) == Some(*region) {
            self.region_passes.include(samples);
        }
        let from = region.within(&part);
        self.reporter.filtered_part(
            |image| paste(image, region, &filtered.result.image, &from),
            seconds,
            store,
        );
    }
}

/// Replaces a rectangle of an image by one of the same size of another image.
fn paste(image: &mut Planes, to: &Rectangle, other: &Planes, from: &Rectangle) {
    let corner = |part: &Rectangle| [part.x[0], part.y[0]];
    image.paste(other, corner(from), corner(to), [to.width(), to.height()]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_wait_for_more_samples_and_take_a_tenth_of_the_time() {
        let mut passes = RegionPasses::default();
        assert!(passes.is_due(1, 0.0), "the first comes at once");
        passes.include(100);
        passes.seconds = 0.5;
        assert!(!passes.is_due(140, 10.0));
        assert!(passes.is_due(141, 10.0));
        assert!(!passes.is_due(1000, 4.9));
    }
}
