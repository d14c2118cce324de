//! Mutual information of many pairs of variables at once (Cover and Thomas, *Elements of
//! Information Theory*, chapter 2), by the plug-in estimate over histograms of 5×5 bins.
//!
//! Bit-sliced: for each variable and each of the four limits between bins, one bit a sample tells
//! whether the sample lies above it. Cumulative joint counts are then the population counts of
//! bitwise ands, and differences of those are the counts of a histogram.

use std::f32::consts::{FRAC_1_SQRT_2, LOG2_E};

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

/// A number for each limit and variable of a group.
type Limits = [[u32; GROUP]; LIMITS.len()];

/// The same of all variables.
type Words = [Limits; LANES / GROUP];

/// How to standardise each dimension.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standard {
    pub mean: [f32; LANES],
    /// One over the deviation; 0 for a dimension to be taken as constant.
    pub scale: [f32; LANES],
}

/// Samples of up to [`LANES`] variables, as bits.
#[derive(Clone, Debug, Default)]
pub(super) struct BitSlices {
    /// For every [`WORD`] samples.
    words: Vec<Words>,
    /// Set bits.
    totals: Words,
    samples: usize,
}

impl BitSlices {
    pub fn clear(&mut self) {
        self.words.clear();
        self.totals = Words::default();
        self.samples = 0;
    }

    /// Takes in `count` samples; the rest of the block must be [`NO_SAMPLE`]. Dimension `order[i]`
    /// of the samples becomes variable `i`.
    pub fn push(&mut self, block: &[[f32; LANES]; WORD], count: usize, standard: &Standard, order: &[usize]) {
        let bits = slice(block, standard);
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

    /// Mutual information, in bits, of variable `a` with each of the first `variables`. Never
    /// negative, exactly 0 where one of the two is in a single bin.
    pub fn information(&self, a: usize, variables: usize) -> [f32; LANES] {
        let own = std::array::from_fn(|limit| self.totals[a / GROUP][limit][a % GROUP]);
        let mut information = [0.0; LANES];
        for (group, bits) in information.chunks_mut(GROUP).enumerate().take(variables.div_ceil(GROUP)) {
            let both = count_both(&self.words, a, group);
            bits.copy_from_slice(&group_information(self.samples as u32, own, &self.totals[group], &both));
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
    let mut slices = BitSlices::default();
    for (a, b) in a.chunks(WORD).zip(b.chunks(WORD)) {
        let mut block = [[NO_SAMPLE; LANES]; WORD];
        for ((sample, &a), &b) in block.iter_mut().zip(a).zip(b) {
            (sample[0], sample[1]) = (a, b);
        }
        slices.push(&block, a.len(), &standard, &[0, 1]);
    }
    slices.information(0, 2)[1]
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

/// Adds up the bits that are set in each of some words.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn count_all(words: &Words, totals: &mut Words) {
    for (totals, words) in totals.iter_mut().zip(words) {
        for (total, word) in totals.as_flattened_mut().iter_mut().zip(words.as_flattened()) {
            *total += word.count_ones();
        }
    }
}

/// How many samples have variable `a` above each of its limits (first index) and each variable of a group above
/// each of its own.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
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

/// Mutual information of `a` with a group of variables: of all `samples`, `own[i]` have `a` above its limit i,
/// `others[j]` a variable above its limit j, `both[i][j]` both.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn group_information(
    samples: u32,
    own: [u32; LIMITS.len()],
    others: &Limits,
    both: &[Limits; LIMITS.len()],
) -> [f32; GROUP] {
    // All samples are above limit 0 here, none above limit BINS.
    let mut above = [[[0; GROUP]; BINS + 1]; BINS + 1];
    above[0][0] = [samples; GROUP];
    for i in 1..BINS {
        above[i][0] = [own[i - 1]; GROUP];
        above[0][i] = others[i - 1];
        above[i][1..BINS].copy_from_slice(&both[i - 1]);
    }

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
    let n = samples as f32;
    std::array::from_fn(|l| {
        let information = n.log2() + (joint[l] - marginal[l]) / n;
        if constant[l] { 0.0 } else { information.max(0.0) }
    })
}

/// c·log₂ c up to rounding, 0 for a count of 0; counts below 2³¹.
#[inline(always)]
fn entropy_term(count: u32) -> f32 {
    const MANTISSA_BITS: u32 = f32::MANTISSA_DIGITS - 1;
    // Signed: AVX2 has no other conversion.
    let c = count as i32 as f32;
    // c = m 2^power with m from √½ to √2; log m by the series of artanh((m − 1) ∕ (m + 1)).
    let power = c.to_bits().wrapping_sub(FRAC_1_SQRT_2.to_bits()) as i32 >> MANTISSA_BITS;
    let m = f32::from_bits(c.to_bits().wrapping_sub((power << MANTISSA_BITS) as u32));
    let s = (m - 1.0) / (m + 1.0);
    let artanh = s * (1.0 + s * s * (1.0 / 3.0 + s * s * (1.0 / 5.0 + s * s * (1.0 / 7.0))));
    c * (power as f32 + 2.0 * LOG2_E * artanh)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;

    /// Slices of samples, each variable in the order of its dimension, standardised by `standard`.
    fn slices(samples: &[Vec<f32>], standard: &Standard) -> BitSlices {
        let order: Vec<usize> = (0..samples[0].len()).collect();
        let mut slices = BitSlices::default();
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
    fn terms_of_entropies_agree_with_the_library_function() {
        assert_eq!(entropy_term(0), 0.0);
        for count in (1..5000).chain([1 << 20, (1 << 24) - 1]) {
            let c = f64::from(count);
            let off = f64::from(entropy_term(count)) / c - c.log2();
            assert!(off.abs() < 2e-7 * c.log2().max(1.0), "{count}: {off}");
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
