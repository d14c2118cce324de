//! Moves statistics between processes, from the rectangles that they have to the rectangles that they want.
//!
//! With what is wanted this is every exchange there is: new owners, margins, the whole image in one process.

use super::link::Link;
use crate::stats::{Layout, Rectangle, StatisticsExtent, Store};

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
        Store::for_rectangle(part, self.layout.clone(), self.capacity, self.seed)
    }

    /// Returns the bytes of the statistics of a rectangle.
    pub fn bytes(&self, part: &Rectangle, extent: StatisticsExtent) -> usize {
        Store::rectangle_byte_len(part, extent, &self.layout, self.capacity)
    }
}

/// Fills the rectangle that this process wants with the statistics of the processes that have them. All processes call it,
/// with the rectangles that each has, which do not overlap, and that each wants, if any. `own` has the statistics of this
/// process, and `wanted` the size of what it wants; what no process has, or `extent` lacks, stays as it is.
pub fn exchange(
    link: &Link,
    (kind, extent): (&StoreKind, StatisticsExtent),
    (have, own): (&[Option<Rectangle>], Option<&Store>),
    (want, wanted): (&[Option<Rectangle>], Option<&mut Store>),
) {
    let rank = link.rank();
    let shared = |from: usize, to: usize| have[from]?.intersection(&want[to]?);
    // Send what others want
    let message = |to: usize| {
        let (part, own) = (shared(rank, to)?, own?);
        Some((to, own.rectangle_to_bytes(&part.within(&have[rank]?), extent)))
    };
    let messages: Vec<_> = (0..link.size()).filter(|&to| to != rank).filter_map(message).collect();

    // Take what is wanted
    link.send_all(&messages, || {
        let (Some(want), Some(wanted)) = (want[rank], wanted) else { return };
        for from in 0..link.size() {
            let Some(part) = shared(from, rank) else { continue };
            let place = part.within(&want);
            if let (true, Some(own), Some(have)) = (from == rank, own, have[rank]) {
                wanted.copy_rectangle(&place, own, &part.within(&have), extent);
            } else {
                let bytes = link.receive(from, kind.bytes(&part, extent));
                wanted.read_rectangle(&place, extent, &bytes);
            }
        }
    });
}
