//! SplitMix64: hashes 64-bit keys to random numbers (Steele, Lea and Flood 2014).
//!
//! Random choices are hashes of what they belong to (a seed, a pixel, a sample's index), so they do not
//! depend on threads or on the order of work.

/// The increment of SplitMix64's state.
pub const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// One step of SplitMix64: the increment, then the finaliser.
#[inline(always)]
pub fn hash(x: u64) -> u64 {
    finalise(x.wrapping_add(GAMMA))
}

/// The finaliser of SplitMix64: a bijection that changes about half of the bits for any change of one.
#[inline(always)]
pub fn finalise(x: u64) -> u64 {
    let z = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_equals_the_published_generator() {
        assert_eq!(hash(0), 0xe220_a839_7b1d_cdaf);
        assert_eq!(hash(GAMMA), 0x6e78_9e6a_a1b9_65f4);
        assert_eq!(hash(GAMMA.wrapping_mul(2)), 0x06c4_5d18_8009_454f);
    }
}
