//! The point that light sampling computes the incident light of (pbrt-v4's `LightSampleContext`): one, and a
//! batch with a point in every SIMD lane.

use glam::Vec3;

use super::angle::Angle;
use crate::simd::{LANES, Lanes, Lanes3};

/// Bounds on cosines are raised by this tolerance, well above their rounding errors, so that the light
/// sampler never gives probability 0 to a light that illuminates the point.
pub const COS_TOLERANCE: f32 = 1e-3;

/// A point at which lights are sampled.
#[derive(Clone, Copy, Debug)]
pub struct LightSampleContext {
    pub position: Vec3,
    /// Unit shading normal on the side of the outgoing direction.
    pub normal: Vec3,
    /// The BSDF transmits, so that light from behind the surface counts as well.
    pub transmits: bool,
}

impl LightSampleContext {
    /// Upper bound on the cosine of incidence over the unit directions within the angle `spread` of `wi`;
    /// 0 only if light from none of them is scattered.
    #[inline(always)]
    pub fn bound_cosine(&self, wi: Vec3, spread: Angle) -> f32 {
        let cos = self.normal.dot(wi);
        let angle = Angle::from_cos(if self.transmits { cos.abs() } else { cos });
        (angle.minus(spread).cos + COS_TOLERANCE).max(0.0)
    }
}

/// [`LightSampleContext`]s in lanes.
#[derive(Clone, Copy)]
pub struct LightSampleContexts {
    pub position: Lanes3,
    pub normal: Lanes3,
    pub transmits: Lanes<u32>,
}

impl LightSampleContexts {
    pub const NONE: Self = Self { position: Lanes3::ZERO, normal: Lanes3::ZERO, transmits: [0; LANES] };

    #[inline(always)]
    pub fn at(&self, lane: usize) -> LightSampleContext {
        LightSampleContext {
            position: self.position.at(lane),
            normal: self.normal.at(lane),
            transmits: self.transmits[lane] != 0,
        }
    }
}
