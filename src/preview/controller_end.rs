//! How a controller ends.

use std::path::PathBuf;

use super::scene_sessions::SceneSession;
use crate::progressive::Outcome;
use crate::scene::Camera;

/// How a controller ends.
pub enum ControllerEnd {
    /// With an image, seen by this camera.
    Finished(Box<Outcome>, Camera),
    /// The preview was closed.
    Closed,
    /// A user opens another scene; this one can go on later.
    Opens(PathBuf, Box<SceneSession>),
}
