//! Mutual information of two variables, as the filter estimates it.

use super::bit_slices::{BLOCK_SAMPLES, BinLimits, BitSlices, Standardisation};
use super::sample_vector::MAX_VARIABLES;
use crate::stats::Moments;

/// Returns the mutual information of two variables in bits, by the plug-in estimate over 5×5 bins, one
/// standard deviation wide around each variable's mean. It is never negative, and exactly 0 where a variable
/// is constant. Its bias is about 11.5 bits over the number of samples.
///
/// # Panics
/// If the numbers of samples differ.
pub fn mutual_information(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len(), "samples of both variables");
    let mut standardisation = Standardisation { mean: [0.0; MAX_VARIABLES], scale: [0.0; MAX_VARIABLES] };
    for (variable, values) in [a, b].into_iter().enumerate() {
        let mut moments = Moments::default();
        values.iter().for_each(|&v| moments.push(f64::from(v)));
        standardisation.mean[variable] = moments.mean as f32;
        let deviation = (moments.m2 / f64::from(moments.count.max(1))).sqrt();
        standardisation.scale[variable] = if deviation > 0.0 { deviation.recip() as f32 } else { 0.0 };
    }
    let limits = BinLimits::new(&standardisation);
    let pairs: Vec<[f32; 2]> = a.iter().zip(b).map(|(&a, &b)| [a, b]).collect();
    let samples: Vec<&[f32]> = pairs.iter().map(|pair| &pair[..]).collect();
    let mut slices = BitSlices::default();
    samples.chunks(BLOCK_SAMPLES).for_each(|samples| slices.push(samples, &limits, &[0, 1]));
    slices.finish();
    slices.mutual_information(0, 2)[1]
}

#[cfg(test)]
mod tests {
    use super::super::bit_slices::tests::{by_definition, normal};
    use super::*;

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
}
