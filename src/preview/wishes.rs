//! What people have asked for and has to wait for the end of a step, or of a filter pass.

use super::camera_move::CameraMove;
use crate::progressive::Settings;

/// See the module.
#[derive(Default)]
pub struct Wishes {
    pub moves: Vec<CameraMove>,
    pub restart: bool,
    pub settings: bool,
    pub region: bool,
    /// Images of what is to come, as soon as it is one, as these settings make them.
    pub saves: Vec<Settings>,
    pub quit: bool,
}

impl Wishes {
    /// Whether the loop has to be left.
    pub fn any(&self) -> bool {
        self.breaks_off() || self.goes_on_otherwise()
    }

    /// Whether the samples so far are of no use any more.
    pub fn begins_anew(&self) -> bool {
        !self.moves.is_empty() || self.restart
    }

    /// Whether nobody waits for a filter pass any more.
    pub fn breaks_off(&self) -> bool {
        self.begins_anew() || self.quit
    }

    /// Whether the samples to come are others than without them.
    pub fn goes_on_otherwise(&self) -> bool {
        self.settings || self.region
    }

    /// A new generation fulfils all but a save.
    pub fn begin(&mut self) {
        *self = Self { saves: std::mem::take(&mut self.saves), ..Self::default() };
    }
}
