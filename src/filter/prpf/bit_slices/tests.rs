//! Mutual information against its definition.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;

/// Slices of samples, each variable in the order of its dimension, standardised by `standardisation`.
fn slices(samples: &[Vec<f32>], standardisation: &Standardisation) -> BitSlices {
    let order: Vec<usize> = (0..samples[0].len()).collect();
    let limits = BinLimits::new(standardisation);
    let mut slices = BitSlices::default();
    for samples in samples.chunks(BLOCK_SAMPLES) {
        let samples: Vec<&[f32]> = samples.iter().map(|sample| &sample[..]).collect();
        slices.push(&samples, &limits, &order);
    }
    slices.finish();
    slices
}

fn standardisation(mean: f32, deviation: f32) -> Standardisation {
    Standardisation { mean: [mean; MAX_VARIABLES], scale: [1.0 / deviation; MAX_VARIABLES] }
}

/// Samples of `variables` independent, roughly normal numbers with standard deviation 1.
pub(in crate::filter::prpf) fn normal(count: usize, variables: usize, seed: u64) -> Vec<Vec<f32>> {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut number = || (0..12).map(|_| rng.random::<f32>()).sum::<f32>() - 6.0;
    (0..count).map(|_| (0..variables).map(|_| number()).collect()).collect()
}

fn bin(z: f32) -> usize {
    (z + 2.5).floor().clamp(0.0, 4.0) as usize
}

/// The definition, Σ p(a, b) log₂ (p(a, b) ∕ (p(a) p(b))) over bins.
pub(in crate::filter::prpf) fn by_definition(samples: &[Vec<f32>], a: usize, b: usize) -> f64 {
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
fn every_pair_agrees_with_the_definition_at_any_count() {
    for count in [1, 31, 32, 33, 500, 1024] {
        let mut samples = normal(count, 27, 3);
        // Make two variables depend on others
        samples.iter_mut().for_each(|s| (s[20], s[3]) = (s[1] + 0.2 * s[20], s[4] * s[4]));
        let slices = slices(&samples, &standardisation(0.0, 1.0));
        for a in 0..27 {
            let information = slices.mutual_information(a, 27);
            for (b, &found) in information[..27].iter().enumerate() {
                let expected = by_definition(&samples, a, b);
                let found = f64::from(found);
                assert!((found - expected).abs() < 2e-5, "{count} {a} {b}: {found} for {expected}");
            }
        }
    }
}

#[test]
fn entropy_terms_agree_with_the_library_function() {
    assert_eq!(entropy_term(0), 0.0);
    for count in (1..5000).chain([1 << 20, (1 << 24) - 1]) {
        let c = f64::from(count);
        let off = f64::from(entropy_term(count)) / c - c.log2();
        assert!(off.abs() < 2e-7 * c.log2().max(1.0), "{count}: {off}");
    }
}

#[test]
fn information_of_identical_variables_is_their_entropy() {
    let mut samples = normal(1024, 2, 5);
    samples.iter_mut().for_each(|s| s[1] = s[0]);
    let mut p = [0.0; 5];
    samples.iter().for_each(|s| p[bin(s[0])] += 1.0 / 1024.0);
    let entropy: f32 = -p.iter().map(|p: &f32| p * p.log2()).sum::<f32>();
    let found = slices(&samples, &standardisation(0.0, 1.0)).mutual_information(0, 2)[1];
    assert!((found - entropy).abs() < 1e-5, "{found} for {entropy}");
}

#[test]
fn information_of_independent_variables_is_the_bias_of_the_estimate() {
    // Bias of the plug-in estimate: (5 − 1)² ∕ (2 N ln 2) bits.
    for count in [64, 256, 1024] {
        let mut found = Vec::new();
        for seed in 0..20 {
            let slices = slices(&normal(count, 8, seed), &standardisation(0.0, 1.0));
            (1..8).for_each(|b| found.push(slices.mutual_information(0, 8)[b]));
        }
        let mean = found.iter().sum::<f32>() / found.len() as f32;
        let bias = 16.0 / (2.0 * count as f32 * std::f32::consts::LN_2);
        // Five standard errors of a χ² distribution with 16 degrees of freedom
        let error = 5.0 * bias * (2.0 / 16.0 / found.len() as f32).sqrt();
        // The bias is smaller where bins are nearly empty.
        let missing = if count == 64 { 0.25 * bias } else { 0.1 * bias };
        assert!(mean < bias + error && mean > bias - error - missing, "{count}: {mean} for {bias}");
    }
}

#[test]
fn information_of_a_constant_is_exactly_zero() {
    let mut samples = normal(1024, 3, 5);
    samples.iter_mut().for_each(|s| s[1] = 0.3);
    let mut standardisation = standardisation(0.0, 1.0);
    standardisation.scale[2] = 0.0;
    let slices = slices(&samples, &standardisation);
    assert_eq!(slices.mutual_information(0, 3)[1..3], [0.0, 0.0]);
    assert_eq!(slices.mutual_information(1, 3)[..3], [0.0; 3]);
}

#[test]
fn information_is_invariant_to_scale_and_shift() {
    let mut samples = normal(700, 3, 9);
    samples.iter_mut().for_each(|s| s[1] += s[0]);
    let before = slices(&samples, &standardisation(0.0, 1.0)).mutual_information(0, 3);
    samples.iter_mut().flatten().for_each(|v| *v = *v * 0.125 + 64.0);
    let after = slices(&samples, &standardisation(64.0, 0.125)).mutual_information(0, 3);
    assert_eq!(before[1..3], after[1..3]);
}
