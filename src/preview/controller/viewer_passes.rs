//! Filter passes: those of the loop, and additional ones for the viewers.

use std::sync::Arc;
use std::time::Instant;

use super::Controller;
use crate::filter::{FilterResult, UNFILTERED, draft_if_sparse, draft_of, sparse_filtering};
use crate::preview::background_pass::Event;
use crate::preview::status::Phase;
use crate::preview::view::View;
use crate::progressive::{
    Conditions, ErrorEstimate, FailureMap, FilterPass, Filtered, RenderLoop, Settings, StoppedBy,
};
use crate::stats::Store;

/// Largest fraction of the time that passes for the viewers alone take, where the loop's interim passes are shown, and where
/// they are by another method than the chosen one.
const VIEWER_PASS_FRACTIONS: [f64; 2] = [0.04, 0.1];
/// Such a pass waits until there are this many times the samples of the latest one.
const VIEWER_PASS_GROWTH: f64 = 1.4;

impl Controller<'_> {
    /// Returns whether the viewers need a pass beside those of the loop.
    pub(super) fn should_filter(&self, store: &Store) -> bool {
        let Some(progress) = self.reporter.progress() else { return false };
        let filters = self.configuration.settings.denoiser != UNFILTERED;
        let shown = self.reporter.shown();
        let lacks_map = self.wants_failure_map() && shown.is_none_or(|shown| shown.interpolation.is_none());
        let lacks_image = filters && self.reporter.wants(View::is_filtered) && {
            let samples = progress.samples as f64;
            let has_grown = samples > VIEWER_PASS_GROWTH * self.reporter.shown_samples() as f64;
            let fraction = VIEWER_PASS_FRACTIONS[usize::from(!self.has_interim_passes_of_method())];
            let is_affordable = self.viewer_pass_seconds < fraction * progress.elapsed;
            // One of another method is that of an interim pass, after a change of the method.
            let chosen = self.configuration.settings.denoiser;
            let own =
                [chosen, draft_if_sparse(store, draft_of(chosen))].map(|denoiser| denoiser.name().method);
            let lacks_own =
                shown.is_none_or(|shown| shown.failure.is_none() && !own.contains(&shown.made_by.method));
            lacks_own || is_affordable && has_grown
        };
        (lacks_image || lacks_map) && self.is_covered(store) && !self.pass_threads.is_busy()
    }

    /// Filters for the viewers if they need it: the region first; coarsely before every pixel has samples.
    pub(super) fn filter_if_due(&mut self, store: &Arc<Store>) {
        if let Some(region) = self.region_to_filter(store) {
            self.filter_region(store, &region);
        } else if self.should_filter(store) {
            self.filter_for_viewers(store);
        } else if let Some(side) = self.coarse_side(store) {
            self.filter_coarsely(store, side);
        }
    }

    fn has_interim_passes_of_method(&self) -> bool {
        let settings = &self.configuration.settings;
        settings.interim_denoiser().name().method == settings.denoiser.name().method
    }

    /// Returns whether the image of an interim pass is to be shown. One by a stand-in of another method is worse than the
    /// image that viewers have, even of a fraction of its samples.
    pub(super) fn shows_interim_passes(&self) -> bool {
        let method = self.configuration.settings.denoiser.name().method;
        let has_coarse = self.reporter.coarse().is_some();
        let has_own = self.reporter.shown().map_or(has_coarse, |shown| shown.made_by.method == method);
        self.has_interim_passes_of_method() || !has_own || !self.reporter.is_selected(View::is_filtered)
    }

    /// Filters for the viewers: by the fastest preset of the denoiser's method, but a finished image by the denoiser itself.
    pub(super) fn filter_for_viewers(&mut self, store: &Arc<Store>) {
        let started = Instant::now();
        let mut settings = self.configuration.settings.clone();
        if self.reporter.phase() != Phase::Finished {
            settings.denoiser = draft_of(settings.denoiser);
        }
        // A pass that is given up is made again when it is needed.
        let _ = self.filter(self.viewer_pass(store, &settings), true);
        self.viewer_pass_seconds += started.elapsed().as_secs_f64();
    }

    /// Makes the last image, unless it is on show already; `None` as for [`Self::filter`].
    pub(super) fn finalise(
        &mut self,
        render_loop: &mut RenderLoop,
        conditions: &Conditions,
        stopped_by: StoppedBy,
    ) -> Option<Filtered> {
        let pass = render_loop.final_pass(conditions, stopped_by);
        let filtered = match self.shown_result(&pass) {
            Some(shown) => shown,
            None => self.filter(pass, true)?,
        };
        render_loop.complete_final(&filtered);
        self.reporter.progressed(render_loop.progress());
        Some(filtered)
    }

    /// Returns the result of a pass over pixels that is on show already, as after an undo; `None` if another image is.
    fn shown_result(&self, pass: &FilterPass) -> Option<Filtered> {
        let side = sparse_filtering::side(pass.denoiser, &pass.store, pass.least_side);
        let has_pixels = side == 1 && self.reporter.shown_side() == 1;
        let has_samples = has_pixels && self.reporter.shown_samples() == pass.store.samples();
        let is_same = |shown: &&FilterResult| has_samples && shown.made_by == pass.denoiser.name();
        let result = self.reporter.shown().filter(is_same)?.clone();
        let estimate = ErrorEstimate::new(&result, &pass.store, None);
        Some(Filtered { result, side: 1, estimate, seconds: 0.0 })
    }

    /// Runs a pass and shows its image if it `is_shown`; `None` if it was given up, or if another method was chosen meanwhile.
    pub(super) fn filter(&mut self, pass: FilterPass, is_shown: bool) -> Option<Filtered> {
        let (store, settings) = (pass.store.clone(), self.configuration.settings.clone());
        let (commands, threads) = (self.hub.commands().clone(), self.pass_threads.clone());
        let run = |handle: &mut dyn FnMut(Event) -> bool| threads.run(pass, &commands, handle);
        let filtered = self.while_filtering(&store, &settings, is_shown, run);
        filtered.filter(|_| self.has_method_of(&settings))
    }

    /// Handles commands and reports while `run` waits for a pass over `store` by these settings, and shows its image if it
    /// `is_shown`, unless another method was chosen meanwhile.
    pub(super) fn while_filtering(
        &mut self,
        store: &Arc<Store>,
        settings: &Settings,
        is_shown: bool,
        run: impl FnOnce(&mut dyn FnMut(Event) -> bool) -> Option<Filtered>,
    ) -> Option<Filtered> {
        let started = Instant::now();
        let before = self.reporter.enter(Phase::Filtering);
        self.report(store, true);
        let filtered = run(&mut |event| self.goes_on_filtering(event, store));
        self.reporter.enter(before);
        self.reporter.hasten();
        let fitting = filtered.as_ref().filter(|_| is_shown && self.has_method_of(settings));
        if fitting.is_some() {
            self.region_passes.include(self.region_samples(store));
        }
        self.reporter.filtered(fitting, started.elapsed().as_secs_f64(), store);
        filtered
    }

    /// Handles an event during a pass; returns whether the pass goes on.
    pub(super) fn goes_on_filtering(&mut self, event: Event, store: &Arc<Store>) -> bool {
        match event {
            Event::Command(command) => self.handle(command, store),
            Event::Idle => self.receive(store),
        }
        self.reporter.publish(store);
        self.report(store, false);
        !self.pending.ends_pass()
    }

    /// Returns a pass over `store` as these settings ask for, with the map that a viewer wants.
    pub(super) fn viewer_pass(&self, store: &Arc<Store>, settings: &Settings) -> FilterPass {
        let wants_map = self.wants_failure_map();
        FilterPass {
            failure_map: if wants_map { FailureMap::Compute } else { FailureMap::Carry(None) },
            ..FilterPass::new(store.clone(), draft_if_sparse(store, settings.denoiser), settings.seed)
        }
    }

    pub(super) fn has_method_of(&self, settings: &Settings) -> bool {
        let method = |settings: &Settings| settings.denoiser.name().method;
        method(&self.configuration.settings) == method(settings)
    }

    fn wants_failure_map(&self) -> bool {
        self.reporter.wants(|view| view == View::Failure)
    }
}
