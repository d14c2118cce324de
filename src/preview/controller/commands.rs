//! Handles commands: at once, or by making them pending.

use std::sync::Arc;

use crossbeam::channel::TryRecvError;

use super::Controller;
use super::region_passes::RegionPasses;
use crate::memory::{available_bytes, format_bytes};
use crate::preview::command::Command;
use crate::preview::pixel_values::describe_pixel;
use crate::preview::settings_change::SettingsChange;
use crate::progressive::{Host, Settings, memory_needed};
use crate::stats::Store;

impl Controller<'_> {
    /// Handles all commands that have come before; those that come meanwhile wait, or a flood of them would stop the render.
    pub(super) fn receive(&mut self, store: &Arc<Store>) {
        for command in std::mem::take(&mut self.deferred) {
            self.handle(command, store);
        }
        for _ in 0..self.hub.commands().len() {
            // The hub's queue is bounded, and that of the commands that wait is not.
            if !self.deferred.is_empty() {
                break;
            }
            let Ok(command) = self.hub.commands().try_recv() else { break };
            self.handle(command, store);
        }
        if self.configuration.stays && self.is_interrupted() {
            self.pending.quit = true;
        }
        self.request_pending_saves(store);
        self.check_background();
    }

    /// Handles a command, or makes it pending.
    pub(super) fn handle(&mut self, command: Command, store: &Arc<Store>) {
        let steers = !matches!(command, Command::Wake | Command::Save | Command::Inspect { .. });
        if steers && self.is_interrupted() {
            // The user wants the image as it is, and not the start of another.
            return;
        }
        if self.has_to_wait(&command, store) {
            return self.deferred.push_back(command);
        }
        match command {
            Command::Wake => {}
            Command::Pause(is_paused) => {
                self.is_paused = is_paused && !self.reporter.is_finished();
                self.reporter.hasten();
            }
            Command::ChangeSettings(change) => self.change_settings(&change, store),
            Command::MoveCamera(step) => self.add_move(step),
            Command::AddBookmark => self.add_bookmark(),
            Command::RemoveBookmark(number) => {
                self.bookmarks.remove(number);
                self.reporter.hasten();
            }
            Command::SetRegion(region) => {
                self.region = region;
                self.region_passes = RegionPasses::default();
                self.reporter.hasten();
            }
            Command::Restart => self.pending.restart = true,
            Command::OpenScene(index) => self.pending.scene = self.hub.scenes().get(index).cloned(),
            Command::Return(step) if self.history.leads(step) => self.pending.history = Some(step),
            Command::Return(_) => {}
            Command::Save => {
                self.pending.request_save(&self.configuration.settings);
                self.request_pending_saves(store);
            }
            Command::Inspect { pixel, reply } => {
                // A viewer that does not read its answers misses them.
                let _ = reply.try_send(describe_pixel(pixel, store, self.reporter.shown()));
            }
        }
    }

    /// Returns whether a command concerns a generation that is about to begin: whatever follows a return to another render, and a
    /// return or a bookmark after a movement, a restart or settings that this store does not meet.
    fn has_to_wait(&self, command: &Command, store: &Store) -> bool {
        let is_other_render = self.pending.history.is_some() || !self.deferred.is_empty();
        match command {
            Command::Wake | Command::Inspect { .. } => false,
            Command::Return(_) | Command::AddBookmark => {
                let is_new_render =
                    self.pending.starts_generation() || !self.configuration.settings.are_met_by(store);
                is_other_render || is_new_render
            }
            _ => is_other_render,
        }
    }

    fn change_settings(&mut self, change: &SettingsChange, store: &Store) {
        let mut settings = self.configuration.settings.clone();
        let is_other_method = change.apply(&mut settings);
        if settings == self.configuration.settings {
            return;
        }
        let begins_anew = !settings.are_met_by(store);
        if begins_anew && let Err(problem) = self.has_memory_for(&settings, store) {
            return self.reporter.notice(problem, true);
        }
        self.configuration.settings = settings;
        // A render that another one replaces is kept with its image.
        if is_other_method && !begins_anew {
            self.reporter.forget_image();
        }
        self.reporter.change(&self.configuration.settings);
        self.pending.settings = true;
    }

    /// Checks that a render with these settings fits in memory.
    ///
    /// # Errors
    /// One line that names the page's own controls.
    fn has_memory_for(&mut self, settings: &Settings, store: &Store) -> Result<(), String> {
        let keeps = self.generation_host().checkpoint_interval().is_some();
        let name = settings.denoiser.name();
        let layout = self.layout_for(settings);
        let Some(needed) = memory_needed(&layout, settings, (store.width(), store.height()), keeps) else {
            return Err(format!("{name} keeps every sample: enter a number of samples per pixel first"));
        };
        match available_bytes().filter(|&available| needed > available) {
            Some(available) => Err(format!(
                "{name} needs about {} of memory for this many samples, but {} are available: enter fewer samples",
                format_bytes(needed),
                format_bytes(available)
            )),
            None => Ok(()),
        }
    }

    /// Takes the results of background passes, and problems with checkpoints.
    pub(super) fn check_background(&mut self) {
        for (request, pass) in std::mem::take(&mut self.background) {
            match pass.result() {
                Err(TryRecvError::Empty) => self.background.push((request, pass)),
                result => {
                    let filtered = result.ok();
                    let image = filtered.as_ref().map(|filtered| (&filtered.result, filtered.side));
                    self.write_image(&request, image);
                }
            }
        }
        if self.keeps_checkpoints
            && let Some(problem) = self.configuration.host.checkpoint_problem()
        {
            self.reporter.notice(problem, true);
        }
    }
}
