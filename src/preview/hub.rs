//! Where images wait for whoever looks: the newest of each view, and nothing older.
//!
//! The render thread writes here and never waits; a viewer that is slow finds a newer image when it
//! comes back. What nobody is ready to take is not made at all.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use crossbeam::channel::{Receiver, Sender, TrySendError, bounded};
use tokio::sync::watch;

use super::frame::Frame;
use super::protocol::Command;
use super::view::View;

/// The newest frame of each view, by its index.
pub type Frames = [Option<Arc<Frame>>; View::ALL.len()];

/// Commands that may wait; more come only from a page that floods.
const WAITING_COMMANDS: usize = 256;

/// See the module.
pub struct Hub {
    frames: watch::Sender<Frames>,
    status: watch::Sender<Arc<str>>,
    commands: (Sender<Command>, Receiver<Command>),
    viewers: Mutex<Vec<(u64, u32)>>,
    /// Union of what ready viewers look at: a bit per view.
    wanted: AtomicU32,
    next_viewer: AtomicU64,
}

impl Default for Hub {
    fn default() -> Self {
        Self {
            frames: watch::Sender::new(Frames::default()),
            status: watch::Sender::new(Arc::from("")),
            commands: bounded(WAITING_COMMANDS),
            viewers: Mutex::default(),
            wanted: AtomicU32::new(0),
            next_viewer: AtomicU64::new(0),
        }
    }
}

impl Hub {
    /// Replaces a view's frame by a newer one.
    pub fn publish(&self, frame: Frame) {
        let view = frame.view.index();
        self.frames.send_modify(|frames| frames[view] = Some(Arc::new(frame)));
    }

    /// Forgets frames that a restart has made wrong.
    pub fn forget_before(&self, generation: u32) {
        self.frames.send_modify(|frames| {
            frames.iter_mut().for_each(|frame| *frame = frame.take().filter(|f| f.generation >= generation));
        });
    }

    /// Sequence number of a view's newest frame.
    pub fn newest(&self, view: View) -> Option<u32> {
        self.frames.borrow()[view.index()].as_ref().map(|frame| frame.sequence)
    }

    /// What everyone who looks is told, as JSON.
    pub fn tell(&self, status: String) {
        self.status.send_replace(status.into());
    }

    pub fn frames(&self) -> watch::Receiver<Frames> {
        self.frames.subscribe()
    }

    pub fn status(&self) -> watch::Receiver<Arc<str>> {
        self.status.subscribe()
    }

    /// Whether anyone is there.
    #[cfg(test)]
    pub fn has_viewers(&self) -> bool {
        !self.viewers().is_empty()
    }

    /// Whether anyone who looks at a view is ready for a frame of it.
    pub fn wants(&self, view: View) -> bool {
        self.wanted.load(Ordering::Relaxed) & bit(view) != 0
    }

    /// Hands a command to the render; false if too many wait.
    pub fn command(&self, command: Command) -> bool {
        !matches!(self.commands.0.try_send(command), Err(TrySendError::Full(_)))
    }

    /// Where commands arrive.
    pub fn commands(&self) -> &Receiver<Command> {
        &self.commands.1
    }

    fn viewers(&self) -> std::sync::MutexGuard<'_, Vec<(u64, u32)>> {
        // A list of numbers is whole whatever happened to another thread.
        self.viewers.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn set(&self, id: u64, views: Option<u32>) {
        let mut viewers = self.viewers();
        viewers.retain(|(other, _)| *other != id);
        viewers.extend(views.map(|views| (id, views)));
        self.wanted.store(viewers.iter().fold(0, |all, (_, views)| all | views), Ordering::Relaxed);
    }
}

fn bit(view: View) -> u32 {
    1 << view.index()
}

/// Somebody who looks; stops counting when dropped.
pub struct Viewer {
    hub: Arc<Hub>,
    id: u64,
    views: u32,
    /// Sequence numbers of what was taken, by view.
    taken: [Option<u32>; View::ALL.len()],
}

impl Viewer {
    pub fn new(hub: Arc<Hub>) -> Self {
        let id = hub.next_viewer.fetch_add(1, Ordering::Relaxed);
        hub.set(id, Some(0));
        Self { hub, id, views: 0, taken: [None; View::ALL.len()] }
    }

    /// Looks at these views from now on.
    pub fn look(&mut self, views: &[View]) {
        self.views = views.iter().fold(0, |all, &view| all | bit(view));
    }

    /// Says whether a frame could be taken now. When it could, the render is woken, which may be idle.
    pub fn ready(&self, ready: bool) {
        self.hub.set(self.id, Some(if ready { self.views } else { 0 }));
        if ready {
            self.hub.command(Command::Look);
        }
    }

    /// A frame that this viewer has not had, of the view that waited longest.
    pub fn take(&mut self, frames: &mut watch::Receiver<Frames>) -> Option<Arc<Frame>> {
        let frames = frames.borrow_and_update();
        let new = |frame: &&Arc<Frame>| {
            self.views & bit(frame.view) != 0 && self.taken[frame.view.index()] != Some(frame.sequence)
        };
        // So that a view that changes often hides no other.
        let frame = frames.iter().flatten().filter(new).min_by_key(|frame| self.taken[frame.view.index()])?;
        self.taken[frame.view.index()] = Some(frame.sequence);
        Some(frame.clone())
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.hub.set(self.id, None);
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::Stamp;
    use super::*;
    use crate::image::Planes;

    fn frame(view: View, generation: u32, sequence: u32) -> Frame {
        let stamp = Stamp { generation, sequence, spp: 0.0, seconds: 0.0 };
        Frame::new(view, &Planes::new(1, 1, 1), None, stamp)
    }

    #[test]
    fn a_slow_viewer_gets_the_newest_frame_and_only_once() {
        let hub = Arc::new(Hub::default());
        let mut viewer = Viewer::new(hub.clone());
        let mut frames = hub.frames();
        viewer.look(&[View::Raw]);
        for sequence in 1..5 {
            hub.publish(frame(View::Raw, 0, sequence));
        }
        hub.publish(frame(View::Error, 0, 5));
        assert_eq!(viewer.take(&mut frames).map(|f| f.sequence), Some(4));
        assert!(viewer.take(&mut frames).is_none());
    }

    #[test]
    fn a_view_that_changes_often_hides_no_other() {
        let hub = Arc::new(Hub::default());
        let mut viewer = Viewer::new(hub.clone());
        let mut frames = hub.frames();
        viewer.look(&[View::Raw, View::Filtered]);
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
    fn only_what_someone_is_ready_for_is_wanted() {
        let hub = Arc::new(Hub::default());
        let mut viewer = Viewer::new(hub.clone());
        viewer.look(&[View::Raw]);
        assert!(!hub.wants(View::Raw));
        viewer.ready(true);
        assert!(hub.wants(View::Raw) && !hub.wants(View::Error));
        viewer.ready(false);
        assert!(!hub.wants(View::Raw) && hub.has_viewers());
        viewer.ready(true);
        drop(viewer);
        assert!(!hub.wants(View::Raw) && !hub.has_viewers());
    }

    #[test]
    fn a_restart_takes_old_frames_away() {
        let hub = Hub::default();
        hub.publish(frame(View::Raw, 1, 1));
        hub.publish(frame(View::Filtered, 2, 2));
        hub.forget_before(2);
        assert_eq!((hub.newest(View::Raw), hub.newest(View::Filtered)), (None, Some(2)));
    }

    #[test]
    fn commands_beyond_the_bound_are_refused() {
        let hub = Hub::default();
        assert!((0..WAITING_COMMANDS).all(|_| hub.command(Command::Look)));
        assert!(!hub.command(Command::Look));
    }
}
