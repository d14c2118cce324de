//! Commands that have to wait for the end of a step, or of a filter pass.

use std::path::PathBuf;

use super::camera_move::CameraMove;
use super::history::HistoryStep;
use super::orbit_camera::OrbitCamera;
use crate::progressive::Settings;

/// The pending commands.
#[derive(Default)]
pub struct Pending {
    /// Movements, each from the camera of a bookmark if it goes to one.
    pub moves: Vec<(Option<OrbitCamera>, CameraMove)>,
    pub restart: bool,
    /// Another scene to open.
    pub scene: Option<PathBuf>,
    pub history: Option<HistoryStep>,
    /// Whether the next samples are others by changed settings.
    pub settings: bool,
    /// Images to be saved of the generation to come, each filtered by these settings.
    pub saves: Vec<Settings>,
    pub quit: bool,
}

impl Pending {
    /// Requests an image of the generation to come. Duplicate requests are merged.
    pub fn request_save(&mut self, settings: &Settings) {
        if !self.saves.contains(settings) {
            self.saves.push(settings.clone());
        }
    }

    /// Returns whether the loop has to be left.
    pub fn any(&self) -> bool {
        self.ends_pass() || self.settings
    }

    /// Returns whether the samples so far are discarded.
    pub fn starts_generation(&self) -> bool {
        !self.moves.is_empty() || self.restart || self.history.is_some()
    }

    /// Returns whether a filter pass is no longer needed.
    pub fn ends_pass(&self) -> bool {
        self.starts_generation() || self.quit || self.scene.is_some()
    }

    /// A new generation fulfils all commands but saves.
    pub fn clear_for_generation(&mut self) {
        *self = Self { saves: std::mem::take(&mut self.saves), ..Self::default() };
    }
}
