//! Multiple importance sampling of light sampling and BSDF sampling (Veach 1997, chapter 9).

use super::path_packet::PathPacket;
use crate::render::lights::LightSampleContext;

/// Returns the power heuristic's weight of the technique with density `pdf` against that with `other_pdf`.
#[inline(always)]
pub fn power_heuristic(pdf: f32, other_pdf: f32) -> f32 {
    let ratio = other_pdf / pdf;
    1.0 / (1.0 + ratio * ratio)
}

/// Returns the MIS weight of emission that a path hits by BSDF sampling. `light_pdf` is the density with
/// which light sampling at the last scattering event samples the ray's direction.
#[inline]
pub fn emission_weight(
    packet: &PathPacket,
    lane: usize,
    light_pdf: impl FnOnce(&LightSampleContext) -> f32,
) -> f32 {
    packet
        .mis_context(lane)
        .map_or(1.0, |context| power_heuristic(packet.bsdf_pdf[lane], light_pdf(&context)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_two_techniques_add_up_to_one() {
        for (a, b) in [(1.0, 3.0), (1e-20, 1e20), (0.0, 2.0), (1e30, 1e30)] {
            let sum = power_heuristic(a, b) + power_heuristic(b, a);
            assert!((sum - 1.0).abs() < 1e-6, "{a} {b}");
        }
        assert!((power_heuristic(1.0, 3.0) - 0.1).abs() < 1e-7);
    }
}
