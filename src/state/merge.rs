//! Merges render states of one image that hold different samples.
//!
//! Takes states of other seeds or shards, such as those of several machines; gives one state with all their samples.

use std::sync::Arc;

use super::render_state::RenderState;
use super::stream::Stream;
use crate::progressive::{Checkpoint, Position};
use crate::render::Shard;
use crate::stats::Layout;

/// Why two states cannot be added.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MergeError {
    #[error("{field}: found {found}; accepted is that of the first state, {accepted}")]
    Differ { field: &'static str, found: String, accepted: String },
    #[error("both hold the same samples: found {0} and {1}; accepted are states of other seeds or shards")]
    Overlap(Stream, Stream),
    #[error("a pixel would have more than {} samples, which a state cannot count", u32::MAX)]
    TooMany,
}

/// A state to which others are added.
pub struct Merge {
    state: RenderState,
}

impl Merge {
    /// Starts with one state, which the others have to match.
    pub fn new(mut first: RenderState) -> Self {
        first.streams = counted_streams(&first);
        Self { state: first }
    }

    /// Adds the samples of a state. The render loop's data (passes, estimate, interim pass, unfinished batch) is dropped.
    ///
    /// # Errors
    /// A state of another image, samples that are there already, or more than a pixel can count.
    pub fn add(&mut self, other: &RenderState) -> Result<(), MergeError> {
        let state = &mut self.state;
        if let Some((field, found, accepted)) = state.metadata.difference(&other.metadata) {
            return Err(MergeError::Differ { field, found, accepted });
        }
        let (ours, theirs) = (&state.checkpoint.store, &other.checkpoint.store);
        let differ = |field, found, accepted| Err(MergeError::Differ { field, found, accepted });
        if ours.layout() != theirs.layout() {
            return differ("layout", dimension_names(theirs.layout()), dimension_names(ours.layout()));
        }
        if ours.capacity() != theirs.capacity() {
            return differ("reservoir", theirs.capacity().to_string(), ours.capacity().to_string());
        }
        let mut pairs = state.streams.iter().flat_map(|&a| other.streams.iter().map(move |&b| (a, b)));
        if let Some((ours, theirs)) = pairs.find(|(a, b)| a.overlaps(*b)) {
            return Err(MergeError::Overlap(theirs, ours));
        }
        if !can_add(&ours.next_indices(), &theirs.next_indices()) {
            return Err(MergeError::TooMany);
        }
        Arc::make_mut(&mut state.checkpoint.store).merge(theirs);
        state.streams.extend(counted_streams(other));
        let Checkpoint { position, passes, interim, .. } = &mut state.checkpoint;
        passes.clear();
        (*position, *interim) = (Position::Filter, None);
        Ok(())
    }

    /// Returns the merged state. If it holds all shards of one seed, each with the samples that it has in the whole,
    /// it becomes the whole stream, and a render can resume from it.
    pub fn finish(mut self) -> RenderState {
        if let Some(whole) = whole_stream(&self.state) {
            self.state.streams = vec![whole];
        }
        self.state
    }
}

/// Returns the streams of a state, each with its samples per pixel if that is one number.
fn counted_streams(state: &RenderState) -> Vec<Stream> {
    match state.streams[..] {
        [stream] => vec![Stream { drawn: uniform_count(state), ..stream }],
        _ => state.streams.clone(),
    }
}

/// Returns the samples taken per pixel, if all pixels have the same number.
fn uniform_count(state: &RenderState) -> Option<u32> {
    let drawn = state.checkpoint.store.next_indices();
    drawn.first().copied().filter(|first| drawn.iter().all(|drawn| drawn == first))
}

/// Returns the whole stream of a seed, if a state holds all its shards and each has as many samples as in the whole.
fn whole_stream(state: &RenderState) -> Option<Stream> {
    let seed = state.streams.first()?.seed;
    let total = uniform_count(state)?;
    let shards: Vec<Shard> = state.streams.iter().map(|stream| stream.shard).collect();
    let is_full =
        |stream: &Stream| stream.seed == seed && stream.drawn == Some(stream.shard.samples_among(total));
    (Shard::are_complete(&shards) && state.streams.iter().all(is_full))
        .then(|| Stream::new(seed, Shard::WHOLE))
}

/// Tests whether no pixel's count overflows.
fn can_add(ours: &[u32], theirs: &[u32]) -> bool {
    ours.iter().zip(theirs).all(|(a, b)| a.checked_add(*b).is_some())
}

fn dimension_names(layout: &Layout) -> String {
    layout.dimensions().iter().map(|d| d.name).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_that_overflow_cannot_be_added() {
        assert!(can_add(&[u32::MAX - 1, 5], &[1, 7]));
        assert!(!can_add(&[5, u32::MAX - 1], &[7, 2]));
    }
}
