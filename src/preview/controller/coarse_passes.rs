//! Filtered images of a new view before every pixel has samples: passes over the pooled samples of squares of pixels.

use std::sync::Arc;
use std::time::Instant;

use super::Controller;
use crate::filter::{UNFILTERED, draft_without_vectors};
use crate::preview::generation_record::CoarseImage;
use crate::preview::publisher::PAIR;
use crate::preview::view::{View, ViewSource};
use crate::progressive::{FailureMap, FilterPass, Settings};
use crate::stats::{Rectangle, Store};

/// Sides of the squares, in pixels: the finest that has enough samples is taken.
const SIDES: [usize; 3] = [2, 4, 8];
/// Samples that a square has on average, at least.
const SQUARE_SAMPLES: f64 = 4.0;
/// Another such pass waits until there are this many times the samples of the latest one.
const GROWTH: f64 = 2.0;
/// Where every pixel has samples within this time, no coarse image is made, in seconds.
const SOON: f64 = 0.5;

impl Controller<'_> {
    /// Returns the side of the squares of a coarse filtered image, if viewers wait for one.
    pub(super) fn coarse_side(&self, store: &Store) -> Option<usize> {
        let progress = self.reporter.progress()?;
        let filters = self.configuration.settings.denoiser != UNFILTERED;
        // A viewer that still draws another frame gets it next.
        let is_selected =
            self.reporter.is_selected(|view| view == View::Filtered || View::PASS_MAPS.contains(&view));
        let lacks_image = self.reporter.shown().is_none() && is_selected;
        if !filters || !lacks_image || self.is_covered(store) || self.pass_threads.is_busy() {
            return None;
        }
        // One without a map that is selected counts as none.
        let has = |coarse: &CoarseImage, map: View| coarse.maps.iter().any(|(view, _)| *view == map);
        let lacks = |coarse: &CoarseImage| {
            self.reporter.is_selected(|view| View::PASS_MAPS.contains(&view) && !has(coarse, view))
        };
        let latest = self.reporter.coarse().filter(|coarse| !lacks(coarse)).map_or(0.0, |coarse| coarse.spp);
        side_for(self.spp_outside_region(store), latest, progress.elapsed)
    }

    /// Returns the samples per pixel outside the priority region, of a store of which not every pixel has samples.
    fn spp_outside_region(&self, store: &Store) -> f64 {
        let image = Rectangle::whole(store.width(), store.height());
        let (mut pixels, mut empty) = (image.pixels(), store.empty_pixels(&image));
        if let Some(region) = self.pixel_region(store).filter(|region| *region != image) {
            pixels -= region.pixels();
            empty -= store.empty_pixels(&region);
        }
        PAIR * (1.0 - empty as f64 / pixels.max(1) as f64)
    }

    /// Filters the pooled samples of squares for the viewers.
    pub(super) fn filter_coarsely(&mut self, store: &Arc<Store>, side: usize) {
        let started = Instant::now();
        let settings = self.configuration.settings.clone();
        let pooled = Arc::new(store.pooled(side));
        let mut pass = self.draft_pass(pooled.clone());
        if self.reporter.is_selected(|view| view == View::Failure) {
            pass.failure_map = FailureMap::Compute;
        }
        let (commands, threads) = (self.hub.commands().clone(), self.pass_threads.clone());
        let filtered = threads.run(pass, &commands, &mut |event| self.goes_on_filtering(event, store));
        let fitting = filtered.filter(|_| self.has_method_of(&settings));
        let coarse = fitting.map(|filtered| {
            let source = ViewSource { store: &pooled, shown: Some(&filtered.result), comparison: None };
            let map = |view: View| Some((view, view.planes(&source)?));
            let maps = View::PASS_MAPS.into_iter().filter_map(map).collect();
            let (size, spp) = ((store.width(), store.height()), self.spp_outside_region(store));
            let squares = filtered.result.image;
            let mut coarse = CoarseImage { squares, maps, side, size, detailed: None, spp };
            self.keep_region(&mut coarse, store);
            coarse
        });
        self.reporter.filtered_coarsely(coarse, started.elapsed().as_secs_f64());
    }

    /// Returns a fast pass over a store without reservoirs.
    pub(super) fn draft_pass(&self, store: Arc<Store>) -> FilterPass {
        let Settings { denoiser, seed, .. } = self.configuration.settings;
        FilterPass::new(store, draft_without_vectors(denoiser), seed)
    }
}

/// Returns the side of the squares that have enough of `spp` samples per pixel, where the latest image was made of `latest`;
/// `None` if there are none, or if another image is not worth it. `elapsed`: seconds that the samples took.
fn side_for(spp: f64, latest: f64, elapsed: f64) -> Option<usize> {
    let is_soon = elapsed * (PAIR / spp - 1.0) < SOON;
    let is_enough = |side: &usize| spp * (side * side) as f64 >= SQUARE_SAMPLES;
    SIDES.into_iter().find(is_enough).filter(|_| spp >= GROWTH * latest && !is_soon)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_get_finer_as_samples_come() {
        assert_eq!(side_for(0.01, 0.0, 1.0), None);
        assert_eq!(side_for(1.0 / 16.0, 0.0, 1.0), Some(8));
        assert_eq!(side_for(1.0 / 4.0, 1.0 / 8.0, 2.0), Some(4));
        assert_eq!(side_for(1.0, 0.5, 8.0), Some(2));
        // Not yet twice the samples; soon every pixel has some.
        assert_eq!(side_for(1.0, 0.6, 8.0), None);
        assert_eq!(side_for(1.0, 0.5, 0.4), None);
    }
}
