//! Chooses the samples in a pixel's bounded reservoir (algorithm R, Vitter 1985).

use crate::hash::hash;

/// The reservoir slot of the pixel's sample with this 0-based index, or `None` if it is discarded. The
/// random number is a hash of `key` and `index`, so the choice depends neither on batches nor on
/// threads.
#[inline]
pub(super) fn slot(key: u64, index: u32, capacity: usize) -> Option<usize> {
    let index = index as usize;
    if index < capacity {
        return Some(index);
    }
    if capacity == 0 {
        return None;
    }
    // Multiplying 32 random bits and shifting is uniform over 0..=index up to 2⁻³².
    let j = ((hash(key ^ (index as u64) << 1) >> 32) * (index as u64 + 1)) >> 32;
    ((j as usize) < capacity).then_some(j as usize)
}

/// Key of a pixel's reservoir.
#[inline]
pub(super) fn key(seed: u64, x: usize, y: usize) -> u64 {
    hash(seed ^ hash((y as u64) << 32 | x as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_pixels_or_seeds_share_a_key() {
        let mut keys: Vec<u64> =
            (0..4096).flat_map(|i| [1, 2].map(|seed| key(seed, i % 64, i / 64))).collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), 2 * 4096);
    }

    #[test]
    fn every_sample_is_chosen_with_equal_probability() {
        assert!((0..8).all(|i| slot(5, i, 8) == Some(i as usize)));
        assert_eq!(slot(5, 0, 0), None);
        for index in [8, 31, 99] {
            let mut slots = [0_u32; 8];
            for k in 0..40_000 {
                if let Some(slot) = slot(hash(k), index, 8) {
                    slots[slot] += 1;
                }
            }
            let expected = 40_000.0 / f64::from(index + 1);
            let chi2: f64 = slots.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
            // 8 degrees of freedom: 1 in 10⁵ exceed 37.
            assert!(chi2 < 37.0, "{index}: {chi2}");
        }
    }
}
