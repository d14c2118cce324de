//! Merges the statistics of two rows (moments after Chan, Golub and LeVeque 1983; reservoirs by
//! sampling without replacement).

use super::Row;
use crate::hash::hash;
use crate::stats::moments::Moments;
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
        for (h, half) in self.halves.iter_mut().enumerate() {
            let plane = h.min(self.deviations.len() - 1);
            let (m2s, other_m2s) = (&mut self.deviations[plane], &other.deviations[plane]);
            // A plane for both halves is added once.
            let is_added = plane == h;
            let other = &other.halves[h];
            for (dim, x) in (0..self.dims).flat_map(|dim| (0..self.width).map(move |x| (dim, x))) {
                let i = dim * self.stride + x;
                let a = Moments { count: half.count[x], mean: half.mean[i], m2: m2s[i] };
                let m2 = if is_added { other_m2s[i] } else { 0.0 };
                let b = Moments { count: other.count[x], mean: other.mean[i], m2 };
                let m = a.merge(b);
                (half.mean[i], m2s[i]) = (m.mean, m.m2);
            }
            for (a, b) in half.count.iter_mut().zip(&other.count) {
                *a = a.checked_add(*b).expect("a pixel has at most u32::MAX samples");
            }
        }
    }

    /// Adds the samples of every `side` pixels of a longer row to one pixel, without reservoirs.
    ///
    /// # Panics
    /// If a pixel would have more than `u32::MAX` samples.
    pub(crate) fn merge_groups(&mut self, other: &Self, side: usize) {
        let add = |a: &mut u32, b: u32| *a = a.checked_add(b).expect("a pixel has at most u32::MAX samples");
        // Pixels behind the last one have no samples.
        for x in (0..other.width).filter(|&x| other.next_index[x] > 0) {
            let to = x / side;
            add(&mut self.next_index[to], other.next_index[x]);
            add(&mut self.rejected[to], other.rejected[x]);
            for h in 0..self.halves.len() {
                let plane = h.min(self.deviations.len() - 1);
                for dim in 0..self.dims {
                    let (i, j) = (dim * self.stride + to, dim * other.stride + x);
                    let (half, other_half) = (&mut self.halves[h], &other.halves[h]);
                    let m2s = &mut self.deviations[plane];
                    // A plane for both halves is added once.
                    let m2 = if plane == h { other.deviations[plane][j] } else { 0.0 };
                    let a = Moments { count: half.count[to], mean: half.mean[i], m2: m2s[i] };
                    let m = a.merge(Moments { count: other_half.count[x], mean: other_half.mean[j], m2 });
                    (half.mean[i], m2s[i]) = (m.mean, m.m2);
                }
                self.halves[h].count[to] += other.halves[h].count[x];
            }
        }
    }

    /// Fills the reservoir by sampling without replacement from the union of both pixels' samples. Each
    /// vector in a reservoir represents an equal fraction of its pixel's samples.
    fn merge_reservoir(&mut self, x: usize, other: &Self) {
        let (mut left_a, mut left_b) =
            (u64::from(self.count(x, Part::Whole)), u64::from(other.count(x, Part::Whole)));
        let (a, b) = (self.reservoir(x).to_vec(), other.reservoir(x));
        let (mut a, mut b) = (a.chunks_exact(self.dims), b.chunks_exact(self.dims));
        let mut merged = Vec::with_capacity(self.capacity * self.dims);
        for slot in 0..self.capacity as u64 {
            let total = left_a + left_b;
            if total == 0 {
                break;
            }
            // Choose the source in proportion to the samples that are left in each.
            let from_a = hash(self.keys[x] ^ other.keys[x].rotate_left(1) ^ slot) % total < left_a;
            let vector = if from_a { a.next() } else { b.next() };
            let left = if from_a { &mut left_a } else { &mut left_b };
            *left -= 1;
            merged.extend_from_slice(vector.expect("a reservoir holds all samples, up to its capacity"));
        }
        self.reservoir[x * self.capacity * self.dims..][..merged.len()].copy_from_slice(&merged);
    }
}
