//! Sessions of the scenes that are not open: bookmarks, and cameras and renders as far as memory allows.

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
    /// With their cameras; `None` once they were discarded to make room for those of other scenes.
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
    pub fn has_renders_of(&self, hash: &str) -> bool {
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

    /// Keeps what was made of a scene, which is left now.
    pub fn keep(&mut self, scene: PathBuf, session: SceneSession) {
        self.sessions.push((scene, session));
    }

    /// Discards renders until the others fit in their part of the memory; bookmarks stay. Returns the scenes.
    pub fn make_room(&mut self) -> Vec<PathBuf> {
        match available_bytes() {
            Some(available) => self.discard_down_to(MEMORY_FRACTION * (available + self.bytes())),
            None => Vec::new(),
        }
    }

    fn bytes(&self) -> f64 {
        self.sessions.iter().map(|(_, session)| session.bytes()).sum()
    }

    /// Discards renders, of the scene that was left first, until the others take no more than `limit` bytes. Those of the latest scene
    /// stay. Returns the scenes.
    fn discard_down_to(&mut self, limit: f64) -> Vec<PathBuf> {
        let mut discarded = Vec::new();
        for index in 0..self.sessions.len().saturating_sub(1) {
            if self.bytes() <= limit {
                break;
            }
            let (scene, session) = &mut self.sessions[index];
            if session.renders.take().is_some() {
                discarded.push(scene.clone());
            }
        }
        discarded
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
            sessions.keep(scene.into(), session());
        }
        let limit = 2.0 * session().bytes();
        assert_eq!(sessions.discard_down_to(limit), [PathBuf::from("a")]);
        assert_eq!(sessions.discard_down_to(0.0), [PathBuf::from("b")], "those of the latest stay");

        // The scene is known still, without renders
        let first = sessions.take(Path::new("a")).expect("a session");
        assert!(!first.has_renders_of("a"));
        let latest = sessions.take(Path::new("c")).expect("a session");
        assert!(latest.has_renders_of("a") && !latest.has_renders_of("b"));
        assert!(sessions.take(Path::new("c")).is_none());
    }
}
