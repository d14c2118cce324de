//! A render that can go on: the content of a state file.

use super::image_metadata::ImageMetadata;
use super::stream::Stream;
use crate::filter::{DEFAULT, weights_of};
use crate::progressive::{Checkpoint, Settings};
use crate::stats::BlockSet;

/// Everything that is needed to resume a render, to filter it again, or to merge it with others.
///
/// [`Self::read`] and [`Self::write`] load it from a file and store it.
#[derive(Clone, Debug)]
pub struct RenderState {
    pub metadata: ImageMetadata,
    pub settings: Settings,
    /// Name of the trained weights by which the render's denoiser filtered, if it has any and the state says so.
    pub weights: Option<String>,
    /// Which samples the store holds: one stream, or several that were merged.
    pub streams: Vec<Stream>,
    pub checkpoint: Checkpoint,
}

impl RenderState {
    /// Returns what differs if the weights in use are not those by which the render filtered.
    pub fn other_weights(&self) -> Option<String> {
        let in_use = weights_of(self.settings.denoiser.name())?;
        let found = self.weights.as_deref().filter(|found| *found != in_use)?;
        Some(format!("rendered with the weights {found} of its denoiser; those in use are {in_use}"))
    }

    /// Returns the blocks of dimensions that the default denoiser reads. A render that writes a state records them as well, so
    /// that this denoiser can filter any state.
    pub fn blocks_kept() -> BlockSet {
        DEFAULT.reads().blocks.iter().copied().collect()
    }
}
