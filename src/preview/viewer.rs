//! One viewer of a render: takes the newest frames from the hub at its own pace.

use std::sync::Arc;

use tokio::sync::watch;

use super::command::Command;
use super::hub::{Frames, Hub, Selection, bit};
use super::preview_frame::PreviewFrame;
use super::view::View;

/// A viewer of the render: it is ready for frames of some views, and takes each frame once.
///
/// Dropping it removes it from the hub.
pub struct Viewer {
    hub: Arc<Hub>,
    id: u64,
    views: u32,
    /// Sequence number of the latest frame taken of each view.
    taken: [Option<u32>; View::ALL.len()],
}

impl Viewer {
    /// Adds a viewer of no views to `hub`.
    pub fn new(hub: Arc<Hub>) -> Self {
        let id = hub.next_viewer();
        let viewer = Self { hub, id, views: 0, taken: [None; View::ALL.len()] };
        viewer.set_ready(false);
        viewer
    }

    /// Selects the views to take frames of.
    pub fn select(&mut self, views: &[View]) {
        self.views = views.iter().fold(0, |all, &view| all | bit(view));
    }

    /// Sets whether the viewer is ready for a frame. If it is, an idle render is woken.
    pub fn set_ready(&self, is_ready: bool) {
        self.hub.select(Selection { viewer: self.id, views: self.views, is_ready });
        if is_ready {
            self.hub.send(Command::Wake);
        }
    }

    /// Takes a frame that this viewer has not taken yet, of the view that has waited longest. An unfiltered coarse image, the
    /// first one of a new view, stands in for every view.
    pub fn take(&mut self, frames: &mut watch::Receiver<Frames>) -> Option<Arc<PreviewFrame>> {
        let frames = frames.borrow_and_update();
        let is_selected = |frame: &PreviewFrame| self.views & bit(frame.view) != 0;
        let is_new = |frame: &&Arc<PreviewFrame>| {
            let is_stand_in = || {
                let is_older = |own: &Arc<PreviewFrame>| own.generation < frame.generation;
                let mut of_selected = frames.iter().flatten().filter(|own| is_selected(own));
                frame.view == View::Raw && frame.grid > 1 && of_selected.all(is_older)
            };
            let is_wanted = is_selected(frame) || is_stand_in();
            is_wanted && self.taken[frame.view.index()] != Some(frame.sequence)
        };
        // The oldest goes first, or a view that changes often would starve the others.
        let frame =
            frames.iter().flatten().filter(is_new).min_by_key(|frame| self.taken[frame.view.index()])?;
        self.taken[frame.view.index()] = Some(frame.sequence);
        Some(frame.clone())
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.hub.remove(self.id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Planes;
    use crate::preview::preview_frame::FrameInfo;

    fn frame(view: View, generation: u32, sequence: u32) -> PreviewFrame {
        let info = FrameInfo { generation, sequence, spp: 0.0, seconds: 0.0, side: 1 };
        PreviewFrame::new(view, &Planes::new(1, 1, 1), None, info)
    }

    #[test]
    fn a_slow_viewer_gets_the_newest_frame_and_only_once() {
        let hub = Arc::new(Hub::default());
        let mut viewer = Viewer::new(hub.clone());
        let mut frames = hub.frames();
        viewer.select(&[View::Raw]);
        for sequence in 1..5 {
            hub.publish(frame(View::Raw, 0, sequence));
        }
        hub.publish(frame(View::Error, 0, 5));
        assert_eq!(viewer.take(&mut frames).map(|f| f.sequence), Some(4));
        assert!(viewer.take(&mut frames).is_none());
    }

    #[test]
    fn an_unfiltered_coarse_image_stands_in_for_every_view() {
        let hub = Arc::new(Hub::default());
        let mut viewer = Viewer::new(hub.clone());
        let mut frames = hub.frames();
        viewer.select(&[View::Albedo]);
        let coarse = |view, sequence| {
            let info = FrameInfo { generation: 1, sequence, spp: 0.0, seconds: 0.0, side: 4 };
            PreviewFrame::coarse(view, &Planes::new(1, 1, 3), (4, 4), info)
        };
        hub.publish(coarse(View::Filtered, 1));
        assert!(viewer.take(&mut frames).is_none());
        hub.publish(coarse(View::Raw, 2));
        assert_eq!(viewer.take(&mut frames).map(|f| f.sequence), Some(2));
        hub.publish(frame(View::Raw, 1, 3));
        assert!(viewer.take(&mut frames).is_none());
        // A view that has its own image of the generation needs none
        hub.publish(coarse(View::Raw, 4));
        hub.publish(frame(View::Albedo, 1, 5));
        assert_eq!(viewer.take(&mut frames).map(|f| f.sequence), Some(5));
        assert!(viewer.take(&mut frames).is_none());
    }

    #[test]
    fn a_view_that_changes_often_starves_no_other() {
        let hub = Arc::new(Hub::default());
        let mut viewer = Viewer::new(hub.clone());
        let mut frames = hub.frames();
        viewer.select(&[View::Raw, View::Filtered]);
        hub.publish(frame(View::Filtered, 0, 1));
        hub.publish(frame(View::Raw, 0, 2));
        let mut taken = Vec::new();
        for sequence in 3..6 {
            taken.extend(viewer.take(&mut frames).map(|f| f.view));
            hub.publish(frame(View::Filtered, 0, 2 * sequence));
            hub.publish(frame(View::Raw, 0, 2 * sequence + 1));
        }
        assert!(taken.contains(&View::Raw) && taken.contains(&View::Filtered), "{taken:?}");
    }

    #[test]
    fn only_views_that_a_viewer_is_ready_for_are_wanted() {
        let hub = Arc::new(Hub::default());
        let mut viewer = Viewer::new(hub.clone());
        viewer.select(&[View::Raw]);
        assert!(!hub.wants(View::Raw));
        viewer.set_ready(true);
        assert!(hub.wants(View::Raw) && !hub.wants(View::Error));
        viewer.set_ready(false);
        assert!(!hub.wants(View::Raw) && hub.is_selected(View::Raw) && !hub.is_selected(View::Error));
        assert!(hub.has_viewers());
        viewer.set_ready(true);
        drop(viewer);
        assert!(!hub.wants(View::Raw) && !hub.is_selected(View::Raw) && !hub.has_viewers());
    }
}
