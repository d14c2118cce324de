//! An image that a viewer wants saved, as it was at the moment of the command.

use std::sync::Arc;

use crate::progressive::Settings;
use crate::scene::Camera;
use crate::stats::Store;

/// An image to be saved: the samples at the moment of the command, the settings that filter them, and the camera.
pub struct ImageRequest {
    pub store: Arc<Store>,
    pub settings: Settings,
    pub camera: Camera,
}
