//! Adds states of one picture that hold other samples.

use std::sync::Arc;

use super::{State, Stream};
use crate::progressive::Memory;
use crate::render::Share;
use crate::stats::{Layout, Store};

/// Why two states cannot be added.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MergeError {
    #[error("{field}: found {found}; accepted is that of the first state, {accepted}")]
    Differ { field: &'static str, found: String, accepted: String },
    #[error("both hold the same samples: found {0}, beside {1}; accepted are other seeds or other shards")]
    Overlap(Stream, Stream),
}

/// Several states on their way to become one.
pub struct Merge {
    state: State,
    /// Samples drawn per pixel, state by state.
    drawn: Vec<Vec<u32>>,
}

impl Merge {
    pub fn new(first: State) -> Self {
        let drawn = vec![drawn(&first.memory.store)];
        Self { state: first, drawn }
    }

    /// Adds a state's samples. What belongs to the loop is lost.
    ///
    /// # Errors
    /// Another picture, or samples that are there already.
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
        self.drawn.push(drawn(theirs));
        Arc::make_mut(&mut state.memory.store).merge(theirs);
        state.streams.extend(&other.streams);
        let Memory { batches, estimate, rerun, under_way, .. } = &mut state.memory;
        batches.clear();
        (*estimate, *rerun, *under_way) = (None, None, None);
        Ok(())
    }

    /// The sum. Where it has all shares of one seed, each as long as in the whole, it is that whole, and
    /// a render can go on from it.
    pub fn finish(mut self) -> State {
        let streams = &mut self.state.streams;
        let shares: Vec<Share> = streams.iter().map(|stream| stream.share).collect();
        let seed = streams.first().map(|stream| stream.seed);
        let one_seed = streams.iter().all(|stream| Some(stream.seed) == seed);
        if one_seed && Share::are_whole(&shares) && self.drawn.len() == shares.len() {
            let whole = |i: usize| {
                let total = self.drawn.iter().map(|drawn| drawn[i]).fold(0, u32::saturating_add);
                shares.iter().zip(&self.drawn).all(|(share, drawn)| drawn[i] == share.of_first(total))
            };
            if (0..self.state.memory.store.pixels()).all(whole) {
                streams.truncate(1);
                streams.iter_mut().for_each(|stream| stream.share = Share::WHOLE);
            }
        }
        self.state
    }
}

fn drawn(store: &Store) -> Vec<u32> {
    let width = store.width();
    store.rows().iter().flat_map(|row| (0..width).map(|x| row.next_index(x))).collect()
}

fn names(layout: &Layout) -> String {
    layout.dimensions().iter().map(|d| d.name).collect::<Vec<_>>().join(" ")
}
