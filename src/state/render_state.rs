//! A render that can go on: the content of a state file.

use super::image_metadata::ImageMetadata;
use super::stream::Stream;
use crate::filter::DENOISERS;
use crate::progressive::{Checkpoint, Settings};
use crate::stats::BlockSet;

/// Everything that is needed to resume a render, to filter it again, or to merge it with others.
///
/// [`Self::read`] and [`Self::write`] load it from a file and store it.
#[derive(Clone, Debug)]
pub struct RenderState {
    pub metadata: ImageMetadata,
    pub settings: Settings,
    /// Which samples the store holds: one stream, or several that were merged.
    pub streams: Vec<Stream>,
    pub checkpoint: Checkpoint,
}

impl RenderState {
    /// Returns the blocks of dimensions that the default denoiser reads. A render that writes a state records them as well, so
    /// that this denoiser can filter any state.
    pub fn blocks_kept() -> BlockSet {
        DENOISERS[0].reads().blocks.iter().copied().collect()
    }
}
