//! Mutual information of many pairs of variables at once (Cover and Thomas, *Elements of
//! Information Theory*, chapter 2), by the plug-in estimate over histograms of 5×5 bins.
//!
//! Bit-sliced: for each variable and each of the four limits between bins, one bit a sample tells
//! whether the sample lies above it. Cumulative joint counts are then the population counts of
//! bitwise ands, and differences of those are the counts of a histogram.

use multiversion::multiversion;

/// Variables at most. One machine word holds the same 32 samples of each.
pub(super) const LANES: usize = 32;

/// Samples in a word.
pub(super) const WORD: usize = u32::BITS as usize;

/// Limits between bins, in deviations from the mean: bins are one deviation wide, the outermost
/// open.
const LIMITS: [f32; 4] = [-1.5, -0.5, 0.5, 1.5];

/// A value that is in no bin.
pub(super) const NO_SAMPLE: f32 = f32::NEG_INFINITY;

/// How to standardise each variable.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standard {
    pub mean: [f32; LANES],
    /// One over the deviation; 0 for a variable to be taken as constant.
    pub scale: [f32; LANES],
}

/// Samples of up to [`LANES`] variables, as bits: `[word][limit][variable]`.
#[derive(Clone, Debug, Default)]
pub(super) struct BitSlices {
    words: Vec<[[u32; LANES]; LIMITS.len()]>,
    samples: usize,
    /// c·log₂ c by count.
    entropy_terms: Vec<f32>,
}

impl BitSlices {
    /// For at most `samples` samples.
    pub fn new(samples: usize) -> Self {
        // A power of two, so that masked counts need no bounds test.
        let len = (samples + WORD).next_power_of_two();
        let entropy_terms =
            (0..len).map(|c| if c > 0 { c as f32 * (c as f32).log2() } else { 0.0 }).collect();
        Self { words: Vec::with_capacity(samples.div_ceil(WORD)), samples: 0, entropy_terms }
    }

    pub fn clear(&mut self) {
        self.words.clear();
        self.samples = 0;
    }

    /// Takes in `count` samples; the rest of the block must be [`NO_SAMPLE`].
    pub fn push(&mut self, block: &[[f32; LANES]; WORD], count: usize, standard: &Standard) {
        self.words.push(slice(block, standard));
        self.samples += count;
    }

    /// Puts variable `order[i]` at place `i`.
    pub fn reorder(&mut self, order: &[usize]) {
        for limits in &mut self.words {
            for word in limits {
                let old = *word;
                order.iter().zip(word).for_each(|(&from, to)| *to = old[from]);
            }
        }
    }

    /// Mutual information, in bits, of variable `a` with each of the first `variables`. Never
    /// negative, exactly 0 where one of the two is in a single bin.
    pub fn information(&self, a: usize, variables: usize) -> [f32; LANES] {
        let mut information = [0.0; LANES];
        for group in 0..variables.div_ceil(GROUP) {
            let bits = &mut information[group * GROUP..][..GROUP];
            bits.copy_from_slice(&group_information(self, a, group * GROUP));
        }
        information
    }
}

/// Variables handled together.
const GROUP: usize = 16;

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn slice(block: &[[f32; LANES]; WORD], standard: &Standard) -> [[u32; LANES]; LIMITS.len()] {
    let mut bits = [[0; LANES]; LIMITS.len()];
    for sample in block {
        for l in 0..LANES {
            let z = (sample[l] - standard.mean[l]) * standard.scale[l];
            for (limit, bits) in LIMITS.iter().zip(&mut bits) {
                bits[l] = bits[l] << 1 | u32::from(z >= *limit);
            }
        }
    }
    bits
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn group_information(slices: &BitSlices, a: usize, first: usize) -> [f32; GROUP] {
    const BINS: usize = LIMITS.len() + 1;
    let terms = &slices.entropy_terms[..];
    let mask = terms.len() - 1;
    let term = |count: u32| terms[count as usize & mask];

    // above[i][j]: samples with a above limit i and b above limit j; limit 0 is below, limit BINS
    // above all samples.
    let mut above = [[[0u32; GROUP]; BINS + 1]; BINS + 1];
    above[0][0] = [slices.samples as u32; GROUP];
    for word in &slices.words {
        for j in 1..BINS {
            let b: &[u32; GROUP] =
                word[j - 1][first..first + GROUP].try_into().expect("the slice has this length");
            for l in 0..GROUP {
                above[0][j][l] += b[l].count_ones();
            }
            for i in 1..BINS {
                let a = word[i - 1][a];
                for l in 0..GROUP {
                    above[i][j][l] += (a & b[l]).count_ones();
                }
            }
        }
        for i in 1..BINS {
            let count = word[i - 1][a].count_ones();
            above[i][0].iter_mut().for_each(|sum| *sum += count);
        }
    }

    let n = slices.samples as f32;
    let mut joint = [0.0; GROUP];
    let mut marginal = [0.0; GROUP];
    let mut constant = [false; GROUP];
    for i in 0..BINS {
        for l in 0..GROUP {
            let in_a = above[i][0][l] - above[i + 1][0][l];
            let in_b = above[0][i][l] - above[0][i + 1][l];
            marginal[l] += term(in_a) + term(in_b);
            constant[l] |= in_a == slices.samples as u32 || in_b == slices.samples as u32;
        }
        for j in 0..BINS {
            for l in 0..GROUP {
                let below = above[i + 1][j][l] - above[i + 1][j + 1][l];
                joint[l] += term(above[i][j][l] - above[i][j + 1][l] - below);
            }
        }
    }
    let mut bits = [0.0; GROUP];
    for l in 0..GROUP {
        let information = n.log2() + (joint[l] - marginal[l]) / n;
        bits[l] = if constant[l] { 0.0 } else { information.max(0.0) };
    }
    bits
}
