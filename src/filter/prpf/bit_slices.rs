//! Mutual information of many pairs of variables at once, by the plug-in estimate over histograms of 5×5 bins
//! (Cover and Thomas, *Elements of Information Theory*, chapter 2).
//!
//! Takes samples of up to [`MAX_VARIABLES`] variables and returns bits. The samples are stored bit-sliced:
//! for each variable and each of the four limits between bins, one bit per sample tells whether the sample
//! lies above the limit. Population counts of bitwise ands are the cumulative joint counts, and their
//! differences are the counts of the joint histogram.

use std::f32::consts::{FRAC_1_SQRT_2, LOG2_E};

use super::sample_vector::{MAX_VARIABLES, SampleVector};
use crate::simd::{apply, multiversioned, multiversioned_popcount};

/// Samples per block, whose bits share a machine word.
pub const BLOCK_SAMPLES: usize = u32::BITS as usize;

/// A block of samples.
pub type SampleBlock = [SampleVector; BLOCK_SAMPLES];

/// Limits between bins, in standard deviations from the mean. Bins are one standard deviation wide, the outermost
/// are open.
const LIMITS: [f32; 4] = [-1.5, -0.5, 0.5, 1.5];
const BINS: usize = LIMITS.len() + 1;

/// Value of unused samples of a block; it lies above no limit.
pub const NO_SAMPLE: f32 = f32::NEG_INFINITY;

/// Variables that are processed together.
const GROUP: usize = 16;

/// An integer for each limit and each variable of a group.
type Limits = [[u32; GROUP]; LIMITS.len()];

/// An integer for each limit and each variable.
type Words = [Limits; MAX_VARIABLES / GROUP];

/// Mean and scale that standardise each dimension of a sample vector.
#[derive(Clone, Copy, Debug)]
pub struct Standardisation {
    pub mean: SampleVector,
    /// One over the standard deviation; 0 makes a dimension constant.
    pub scale: SampleVector,
}

/// Bit-sliced samples of up to [`MAX_VARIABLES`] variables.
#[derive(Clone, Debug, Default)]
pub struct BitSlices {
    /// Bits of each block of [`BLOCK_SAMPLES`] samples.
    words: Vec<Words>,
    /// Numbers of set bits.
    totals: Words,
    samples: usize,
}

impl BitSlices {
    /// Removes all samples.
    pub fn clear(&mut self) {
        self.words.clear();
        self.totals = Words::default();
        self.samples = 0;
    }

    /// Adds a block of `count` samples; the rest of the block must be [`NO_SAMPLE`]. Dimension `order[i]` of the
    /// samples becomes variable `i`.
    pub fn push(
        &mut self,
        block: &SampleBlock,
        count: usize,
        standardisation: &Standardisation,
        order: &[usize],
    ) {
        let bits = slice(block, standardisation);
        let mut words = Words::default();
        for (variable, &dim) in order.iter().enumerate() {
            for (limit, bits) in bits.iter().enumerate() {
                words[variable / GROUP][limit][variable % GROUP] = bits[dim];
            }
        }
        count_all(&words, &mut self.totals);
        self.words.push(words);
        self.samples += count;
    }

    /// Returns the mutual information of variable `a` with each of the first `variables`, in bits. It is never
    /// negative, and exactly 0 where all samples of one of the two fall into one bin.
    pub fn mutual_information(&self, a: usize, variables: usize) -> SampleVector {
        let own = std::array::from_fn(|limit| self.totals[a / GROUP][limit][a % GROUP]);
        let mut information = [0.0; MAX_VARIABLES];
        for (group, bits) in information.chunks_mut(GROUP).enumerate().take(variables.div_ceil(GROUP)) {
            let both = count_both(&self.words, a, group);
            bits.copy_from_slice(&group_information(self.samples as u32, own, &self.totals[group], &both));
        }
        information
    }
}

/// Returns, for each limit and dimension, a word with a bit for each sample of a block.
#[apply(multiversioned!)]
fn slice(block: &SampleBlock, standardisation: &Standardisation) -> [[u32; MAX_VARIABLES]; LIMITS.len()] {
    let mut bits = [[0; MAX_VARIABLES]; LIMITS.len()];
    for sample in block {
        for l in 0..MAX_VARIABLES {
            let z = (sample[l] - standardisation.mean[l]) * standardisation.scale[l];
            for (limit, bits) in LIMITS.iter().zip(&mut bits) {
                bits[l] = bits[l] << 1 | u32::from(z >= *limit);
            }
        }
    }
    bits
}

/// Adds the numbers of set bits to the totals.
#[apply(multiversioned_popcount!)]
fn count_all(words: &Words, totals: &mut Words) {
    for (totals, words) in totals.iter_mut().zip(words) {
        for (total, word) in totals.as_flattened_mut().iter_mut().zip(words.as_flattened()) {
            *total += word.count_ones();
        }
    }
}

/// Counts the samples in which variable `a` lies above each of its limits (first index) and each variable of
/// a group above each of its own.
#[apply(multiversioned_popcount!)]
fn count_both(words: &[Words], a: usize, group: usize) -> [Limits; LIMITS.len()] {
    std::array::from_fn(|limit| {
        let mut counts = Limits::default();
        let flat = counts.as_flattened_mut();
        for words in words {
            let mask = words[a / GROUP][limit][a % GROUP];
            for (count, word) in flat.iter_mut().zip(words[group].as_flattened()) {
                *count += (mask & word).count_ones();
            }
        }
        counts
    })
}

/// Returns the mutual information of a variable with each of a group. Of all `samples`, `own[i]` have the
/// variable above its limit i, `others[j]` the other above its limit j, and `both[i][j]` both.
#[apply(multiversioned!)]
fn group_information(
    samples: u32,
    own: [u32; LIMITS.len()],
    others: &Limits,
    both: &[Limits; LIMITS.len()],
) -> [f32; GROUP] {
    // Build cumulative counts: here all samples lie above limit 0 and none above limit BINS
    let mut above = [[[0; GROUP]; BINS + 1]; BINS + 1];
    above[0][0] = [samples; GROUP];
    for i in 1..BINS {
        above[i][0] = [own[i - 1]; GROUP];
        above[0][i] = others[i - 1];
        above[i][1..BINS].copy_from_slice(&both[i - 1]);
    }

    // Sum c log c over the joint and the marginal histograms
    let mut joint = [0.0; GROUP];
    let mut marginal = [0.0; GROUP];
    let mut constant = [false; GROUP];
    for i in 0..BINS {
        for l in 0..GROUP {
            let in_a = above[i][0][l] - above[i + 1][0][l];
            let in_b = above[0][i][l] - above[0][i + 1][l];
            marginal[l] += entropy_term(in_a) + entropy_term(in_b);
            constant[l] |= in_a == samples || in_b == samples;
        }
        for j in 0..BINS {
            for l in 0..GROUP {
                let above_i = above[i][j][l] - above[i][j + 1][l];
                joint[l] += entropy_term(above_i - (above[i + 1][j][l] - above[i + 1][j + 1][l]));
            }
        }
    }

    // Combine the entropies
    let n = samples as f32;
    std::array::from_fn(|l| {
        let information = n.log2() + (joint[l] - marginal[l]) / n;
        if constant[l] { 0.0 } else { information.max(0.0) }
    })
}

/// Returns c log₂ c up to rounding, 0 for a count of 0. Counts must be below 2³¹.
#[inline(always)]
fn entropy_term(count: u32) -> f32 {
    const MANTISSA_BITS: u32 = f32::MANTISSA_DIGITS - 1;
    // AVX2 converts signed integers only.
    let c = count as i32 as f32;
    // Split c = m·2^power with m in [√½, √2), and compute log m by the series of artanh((m − 1) ∕ (m + 1)).
    let power = c.to_bits().wrapping_sub(FRAC_1_SQRT_2.to_bits()) as i32 >> MANTISSA_BITS;
    let m = f32::from_bits(c.to_bits().wrapping_sub((power << MANTISSA_BITS) as u32));
    let s = (m - 1.0) / (m + 1.0);
    let artanh = s * (1.0 + s * s * (1.0 / 3.0 + s * s * (1.0 / 5.0 + s * s * (1.0 / 7.0))));
    c * (power as f32 + 2.0 * LOG2_E * artanh)
}

#[cfg(test)]
pub(super) mod tests;
