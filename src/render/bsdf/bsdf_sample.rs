//! Directions sampled from a BSDF: one, and a batch with a direction in every SIMD lane.

use glam::Vec3;

use crate::simd::{LANES, Lanes, Lanes3};

/// A direction sampled from a BSDF (pbrt-v4's `BSDFSample`).
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Unit, away from the surface; in the space of the outgoing direction that it was sampled for.
    pub wi: Vec3,
    /// f |cos| / pdf; of the sampled specular lobe alone, divided by its probability, if `specular`.
    pub weight: Vec3,
    /// Density per solid angle; 0 for specular samples.
    pub pdf: f32,
    pub specular: bool,
    /// `wi` and the outgoing direction are on different sides of the surface.
    pub transmission: bool,
    /// Index of refraction on the side of `wi` over that on the side of `wo` if refracted; else 1.
    pub eta: f32,
}

impl BsdfSample {
    /// A reflection off a lobe that is not specular.
    pub(super) fn glossy(wi: Vec3, weight: Vec3, pdf: f32) -> Self {
        Self { wi, weight, pdf, specular: false, transmission: false, eta: 1.0 }
    }

    /// A reflection off a specular lobe.
    pub(super) fn specular(wi: Vec3, weight: Vec3) -> Self {
        Self { wi, weight, pdf: 0.0, specular: true, transmission: false, eta: 1.0 }
    }
}

/// [`BsdfSample`]s in lanes; the weight is 0 where no direction was sampled.
pub struct BsdfSamples {
    pub wi: Lanes3,
    pub weight: Lanes3,
    pub pdf: Lanes,
    pub eta: Lanes,
    pub is_specular: Lanes<u32>,
}

impl BsdfSamples {
    pub const NONE: Self = Self {
        wi: Lanes3::ZERO,
        weight: Lanes3::ZERO,
        pdf: [0.0; LANES],
        eta: [1.0; LANES],
        is_specular: [0; LANES],
    };

    #[inline]
    pub fn set(&mut self, lane: usize, sample: Option<BsdfSample>) {
        let Some(sample) = sample else { return };
        self.wi.set(lane, sample.wi);
        self.weight.set(lane, sample.weight);
        self.pdf[lane] = sample.pdf;
        self.eta[lane] = sample.eta;
        self.is_specular[lane] = u32::from(sample.specular);
    }
}
