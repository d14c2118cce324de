//! Passes images, status and commands between the render thread and its viewers.
//!
//! The hub holds the newest image of each view and the newest status, and a bounded queue of commands. The render
//! thread never waits for a viewer: a slow one skips images. No image is made of a view for which no viewer is ready.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Duration;

use crossbeam::channel::{Receiver, Sender, TrySendError, bounded};
use tokio::sync::watch;

use super::command::Command;
use super::notices::Notices;
use super::preview_frame::PreviewFrame;
use super::saved_images::SavedImages;
use super::view::View;

/// The newest frame of each view, by its index.
pub type Frames = [Option<Arc<PreviewFrame>>; View::ALL.len()];

/// Length of the queue of commands; only a page that floods the render fills it.
const COMMAND_QUEUE: usize = 256;

/// Time between two looks at a flag while waiting for a command.
const POLL: Duration = Duration::from_millis(200);

/// The meeting point of render thread and viewers; see the module.
pub struct Hub {
    frames: watch::Sender<Frames>,
    status: watch::Sender<Arc<str>>,
    /// Why there will be nothing more, once that is so.
    end: watch::Sender<Option<Arc<str>>>,
    saves: SavedImages,
    notices: Notices,
    /// Scenes that a viewer may open.
    scenes: OnceLock<Vec<PathBuf>>,
    /// Count the generations and the frames of all scenes.
    generation: AtomicU32,
    sequence: AtomicU32,
    commands: (Sender<Command>, Receiver<Command>),
    viewers: Mutex<Vec<Selection>>,
    /// The views that some viewer has selected, and those that one is ready for: a bit per view.
    selected: AtomicU32,
    wanted: AtomicU32,
    next_viewer: AtomicU64,
}

/// What a viewer shows.
#[derive(Clone, Copy)]
pub(super) struct Selection {
    pub viewer: u64,
    /// A bit per view.
    pub views: u32,
    /// Whether it is ready for a frame.
    pub is_ready: bool,
}

impl Default for Hub {
    fn default() -> Self {
        Self {
            frames: watch::Sender::new(Frames::default()),
            status: watch::Sender::new(Arc::from("")),
            end: watch::Sender::new(None),
            saves: SavedImages::default(),
            notices: Notices::default(),
            scenes: OnceLock::new(),
            generation: AtomicU32::new(0),
            sequence: AtomicU32::new(0),
            commands: bounded(COMMAND_QUEUE),
            viewers: Mutex::default(),
            selected: AtomicU32::new(0),
            wanted: AtomicU32::new(0),
            next_viewer: AtomicU64::new(0),
        }
    }
}

impl Hub {
    /// Replaces the frame of a view by a newer one.
    pub fn publish(&self, frame: PreviewFrame) {
        let view = frame.view.index();
        self.frames.send_modify(|frames| frames[view] = Some(Arc::new(frame)));
    }

    /// Drops the frames of earlier generations.
    pub fn drop_before(&self, generation: u32) {
        self.frames.send_modify(|frames| {
            frames.iter_mut().for_each(|frame| *frame = frame.take().filter(|f| f.generation >= generation));
        });
    }

    /// Returns the sequence number of a view's newest frame.
    #[cfg(test)]
    pub fn newest(&self, view: View) -> Option<u32> {
        self.frames.borrow()[view.index()].as_ref().map(|frame| frame.sequence)
    }

    /// Sends a status, as JSON, to all viewers.
    pub fn publish_status(&self, status: String) {
        self.status.send_replace(status.into());
    }

    /// Subscribes to frames.
    pub fn frames(&self) -> watch::Receiver<Frames> {
        self.frames.subscribe()
    }

    /// Subscribes to the status; it is empty before the first is published.
    pub fn status(&self) -> watch::Receiver<Arc<str>> {
        self.status.subscribe()
    }

    /// Tells all viewers that there will be nothing more, and why.
    pub fn end(&self, reason: &str) {
        self.end.send_replace(Some(reason.into()));
    }

    /// Subscribes to the end.
    pub fn ended(&self) -> watch::Receiver<Option<Arc<str>>> {
        self.end.subscribe()
    }

    /// Returns the images that were saved.
    pub fn saves(&self) -> &SavedImages {
        &self.saves
    }

    /// Returns the notices to the user.
    pub fn notices(&self) -> &Notices {
        &self.notices
    }

    /// Lets viewers open these scenes.
    pub fn offer_scenes(&self, scenes: Vec<PathBuf>) {
        // There is one list for the whole life of a preview.
        let _ = self.scenes.set(scenes);
    }

    /// Returns the scenes that a viewer may open.
    pub fn scenes(&self) -> &[PathBuf] {
        self.scenes.get().map_or(&[], Vec::as_slice)
    }

    /// Tells all viewers that a scene is being read or, with a problem, that it cannot be; what they command meanwhile is
    /// dropped by [`Self::drop_commands`]. The frames of the scene before are dropped here.
    pub fn begin_loading(&self, scene: &str, problem: Option<&str>) {
        self.frames.send_replace(Frames::default());
        let status = serde_json::json!({ "type": "loading", "scene": scene, "problem": problem });
        self.publish_status(status.to_string());
    }

    /// Tells all viewers why a scene is not open, and waits until one of them opens another. `None` if the flag is set first.
    pub fn await_scene(&self, scene: &str, problem: &str, is_interrupted: &AtomicBool) -> Option<PathBuf> {
        self.begin_loading(scene, Some(problem));
        self.drop_commands();
        while !is_interrupted.load(Ordering::Relaxed) {
            if let Ok(Command::OpenScene(index)) = self.commands.1.recv_timeout(POLL)
                && let Some(scene) = self.scenes().get(index)
            {
                return Some(scene.clone());
            }
        }
        None
    }

    /// Drops the commands that wait: they concern another scene.
    pub fn drop_commands(&self) {
        while self.commands.1.try_recv().is_ok() {}
    }

    /// Returns the number of a new generation, from 1.
    pub(super) fn next_generation(&self) -> u32 {
        self.generation.fetch_add(1, Ordering::Relaxed) + 1
    }

    /// Returns the number of a new frame, from 1.
    pub(super) fn next_sequence(&self) -> u32 {
        self.sequence.fetch_add(1, Ordering::Relaxed).wrapping_add(1)
    }

    /// Tests whether there is any viewer.
    #[cfg(test)]
    pub fn has_viewers(&self) -> bool {
        !self.viewers().is_empty()
    }

    /// Returns an identifier for a new viewer.
    pub(super) fn next_viewer(&self) -> u64 {
        self.next_viewer.fetch_add(1, Ordering::Relaxed)
    }

    /// Tests whether any viewer is ready for a frame of a view.
    pub fn wants(&self, view: View) -> bool {
        self.wanted.load(Ordering::Relaxed) & bit(view) != 0
    }

    /// Queues a command for the render; returns false if the queue is full.
    pub fn send(&self, command: Command) -> bool {
        !matches!(self.commands.0.try_send(command), Err(TrySendError::Full(_)))
    }

    /// Returns the queue of commands, for the render thread.
    pub fn commands(&self) -> &Receiver<Command> {
        &self.commands.1
    }

    /// Tests whether any viewer shows a view, ready for a frame or not.
    pub fn is_selected(&self, view: View) -> bool {
        self.selected.load(Ordering::Relaxed) & bit(view) != 0
    }

    fn viewers(&self) -> std::sync::MutexGuard<'_, Vec<Selection>> {
        // A panic of another thread leaves the list of numbers intact.
        self.viewers.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Replaces what a viewer shows.
    pub(super) fn select(&self, selection: Selection) {
        let mut viewers = self.viewers();
        viewers.retain(|other| other.viewer != selection.viewer);
        viewers.push(selection);
        self.count(&viewers);
    }

    /// Removes a viewer.
    pub(super) fn remove(&self, viewer: u64) {
        let mut viewers = self.viewers();
        viewers.retain(|other| other.viewer != viewer);
        self.count(&viewers);
    }

    fn count(&self, viewers: &[Selection]) {
        let union = |all: u32, viewer: &Selection| all | viewer.views;
        self.selected.store(viewers.iter().fold(0, union), Ordering::Relaxed);
        let wanted = viewers.iter().filter(|viewer| viewer.is_ready).fold(0, union);
        self.wanted.store(wanted, Ordering::Relaxed);
    }
}

/// Returns the bit of a view in a set of views.
pub(super) fn bit(view: View) -> u32 {
    1 << view.index()
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
    fn a_restart_drops_old_frames() {
        let hub = Hub::default();
        hub.publish(frame(View::Raw, 1, 1));
        hub.publish(frame(View::Filtered, 2, 2));
        hub.drop_before(2);
        assert_eq!((hub.newest(View::Raw), hub.newest(View::Filtered)), (None, Some(2)));
    }

    #[test]
    fn no_image_of_the_scene_before_is_sent_while_another_one_is_loaded() {
        let hub = Hub::default();
        hub.publish(frame(View::Raw, 1, 1));
        hub.begin_loading("b.pbrt", None);
        assert_eq!(hub.newest(View::Raw), None);
    }

    #[test]
    fn a_scene_is_awaited_until_there_is_one_or_an_interruption() {
        let hub = Hub::default();
        hub.offer_scenes(vec!["a.pbrt".into(), "b.pbrt".into()]);
        let interrupt = AtomicBool::new(false);
        let chosen = std::thread::scope(|threads| {
            threads.spawn(|| {
                while hub.status().borrow().is_empty() {
                    std::thread::yield_now();
                }
                for command in [Command::Save, Command::OpenScene(7), Command::OpenScene(1)] {
                    std::thread::sleep(2 * POLL / 10);
                    assert!(hub.send(command));
                }
            });
            hub.await_scene("a.pbrt", "not opened: a.pbrt", &interrupt)
        });
        assert_eq!(chosen, Some("b.pbrt".into()));
        assert!(hub.status().borrow().contains("not opened: a.pbrt"));
        interrupt.store(true, Ordering::Relaxed);
        assert_eq!(hub.await_scene("a.pbrt", "", &interrupt), None);
    }

    #[test]
    fn commands_beyond_the_bound_are_refused() {
        let hub = Hub::default();
        assert!((0..COMMAND_QUEUE).all(|_| hub.send(Command::Wake)));
        assert!(!hub.send(Command::Wake));
    }
}
