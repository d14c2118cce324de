//! Operations on blocks of [`LANES`] neighbouring pixels in vector registers.

use crate::simd::{LANES, Lanes};

/// Returns the first [`LANES`] values of a slice.
///
/// # Panics
/// If the slice is shorter.
#[inline(always)]
pub fn lanes(values: &[f32]) -> &Lanes {
    values[..LANES].try_into().expect("the slice has this length")
}

/// Returns a·b + c, rounded once if `FMA`. Kernels set the constant if their target has the instruction:
/// without it `mul_add` is a slow library call.
#[inline(always)]
pub fn multiply_add<const FMA: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}
