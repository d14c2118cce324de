//! The exact sum of `f32` values, which depends neither on their order nor on how they are divided among threads or processes.
//!
//! Each exponent has an integer sum of its significands (after Kulisch 1971, with one accumulator for each exponent); the sums of
//! several parts add up as integers.

use rayon::prelude::*;

/// Exponents of `f32`.
pub const EXPONENTS: usize = 256;
/// Bits of the fraction.
const FRACTION: u32 = 23;
/// Exponent of the last bit of a value with the smallest exponent field.
const LOWEST: i32 = -149;

/// The sums of the significands of each exponent. At most 2³⁹ values can be added.
#[derive(Clone, Debug)]
pub struct ExactSum(pub [i64; EXPONENTS]);

impl ExactSum {
    /// Adds up a function of the values of some rows, which have to be finite.
    pub fn new<'a>(
        rows: impl ParallelIterator<Item = &'a [f32]>,
        function: impl Fn(f32) -> f32 + Sync + Send,
    ) -> Self {
        let add = |mut sum: Self, row: &[f32]| {
            row.iter().for_each(|&value| sum.add(function(value)));
            sum
        };
        let none = || Self([0; EXPONENTS]);
        rows.fold(none, add).reduce(none, Self::merge)
    }

    fn add(&mut self, value: f32) {
        let bits = value.to_bits();
        let exponent = (bits >> FRACTION & 0xff) as usize;
        let fraction = bits & ((1 << FRACTION) - 1);
        // All but the smallest numbers have a leading one that is not stored
        let significand = i64::from(fraction | u32::from(exponent > 0) << FRACTION);
        self.0[exponent] += if value.is_sign_negative() { -significand } else { significand };
    }

    /// Adds the sums of other values.
    pub fn merge(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(other.0).for_each(|(sum, other)| *sum += other);
        self
    }

    /// Returns the sum.
    pub fn value(&self) -> f64 {
        let scaled = |(exponent, &sum): (usize, &i64)| {
            sum as f64 * f64::from(exponent.max(1) as i32 - 1 + LOWEST).exp2()
        };
        self.0.iter().enumerate().map(scaled).sum()
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    #[test]
    fn sums_are_exact_in_any_order_and_any_parts() {
        let sum_of = |values: &[f32]| ExactSum::new(values.par_chunks(100), |v| v);
        let mut rng = rand_pcg::Pcg32::seed_from_u64(4);
        let scale = |i: usize| 2f32.powi((i % 90) as i32 - 60);
        let mut values: Vec<f32> = (0..50_000).map(|i| (rng.random::<f32>() - 0.4) * scale(i)).collect();
        values.extend([f32::MIN_POSITIVE / 2.0, -f32::MIN_POSITIVE, f32::MAX / 1e9, 0.0, -0.0]);
        let sum = sum_of(&values);
        let (first, second) = values.split_at(12_345);
        let parts = sum_of(second).merge(sum_of(first));
        assert_eq!(sum.0, parts.0);
        let expected: f64 = values.iter().map(|&v| f64::from(v)).sum();
        assert!((sum.value() / expected - 1.0).abs() < 1e-12, "{} {expected}", sum.value());
        assert_eq!(ExactSum::new([[1.5, -0.25, 3.0].as_slice()].into_par_iter(), f32::abs).value(), 4.75);
        assert_eq!(sum_of(&[f32::MIN_POSITIVE / 8.0]).value(), f64::from(f32::MIN_POSITIVE) / 8.0);
    }
}
