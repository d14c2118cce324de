//! Images that viewers want saved, each as it was at the moment of the command.

use std::sync::Arc;

use super::Controller;
use crate::filter::{FilterResult, suited_to};
use crate::preview::configuration::SavedImage;
use crate::preview::image_request::ImageRequest;
use crate::preview::saved_images::SavedFile;
use crate::preview::status::Phase;
use crate::progressive::Settings;
use crate::stats::Store;

/// Most images that are made in the background while the render has gone on to others: each holds a store.
const MOST_IN_BACKGROUND: usize = 2;

impl Controller<'_> {
    /// Turns pending saves into requests. A save captures the current image or, after a command that discards the samples,
    /// the first image of the new generation. Duplicate requests are merged.
    pub(super) fn request_pending_saves(&mut self, store: &Arc<Store>) {
        let is_last = self.pending.quit || self.pending.scene.is_some();
        let is_there = is_last || self.is_covered(store) || self.reporter.phase() == Phase::Finished;
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

    /// Saves the requested images, at once or, if the render has to go on to another generation, in the background.
    pub(super) fn save_requested_images(&mut self) {
        while let Some(request) = self.requests.pop_front() {
            let made_by = suited_to(&request.store, request.settings.denoiser).name();
            let is_done = self.reporter.phase() == Phase::Finished
                && self.reporter.shown_samples() == request.store.samples();
            let matches = |shown: &&FilterResult| is_done && shown.made_by == made_by;
            if let Some(shown) = self.reporter.shown().filter(matches).cloned() {
                self.write_image(&request, Some(&shown));
            } else if self.background.len() == MOST_IN_BACKGROUND {
                self.notice_unsaved(
                    "earlier images are still being filtered; save again when they are there",
                );
            } else {
                let pass = self.pass_threads.start(self.viewer_pass(&request.store, &request.settings));
                let commands = self.hub.commands().clone();
                let (store, settings) = (request.store.clone(), request.settings.clone());
                match self
                    .while_filtering(&store, &settings, true, |handle| pass.wait_handling(&commands, handle))
                {
                    Some(filtered) => self.write_image(&request, Some(&filtered.result)),
                    None => self.background.push((request, pass)),
                }
                self.report(&store, true);
            }
        }
    }

    /// Writes a requested image; without a `result` its pass has failed.
    pub(super) fn write_image(&mut self, request: &ImageRequest, result: Option<&FilterResult>) {
        let ImageRequest { store, settings, camera } = request;
        let written = result.ok_or("the filter pass ended early".to_owned()).and_then(|result| {
            let image = SavedImage { store, result, settings, camera };
            self.configuration.host.write_image(&image)
        });
        match written {
            Ok(paths) => {
                let names: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
                let spp = store.samples() as f64 / store.pixels().max(1) as f64;
                let text = format!("saved {}: {spp:.1} samples per pixel", names.join(" and "));
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
