//! Mutual information of many pairs of variables at once (Cover and Thomas, *Elements of
//! Information Theory*, chapter 2), by the plug-in estimate over histograms of 5×5 bins.
//!
//! Bit-sliced: for each variable and each of the four limits between bins, one bit a sample tells
//! whether the sample lies above it. Cumulative joint counts are then the population counts of
//! bitwise ands, and differences of those are the counts of a histogram.

use multiversion::multiversion;

/// Variables at most.
pub(super) const LANES: usize = 32;

/// Samples whose bits share a machine word.
pub(super) const WORD: usize = u32::BITS as usize;

/// Limits between bins, in deviations from the mean: bins are one deviation wide, the outermost
/// open.
const LIMITS: [f32; 4] = [-1.5, -0.5, 0.5, 1.5];
const BINS: usize = LIMITS.len() + 1;

/// A value that is in no bin.
pub(super) const NO_SAMPLE: f32 = f32::NEG_INFINITY;

/// Variables handled together.
const GROUP: usize = 16;

/// Words of a group of variables: `[limit][variable]`.
const GROUP_WORDS: usize = LIMITS.len() * GROUP;

/// Words of all variables: `[group][limit][variable]`.
type Words = [u32; LIMITS.len() * LANES];

/// How to standardise each dimension.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standard {
    pub mean: [f32; LANES],
    /// One over the deviation; 0 for a dimension to be taken as constant.
    pub scale: [f32; LANES],
}

/// Samples of up to [`LANES`] variables, as bits.
#[derive(Clone, Debug)]
pub(super) struct BitSlices {
    /// For every [`WORD`] samples.
    words: Vec<Words>,
    /// Set bits.
    totals: Words,
    samples: usize,
    /// c·log₂ c by count.
    entropy_terms: Vec<f32>,
}

impl BitSlices {
    /// For at most `samples` samples.
    pub fn new(samples: usize) -> Self {
        // A power of two, so that masked counts need no bounds test.
        let len = (samples + WORD).next_power_of_two();
        let term = |c: usize| if c > 0 { c as f32 * (c as f32).log2() } else { 0.0 };
        let entropy_terms = (0..len).map(term).collect();
        Self { words: Vec::new(), totals: [0; LIMITS.len() * LANES], samples: 0, entropy_terms }
    }

    pub fn clear(&mut self) {
        self.words.clear();
        self.totals.fill(0);
        self.samples = 0;
    }

    /// Takes in `count` samples; the rest of the block must be [`NO_SAMPLE`]. Dimension `order[i]`
    /// of the samples becomes variable `i`.
    pub fn push(&mut self, block: &[[f32; LANES]; WORD], count: usize, standard: &Standard, order: &[usize]) {
        let bits = slice(block, standard);
        let mut words = [0; LIMITS.len() * LANES];
        for (variable, &dim) in order.iter().enumerate() {
            for (limit, bits) in bits.iter().enumerate() {
                words[place(variable, limit)] = bits[dim];
            }
        }
        count_bits(&[words], None, &mut self.totals);
        self.words.push(words);
        self.samples += count;
    }

    /// Mutual information, in bits, of variable `a` with each of the first `variables`. Never
    /// negative, exactly 0 where one of the two is in a single bin.
    pub fn information(&self, a: usize, variables: usize) -> [f32; LANES] {
        let groups = variables.div_ceil(GROUP);
        let mut above = [[0; LIMITS.len() * LANES]; BINS];
        above[0] = self.totals;
        for i in 1..BINS {
            count_bits(&self.words, Some(place(a, i - 1)), &mut above[i][..groups * GROUP_WORDS]);
        }
        let own = std::array::from_fn(|i| match i {
            0 => self.samples as u32,
            _ => self.totals[place(a, i - 1)],
        });
        let mut information = [0.0; LANES];
        for (group, bits) in information.chunks_mut(GROUP).enumerate().take(groups) {
            let above = above.each_ref().map(|above| &above[group * GROUP_WORDS..][..GROUP_WORDS]);
            bits.copy_from_slice(&group_information(&own, above, &self.entropy_terms));
        }
        information
    }
}

/// Where a variable's bits for a limit are among [`Words`].
fn place(variable: usize, limit: usize) -> usize {
    variable / GROUP * GROUP_WORDS + limit * GROUP + variable % GROUP
}

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

/// Adds up the bits that are set both in each of the first words and in the word at `mask`.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn count_bits(words: &[Words], mask: Option<usize>, counts: &mut [u32]) {
    for words in words {
        let mask = mask.map_or(u32::MAX, |mask| words[mask]);
        for (count, word) in counts.iter_mut().zip(words) {
            *count += (mask & word).count_ones();
        }
    }
}

/// Mutual information of `a` with a group of variables. `own[i]` samples have `a` above its limit
/// i, `counts[i]` those that also have a variable above each of its own; limit 0 is below all.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn group_information(own: &[u32; BINS], counts: [&[u32]; BINS], terms: &[f32]) -> [f32; GROUP] {
    let mask = terms.len() - 1;
    let term = |count: u32| terms[count as usize & mask];
    let samples = own[0];

    // Limit BINS is above all samples.
    let mut above = [[[0; GROUP]; BINS + 1]; BINS + 1];
    for i in 0..BINS {
        above[i][0] = [own[i]; GROUP];
        for j in 1..BINS {
            above[i][j].copy_from_slice(&counts[i][(j - 1) * GROUP..][..GROUP]);
        }
    }

    let mut joint = [0.0; GROUP];
    let mut marginal = [0.0; GROUP];
    let mut constant = [false; GROUP];
    for i in 0..BINS {
        for l in 0..GROUP {
            let in_a = above[i][0][l] - above[i + 1][0][l];
            let in_b = above[0][i][l] - above[0][i + 1][l];
            marginal[l] += term(in_a) + term(in_b);
            constant[l] |= in_a == samples || in_b == samples;
        }
        for j in 0..BINS {
            for l in 0..GROUP {
                let above_i = above[i][j][l] - above[i][j + 1][l];
                joint[l] += term(above_i - (above[i + 1][j][l] - above[i + 1][j + 1][l]));
            }
        }
    }
    let n = samples as f32;
    std::array::from_fn(|l| {
        let information = n.log2() + (joint[l] - marginal[l]) / n;
        if constant[l] { 0.0 } else { information.max(0.0) }
    })
}
