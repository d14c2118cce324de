//! Computes mean and variance of a sequence of numbers, one at a time (Welford 1962).

/// Welford's running moments. Merging follows Chan, Golub and LeVeque (1983).
///
/// Values are `f64`: where the deviation is small compared with the mean, a running mean in `f32` stops
/// changing after some thousand samples, and the deviation is wrong by some per cent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    pub count: u32,
    pub mean: f64,
    /// Sum of squared deviations from the mean.
    pub m2: f64,
}

impl Moments {
    /// Adds one number.
    #[inline]
    pub fn push(&mut self, value: f64) {
        self.count += 1;
        update(&mut self.mean, &mut self.m2, value, 1.0 / f64::from(self.count));
    }

    /// The moments of both sequences together.
    #[inline]
    pub fn merge(self, other: Self) -> Self {
        let count = self.count + other.count;
        // Without a branch, so that loops over pixels become vector code: an empty sequence adds exactly 0.
        let (n_a, n_b, n) = (f64::from(self.count), f64::from(other.count), f64::from(count.max(1)));
        let d = other.mean - self.mean;
        Self { count, mean: self.mean + d * (n_b / n), m2: self.m2 + other.m2 + d * d * (n_a * n_b / n) }
    }

    /// Unbiased variance of the samples; 0 for fewer than two.
    #[inline]
    pub fn variance(self) -> f64 {
        if self.count < 2 { 0.0 } else { self.m2 / f64::from(self.count - 1) }
    }
}

/// Rounds a sum of squared deviations to `f32`, up or down at random such that it is right on average: rounded to the nearest, small
/// steps of a large sum would be lost. The lowest bits of the mean are the random number. After ten million steps the error is
/// half the standard error of the variance of so many samples.
#[inline(always)]
pub(super) fn round_deviations(m2: f64, mean: f64) -> f32 {
    /// The bits of an `f64` beyond the precision of `f32`.
    const LOW: u64 = (1 << 29) - 1;
    let m2 = m2.min(f64::from(f32::MAX));
    f64::from_bits((m2.to_bits() + (mean.to_bits() & LOW)) & !LOW) as f32
}

/// One Welford step; `weight` is 1/n, where n counts the new number.
#[inline(always)]
pub(super) fn update(mean: &mut f64, m2: &mut f64, value: f64, weight: f64) {
    let d = value - *mean;
    *mean += d * weight;
    *m2 += d * (value - *mean);
}
