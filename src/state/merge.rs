//! Adds states of one picture that hold other samples.

use std::sync::Arc;

use super::{State, Stream};
use crate::progressive::Memory;
use crate::render::Share;
use crate::stats::Layout;

/// Why two states cannot be added.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MergeError {
    #[error("{field}: found {found}; accepted is that of the first state, {accepted}")]
    Differ { field: &'static str, found: String, accepted: String },
    #[error("both hold the same samples: found {0}, beside {1}; accepted are other seeds or other shards")]
    Overlap(Stream, Stream),
    #[error("a pixel would have more than {} samples, which a state cannot count", u32::MAX)]
    TooMany,
}

/// Several states on their way to become one.
pub struct Merge {
    state: State,
}

impl Merge {
    pub fn new(mut first: State) -> Self {
        first.streams = counted(&first);
        Self { state: first }
    }

    /// Adds a state's samples. What belongs to the loop is lost.
    ///
    /// # Errors
    /// Another picture, samples that are there already, or more than can be counted.
    pub fn add(&mut self, other: &State) -> Result<(), MergeError> {
        let state = &mut self.state;
        if let Some((field, found, accepted)) = state.frame.difference(&other.frame) {
            return Err(MergeError::Differ { field, found, accepted });
        }
        let (ours, theirs) = (&state.memory.store, &other.memory.store);
        let differ = |field, found, accepted| Err(MergeError::Differ { field, found, accepted });
        if ours.layout() != theirs.layout() {
            return differ("layout", names(theirs.layout()), names(ours.layout()));
        }
        if ours.capacity() != theirs.capacity() {
            return differ("reservoir", theirs.capacity().to_string(), ours.capacity().to_string());
        }
        let mut pairs = state.streams.iter().flat_map(|&a| other.streams.iter().map(move |&b| (a, b)));
        if let Some((ours, theirs)) = pairs.find(|(a, b)| a.overlaps(*b)) {
            return Err(MergeError::Overlap(theirs, ours));
        }
        if !can_be_added(&ours.next_indices(), &theirs.next_indices()) {
            return Err(MergeError::TooMany);
        }
        Arc::make_mut(&mut state.memory.store).merge(theirs);
        state.streams.extend(counted(other));
        let Memory { batches, estimate, rerun, under_way, .. } = &mut state.memory;
        batches.clear();
        (*estimate, *rerun, *under_way) = (None, None, None);
        Ok(())
    }

    /// The sum. Where it has all shares of one seed, each as long as in the whole, it is that whole, and
    /// a render can go on from it.
    pub fn finish(mut self) -> State {
        if let Some(whole) = whole(&self.state) {
            self.state.streams = vec![whole];
        }
        self.state
    }
}

/// A state's streams, each with its samples per pixel where that is one number.
fn counted(state: &State) -> Vec<Stream> {
    match state.streams[..] {
        [stream] => vec![Stream { drawn: even(state), ..stream }],
        _ => state.streams.clone(),
    }
}

/// Samples drawn per pixel, if all pixels have as many.
fn even(state: &State) -> Option<u32> {
    let drawn = state.memory.store.next_indices();
    drawn.first().copied().filter(|first| drawn.iter().all(|drawn| drawn == first))
}

/// The stream that a state's streams are together, if all shares are there and none is longer or shorter than in
/// the whole.
fn whole(state: &State) -> Option<Stream> {
    let seed = state.streams.first()?.seed;
    let total = even(state)?;
    let shares: Vec<Share> = state.streams.iter().map(|stream| stream.share).collect();
    let is_full = |stream: &Stream| stream.seed == seed && stream.drawn == Some(stream.share.of_first(total));
    (Share::are_whole(&shares) && state.streams.iter().all(is_full)).then(|| Stream::new(seed, Share::WHOLE))
}

fn can_be_added(ours: &[u32], theirs: &[u32]) -> bool {
    ours.iter().zip(theirs).all(|(a, b)| a.checked_add(*b).is_some())
}

fn names(layout: &Layout) -> String {
    layout.dimensions().iter().map(|d| d.name).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_added_as_far_as_they_can_be_counted() {
        assert!(can_be_added(&[u32::MAX - 1, 5], &[1, 7]));
        assert!(!can_be_added(&[5, u32::MAX - 1], &[7, 2]));
    }
}
