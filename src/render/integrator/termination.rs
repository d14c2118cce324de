//! Termination of paths: the greatest depth, and Russian roulette.

/// Scattering events after which Russian roulette may end a path (as pbrt-v4).
pub const ROULETTE_DEPTH: u32 = 2;

/// Where paths end.
pub struct Termination {
    /// Scattering events at most.
    pub max_depth: u32,
    /// Paths end at the hit after the first scattering event that is not perfectly specular.
    pub direct_only: bool,
    /// A path's last ray can hit a light.
    pub lights_are_hit: bool,
    /// The second hit is recorded, even if it is the last.
    pub records_second_hit: bool,
}

impl Termination {
    /// Returns whether a path of this depth ends at its next hit.
    #[inline(always)]
    pub fn ends_at_hit(&self, depth: u32, is_non_specular_bounce: bool) -> bool {
        (depth >= self.max_depth) | (self.direct_only & is_non_specular_bounce)
    }

    /// Returns whether the next hit of a path, scattered for the `depth`-th time, contributes to the sample.
    #[inline(always)]
    pub fn needs_next_hit(&self, depth: u32, is_non_specular_bounce: bool) -> bool {
        let is_recorded = self.records_second_hit & (depth == 1);
        !self.ends_at_hit(depth, is_non_specular_bounce) | self.lights_are_hit | is_recorded
    }

    /// Returns whether Russian roulette decides if a path goes on, scattered for the `depth`-th time. A path
    /// whose throughput is not a number always goes on, so that the pixel-statistics store counts the sample.
    #[inline(always)]
    pub fn has_roulette(&self, depth: u32, throughput: glam::Vec3) -> bool {
        let is_number = throughput.x + throughput.y + throughput.z >= 0.0;
        !self.direct_only & (depth >= ROULETTE_DEPTH) & is_number
    }
}

/// Returns the probability with which Russian roulette continues a path: the fourth root of its throughput
/// without changes of the index of refraction (`max_component`). pbrt-v4 takes the throughput itself, which
/// equalises throughputs, although incident radiance varies far more: the error after equal time is 0.6 to 1.03
/// of pbrt-v4's (docs/performance.md).
#[inline(always)]
pub fn survival_probability(max_component: f32) -> f32 {
    max_component.min(1.0).sqrt().sqrt()
}
