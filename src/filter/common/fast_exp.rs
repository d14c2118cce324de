//! The exponential function of filter weights, as polynomials that compile to vector code.
//!
//! Both functions split exp(−x) = 2ⁿ·2ᶠ with an integer n and f in [−½, ½], evaluate 2ᶠ as a polynomial and
//! add n to the exponent bits. Neither converts to an integer, which would prevent vectorisation.

use super::lanes::multiply_add;

/// 1.5·2²³: adding it to a number leaves the nearest integer in the low bits of the mantissa.
const ROUND: f32 = 12_582_912.0;

/// Logarithm of the smallest result of [`exp_negative`]. Smaller weights would become denormal in products,
/// which are slow, and contribute nothing to a sum.
const MIN_POWER: f32 = -64.0;

/// exp(−x) for x ≥ 0, with a relative error below 10⁻⁴ and exact at 0; 2⁻⁶⁴ for x above 44.
#[inline(always)]
pub fn exp_negative(x: f32) -> f32 {
    let power = (x * -std::f32::consts::LOG2_E).max(MIN_POWER);
    let shifted = power + ROUND;
    let f = power - (shifted - ROUND);
    // Minimax polynomial of degree 4
    let p = 1.0 + f * (std::f32::consts::LN_2 + f * (0.240_226_5 + f * (0.055_504_1 + f * 0.009_618_1)));
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// exp(−x) for 0 ≤ x ≤ 80, with a relative error below 10⁻⁵ and exact at 0. Above, the result is unspecified.
#[inline(always)]
pub fn exp_negative_precise<const FMA: bool>(x: f32) -> f32 {
    const LN_2: f32 = std::f32::consts::LN_2;
    let power = x * -std::f32::consts::LOG2_E;
    let shifted = power + ROUND;
    let f = power - (shifted - ROUND);
    // Taylor polynomial of degree 5
    let p = multiply_add::<FMA>(f, LN_2.powi(5) / 120.0, LN_2.powi(4) / 24.0);
    let p = multiply_add::<FMA>(p, f, LN_2.powi(3) / 6.0);
    let p = multiply_add::<FMA>(p, f, LN_2 * LN_2 / 2.0);
    let p = multiply_add::<FMA>(p, f, LN_2);
    let p = multiply_add::<FMA>(p, f, 1.0);
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn relative_error(found: f32, x: f32) -> f64 {
        (f64::from(found) / (-f64::from(x)).exp() - 1.0).abs()
    }

    #[test]
    fn both_agree_with_the_library_function() {
        for x in (0..=4_000).map(|i| i as f32 * 0.01) {
            let error = relative_error(exp_negative(x), x);
            assert!(error < 1e-4, "exp(-{x}): relative error {error}");
            for found in [exp_negative_precise::<false>(x), exp_negative_precise::<true>(x)] {
                let error = relative_error(found, x);
                assert!(error < 1e-5, "exp(-{x}): relative error {error}");
            }
        }
    }

    #[test]
    fn zero_gives_exactly_one() {
        assert_eq!(exp_negative(0.0), 1.0);
        assert_eq!(exp_negative_precise::<false>(0.0), 1.0);
        assert_eq!(exp_negative_precise::<true>(0.0), 1.0);
    }

    #[test]
    fn large_arguments_give_a_positive_normal_number() {
        for x in [50.0, 1e6, 1e30, f32::INFINITY] {
            assert_eq!(exp_negative(x), 2f32.powi(-64));
        }
    }
}
