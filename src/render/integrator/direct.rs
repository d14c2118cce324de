//! Direct light at a point: one light is sampled, weighted against finding it by a scattered ray
//! (Veach 1997, chapter 9, power heuristic).

use glam::Vec3;

use super::PathTracer;
use super::events::direct_light;
use super::flights::{Flights, Shadows};
use super::path::place;
use super::shade::{Other, Places};
use crate::geometry::{LANES, Ray, lanes_of};
use crate::render::bsdf::Evaluated;
use crate::render::lights::LightSamples;
use crate::render::record::Records;
use crate::render::sampler::BounceNumbers;

/// Boundaries without effect that a ray passes at most. More than any scene nests; the limit is
/// there for surfaces that overlap so that rounding makes a ray meet them again and again.
pub(super) const MAX_PASSES: u32 = 256;

impl PathTracer<'_> {
    /// Samples a light for each path in a mask's lanes. What arrives from there is kept back until enough
    /// has come together for its way to be searched.
    #[expect(clippy::too_many_arguments, reason = "the packet's parts, of which each stage needs others")]
    pub(super) fn sample_lights(
        &self,
        mask: u32,
        flights: &Flights,
        places: &Places,
        others: &[Other],
        numbers: &BounceNumbers,
        shadows: &mut Shadows,
        records: &mut [Records],
    ) {
        if mask == 0 {
            return;
        }
        let mut lights = LightSamples::NONE;
        self.lights.sample(mask, &places.receivers, &numbers.light, &numbers.light_uv, &mut lights);
        let mut bsdfs = Evaluated::NOTHING;
        let (rays, normals) = (&flights.rays, &places.normals);
        places.surfaces.eval(mask & places.plain, rays, normals, &lights.wi, &mut bsdfs);
        Self::eval_others(others, mask, flights, &lights.wi, &mut bsdfs);
        let mut new = Shadows::NONE;
        let arrives = direct_light(mask, flights, &places.points, &lights, &bsdfs, &mut new);
        for lane in lanes_of(arrives) {
            shadows.push(flights.path[lane], &new, lane);
            if shadows.count == LANES {
                self.add_visible_light(shadows, records);
            }
        }
    }

    /// Adds what was kept back where nothing but boundaries without effect is in its way.
    pub(super) fn add_visible_light(&self, shadows: &mut Shadows, records: &mut [Records]) {
        let count = std::mem::take(&mut shadows.count);
        if count == 0 {
            return;
        }
        let all = (1 << count) - 1;
        let visible = if self.has_interfaces {
            let is_visible = |lane: &usize| self.is_visible_through_interfaces(shadows.rays.at(*lane));
            (0..count).filter(is_visible).fold(0, |mask, lane| mask | 1 << lane)
        } else {
            all & !self.accel.occluded_lanes(&shadows.rays, count)
        };
        for lane in lanes_of(visible) {
            let (packet, place) = place(shadows.path[lane]);
            let sum = &mut records[packet].sampled;
            sum.set(place, sum.at(place) + shadows.light.at(lane));
        }
    }

    fn is_visible_through_interfaces(&self, mut ray: Ray) -> bool {
        let end = ray.origin + ray.direction * ray.t_max;
        for _ in 0..MAX_PASSES {
            let Some(hit) = self.accel.intersect(&ray) else { return true };
            let point = self.accel.surface(&ray, &hit);
            if !self.is_interface(&point) {
                return false;
            }
            ray.origin = point.offset_origin(ray.direction);
            if ray.t_max.is_finite() {
                ray.direction = end - ray.origin;
                ray.t_max = 1.0;
            }
        }
        false
    }
}

/// The normal on the side of `w`.
#[inline(always)]
pub(super) fn turned(normal: Vec3, w: Vec3) -> Vec3 {
    if normal.dot(w) < 0.0 { -normal } else { normal }
}

/// Share of the technique with density `pdf` against another one.
#[inline(always)]
pub(super) fn power_heuristic(pdf: f32, other: f32) -> f32 {
    let ratio = other / pdf;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_two_techniques_add_up_to_one() {
        for (a, b) in [(1.0, 3.0), (1e-20, 1e20), (0.0, 2.0), (1e30, 1e30)] {
            let sum = power_heuristic(a, b) + power_heuristic(b, a);
            assert!((sum - 1.0).abs() < 1e-6, "{a} {b}");
        }
        assert!((power_heuristic(1.0, 3.0) - 0.1).abs() < 1e-7);
    }
}
