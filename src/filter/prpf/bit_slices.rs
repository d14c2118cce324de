//! Mutual information of many pairs of variables at once, by the plug-in estimate over histograms of 5×5 bins
//! (Cover and Thomas, *Elements of Information Theory*, chapter 2).
//!
//! Takes samples of up to [`MAX_VARIABLES`] variables and returns bits. The samples are stored bit-sliced:
//! for each variable and each of the four limits between bins, one bit per sample tells whether the sample
//! lies above the limit. Population counts of bitwise ands are the cumulative joint counts, and their
//! differences are the counts of the joint histogram.

use std::f32::consts::{FRAC_1_SQRT_2, LOG2_E};

use super::sample_vector::{MAX_VARIABLES, SampleVector};
use crate::filter::common::lanes::lanes;
use crate::simd::{LANES, Lanes, apply, multiversioned, multiversioned_popcount};

/// Samples per block, whose bits share a machine word.
pub const BLOCK_SAMPLES: usize = u32::BITS as usize;

/// Limits between bins, in standard deviations from the mean. Bins are one standard deviation wide, the outermost
/// are open.
const LIMITS: [f32; 4] = [-1.5, -0.5, 0.5, 1.5];
const BINS: usize = LIMITS.len() + 1;

/// Variables that are processed together.
const GROUP: usize = 8;

/// An integer for each limit of each variable of a group.
type Group = [[u32; LIMITS.len()]; GROUP];

/// An integer for each limit of each variable.
type Words = [Group; MAX_VARIABLES / GROUP];

/// Mean and scale that standardise each dimension of a sample vector.
#[derive(Clone, Copy, Debug)]
pub struct Standardisation {
    pub mean: SampleVector,
    /// One over the standard deviation; 0 makes a dimension constant.
    pub scale: SampleVector,
}

/// Limits between the bins of each dimension of a sample vector.
pub struct BinLimits([SampleVector; LIMITS.len()]);

impl BinLimits {
    pub fn new(Standardisation { mean, scale }: &Standardisation) -> Self {
        // A scale of 0 gives infinite limits.
        Self(LIMITS.map(|limit| std::array::from_fn(|dim| mean[dim] + limit / scale[dim])))
    }
}

/// Bit-sliced samples of up to [`MAX_VARIABLES`] variables.
#[derive(Clone, Debug)]
pub struct BitSlices {
    /// Bits of each block of [`BLOCK_SAMPLES`] samples.
    words: Vec<Words>,
    samples: u32,
    /// Numbers of set bits.
    totals: Words,
    /// Σ c log₂ c over the bins of each variable.
    entropies: SampleVector,
    /// Whether all samples fall into one bin of a variable.
    is_constant: [bool; MAX_VARIABLES],
}

impl Default for BitSlices {
    fn default() -> Self {
        Self {
            words: Vec::new(),
            samples: 0,
            totals: Words::default(),
            entropies: [0.0; MAX_VARIABLES],
            is_constant: [true; MAX_VARIABLES],
        }
    }
}

impl BitSlices {
    /// Removes all samples.
    pub fn clear(&mut self) {
        self.words.clear();
        self.samples = 0;
    }

    /// Adds a block of at most [`BLOCK_SAMPLES`] samples of equal length. Dimension `order[i]` of the samples becomes
    /// variable `i`.
    pub fn push(&mut self, samples: &[&[f32]], limits: &BinLimits, order: &[usize]) {
        let Some(len) = samples.first().map(|sample| sample.len().min(MAX_VARIABLES)) else { return };
        // The dimensions are those of two vectors, which may overlap.
        let second = len.saturating_sub(LANES);
        let bits = if len < LANES {
            let mut padded = [[0.0; LANES]; BLOCK_SAMPLES];
            padded.iter_mut().zip(samples).for_each(|(to, sample)| to[..len].copy_from_slice(sample));
            let padded: [&[f32]; BLOCK_SAMPLES] = std::array::from_fn(|i| &padded[i][..]);
            slice(&padded[..samples.len()], limits, second)
        } else {
            slice(samples, limits, second)
        };
        let mut words = Words::default();
        for (words, &dim) in words.as_flattened_mut().iter_mut().zip(order) {
            let (vector, lane) = if dim < LANES { (0, dim) } else { (1, dim - second) };
            *words = std::array::from_fn(|limit| bits[vector][limit][lane]);
        }
        self.words.push(words);
        self.samples += samples.len() as u32;
    }

    /// Computes what depends on single variables, after the last block.
    pub fn finish(&mut self) {
        self.totals = count_all(&self.words);
        for (group, totals) in self.totals.iter().enumerate() {
            let (entropies, is_constant) = marginals(self.samples, totals);
            self.entropies[group * GROUP..][..GROUP].copy_from_slice(&entropies);
            self.is_constant[group * GROUP..][..GROUP].copy_from_slice(&is_constant);
        }
    }

    /// Returns the mutual information of variable `a` with each of the first `variables`, in bits. It is never
    /// negative, and exactly 0 where all samples of one of the two fall into one bin. [`Self::finish`] has to be called
    /// before.
    pub fn mutual_information(&self, a: usize, variables: usize) -> SampleVector {
        let mut information = [0.0; MAX_VARIABLES];
        if self.is_constant[a] {
            return information;
        }
        for (group, bits) in information.chunks_mut(GROUP).enumerate().take(variables.div_ceil(GROUP)) {
            let own = &self.totals[a / GROUP][a % GROUP];
            let both = self.count_both(a, group);
            let joint = joint_entropies(self.samples, own, &self.totals[group], &both);
            let n = self.samples as f32;
            for (l, bits) in bits.iter_mut().enumerate() {
                let b = group * GROUP + l;
                if !self.is_constant[b] {
                    let entropies = joint[l] - (self.entropies[a] + self.entropies[b]);
                    *bits = (n.log2() + entropies / n).max(0.0);
                }
            }
        }
        information
    }

    /// Counts the samples in which variable `a` lies above each of its limits (first index) and each variable of
    /// a group above each of its own.
    fn count_both(&self, a: usize, group: usize) -> [Group; LIMITS.len()] {
        let own = &self.totals[a / GROUP][a % GROUP];
        // What lies above a limit lies above those before it: equally many samples are the same samples.
        let is_counted = |limit: usize| {
            own[limit] > 0 && own[limit] < self.samples && (limit == 0 || own[limit] < own[limit - 1])
        };
        let mut both = [Group::default(); LIMITS.len()];
        let mut counted = (0..LIMITS.len()).filter(|&limit| is_counted(limit));
        while let Some(limit) = counted.next() {
            let other = counted.next().unwrap_or(limit);
            [both[limit], both[other]] =
                count_masked(&self.words, [limit, other].map(|limit| (a, limit)), group);
        }
        for limit in 0..LIMITS.len() {
            if own[limit] == self.samples {
                both[limit] = self.totals[group];
            } else if limit > 0 && own[limit] == own[limit - 1] {
                both[limit] = both[limit - 1];
            }
        }
        both
    }
}

/// Returns, for two vectors of dimensions, from 0 and from `second` on, and for each limit, a word with a bit for each
/// sample.
#[apply(multiversioned!)]
fn slice(samples: &[&[f32]], limits: &BinLimits, second: usize) -> [[Lanes<u32>; LIMITS.len()]; 2] {
    let mut bits = [[[0; LANES]; LIMITS.len()]; 2];
    for (vector, start) in [0, second].into_iter().enumerate() {
        let limits: [Lanes; LIMITS.len()] = std::array::from_fn(|limit| *lanes(&limits.0[limit][start..]));
        // The compiler would keep an array of words in memory, four variables stay in registers.
        let [mut w0, mut w1, mut w2, mut w3] = [[0; LANES]; LIMITS.len()];
        for (i, sample) in samples.iter().enumerate() {
            let values = lanes(&sample[start..]);
            set_bits(&mut w0, values, &limits[0], 1 << i);
            set_bits(&mut w1, values, &limits[1], 1 << i);
            set_bits(&mut w2, values, &limits[2], 1 << i);
            set_bits(&mut w3, values, &limits[3], 1 << i);
        }
        bits[vector] = [w0, w1, w2, w3];
    }
    bits
}

/// Sets a bit in the words of those lanes whose values lie above a limit.
#[inline(always)]
fn set_bits(words: &mut Lanes<u32>, values: &Lanes, limits: &Lanes, bit: u32) {
    for l in 0..LANES {
        words[l] |= if values[l] >= limits[l] { bit } else { 0 };
    }
}

/// Returns the numbers of set bits.
#[apply(multiversioned_popcount!)]
fn count_all(words: &[Words]) -> Words {
    let mut totals = Words::default();
    for words in words {
        let totals = totals.as_flattened_mut().as_flattened_mut();
        for (total, word) in totals.iter_mut().zip(words.as_flattened().as_flattened()) {
            *total += word.count_ones();
        }
    }
    totals
}

/// Counts, for each of two pairs of a variable and a limit, the samples in which the variable lies above the limit and
/// each variable of a group above each of its own. (For one pair the compiler would gather words of several blocks.)
#[apply(multiversioned_popcount!)]
fn count_masked(words: &[Words], pairs: [(usize, usize); 2], group: usize) -> [Group; 2] {
    let mut counts = [Group::default(); 2];
    for words in words {
        let masks = pairs.map(|(a, limit)| words[a / GROUP][a % GROUP][limit]);
        let words = words[group].as_flattened();
        for (l, word) in words.iter().enumerate() {
            for (counts, mask) in counts.iter_mut().zip(masks) {
                counts.as_flattened_mut()[l] += (mask & word).count_ones();
            }
        }
    }
    counts
}

/// Returns Σ c log₂ c over the bins of each variable of a group, and whether one bin has all samples.
#[apply(multiversioned!)]
fn marginals(samples: u32, totals: &Group) -> ([f32; GROUP], [bool; GROUP]) {
    let above = cumulative(&[samples; GROUP], totals);
    let mut entropies = [0.0; GROUP];
    let mut is_constant = [false; GROUP];
    for bin in 0..BINS {
        for l in 0..GROUP {
            let count = above[bin][l] - above[bin + 1][l];
            entropies[l] += entropy_term(count);
            is_constant[l] |= count == samples;
        }
    }
    (entropies, is_constant)
}

/// Returns Σ c log₂ c over the joint histogram of a variable with each of a group. Of all `samples`, `own[i]` have the
/// variable above its limit i, `others[l][j]` variable l of the group above its limit j, and `both[i][l][j]` both.
#[apply(multiversioned!)]
fn joint_entropies(
    samples: u32,
    own: &[u32; LIMITS.len()],
    others: &Group,
    both: &[Group; LIMITS.len()],
) -> [f32; GROUP] {
    // Build the histogram without empty rows: most colours have no samples in the lowest bin
    let mut histogram = [[0; GROUP]; (BINS * BINS).next_multiple_of(LANES / GROUP)];
    let mut filled = 0;
    let mut row = cumulative(&[samples; GROUP], others);
    let mut row_count = samples;
    // No sample lies above the highest bin
    let rows = own.iter().zip(both).map(|(&own, both)| (own, cumulative(&[own; GROUP], both)));
    for (next_count, next) in rows.chain([(0, [[0; GROUP]; BINS + 1])]) {
        if next_count != row_count {
            for (j, bin) in histogram[filled..filled + BINS].iter_mut().enumerate() {
                for l in 0..GROUP {
                    bin[l] = (row[j][l] - row[j + 1][l]) - (next[j][l] - next[j + 1][l]);
                }
            }
            filled += BINS;
        }
        (row, row_count) = (next, next_count);
    }

    // Sum over its bins, as many at once as a vector holds
    let mut entropies = [0.0; LANES];
    let (vectors, _) = histogram.as_flattened().as_chunks::<LANES>();
    for counts in &vectors[..(filled * GROUP).div_ceil(LANES)] {
        for l in 0..LANES {
            entropies[l] += entropy_term(counts[l]);
        }
    }
    std::array::from_fn(|l| entropies[l] + entropies[GROUP + l])
}

/// Returns the numbers of samples at or above the lower limit of each bin, then 0. `all` are those of the lowest bin.
#[inline(always)]
fn cumulative(all: &[u32; GROUP], above: &Group) -> [[u32; GROUP]; BINS + 1] {
    let mut counts = [[0; GROUP]; BINS + 1];
    counts[0] = *all;
    for (limit, counts) in counts[1..BINS].iter_mut().enumerate() {
        for l in 0..GROUP {
            counts[l] = above[l][limit];
        }
    }
    counts
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
