//! The camera: its movements, its bookmarks, and its part of the status.

use super::Controller;
use crate::preview::bookmarks::MOST_BOOKMARKS;
use crate::preview::camera_move::CameraMove;
use crate::preview::orbit_camera::OrbitCamera;
use crate::preview::status::{CameraStatus, ListedBookmark};
use crate::render::Renderer;
use crate::scene::Camera;
use crate::scene::pbrt::camera_directives;

impl Controller<'_> {
    /// Returns the camera that renders: the scene's own before the first generation.
    pub(super) fn current_camera(&self) -> &Camera {
        self.camera.as_ref().map_or(&self.configuration.scene.camera, OrbitCamera::camera)
    }

    /// Starts with the scene's own camera, which orbits the point in the middle of the image.
    pub(super) fn set_up_camera(&mut self, renderer: &Renderer) {
        if self.camera.is_some() {
            return;
        }
        let (width, height) = renderer.resolution();
        let pivot = renderer.seen_at(width / 2, height / 2).map(|p| p.as_dvec3());
        let reach = f64::from(renderer.diameter()) / 2.0;
        self.camera = Some(OrbitCamera::new(&self.configuration.scene.camera, pivot, reach));
    }

    /// Returns whether the camera sees what the scene's own does.
    pub(super) fn sees_as_scene(&self) -> bool {
        let own = &self.configuration.scene.camera;
        self.camera.as_ref().is_none_or(|camera| camera.is_equivalent(own))
    }

    /// Lets a movement wait. The camera of a bookmark is found now: a later command may remove it.
    pub(super) fn add_move(&mut self, step: CameraMove) {
        let start = step.bookmark.and_then(|number| self.bookmarks.camera(number)).cloned();
        self.pending.moves.push((start, step));
    }

    /// Moves the camera by the pending movements; returns whether the image changes.
    pub(super) fn moves_camera(&mut self, renderer: &Renderer) -> bool {
        let Some(mut camera) = self.camera.take() else { return false };
        let before = camera.camera().clone();
        for (start, step) in std::mem::take(&mut self.pending.moves) {
            camera = start.unwrap_or(camera);
            self.apply_move(&mut camera, &step, renderer);
        }
        let has_moved = !camera.is_equivalent(&before);
        self.camera = Some(camera);
        has_moved
    }

    fn apply_move(&mut self, camera: &mut OrbitCamera, step: &CameraMove, renderer: &Renderer) {
        // Find the point to focus on
        let (width, height) = renderer.resolution();
        let pixel = step.focus_at.map(|[x, y]| [x as usize, y as usize]);
        let inside = pixel.filter(|[x, y]| *x < width && *y < height);
        let seen = inside.and_then(|[x, y]| renderer.seen_at(x, y));
        if step.focus_at.is_some() && seen.is_none() {
            self.reporter.notice("cannot focus there: no surface is seen at this pixel".to_owned(), true);
        }

        // Move, and tell why nothing changes
        camera.apply(step, seen.map(|p| p.as_dvec3()));
        let sets_lens = step.focus.is_some() || seen.is_some() || step.aperture.is_some_and(|a| a > 0.0);
        if sets_lens && !camera.has_lens() {
            self.reporter.notice("a spherical camera has no lens: everything is in focus".to_owned(), false);
        } else if sets_lens && camera.camera().lens_radius == 0.0 {
            let text = format!(
                "focus is at {:.4}, but with aperture 0 everything is in focus: enter an aperture to see it",
                camera.camera().focal_distance
            );
            self.reporter.notice(text, false);
        }
    }

    /// Keeps the camera as a bookmark.
    pub(super) fn add_bookmark(&mut self) {
        let Some(camera) = &self.camera else { return };
        if self.bookmarks.contains(camera.camera()) {
            self.reporter.notice("there is a bookmark of this camera already".to_owned(), false);
        } else if self.bookmarks.is_full() {
            let text = format!("there are {MOST_BOOKMARKS} bookmarks: remove one first");
            self.reporter.notice(text, true);
        } else {
            self.bookmarks.add(camera.clone());
            self.reporter.hasten();
        }
    }

    pub(super) fn listed_bookmarks(&self) -> Vec<ListedBookmark> {
        let bookmarks = self.bookmarks.list().iter();
        bookmarks
            .map(|bookmark| ListedBookmark {
                number: bookmark.number,
                directives: self.directives(bookmark.camera.camera()),
            })
            .collect()
    }

    /// Returns the directives of a camera.
    pub(super) fn directives(&self, camera: &Camera) -> String {
        let scene = self.configuration.scene;
        camera_directives(camera, scene.origin, scene.film.width as f32 / scene.film.height as f32)
    }

    pub(super) fn camera_status(&self) -> CameraStatus {
        let camera = self.current_camera();
        CameraStatus {
            aperture: camera.lens_radius,
            focus: camera.focal_distance,
            distance: self.camera.as_ref().map_or(0.0, OrbitCamera::distance),
            directives: self.directives(camera),
        }
    }
}
