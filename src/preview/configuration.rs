//! The configuration of a preview: scene, settings, and the interface to the program around it.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::scene_sessions::SceneSession;
use crate::filter::{DENOISERS, Denoiser, FilterResult, SampleVectors};
use crate::image::Planes;
use crate::progressive::{Checkpoint, Host, Settings};
use crate::render::Renderer;
use crate::scene::{Camera, Scene};
use crate::stats::{BlockSet, Store};

/// An image that a viewer wants written.
#[derive(Clone, Copy)]
pub struct SavedImage<'a> {
    pub store: &'a Store,
    pub result: &'a FilterResult,
    /// Side of the squares that were filtered, in pixels: 1 for pixels.
    pub side: usize,
    pub settings: &'a Settings,
    pub camera: &'a Camera,
}

/// The program around a preview.
pub trait PreviewHost: Host {
    /// Writes an image; returns its paths.
    ///
    /// # Errors
    /// One line: why it could not be written.
    fn write_image(&mut self, image: &SavedImage) -> Result<Vec<PathBuf>, String>;

    /// Returns the images that earlier runs have saved, oldest first.
    fn earlier_images(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// Returns in one line what has gone wrong with checkpoints since the last call.
    fn checkpoint_problem(&mut self) -> Option<String>;

    /// Waits until the latest checkpoint is written.
    ///
    /// # Errors
    /// One line: why it could not be written.
    fn wait_for_checkpoint(&mut self) -> Result<(), String>;
}

/// Returns the blocks of dimensions of which a preview keeps statistics: those that the settings call for, and those of every
/// denoiser that a viewer can choose without a new render.
pub fn recorded_blocks(settings: &Settings, outputs: BlockSet) -> BlockSet {
    let is_offered = |denoiser: &&dyn Denoiser| {
        denoiser.reads().sample_vectors == SampleVectors::None && denoiser.missing().is_none()
    };
    let offered = DENOISERS.iter().copied().filter(is_offered);
    let blocks: BlockSet = offered.flat_map(|denoiser| denoiser.reads().blocks).copied().collect();
    settings.recorded_blocks(outputs) | blocks
}

/// The scene, the settings and the host of a preview.
pub struct Configuration<'a> {
    pub scene: &'a Scene,
    /// With the scene's own camera.
    pub renderer: &'a Renderer<'a>,
    pub settings: Settings,
    /// Blocks of dimensions whose statistics the outputs read.
    pub outputs: BlockSet,
    /// Of the scene's own camera: 3 planes.
    pub reference: Option<Arc<Planes>>,
    /// The checkpoint from which the first view goes on.
    pub checkpoint: Option<Checkpoint>,
    /// What was made of the scene before another one was opened.
    pub session: Option<SceneSession>,
    /// Notice to begin with.
    pub notice: Option<String>,
    /// When the program started, or when the scene was opened.
    pub start: Instant,
    /// Whether the preview stays when a budget is spent, until it is interrupted.
    pub stays: bool,
    pub host: &'a mut dyn PreviewHost,
}
