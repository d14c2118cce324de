//! Values and densities of BSDFs for one pair of directions in every SIMD lane.

use glam::Vec3;

use crate::simd::{LANES, Lanes, Lanes3};

/// The results of [`super::Bsdf::eval_and_pdf`] in lanes.
pub struct BsdfValues {
    /// f |cos wi|.
    pub value: Lanes3,
    /// Density per solid angle.
    pub pdf: Lanes,
}

impl BsdfValues {
    pub const ZERO: Self = Self { value: Lanes3::ZERO, pdf: [0.0; LANES] };

    #[inline]
    pub fn set(&mut self, lane: usize, (value, pdf): (Vec3, f32)) {
        self.value.set(lane, value);
        self.pdf[lane] = pdf;
    }
}
