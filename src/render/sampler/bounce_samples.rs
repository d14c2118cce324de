//! Sample values of scattering events.

use glam::Vec2;

use super::sample_address::SampleAddress;
use crate::hash::hash;
use crate::simd::Lanes;

/// Sample values of one scattering event, a path a lane; 0 where the scene does not require them.
#[derive(Clone, Copy, Debug)]
pub struct BounceSamples {
    pub light_uv: [Lanes; 2],
    pub bsdf_uv: [Lanes; 2],
    pub light_choice: Lanes,
    pub lobe: Lanes,
    pub mix: Lanes,
    pub roulette: Lanes,
}

impl BounceSamples {
    #[inline(always)]
    pub fn bsdf_uv_at(&self, lane: usize) -> Vec2 {
        Vec2::new(self.bsdf_uv[0][lane], self.bsdf_uv[1][lane])
    }

    /// Returns the value that chooses the material of a mix, after the path has passed `interfaces` others. Each
    /// choice has its own value, because the path's having passed a mix makes that mix's value less random.
    #[inline]
    pub fn mix_after(&self, lane: usize, interfaces: u32, address: SampleAddress) -> f32 {
        let value = self.mix[lane];
        if interfaces == 0 {
            return value;
        }
        let sample = hash(address.key ^ (u64::from(address.pixel) << 32 | u64::from(address.index)));
        let bits = hash(sample ^ (u64::from(interfaces) << 32 | u64::from(value.to_bits())));
        (bits >> 40) as f32 / (1 << 24) as f32
    }
}
