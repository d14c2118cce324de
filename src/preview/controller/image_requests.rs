//! Images that viewers want saved, each as it was at the moment of the command.

use std::sync::Arc;

use super::Controller;
use crate::filter::{FilterResult, draft_if_sparse};
use crate::preview::background_pass::Event;
use crate::preview::configuration::SavedImage;
use crate::preview::image_request::ImageRequest;
use crate::preview::saved_images::SavedFile;
use crate::preview::status::Phase;
use crate::progressive::Settings;
use crate::stats::Store;

/// Most images that are made in the background while the render has gone on to others: each holds a store.
const MOST_IN_BACKGROUND: usize = 2;

/// Samples per pixel from which an image is saved before every pixel has some. With fewer its squares of pixels would be large.
const LEAST_SPP: f64 = 1.0 / 16.0;

impl Controller<'_> {
    /// Turns pending saves into requests. A save captures the current image or, after a command that discards the samples,
    /// the first image of the new generation. Duplicate requests are merged.
    pub(super) fn request_pending_saves(&mut self, store: &Arc<Store>) {
        let is_last = self.pending.quit || self.pending.scene.is_some();
        let can_save = || self.pending.saves.iter().all(|settings| self.can_save(store, settings));
        let is_there = is_last || self.reporter.phase() == Phase::Finished || can_save();
        if self.pending.starts_generation() || !is_there {
            return;
        }
        let suffices = |settings: &Settings| settings.are_met_by(store);
        for settings in std::mem::take(&mut self.pending.saves) {
            let request =
                ImageRequest { store: store.clone(), settings, camera: self.current_camera().clone() };
            let is_same = |other: &ImageRequest| {
                Arc::ptr_eq(&other.store, &request.store) && other.settings == request.settings
            };
            if !suffices(&request.settings) && !suffices(&self.configuration.settings) {
                // A generation with the statistics that this denoiser needs is about to begin.
                self.pending.request_save(&request.settings);
            } else if !suffices(&request.settings) {
                self.notice_unsaved("another denoiser was chosen before there were statistics for this one");
            } else if !self.requests.iter().any(is_same) {
                self.requests.push_back(request);
            }
        }
    }

    /// Returns whether there are samples for an image by these settings: of every pixel, or enough for the method to fill gaps.
    fn can_save(&self, store: &Store, settings: &Settings) -> bool {
        let has_samples = store.samples_taken() as f64 >= LEAST_SPP * store.pixels() as f64;
        // A map or a region spreads the samples unevenly
        let is_even = settings.sample_map.is_none() && self.pixel_region(store).is_none();
        let suited = draft_if_sparse(store, settings.denoiser);
        let fills_gaps = suited.least_spp() > 0.0 && suited.name().method == settings.denoiser.name().method;
        self.is_covered(store) || has_samples && is_even && fills_gaps
    }

    /// Saves the requested images, at once or, if the render has to go on to another generation, in the background.
    pub(super) fn save_requested_images(&mut self) {
        while let Some(request) = self.requests.pop_front() {
            let made_by = draft_if_sparse(&request.store, request.settings.denoiser).name();
            let is_done = self.reporter.phase() == Phase::Finished
                && self.reporter.shown_samples() == request.store.samples();
            let matches = |shown: &&FilterResult| is_done && shown.made_by == made_by;
            if let Some(shown) = self.reporter.shown().filter(matches).cloned() {
                self.write_image(&request, Some((&shown, self.reporter.shown_side())));
            } else if self.background.len() == MOST_IN_BACKGROUND {
                self.notice_unsaved(
                    "earlier images are still being filtered; save again when they are there",
                );
            } else {
                let pass = self.pass_threads.start(self.viewer_pass(&request.store, &request.settings));
                let commands = self.hub.commands().clone();
                let (store, settings) = (request.store.clone(), request.settings.clone());
                // Viewers go on with finer and finer squares
                let is_shown = self.is_covered(&store) || self.reporter.phase() == Phase::Finished;
                let run = |handle: &mut dyn FnMut(Event) -> bool| pass.wait_handling(&commands, handle);
                match self.while_filtering(&store, &settings, is_shown, run) {
                    Some(filtered) => self.write_image(&request, Some((&filtered.result, filtered.side))),
                    None => self.background.push((request, pass)),
                }
                self.report(&store, true);
            }
        }
    }

    /// Writes a requested image: its result and the side of the squares that were filtered, in pixels. Without one its pass has failed.
    pub(super) fn write_image(&mut self, request: &ImageRequest, filtered: Option<(&FilterResult, usize)>) {
        let ImageRequest { store, settings, camera } = request;
        let written = filtered.ok_or("the filter pass ended early".to_owned()).and_then(|(result, side)| {
            let image = SavedImage { store, result, side, settings, camera };
            self.configuration.host.write_image(&image)
        });
        match written {
            Ok(paths) => {
                let names: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
                let spp = store.spp();
                let digits = if spp < 1.0 { 2 } else { 1 };
                let squares = match filtered {
                    Some((_, side)) if side > 1 => format!("; squares of {side}×{side} pixels were filtered"),
                    _ => String::new(),
                };
                let failure = filtered.and_then(|(result, _)| result.failure.as_ref());
                let unfiltered =
                    failure.map_or(String::new(), |problem| format!("; not filtered: {problem}"));
                let names = names.join(" and ");
                let text = format!("saved {names}: {spp:.digits$} samples per pixel{squares}{unfiltered}");
                if let Some(path) = paths.into_iter().next() {
                    self.hub.saves().add(SavedFile { path, spp: Some(spp) });
                }
                self.reporter.notice(text, false);
            }
            Err(problem) => self.notice_unsaved(&problem),
        }
    }

    /// Tells why an image was not saved: the viewers, and in the end the command.
    fn notice_unsaved(&mut self, reason: &str) {
        let text = format!("not saved: {reason}");
        let is_end = !self.configuration.stays && self.reporter.phase() == Phase::Finished;
        if is_end || self.is_interrupted() {
            self.unsaved.push(text.clone());
        }
        self.reporter.notice(text, true);
    }
}
