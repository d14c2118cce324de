//! Direct light at a point: one light is sampled, weighted against finding it by a scattered ray
//! (Veach 1997, chapter 9, power heuristic).

use glam::Vec3;

use super::PathTracer;
use crate::geometry::{Ray, SurfacePoint};
use crate::render::bsdf::Bsdf;
use crate::render::lights::Receiver;
use crate::render::sampler::BounceNumbers;

/// Boundaries without effect that a ray passes at most. More than any scene nests; the limit is
/// there for surfaces that overlap so that rounding makes a ray meet them again and again.
pub(super) const MAX_PASSES: u32 = 256;

impl PathTracer<'_> {
    /// Radiance in direction `wo` that comes from one sampled light by way of `bsdf`, if nothing is
    /// in the way of the ray. Lights are sampled as seen from the receiver, see [`receiver`].
    #[inline]
    pub(super) fn direct_light(
        &self,
        point: &SurfacePoint,
        receiver: &Receiver,
        bsdf: &Bsdf,
        wo: Vec3,
        numbers: &BounceNumbers,
        time: f32,
    ) -> Option<(Vec3, Ray)> {
        let light = self.lights.sample(receiver, numbers.light, numbers.light_uv)?;
        let (value, pdf) = bsdf.eval_and_pdf(wo, light.wi);
        let scattered = value * light.radiance;
        if scattered == Vec3::ZERO {
            return None;
        }
        let share = if light.found_by_rays { power_heuristic(light.pdf, pdf) } else { 1.0 };
        Some((scattered * (share / light.pdf), light.shadow_ray(point, time)))
    }

    /// Passes on, for each ray, whether nothing but boundaries without effect is in its way.
    #[inline]
    pub(super) fn are_visible(&self, rays: impl Iterator<Item = Ray>, mut found: impl FnMut(bool)) {
        if self.has_interfaces {
            rays.for_each(|ray| found(self.is_visible_through_interfaces(ray)));
        } else {
            self.accel.occluded_all(rays, |occluded| found(!occluded));
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

/// How a point receives light. It is moved to the viewer's side of the surface, so that a surface
/// that is itself a light is not seen from its other side.
#[inline]
pub(super) fn receiver(point: &SurfacePoint, bsdf: &Bsdf, wo: Vec3) -> Receiver {
    Receiver {
        position: point.offset_origin(wo),
        normal: turned(bsdf.shading_normal(), wo),
        transmits: bsdf.transmits(),
    }
}

/// The normal on the side of `w`.
#[inline]
pub(super) fn turned(normal: Vec3, w: Vec3) -> Vec3 {
    if normal.dot(w) < 0.0 { -normal } else { normal }
}

/// Share of the technique with density `pdf` against another one.
#[inline]
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
