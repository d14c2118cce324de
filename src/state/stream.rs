//! Which samples a state holds.

use serde::{Deserialize, Serialize};

use crate::render::Share;

/// Samples of one seed: all of its sequence from the beginning, or a share of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stream {
    pub seed: u64,
    pub share: Share,
}

impl Stream {
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
