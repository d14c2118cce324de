//! Widths and instruction sets of vector code: the number of lanes that loops work on, the instruction
//! sets that hot functions are compiled for, and the choice between them at run time.
//!
//! Vector code is written as plain loops over arrays of [`LANES`] values, which the compiler turns into
//! vector instructions. `multiversioned!` compiles a function once for AVX-512, once for AVX2 and once for
//! the target's baseline; the first call detects the processor's features and selects a version. The
//! compiler neither fuses nor reorders floating-point operations, so all versions give the same bits, except
//! where a function asks for fused multiply-add (`match_target!`).
//!
//! A closure has the instruction sets of the function around it. A generic function that it is passed to, such as `map` of an array or
//! `fold`, has those of the baseline, so that each element may cost a call. Innermost loops are plain loops.

mod lanes;
mod prefetch;

pub use lanes::{ALL_LANES, LANES, Lanes, Lanes3, group_lanes, lane_mask, lanes_in};
pub(crate) use macro_rules_attribute::apply;
pub(crate) use prefetch::prefetch;

/// Compiles a function for each supported instruction set and selects the version at run time. Use as
/// `#[apply(multiversioned!)]`.
macro_rules! multiversioned {
    ($($function:tt)*) => {
        #[multiversion::multiversion(targets(
            "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
            "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
        ))]
        $($function)*
    };
}

/// [`multiversioned`], where the AVX-512 version counts bits with a vector instruction (VPOPCNTDQ).
macro_rules! multiversioned_popcount {
    ($($function:tt)*) => {
        #[multiversion::multiversion(targets(
            "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
            "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
        ))]
        $($function)*
    };
}

pub(crate) use multiversioned;
pub(crate) use multiversioned_popcount;

/// Returns whether the processor has AVX2 and both sets of bit-manipulation instructions: the features that
/// ray traversal, which selects its version itself, is compiled for.
#[cfg(target_arch = "x86_64")]
#[inline]
pub(crate) fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
}
