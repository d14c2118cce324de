//! The arithmetic of scattering events, a lane for each.

#![expect(clippy::needless_range_loop, reason = "a lane is one of several arrays' at once")]

use multiversion::multiversion;

use super::direct::{power_heuristic, turned};
use super::flights::{Flights, LIGHT_SAMPLING, SCATTERED, SEEN_DIRECTLY, Shadows};
use super::shade::Places;
use crate::geometry::{LANES, Lanes, Lanes3, PointLanes, RayLanes, mask_of};
use crate::render::bsdf::{Evaluated, Scattered};
use crate::render::lights::{LightSamples, Receivers};

/// Scattering events after which paths may end by chance (as pbrt-v4).
pub const ROULETTE_DEPTH: u32 = 2;

/// When paths end.
pub struct Rules {
    pub max_depth: u32,
    /// Light arrives by one scattering event that is not perfectly specular.
    pub direct_only: bool,
    /// The last ray of a path may find a light.
    pub lights_are_found: bool,
    /// The second hit is recorded, even if it is the last.
    pub records_second_hit: bool,
}

impl Rules {
    /// Whether a path may not scatter where it arrives next.
    #[inline(always)]
    pub fn ends_at_hit(&self, depth: u32, is_scattered: bool) -> bool {
        (depth >= self.max_depth) | (self.direct_only & is_scattered)
    }
}

/// How points receive light. They are moved to the viewer's side of the surface, so that a surface
/// that is itself a light is not seen from its other side.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
pub fn receive(rays: &RayLanes, points: &PointLanes, normals: &Lanes3, receivers: &mut Receivers) {
    for lane in 0..LANES {
        let wo = -rays.direction.at(lane);
        receivers.position.set(lane, points.offset_origin(lane, wo));
        receivers.normal.set(lane, turned(normals.at(lane), wo));
    }
}

/// Light that arrives by one more scattering event, if nothing is in its way; returns the lanes of a mask
/// in which there is any.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
pub fn direct_light(
    mask: u32,
    flights: &Flights,
    points: &PointLanes,
    lights: &LightSamples,
    bsdfs: &Evaluated,
    shadows: &mut Shadows,
) -> u32 {
    let mut arrives: Lanes<u32> = [0; LANES];
    for lane in 0..LANES {
        let scattered = bsdfs.value.at(lane) * lights.radiance.at(lane);
        let light_pdf = lights.pdf[lane];
        let weight = power_heuristic(light_pdf, bsdfs.pdf[lane]);
        let share = if lights.found_by_rays[lane] != 0 { weight } else { 1.0 };
        shadows.light.set(lane, flights.throughput.at(lane) * (scattered * (share / light_pdf)));
        let origin = points.offset_origin(lane, lights.wi.at(lane));
        let (direction, t_max) = lights.shadow_ray(lane, origin);
        shadows.rays.origin.set(lane, origin);
        shadows.rays.direction.set(lane, direction);
        shadows.rays.t_max[lane] = t_max;
        shadows.rays.time[lane] = flights.rays.time[lane];
        let is_dark = (scattered.x == 0.0) & (scattered.y == 0.0) & (scattered.z == 0.0);
        arrives[lane] = u32::from(!is_dark & (light_pdf > 0.0));
    }
    mask & mask_of(|lane| arrives[lane] != 0)
}

/// Chance of a path to go on with so much of its light left: the fourth root of that. With what is left
/// itself, as in pbrt-v4, all paths would carry alike, but what they find differs far more: the error after
/// equal time is 0.6 to 1.03 of that (docs/performance.md).
#[inline(always)]
fn survival(left: f32) -> f32 {
    left.min(1.0).sqrt().sqrt()
}

/// The paths after they were scattered; returns the lanes of those of a mask that go on.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
pub fn scattered_on(
    mask: u32,
    rules: &Rules,
    flights: &Flights,
    places: &Places,
    scattered: &Scattered,
    roulette: &Lanes,
    next: &mut Flights,
) -> u32 {
    let mut alive: Lanes<u32> = [0; LANES];
    for lane in 0..LANES {
        let throughput = flights.throughput.at(lane) * scattered.weight.at(lane);
        let carries = !((throughput.x == 0.0) & (throughput.y == 0.0) & (throughput.z == 0.0));
        let depth = flights.depth[lane] + 1;
        let eta = scattered.eta[lane];
        let eta_scale = flights.eta_scale[lane] * eta * eta;
        let is_specular = scattered.is_specular[lane] != 0;
        let seen_directly = flights.flags[lane] & SEEN_DIRECTLY;
        let wi = scattered.wi.at(lane);

        // The last ray can do nothing but find a light, or be recorded.
        let recorded = rules.records_second_hit & (depth == 1);
        let is_useful = !rules.ends_at_hit(depth, !is_specular) | rules.lights_are_found | recorded;
        // Ends paths that carry little, and makes up for them in those that go on. What is not a number
        // survives, for the store to count.
        let is_number = throughput.x + throughput.y + throughput.z >= 0.0;
        let may_end = !rules.direct_only & (depth >= ROULETTE_DEPTH) & is_number;
        let survival = if may_end { survival((throughput * eta_scale).max_element()) } else { 1.0 };
        let survives = !may_end | (roulette[lane] < survival);
        alive[lane] = u32::from(carries & is_useful & survives);

        next.path[lane] = flights.path[lane];
        next.flags[lane] = if is_specular { seen_directly } else { SCATTERED | LIGHT_SAMPLING };
        next.depth[lane] = depth;
        next.passes[lane] = flights.passes[lane];
        next.rays.origin.set(lane, places.points.offset_origin(lane, wi));
        next.rays.direction.set(lane, wi);
        next.rays.time[lane] = flights.rays.time[lane];
        next.throughput.set(lane, throughput / survival);
        next.eta_scale[lane] = eta_scale;
        next.pdf[lane] = scattered.pdf[lane];
    }
    next.from = places.receivers;
    mask & mask_of(|lane| alive[lane] != 0)
}
