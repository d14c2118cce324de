//! A batch is rendered in steps, between which the loop can be looked at, steered and interrupted.
//!
//! After each step every pixel has about the same share of its batch. Shares below a whole sample are
//! spread over blocks of 4×4 pixels in the order of a Bayer matrix, so that the first sixteenth of
//! the first sample is already an image, a coarse one. What a pixel's statistics are in the end does
//! not depend on the steps, because its samples come in the order of their indices.

/// Rank of a pixel within its block of 4×4: 0 is rendered first, then the corners of blocks of 2×2.
const RANKS: [[u8; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];
/// Pixels of a block, and so steps that a single sample per pixel can be cut into.
pub(super) const BLOCK: u64 = 16;

/// A batch on its way.
pub(super) struct Steps<'a> {
    counts: &'a [u32],
    width: usize,
    /// Samples that a pixel gets at once: pairs, so that the halves grow alike; single ones while
    /// there is no image yet.
    unit: u32,
    total: u64,
    /// Share of the batch that is done, in [0, 1].
    share: f64,
}

impl<'a> Steps<'a> {
    /// `counts`: samples of the batch per pixel; `first`: there is no sample yet.
    pub fn new(counts: &'a [u32], width: usize, first: bool) -> Self {
        let total = counts.iter().map(|&n| u64::from(n)).sum();
        Self { counts, width: width.max(1), unit: if first { 1 } else { 2 }, total, share: 0.0 }
    }

    /// The next step of about `most` samples, per pixel; `None` when the batch is done.
    pub fn next(&mut self, most: u64) -> Option<Vec<u32>> {
        if self.share >= 1.0 || self.total == 0 {
            return None;
        }
        let before = self.share;
        self.share = (before + most.max(1) as f64 / self.total as f64).min(1.0);
        let step = |(i, &n)| self.given(i, n, self.share) - self.given(i, n, before);
        Some(self.counts.iter().enumerate().map(step).collect())
    }

    /// Samples of pixel `i` after a share of the batch.
    fn given(&self, i: usize, count: u32, share: f64) -> u32 {
        if share <= 0.0 || share >= 1.0 {
            return if share <= 0.0 { 0 } else { count };
        }
        let rank = RANKS[i / self.width % 4][i % self.width % 4];
        let ahead = (BLOCK as f64 - 0.5 - f64::from(rank)) / BLOCK as f64;
        let units = f64::from(count) * share / f64::from(self.unit) + ahead;
        (units as u32 * self.unit).min(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(counts: &[u32], width: usize, first: bool, most: u64) -> Vec<Vec<u32>> {
        let mut steps = Steps::new(counts, width, first);
        std::iter::from_fn(|| steps.next(most)).collect()
    }

    #[test]
    fn steps_add_up_to_the_batch_whatever_their_size() {
        let counts: Vec<u32> = (0..64).map(|i| i % 7).collect();
        for most in [1, 3, 16, 100, 10_000] {
            for first in [false, true] {
                let mut sum = vec![0; counts.len()];
                for step in all(&counts, 8, first, most) {
                    sum.iter_mut().zip(step).for_each(|(sum, n)| *sum += n);
                }
                assert_eq!(sum, counts, "{most}");
            }
        }
    }

    #[test]
    fn the_first_sixteenth_has_one_pixel_of_each_block() {
        let counts = vec![4; 8 * 8];
        let step = &all(&counts, 8, true, 4)[0];
        let expected: Vec<u32> = (0..64).map(|i| u32::from(i % 4 == 0 && i / 8 % 4 == 0)).collect();
        assert_eq!(*step, expected);
    }

    #[test]
    fn later_batches_come_in_pairs() {
        let steps = all(&[8; 16], 4, false, 10);
        assert!(steps.iter().flatten().all(|n| n % 2 == 0));
        let largest = steps.iter().map(|step| step.iter().sum::<u32>()).max();
        assert!(largest <= Some(12), "{largest:?}");
    }

    #[test]
    fn an_empty_batch_has_no_steps() {
        assert!(all(&[0; 4], 2, true, 10).is_empty() && all(&[], 0, true, 10).is_empty());
    }
}
