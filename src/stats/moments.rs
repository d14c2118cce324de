//! Mean and sum of squared deviations of one stream of numbers.

/// Welford's running moments (Welford 1962), merged as by Chan, Golub and LeVeque (1983).
///
/// In `f64`: a running mean in `f32` stops moving after some thousand samples where the deviation
/// is small beside the mean, and the deviation then comes out wrong by per cents.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    pub count: u32,
    pub mean: f64,
    /// Sum of squared deviations from the mean.
    pub m2: f64,
}

impl Moments {
    /// Takes in one number.
    #[inline]
    pub fn push(&mut self, value: f64) {
        self.count += 1;
        update(&mut self.mean, &mut self.m2, value, 1.0 / f64::from(self.count));
    }

    /// The moments of both streams together.
    #[inline]
    pub fn merge(self, other: Self) -> Self {
        let count = self.count + other.count;
        if self.count == 0 || other.count == 0 {
            return if self.count == 0 { other } else { self };
        }
        let (n_a, n_b, n) = (f64::from(self.count), f64::from(other.count), f64::from(count));
        let d = other.mean - self.mean;
        Self { count, mean: self.mean + d * (n_b / n), m2: self.m2 + other.m2 + d * d * (n_a * n_b / n) }
    }

    /// Unbiased variance of the samples; 0 for fewer than two.
    #[inline]
    pub fn variance(self) -> f64 {
        if self.count < 2 { 0.0 } else { self.m2 / f64::from(self.count - 1) }
    }
}

/// One Welford step; `weight` is 1/n with the new number counted.
#[inline(always)]
pub(super) fn update(mean: &mut f64, m2: &mut f64, value: f64, weight: f64) {
    let d = value - *mean;
    *mean += d * weight;
    *m2 += d * (value - *mean);
}
