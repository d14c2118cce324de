//! Mutual information of many pairs of variables at once (Cover and Thomas, *Elements of
//! Information Theory*, chapter 2), by the plug-in estimate over histograms of 5×5 bins.
//!
//! Bit-sliced: for each variable and each of the four limits between bins, one bit a sample tells
//! whether the sample lies above it. Cumulative joint counts are then the population counts of
//! bitwise ands, and differences of those are the counts of a histogram.

use multiversion::multiversion;

use crate::stats::Moments;

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
        for (limit, above) in above[1..].iter_mut().enumerate() {
            count_bits(&self.words, Some(place(a, limit)), &mut above[..groups * GROUP_WORDS]);
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

/// Mutual information of two variables, in bits, as the filter measures it: by the plug-in estimate over
/// 5×5 bins, one deviation wide around each variable's mean. Never negative, exactly 0 where one of the two
/// is constant; too high by about 11.5 bits over the number of samples.
///
/// # Panics
/// If one has more samples than the other.
pub fn mutual_information(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len(), "samples of both variables");
    let mut standard = Standard { mean: [0.0; LANES], scale: [0.0; LANES] };
    for (variable, values) in [a, b].into_iter().enumerate() {
        let mut moments = Moments::default();
        values.iter().for_each(|&v| moments.push(f64::from(v)));
        standard.mean[variable] = moments.mean as f32;
        let deviation = (moments.m2 / f64::from(moments.count.max(1))).sqrt();
        standard.scale[variable] = if deviation > 0.0 { deviation.recip() as f32 } else { 0.0 };
    }
    let mut slices = BitSlices::new(a.len());
    for (a, b) in a.chunks(WORD).zip(b.chunks(WORD)) {
        let mut block = [[NO_SAMPLE; LANES]; WORD];
        for ((sample, &a), &b) in block.iter_mut().zip(a).zip(b) {
            (sample[0], sample[1]) = (a, b);
        }
        slices.push(&block, a.len(), &standard, &[0, 1]);
    }
    slices.information(0, 2)[1]
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

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;

    /// Slices of samples, each variable in the order of its dimension, standardised by `standard`.
    fn slices(samples: &[Vec<f32>], standard: &Standard) -> BitSlices {
        let order: Vec<usize> = (0..samples[0].len()).collect();
        let mut slices = BitSlices::new(samples.len());
        for samples in samples.chunks(WORD) {
            let mut block = [[NO_SAMPLE; LANES]; WORD];
            for (to, sample) in block.iter_mut().zip(samples) {
                to[..sample.len()].copy_from_slice(sample);
            }
            slices.push(&block, samples.len(), standard, &order);
        }
        slices
    }

    fn standard(mean: f32, deviation: f32) -> Standard {
        Standard { mean: [mean; LANES], scale: [1.0 / deviation; LANES] }
    }

    /// Samples of `variables` independent numbers, roughly normal with deviation 1.
    fn normal(count: usize, variables: usize, seed: u64) -> Vec<Vec<f32>> {
        let mut rng = Pcg32::seed_from_u64(seed);
        let mut number = || (0..12).map(|_| rng.random::<f32>()).sum::<f32>() - 6.0;
        (0..count).map(|_| (0..variables).map(|_| number()).collect()).collect()
    }

    fn bin(z: f32) -> usize {
        (z + 2.5).floor().clamp(0.0, 4.0) as usize
    }

    /// The definition: Σ p(a, b) log₂ (p(a, b) ∕ (p(a) p(b))) over bins.
    fn by_definition(samples: &[Vec<f32>], a: usize, b: usize) -> f64 {
        let mut joint = [[0.0; 5]; 5];
        for sample in samples {
            joint[bin(sample[a])][bin(sample[b])] += 1.0 / samples.len() as f64;
        }
        let mut information = 0.0;
        for i in 0..5 {
            for j in 0..5 {
                let p: f64 = joint[i][j];
                let in_a: f64 = joint[i].iter().sum();
                let in_b: f64 = joint.iter().map(|row| row[j]).sum();
                if p > 0.0 {
                    information += p * (p / (in_a * in_b)).log2();
                }
            }
        }
        information
    }

    #[test]
    fn bit_slices_agree_with_the_definition_for_every_pair_and_any_count() {
        for count in [1, 31, 32, 33, 500, 1024] {
            let mut samples = normal(count, 27, 3);
            // Some dependence.
            samples.iter_mut().for_each(|s| (s[20], s[3]) = (s[1] + 0.2 * s[20], s[4] * s[4]));
            let slices = slices(&samples, &standard(0.0, 1.0));
            for a in 0..27 {
                let information = slices.information(a, 27);
                for (b, &found) in information[..27].iter().enumerate() {
                    let expected = by_definition(&samples, a, b);
                    let found = f64::from(found);
                    assert!((found - expected).abs() < 2e-5, "{count} {a} {b}: {found} for {expected}");
                }
            }
        }
    }

    #[test]
    fn variables_are_standardised_by_their_own_mean_and_deviation() {
        let mut samples = normal(300, 2, 4);
        samples.iter_mut().for_each(|s| *s = vec![7.0 + 3.0 * s[0], 0.1 * (s[0] + s[1]) - 2.0]);
        let variable = |v: usize| samples.iter().map(|s| s[v]).collect::<Vec<_>>();
        let found = mutual_information(&variable(0), &variable(1));
        let standardised = |values: Vec<f32>| {
            let count = values.len() as f32;
            let mean = values.iter().sum::<f32>() / count;
            let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / count).sqrt();
            values.into_iter().map(move |v| (v - mean) / deviation)
        };
        let both: Vec<Vec<f32>> =
            standardised(variable(0)).zip(standardised(variable(1))).map(|(a, b)| vec![a, b]).collect();
        let expected = by_definition(&both, 0, 1);
        assert!((f64::from(found) - expected).abs() < 1e-4 && found > 0.1, "{found} for {expected}");
    }

    #[test]
    fn identical_variables_share_their_entropy() {
        let mut samples = normal(1024, 2, 5);
        samples.iter_mut().for_each(|s| s[1] = s[0]);
        let mut p = [0.0; 5];
        samples.iter().for_each(|s| p[bin(s[0])] += 1.0 / 1024.0);
        let entropy: f32 = -p.iter().map(|p: &f32| p * p.log2()).sum::<f32>();
        let found = slices(&samples, &standard(0.0, 1.0)).information(0, 2)[1];
        assert!((found - entropy).abs() < 1e-5, "{found} for {entropy}");
    }

    #[test]
    fn independent_variables_share_nothing_beyond_the_estimates_known_bias() {
        // Of a plug-in estimate: (5 − 1)² ∕ (2 N ln 2) bits.
        for count in [64, 256, 1024] {
            let mut found = Vec::new();
            for seed in 0..20 {
                let slices = slices(&normal(count, 8, seed), &standard(0.0, 1.0));
                (1..8).for_each(|b| found.push(slices.information(0, 8)[b]));
            }
            let mean = found.iter().sum::<f32>() / found.len() as f32;
            let bias = 16.0 / (2.0 * count as f32 * std::f32::consts::LN_2);
            // Five standard errors: the estimate is about χ² of 16 degrees of freedom.
            let error = 5.0 * bias * (2.0 / 16.0 / found.len() as f32).sqrt();
            // Where bins are nearly empty, the bias is a little less.
            let missing = if count == 64 { 0.25 * bias } else { 0.1 * bias };
            assert!(mean < bias + error && mean > bias - error - missing, "{count}: {mean} for {bias}");
        }
    }

    #[test]
    fn a_constant_shares_exactly_nothing() {
        let mut samples = normal(1024, 3, 5);
        samples.iter_mut().for_each(|s| s[1] = 0.3);
        let mut standard = standard(0.0, 1.0);
        standard.scale[2] = 0.0;
        let slices = slices(&samples, &standard);
        assert_eq!(slices.information(0, 3)[1..3], [0.0, 0.0]);
        assert_eq!(slices.information(1, 3)[..3], [0.0; 3]);
    }

    #[test]
    fn scale_and_shift_do_not_matter() {
        let mut samples = normal(700, 3, 9);
        samples.iter_mut().for_each(|s| s[1] += s[0]);
        let before = slices(&samples, &standard(0.0, 1.0)).information(0, 3);
        samples.iter_mut().flatten().for_each(|v| *v = *v * 0.125 + 64.0);
        let after = slices(&samples, &standard(64.0, 0.125)).information(0, 3);
        assert_eq!(before[1..3], after[1..3]);
    }
}
