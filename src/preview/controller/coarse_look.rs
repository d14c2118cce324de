//! The first images of a new view, before the render's own: as coarse as it takes to follow a moving camera.

use std::time::{Duration, Instant};

use super::Controller;
use crate::preview::command::Command;
use crate::preview::view::View;
use crate::render::Renderer;

/// Sides of the squares of the coarsest and of the finest such image, in pixels.
const SIDES: (usize, usize) = (32, 4);
/// Longest time for the first such image, and for a finer one after it, in seconds.
const LOOK_SECONDS: [f64; 2] = [0.08, 0.3];
/// Below this time for the finest one, the render's own first step is an image soon enough.
const SHORT: f64 = 0.04;
/// A camera rests if nothing moves it for this time.
const REST: Duration = Duration::from_millis(100);

impl Controller<'_> {
    /// Shows coarse images of a new view, if a viewer waits for one or has moved the camera, and the render's first step takes
    /// longer. Ends early if the camera moves on: then the view needs no memory and no samples.
    pub(super) fn look_coarsely(&mut self, renderer: &Renderer) {
        let (coarsest, finest) = SIDES;
        if self.sees_as_scene() && !self.reporter.wants(|view| view == View::Raw) {
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
            if !self.pending.moves.is_empty() || self.deferred.is_some() {
                return;
            }
        }
    }

    /// Collects movements of the camera, until it rests or there is another command.
    fn await_moves(&mut self) {
        let commands = self.hub.commands().clone();
        let mut rest = REST;
        while let Ok(command) = commands.recv_timeout(rest) {
            match command {
                Command::Wake => {}
                Command::MoveCamera(step) => {
                    self.pending.moves.push(step);
                    rest = Duration::ZERO;
                }
                other => {
                    self.deferred = Some(other);
                    return;
                }
            }
        }
    }
}
