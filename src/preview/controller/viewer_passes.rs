//! Filter passes: those of the loop, and additional ones for the viewers.

use std::sync::Arc;
use std::time::Instant;

use super::Controller;
use crate::filter::{UNFILTERED, suited_to};
use crate::preview::background_pass::Event;
use crate::preview::publisher::is_covered;
use crate::preview::status::Phase;
use crate::preview::view::View;
use crate::progressive::{FailureMap, FilterPass, Filtered, Settings};
use crate::stats::Store;

/// Largest fraction of the time that passes for the viewers alone take.
const VIEWER_PASS_FRACTION: f64 = 0.04;
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
            let is_affordable = self.viewer_pass_seconds < VIEWER_PASS_FRACTION * progress.elapsed;
            shown.is_none() || is_affordable && (has_grown || self.region.is_some())
        };
        (lacks_image || lacks_map) && is_covered(store) && !self.pass_threads.is_busy()
    }

    /// Filters for the viewers: by the denoiser's stand-in, but a finished image by the denoiser itself.
    pub(super) fn filter_for_viewers(&mut self, store: &Arc<Store>) {
        let started = Instant::now();
        let mut settings = self.configuration.settings.clone();
        if self.reporter.phase() != Phase::Finished {
            settings.denoiser = settings.denoiser.stand_in();
        }
        // A pass that is given up is made again when it is needed.
        let _ = self.filter(self.viewer_pass(store, &settings));
        self.viewer_pass_seconds += started.elapsed().as_secs_f64();
    }

    /// Runs a pass and shows its image; `None` if it was given up, or if another method was chosen meanwhile.
    pub(super) fn filter(&mut self, pass: FilterPass) -> Option<Filtered> {
        let (store, settings) = (pass.store.clone(), self.configuration.settings.clone());
        let (commands, threads) = (self.hub.commands().clone(), self.pass_threads.clone());
        let filtered = self.while_filtering(&store, &settings, |handle| threads.run(pass, &commands, handle));
        filtered.filter(|_| self.has_method_of(&settings))
    }

    /// Handles commands and reports while `run` waits for a pass over `store` by these settings, and shows its image
    /// unless another method was chosen meanwhile.
    pub(super) fn while_filtering(
        &mut self,
        store: &Arc<Store>,
        settings: &Settings,
        run: impl FnOnce(&mut dyn FnMut(Event) -> bool) -> Option<Filtered>,
    ) -> Option<Filtered> {
        let started = Instant::now();
        let before = self.reporter.enter(Phase::Filtering);
        self.report(store, true);
        let filtered = run(&mut |event| {
            match event {
                Event::Command(command) => self.handle(command, store),
                Event::Idle => self.receive(store),
            }
            self.reporter.publish(store);
            !self.pending.ends_pass()
        });
        self.reporter.enter(before);
        self.reporter.hasten();
        let fitting = filtered.as_ref().filter(|_| self.has_method_of(settings));
        self.reporter.filtered(fitting, started.elapsed().as_secs_f64(), store);
        filtered
    }

    /// Returns a pass over `store` as these settings ask for, with the map that a viewer wants.
    pub(super) fn viewer_pass(&self, store: &Arc<Store>, settings: &Settings) -> FilterPass {
        let wants_map = self.wants_failure_map();
        FilterPass {
            store: store.clone(),
            denoiser: suited_to(store, settings.denoiser),
            seed: settings.seed,
            failure_map: if wants_map { FailureMap::Compute } else { FailureMap::Carry(None) },
        }
    }

    fn has_method_of(&self, settings: &Settings) -> bool {
        let method = |settings: &Settings| settings.denoiser.name().method;
        method(&self.configuration.settings) == method(settings)
    }

    fn wants_failure_map(&self) -> bool {
        self.reporter.wants(|view| view == View::Failure)
    }
}
