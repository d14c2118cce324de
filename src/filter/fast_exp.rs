//! The exponential function for weights: a polynomial that the compiler turns into vector code.

/// Smallest weight that [`exp_negative`] returns: 2⁻⁶⁴. Smaller ones would become denormals in
/// products, which are slow, and add nothing to a sum.
const LOWEST_POWER: f32 = -64.0;

/// exp(−x) for x ≥ 0, with a relative error below 10⁻⁴; 2⁻⁶⁴ from x ≈ 44 on.
#[inline(always)]
pub(super) fn exp_negative(x: f32) -> f32 {
    // 1.5·2²³: adding it leaves the nearest integer in the low bits of the mantissa.
    const ROUND: f32 = 12_582_912.0;
    let power = (x * -std::f32::consts::LOG2_E).max(LOWEST_POWER);
    let shifted = power + ROUND;
    let f = power - (shifted - ROUND);
    // 2^f on [-½, ½]: minimax polynomial of degree 4.
    let p = 1.0 + f * (std::f32::consts::LN_2 + f * (0.240_226_5 + f * (0.055_504_1 + f * 0.009_618_1)));
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_library_function() {
        for i in 0..4_000 {
            let x = i as f32 * 0.01;
            let exact = f64::from(-x).exp();
            let relative = (f64::from(exp_negative(x)) - exact) / exact;
            assert!(relative.abs() < 1e-4, "exp(-{x}): relative error {relative}");
        }
    }

    #[test]
    fn zero_gives_exactly_one_and_huge_values_stay_positive_and_normal() {
        assert_eq!(exp_negative(0.0), 1.0);
        for x in [50.0, 1e6, 1e30, f32::INFINITY] {
            assert_eq!(exp_negative(x), 2f32.powi(-64));
        }
    }
}
