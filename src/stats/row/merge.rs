//! Merges the statistics of two rows (moments after Chan, Golub and LeVeque 1983; reservoirs by
//! sampling without replacement).

use super::Row;
use crate::hash::hash;
use crate::stats::part::Part;

impl Row {
    /// Adds the samples of the same row of another store.
    ///
    /// # Panics
    /// If a pixel would have more than `u32::MAX` samples.
    pub(in crate::stats) fn merge(&mut self, other: &Self) {
        for x in 0..self.width {
            self.merge_reservoir(x, other);
            self.next_index[x] = self.next_index[x].saturating_add(other.next_index[x]);
            self.rejected[x] = self.rejected[x].saturating_add(other.rejected[x]);
        }
        for (half, other) in self.halves.iter_mut().zip(&other.halves) {
            for (dim, x) in (0..self.dims).flat_map(|dim| (0..self.width).map(move |x| (dim, x))) {
                let i = dim * self.stride + x;
                half.set(i, half.moments(x, i).merge(other.moments(x, i)));
            }
            for (a, b) in half.count.iter_mut().zip(&other.count) {
                *a = a.checked_add(*b).expect("a pixel has at most u32::MAX samples");
            }
        }
    }

    /// Adds the samples of every `side` pixels of a longer row to one pixel, without reservoirs. A pixel's halves change places where
    /// that evens the halves of the sum: first samples are all of the first half.
    pub(crate) fn merge_groups(&mut self, other: &Self, side: usize) {
        // A count beyond all renders may be in a file
        let add = |a: &mut u32, b: u32| *a = a.saturating_add(b);
        // Pixels behind the last one have no samples.
        for x in (0..other.width).filter(|&x| other.next_index[x] > 0) {
            let to = x / side;
            add(&mut self.next_index[to], other.next_index[x]);
            add(&mut self.rejected[to], other.rejected[x]);
            let is_uneven = self.halves[0].count[to] > self.halves[1].count[to];
            let is_exchanged = usize::from(is_uneven && other.halves[0].count[x] > other.halves[1].count[x]);
            for (h, half) in self.halves.iter_mut().enumerate() {
                let other_half = &other.halves[h ^ is_exchanged];
                for dim in 0..self.dims {
                    let (i, j) = (dim * self.stride + to, dim * other.stride + x);
                    half.set(i, half.moments(to, i).merge(other_half.moments(x, j)));
                }
                add(&mut half.count[to], other_half.count[x]);
            }
        }
    }

    /// Fills the reservoir by sampling without replacement from the union of both pixels' samples. Each
    /// vector in a reservoir represents an equal fraction of its pixel's samples.
    fn merge_reservoir(&mut self, x: usize, other: &Self) {
        if self.capacity == 0 {
            return;
        }
        let (mut left_a, mut left_b) =
            (u64::from(self.count(x, Part::Whole)), u64::from(other.count(x, Part::Whole)));
        // With the count, several stores of one seed are merged by different random numbers.
        let key = hash(hash(self.keys[x] ^ other.keys[x].rotate_left(1)) ^ (left_a + left_b));
        let (a, b) = (self.reservoir(x).to_vec(), other.reservoir(x));
        let mut a: Vec<&[f32]> = a.chunks_exact(self.dims).collect();
        let mut b: Vec<&[f32]> = b.chunks_exact(self.dims).collect();
        let mut merged = Vec::with_capacity(self.capacity * self.dims);
        for slot in 0..self.capacity as u64 {
            let total = left_a + left_b;
            if total == 0 {
                break;
            }
            // Choose the source in proportion to the samples that are left in each, and any of its vectors: the first ones are
            // more often early samples.
            let is_from_a = hash(key ^ (2 * slot)) % total < left_a;
            let (vectors, left) = if is_from_a { (&mut a, &mut left_a) } else { (&mut b, &mut left_b) };
            let chosen = hash(key ^ (2 * slot + 1)) % vectors.len() as u64;
            merged.extend_from_slice(vectors.swap_remove(chosen as usize));
            *left -= 1;
        }
        self.reservoir[x * self.capacity * self.dims..][..merged.len()].copy_from_slice(&merged);
    }
}
