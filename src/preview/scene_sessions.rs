//! What a user has made of the scenes that are not open: cameras, bookmarks, and renders as far as memory allows.

use std::path::{Path, PathBuf};

use super::bookmarks::Bookmarks;
use super::history::{History, KeptRender};
use crate::memory::available_bytes;

/// Largest fraction that the renders of all scenes may take of the memory that would be free without them.
const MEMORY_FRACTION: f64 = 0.5;

/// The preview of a scene that can go on.
pub struct SceneSession {
    /// Hash of the scene, as in [`crate::scene::Scene::hash`]: a scene whose files have changed begins anew.
    pub(super) hash: String,
    pub(super) bookmarks: Bookmarks,
    /// `None` once they have made room for those of other scenes.
    pub(super) renders: Option<SceneRenders>,
}

/// The renders of a scene.
pub(super) struct SceneRenders {
    pub history: History,
    pub current: KeptRender,
}

/// The sessions, by their scenes.
#[derive(Default)]
pub struct SceneSessions {
    /// The latest last.
    sessions: Vec<(PathBuf, SceneSession)>,
}

impl SceneSession {
    /// Returns whether there are renders of a scene of this hash.
    pub fn goes_on(&self, hash: &str) -> bool {
        self.renders.is_some() && self.hash == hash
    }

    /// Returns the bytes of its renders.
    fn bytes(&self) -> f64 {
        self.renders.as_ref().map_or(0.0, |renders| renders.history.bytes() + renders.current.bytes())
    }
}

impl SceneSessions {
    /// Takes what was made of a scene.
    pub fn take(&mut self, scene: &Path) -> Option<SceneSession> {
        let index = self.sessions.iter().position(|(other, _)| other == scene)?;
        Some(self.sessions.remove(index).1)
    }

    /// Keeps what was made of a scene. Returns the scenes whose renders had to make room for it; their bookmarks stay.
    pub fn keep(&mut self, scene: PathBuf, session: SceneSession) -> Vec<PathBuf> {
        self.sessions.push((scene, session));
        match available_bytes() {
            Some(available) => self.make_room(MEMORY_FRACTION * (available + self.bytes())),
            None => Vec::new(),
        }
    }

    fn bytes(&self) -> f64 {
        self.sessions.iter().map(|(_, session)| session.bytes()).sum()
    }

    /// Drops renders, of the scene that was left first, until the others take no more than `limit` bytes. Those of the latest scene
    /// stay. Returns the scenes.
    fn make_room(&mut self, limit: f64) -> Vec<PathBuf> {
        let mut dropped = Vec::new();
        for index in 0..self.sessions.len() - 1 {
            if self.bytes() <= limit {
                break;
            }
            let (scene, session) = &mut self.sessions[index];
            if session.renders.take().is_some() {
                dropped.push(scene.clone());
            }
        }
        dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preview::generation_record::GenerationRecord;
    use crate::progressive::{Checkpoint, Settings};
    use crate::stats::{Layout, Store};

    fn session() -> SceneSession {
        let store = Store::new(16, 16, Layout::with_blocks(|_| false), 0, 0);
        let current = KeptRender {
            camera: None,
            settings: Settings::default(),
            checkpoint: Checkpoint::new(store),
            record: GenerationRecord::default(),
            keeps_checkpoints: false,
            is_kept_if_short: true,
        };
        let renders = Some(SceneRenders { history: History::default(), current });
        SceneSession { hash: "a".to_owned(), bookmarks: Bookmarks::default(), renders }
    }

    #[test]
    fn the_renders_of_the_scene_that_was_left_first_make_room() {
        let mut sessions = SceneSessions::default();
        for scene in ["a", "b", "c"] {
            sessions.sessions.push((scene.into(), session()));
        }
        let limit = 2.0 * session().bytes();
        assert_eq!(sessions.make_room(limit), [PathBuf::from("a")]);
        assert_eq!(sessions.make_room(0.0), [PathBuf::from("b")], "those of the latest stay");

        // The scene is known still, without renders
        let first = sessions.take(Path::new("a")).expect("a session");
        assert!(!first.goes_on("a"));
        let latest = sessions.take(Path::new("c")).expect("a session");
        assert!(latest.goes_on("a") && !latest.goes_on("b"));
        assert!(sessions.take(Path::new("c")).is_none());
    }
}
