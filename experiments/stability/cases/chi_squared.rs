//! Tests counts against expected counts by Pearson's χ², as a z-score.

/// Bound of z-scores. Over the two hundred tests of all sections, a correct program exceeds it once in seven hundred
/// runs.
pub const MAX_Z: f64 = 4.5;

/// z-score of Pearson's χ² of counts against expected counts.
pub fn chi_squared_z(counts: &[f64], expected: &[f64]) -> f64 {
    /// Cells are merged until their expected count reaches this.
    const MIN_EXPECTED: f64 = 20.0;
    let (mut statistic, mut groups) = (0.0, 0);
    let (mut observed, mut mean) = (0.0, 0.0);
    for (count, expected) in counts.iter().zip(expected) {
        observed += count;
        mean += expected;
        if mean >= MIN_EXPECTED {
            statistic += (observed - mean).powi(2) / mean;
            groups += 1;
            (observed, mean) = (0.0, 0.0);
        }
    }
    // The remaining cells form a group of their own, so that samples where none are expected count.
    if observed + mean > 0.0 {
        statistic += (observed - mean).powi(2) / mean.max(1.0);
        groups += 1;
    }
    z_score(statistic, groups - 1)
}

/// z-score of a χ² statistic with `freedom` degrees of freedom (Wilson and Hilferty 1931).
pub fn z_score(chi_squared: f64, freedom: i32) -> f64 {
    let freedom = f64::from(freedom.max(1));
    let spread = 2.0 / (9.0 * freedom);
    ((chi_squared / freedom).cbrt() - 1.0 + spread) / spread.sqrt()
}
