//! Which samples a state holds.

use serde::{Deserialize, Serialize};

use crate::render::Share;

/// Samples of one seed: all of its sequence from the beginning, or a share of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stream {
    pub seed: u64,
    pub share: Share,
    /// In a sum of states, how many of these samples each pixel has, if all have as many: whether all shares
    /// make up a whole could not be told otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drawn: Option<u32>,
}

impl Stream {
    pub fn new(seed: u64, share: Share) -> Self {
        Self { seed, share, drawn: None }
    }

    /// Whether some samples are in both.
    pub fn overlaps(self, other: Self) -> bool {
        self.seed == other.seed && self.share.overlaps(other.share)
    }
}

impl std::fmt::Display for Stream {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "seed {}, shard {}", self.seed, self.share)
    }
}
