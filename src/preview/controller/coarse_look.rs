//! The first images of a new view, before the render's own: as coarse as it takes to follow a moving camera.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::Controller;
use crate::filter::UNFILTERED;
use crate::preview::background_pass::Event;
use crate::preview::command::Command;
use crate::preview::generation_record::CoarseImage;
use crate::preview::view::View;
use crate::render::Renderer;

/// Sides of the squares of the coarsest and of the finest such image, in pixels.
const SIDES: (usize, usize) = (32, 4);
/// Longest time for the first such image, and for a finer one after it, in seconds.
const LOOK_SECONDS: [f64; 2] = [0.08, 0.3];
/// Below this time for the finest one, the render's own first step is an image soon enough.
const SHORT: f64 = 0.04;
/// Samples of every square of a filtered image, and longest time to take them, in seconds.
const SAMPLES: u32 = 2;
const FILTERED_SECONDS: f64 = 0.3;
/// A camera rests if nothing moves it for this time.
const REST: Duration = Duration::from_millis(100);

impl Controller<'_> {
    /// Shows coarse images of a new view, if there is a viewer or the camera was moved, and the render's first step takes
    /// longer. Ends early if the camera moves on: then the view needs no memory and no samples.
    pub(super) fn look_coarsely(&mut self, renderer: &Renderer) {
        let (coarsest, finest) = SIDES;
        if self.sees_as_scene() && !self.reporter.is_selected(|_| true) {
            return;
        }
        let started = Instant::now();
        let mut image = renderer.coarse_image(coarsest);
        let seconds = started.elapsed().as_secs_f64();
        // A square of half the side takes four times as long.
        let seconds_for = |side: usize| seconds * (coarsest / side).pow(2) as f64;
        if seconds_for(finest) < SHORT {
            return;
        }
        let (mut side, mut shown) = (coarsest, None);
        for longest in LOOK_SECONDS {
            while side > finest && seconds_for(side / 2) <= longest {
                side /= 2;
            }
            if side < shown.unwrap_or(coarsest) {
                image = renderer.coarse_image(side);
            }
            if shown != Some(side) {
                self.reporter.publish_coarse(&image, side, renderer.resolution());
                shown = Some(side);
            }
            self.await_moves();
            if self.is_called_away() {
                return;
            }
        }

        // Filter a few samples
        let filters = self.configuration.settings.denoiser != UNFILTERED;
        if filters && self.reporter.is_selected(|view| view == View::Filtered) {
            let mut side = finest;
            while side < coarsest && f64::from(SAMPLES) * seconds_for(side) > FILTERED_SECONDS {
                side *= 2;
            }
            self.look_filtered(renderer, side);
        }
    }

    /// Shows a filtered coarse image, unless another command comes before it is done.
    fn look_filtered(&mut self, renderer: &Renderer, side: usize) {
        let started = Instant::now();
        let store = renderer.coarse_store(side, SAMPLES);
        let (width, height) = renderer.resolution();
        let spp = store.samples_taken() as f64 / (width * height).max(1) as f64;
        let (pass, commands) = (self.draft_pass(Arc::new(store)), self.hub.commands().clone());
        let filtered = self.pass_threads.clone().run(pass, &commands, &mut |event| {
            if let Event::Command(command) = event {
                self.set_aside(command);
            }
            !self.is_called_away()
        });
        let coarse = filtered.map(|filtered| CoarseImage {
            squares: filtered.result.image,
            maps: Vec::new(),
            side,
            size: (width, height),
            detailed: None,
            spp,
        });
        self.reporter.filtered_coarsely(coarse, started.elapsed().as_secs_f64());
    }

    /// Collects movements of the camera: those that have come, once there is one. Ends when there is none for [`REST`], whatever
    /// else comes, or when another command matters.
    fn await_moves(&mut self) {
        let commands = self.hub.commands().clone();
        let mut end = Instant::now() + REST;
        while !self.is_deferred()
            && let Ok(command) = commands.recv_deadline(end)
        {
            self.set_aside(command);
            if !self.pending.moves.is_empty() {
                end = Instant::now();
            }
        }
    }

    /// Keeps a command for the time when there is a store.
    fn set_aside(&mut self, command: Command) {
        match command {
            Command::Wake => {}
            Command::MoveCamera(step) => self.add_move(step),
            command => {
                // Of the pixels under a pointer the latest counts
                if is_inspection(&command) {
                    self.deferred.retain(|earlier| !is_inspection(earlier));
                }
                self.deferred.push_back(command);
            }
        }
    }

    /// Returns whether a command waits that matters more than a first image, or the render is to end.
    fn is_called_away(&self) -> bool {
        !self.pending.moves.is_empty() || self.is_deferred() || self.is_interrupted()
    }

    /// Returns whether a command other than a movement waits. A page whose pointer is on the image inspects a pixel after
    /// every frame: that one waits until there is a store.
    fn is_deferred(&self) -> bool {
        self.deferred.iter().any(|command| !is_inspection(command))
    }
}

fn is_inspection(command: &Command) -> bool {
    matches!(command, Command::Inspect { .. })
}
