//! The commands of the first process, what the others answer, and counts of samples as bytes.

use serde::{Deserialize, Serialize};

use crate::filter::DenoiserName;
use crate::progressive::SampleTotals;
use crate::stats::{BlockSet, Rectangle, StatisticsExtent};

/// A command of the first process to another one.
#[derive(Debug, Serialize, Deserialize)]
pub enum Command {
    /// Begin a render with these owners of all pixels. An exchange follows unless there are no samples yet.
    Begin { blocks: BlockSet, capacity: usize, seed: u64, parts: Vec<Rectangle>, is_empty: bool },
    /// Own other pixels. An exchange follows.
    Divide { parts: Vec<Rectangle> },
    /// Take samples: counts of this many bytes follow, and an answer is expected.
    Render { bytes: usize },
    /// Send statistics of all pixels to the first process, by an exchange.
    Gather { extent: StatisticsExtent },
    /// Filter the pixels with all others, and send the result to the first process, by exchanges.
    Filter { denoiser: DenoiserName },
    /// Filter an image of this size, whose statistics the first process has, and send it the result, by exchanges.
    FilterStore { denoiser: DenoiserName, width: usize, height: usize, capacity: usize },
    /// Prepare memory.
    PrepareMemory { bytes: usize },
    /// Answer with a `ProcessRecord`.
    Record,
    /// End.
    End,
}

/// What a process answers to `Command::Render`.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Answer {
    /// Of its pixels.
    pub samples: SampleTotals,
    /// Row, column and index of the first sample of this step that was rejected, among its pixels.
    pub first_rejected: Option<(usize, usize, u32)>,
    /// Seconds that the samples took.
    pub seconds: f64,
    /// Whether a signal asks it to end.
    pub is_interrupted: bool,
}

/// Encodes counts in one byte each if they are all small, else in four; the first byte says which.
pub fn encode_counts(counts: &[u32]) -> Vec<u8> {
    if counts.iter().all(|&n| n <= u8::MAX.into()) {
        return std::iter::once(1).chain(counts.iter().map(|&n| n as u8)).collect();
    }
    std::iter::once(4).chain(counts.iter().flat_map(|n| n.to_le_bytes())).collect()
}

/// Decodes counts.
pub fn decode_counts(bytes: &[u8]) -> Vec<u32> {
    match bytes.split_first() {
        Some((1, counts)) => counts.iter().map(|&n| n.into()).collect(),
        Some((_, counts)) => {
            counts.chunks_exact(4).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]])).collect()
        }
        None => Vec::new(),
    }
}
