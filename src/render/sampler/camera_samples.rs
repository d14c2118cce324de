//! Sample values of camera rays.

use crate::simd::Lanes;

/// Sample values of a camera ray and those of the first scattering event that are recorded, a path a lane.
#[derive(Clone, Copy, Debug)]
pub struct CameraSamples {
    pub film: [Lanes; 2],
    pub lens: [Lanes; 2],
    pub time: Lanes,
    pub light_uv: [Lanes; 2],
    pub bsdf_uv: [Lanes; 2],
}
