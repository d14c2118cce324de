//! Moves statistics between processes, from the rectangles that they have to the rectangles that they want.
//!
//! With what is wanted this is every exchange there is: new owners, margins, the whole image in one process.

use rayon::prelude::*;

use super::link::Link;
use crate::stats::{Layout, Rectangle, Row, Store};

/// What the stores of all processes have in common.
#[derive(Clone, Debug)]
pub struct StoreKind {
    pub layout: Layout,
    /// Sample vectors of a pixel's reservoir.
    pub capacity: usize,
    pub seed: u64,
}

impl StoreKind {
    /// Returns an empty store of a rectangle.
    pub fn empty(&self, part: &Rectangle) -> Store {
        Store::of_part(part, self.layout.clone(), self.capacity, self.seed)
    }

    fn row_bytes(&self, part: &Rectangle) -> usize {
        Row::byte_len(part.width(), &self.layout, self.capacity).expect("what is in memory has a size")
    }
}

/// Fills the rectangle that this process wants with the statistics of the processes that have them. All processes call it,
/// with the rectangles that each has, which do not overlap, and that each wants, if any. `own` has the statistics of this
/// process, and `wanted` the size of what it wants; what no process has stays as it is.
pub fn exchange(
    link: &Link,
    kind: &StoreKind,
    (have, own): (&[Option<Rectangle>], Option<&Store>),
    (want, wanted): (&[Option<Rectangle>], Option<&mut Store>),
) {
    let rank = link.rank();
    let shared = |from: usize, to: usize| have[from]?.intersection(&want[to]?);
    // Send what others want
    let message = |to: usize| {
        let (part, own) = (shared(rank, to)?, own?);
        Some((to, to_bytes(kind, own, &part.within(&have[rank]?))))
    };
    let messages: Vec<_> = (0..link.size()).filter(|&to| to != rank).filter_map(message).collect();

    // Take what is wanted
    link.send_all(&messages, || {
        let (Some(want), Some(wanted)) = (want[rank], wanted) else { return };
        for from in 0..link.size() {
            let Some(part) = shared(from, rank) else { continue };
            let place = part.within(&want);
            if let (true, Some(own), Some(have)) = (from == rank, own, have[rank]) {
                wanted.paste(&place, &own.crop(&part.within(&have)));
            } else {
                let bytes = link.receive(from, kind.row_bytes(&part) * part.height());
                wanted.paste(&place, &from_bytes(kind, &part, &bytes));
            }
        }
    });
}

fn to_bytes(kind: &StoreKind, store: &Store, part: &Rectangle) -> Vec<u8> {
    let cropped = store.crop(part);
    let row_bytes = kind.row_bytes(part);
    let mut bytes = vec![0; row_bytes * part.height()];
    bytes.par_chunks_mut(row_bytes.max(1)).zip(cropped.rows()).for_each(|(out, row)| row.to_bytes(out));
    bytes
}

fn from_bytes(kind: &StoreKind, part: &Rectangle, bytes: &[u8]) -> Store {
    let mut store = kind.empty(part);
    let rows = store.rows_mut().par_iter_mut().zip(bytes.par_chunks(kind.row_bytes(part).max(1)));
    rows.for_each(|(row, bytes)| row.read_bytes(bytes).expect("a store's own bytes are valid"));
    store
}
