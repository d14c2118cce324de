//! Which samples a bounded reservoir keeps.

/// Slot for the sample with this index (0-based) in its pixel's stream, if it is kept: algorithm R
/// (Vitter 1985), its random number a hash of `key` and the index, so that the outcome depends
/// neither on batches nor on threads.
#[inline]
pub(super) fn slot(key: u64, index: u32, capacity: usize) -> Option<usize> {
    let index = index as usize;
    if index < capacity {
        return Some(index);
    }
    if capacity == 0 {
        return None;
    }
    // A multiply-shift of 32 random bits: uniform over 0..=index up to 2⁻³².
    let j = ((hash(key ^ (index as u64) << 1) >> 32) * (index as u64 + 1)) >> 32;
    ((j as usize) < capacity).then_some(j as usize)
}

/// Key of a pixel's stream.
#[inline]
pub(super) fn key(seed: u64, x: usize, y: usize) -> u64 {
    hash(seed ^ hash((y as u64) << 32 | x as u64))
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014).
#[inline(always)]
pub(crate) fn hash(x: u64) -> u64 {
    let mut z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_the_published_generator() {
        /// What SplitMix64 adds to its state, here 0 at first, before each number.
        const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;
        assert_eq!(hash(0), 0xe220_a839_7b1d_cdaf);
        assert_eq!(hash(GAMMA), 0x6e78_9e6a_a1b9_65f4);
        assert_eq!(hash(GAMMA.wrapping_mul(2)), 0x06c4_5d18_8009_454f);
    }

    #[test]
    fn no_two_pixels_or_seeds_share_a_key() {
        let mut keys: Vec<u64> =
            (0..4096).flat_map(|i| [1, 2].map(|seed| key(seed, i % 64, i / 64))).collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), 2 * 4096);
    }

    #[test]
    fn the_first_fill_the_reservoir_and_a_later_one_stays_with_the_chance_of_all() {
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
