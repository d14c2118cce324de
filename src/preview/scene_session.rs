//! What a user has made of a scene, while another one is open: camera, bookmarks, renders.

use super::bookmarks::Bookmarks;
use super::history::{History, KeptRender};

/// The preview of a scene that can go on.
pub struct SceneSession {
    /// Hash of the scene, as in [`crate::scene::Scene::hash`]: a scene whose files have changed begins anew.
    pub hash: String,
    pub(super) bookmarks: Bookmarks,
    pub(super) history: History,
    pub(super) current: KeptRender,
}
