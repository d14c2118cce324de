//! Identifies the samples that a state holds: seed and shard of their random sequence.

use serde::{Deserialize, Serialize};

use crate::render::Shard;

/// The samples of one seed from the beginning of its sequence: all of them, or those of one shard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stream {
    pub seed: u64,
    pub shard: Shard,
    /// In a merged state, how many of these samples each pixel has, if all have the same number. It decides whether
    /// all shards together are the whole sequence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drawn: Option<u32>,
}

impl Stream {
    /// Creates a stream of unknown length.
    pub fn new(seed: u64, shard: Shard) -> Self {
        Self { seed, shard, drawn: None }
    }

    /// Tests whether some samples are in both.
    pub fn overlaps(self, other: Self) -> bool {
        self.seed == other.seed && self.shard.overlaps(other.shard)
    }
}

impl std::fmt::Display for Stream {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "seed {}, shard {}", self.seed, self.shard)
    }
}
