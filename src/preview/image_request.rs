//! An image that a viewer wants saved, as it was at the moment of the command.

use std::sync::Arc;

use crate::progressive::Settings;
use crate::stats::Store;

/// An image to be saved: the samples at the moment of the command, and the settings that filter them.
pub struct ImageRequest {
    pub store: Arc<Store>,
    pub settings: Settings,
}
