//! Samples of the incident radiance from one light: one, and a batch with a sample in every SIMD lane.

use glam::Vec3;

use crate::simd::{LANES, Lanes, Lanes3};

/// Shadow rays stop this fraction of their length before the light, beyond the error bounds of both ends,
/// since the length itself is rounded (pbrt's `ShadowEpsilon`).
const SHADOW_EPSILON: f32 = 1e-4;

/// A sampled direction towards a light, with the radiance that arrives if nothing occludes it.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction towards the light.
    pub wi: Vec3,
    pub radiance: Vec3,
    /// Density per solid angle; 1 for a delta light.
    pub pdf: f32,
    /// Rays of BSDF sampling can hit this light as well.
    pub can_be_hit: bool,
    /// Where the shadow ray ends; `None` is infinitely far.
    pub target: Option<Vec3>,
}

impl LightSample {
    /// Returns direction and length, in units of the direction, of the shadow ray from `origin`.
    pub fn shadow_ray(&self, origin: Vec3) -> (Vec3, f32) {
        match self.target {
            Some(target) => (target - origin, 1.0 - SHADOW_EPSILON),
            None => (self.wi, f32::INFINITY),
        }
    }
}

/// [`LightSample`]s in lanes.
pub struct LightSamples {
    pub wi: Lanes3,
    pub radiance: Lanes3,
    /// 0 where there is no sample.
    pub pdf: Lanes,
    pub can_be_hit: Lanes<u32>,
    pub(super) target: Lanes3,
    pub(super) has_target: Lanes<u32>,
}

impl LightSamples {
    pub const NONE: Self = Self {
        wi: Lanes3::ZERO,
        radiance: Lanes3::ZERO,
        pdf: [0.0; LANES],
        can_be_hit: [0; LANES],
        target: Lanes3::ZERO,
        has_target: [0; LANES],
    };

    pub(super) fn set(&mut self, lane: usize, sample: Option<LightSample>) {
        let Some(sample) = sample else {
            self.pdf[lane] = 0.0;
            return;
        };
        self.wi.set(lane, sample.wi);
        self.radiance.set(lane, sample.radiance);
        self.pdf[lane] = sample.pdf;
        self.can_be_hit[lane] = u32::from(sample.can_be_hit);
        self.target.set(lane, sample.target.unwrap_or(Vec3::ZERO));
        self.has_target[lane] = u32::from(sample.target.is_some());
    }

    /// Direction and length, in units of the direction, of the shadow ray from `origin`.
    #[inline(always)]
    pub fn shadow_ray(&self, lane: usize, origin: Vec3) -> (Vec3, f32) {
        let has_target = self.has_target[lane] != 0;
        let direction = if has_target { self.target.at(lane) - origin } else { self.wi.at(lane) };
        (direction, if has_target { 1.0 - SHADOW_EPSILON } else { f32::INFINITY })
    }
}
