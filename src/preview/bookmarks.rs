//! The cameras that a user keeps to return to.
//!
//! A bookmark has a number of its own: the place in the list changes when another viewer removes one.

use super::orbit_camera::OrbitCamera;
use crate::scene::Camera;

/// Most bookmarks: every status repeats them.
pub const MOST_BOOKMARKS: usize = 16;

/// A camera to return to.
pub struct Bookmark {
    /// Counts the bookmarks of the scene, removed ones included.
    pub number: usize,
    pub camera: OrbitCamera,
}

/// The bookmarks of a scene.
#[derive(Default)]
pub struct Bookmarks {
    list: Vec<Bookmark>,
    /// Number of the next one.
    next: usize,
}

impl Bookmarks {
    /// Returns the bookmarks, oldest first.
    pub fn list(&self) -> &[Bookmark] {
        &self.list
    }

    pub fn is_full(&self) -> bool {
        self.list.len() >= MOST_BOOKMARKS
    }

    /// Returns whether there is a bookmark of a camera.
    pub fn contains(&self, camera: &Camera) -> bool {
        self.list.iter().any(|bookmark| bookmark.camera.camera() == camera)
    }

    /// Returns the camera of a bookmark, by its number.
    pub fn camera(&self, number: usize) -> Option<&OrbitCamera> {
        self.list.iter().find(|bookmark| bookmark.number == number).map(|bookmark| &bookmark.camera)
    }

    /// Adds a bookmark.
    pub fn add(&mut self, camera: OrbitCamera) {
        self.list.push(Bookmark { number: self.next, camera });
        self.next += 1;
    }

    /// Removes a bookmark, by its number.
    pub fn remove(&mut self, number: usize) {
        self.list.retain(|bookmark| bookmark.number != number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::pbrt;

    #[test]
    fn a_bookmark_keeps_its_number_when_another_one_is_removed() {
        let text = include_str!("../../experiments/stability/cases/noisy.pbrt");
        let scene = pbrt::read_str(text, std::path::Path::new(".")).unwrap();
        let camera = |reach| OrbitCamera::new(&scene.camera, None, reach);
        let mut bookmarks = Bookmarks::default();
        [1.0, 2.0, 3.0].into_iter().for_each(|reach| bookmarks.add(camera(reach)));
        bookmarks.remove(0);
        bookmarks.remove(2);
        let distance = |number| bookmarks.camera(number).map(|camera| camera.distance().round());
        assert_eq!([0, 1, 2].map(distance), [None, Some(2.0), None]);
        // A late command for a removed one must not meet another.
        bookmarks.add(camera(4.0));
        assert_eq!(bookmarks.list().iter().map(|bookmark| bookmark.number).collect::<Vec<_>>(), [1, 3]);
        assert!(bookmarks.contains(&scene.camera) && !bookmarks.is_full());
    }
}
