//! Chi-squared test of whether samples follow a density, for tests.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Returns the probability that counts differ from the expected counts at least as much as they do (Pearson).
pub fn p_value(counts: &[f64], expected: &[f64]) -> f64 {
    /// Cells are pooled until their expected count reaches this.
    const MIN_EXPECTED: f64 = 20.0;
    assert_eq!(counts.len(), expected.len());
    let (mut statistic, mut groups) = (0.0, 0);
    let mut close = |mean: f64, observed: f64| {
        statistic += (observed - mean).powi(2) / mean;
        groups += 1;
    };
    let (mut mean, mut observed) = (0.0, 0.0);
    for (count, expected) in counts.iter().zip(expected) {
        mean += expected;
        observed += count;
        if mean >= MIN_EXPECTED {
            close(mean, observed);
            (mean, observed) = (0.0, 0.0);
        }
    }
    // The cells left over are a group of their own, to catch samples where none are expected.
    if observed + mean > 0.0 {
        close(mean.max(1.0), observed);
    }
    ChiSquared::new(f64::from((groups - 1).max(1))).expect("positive").sf(statistic)
}

/// Returns the significance level of each of several tests with which all together fail wrongly once in 100
/// times.
pub fn significance(tests: usize) -> f64 {
    1.0 - 0.99f64.powf(1.0 / tests as f64)
}
