//! The scenes that a preview opens one after the other.

use std::path::PathBuf;
use std::time::Instant;

use super::failure::Failure;
use super::options::RenderOptions;
use crate::preview::{SceneSession, SceneSessions};

/// The scene that is open, and what was made of the others.
pub(super) struct SceneChanges<'a> {
    /// The options of the command line, for its scene.
    first: &'a RenderOptions,
    /// The options for the scene that is open.
    pub options: RenderOptions,
    /// When it was opened.
    pub start: Instant,
    /// Notice to the user about it.
    pub notice: Option<String>,
    sessions: SceneSessions,
    /// The scene that was open before.
    before: Option<PathBuf>,
}

impl<'a> SceneChanges<'a> {
    /// Begins with the scene of the command line.
    pub fn new(first: &'a RenderOptions, start: Instant) -> Self {
        let (options, sessions) = (first.clone(), SceneSessions::default());
        Self { first, options, start, notice: None, sessions, before: None }
    }

    /// Takes what was made of the scene that is opened.
    pub fn take_session(&mut self) -> Option<SceneSession> {
        self.sessions.take(&self.options.scene)
    }

    /// Keeps what was made of the scene that is open.
    pub fn keep(&mut self, session: SceneSession) {
        self.sessions.keep(self.options.scene.clone(), session);
    }

    /// Discards renders of scenes that are not open until there is memory for those of another one. Returns their scenes.
    pub fn make_room(&mut self) -> Vec<PathBuf> {
        self.sessions.make_room()
    }

    /// Goes to another scene, with a notice.
    pub fn open(&mut self, scene: PathBuf, notice: Option<String>) {
        self.before = Some(self.options.scene.clone());
        self.go_to(scene);
        self.notice = notice;
    }

    /// Goes back to the scene before, with a notice of what is wrong with this one. Returns the notice if there is no scene
    /// before.
    pub fn go_back(&mut self, failure: &Failure) -> Option<String> {
        let notice = format!("not opened: {:#}", failure.error());
        let Some(before) = self.before.take() else { return Some(notice) };
        self.go_to(before);
        self.notice = Some(notice);
        None
    }

    fn go_to(&mut self, scene: PathBuf) {
        self.options =
            if scene == self.first.scene { self.first.clone() } else { self.first.for_scene(scene) };
        self.start = Instant::now();
        self.notice = None;
    }
}
