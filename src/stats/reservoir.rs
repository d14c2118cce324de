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
#[inline]
pub(super) fn hash(x: u64) -> u64 {
    let mut z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
