//! Intersection, surface interaction and bounds of full and partial disks and rings, in double
//! precision (pbrt-v4, section 6.4).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec2, Vec3};
use obvhs::aabb::Aabb;

use super::bvh::rounded_out;
use super::local_interaction::{Detail, LocalInteraction, Parametrisation};
use super::sphere::{azimuth, corner_bounds, rounding_error};
use crate::scene::Disk;

/// The parameters of a disk in its own space, clamped to valid ranges.
#[derive(Clone, Copy, Debug)]
pub struct DiskExtent {
    pub height: f64,
    pub radius: f64,
    pub inner_radius: f64,
    pub phi_max: f64,
}

impl DiskExtent {
    pub fn new(disk: &Disk) -> Self {
        Self {
            height: disk.height as f64,
            radius: disk.radius as f64,
            inner_radius: disk.inner_radius as f64,
            phi_max: (disk.phi_max as f64).min(TAU),
        }
    }

    /// Distance along a ray in the disk's space to its surface; NaN for no hit.
    pub fn distance(&self, origin: DVec3, direction: DVec3) -> f64 {
        // Infinite or NaN for a parallel ray.
        let t = (self.height - origin.z) / direction.z;
        let p = origin + t * direction;
        let from_axis = p.x.hypot(p.y);
        let on_ring = from_axis <= self.radius && from_axis >= self.inner_radius;
        if on_ring && (self.phi_max >= TAU || azimuth(p) <= self.phi_max) { t } else { f64::NAN }
    }

    /// Area.
    #[inline]
    pub fn area(&self) -> f64 {
        0.5 * self.phi_max * (self.radius * self.radius - self.inner_radius * self.inner_radius)
    }

    /// Samples a point uniformly by area, with `u` in [0, 1)².
    #[inline]
    pub fn sample(&self, u: DVec2) -> DVec3 {
        let squared = |x: f64| x * x;
        let distance =
            (squared(self.inner_radius) + u.x * (squared(self.radius) - squared(self.inner_radius))).sqrt();
        let (sin, cos) = (u.y * self.phi_max).sin_cos();
        DVec3::new(distance * cos, distance * sin, self.height)
    }

    /// The point of the disk's plane closest to `p`.
    pub fn projected(&self, p: DVec3) -> DVec3 {
        DVec3::new(p.x, p.y, self.height)
    }

    /// The surface at `p`, a point on the disk.
    pub fn interaction(&self, p: DVec3, detail: Detail) -> LocalInteraction {
        LocalInteraction {
            position: p,
            error: rounding_error(p),
            geometric_normal: Vec3::Z,
            shading_normal: None,
            parametrisation: detail.then(|| self.parametrisation(p)),
        }
    }

    fn parametrisation(&self, p: DVec3) -> Parametrisation {
        let width = self.radius - self.inner_radius;
        let distance = p.x.hypot(p.y);
        let (cos_phi, sin_phi) = if distance > 0.0 { (p.x / distance, p.y / distance) } else { (1.0, 0.0) };
        Parametrisation {
            dpdu: (self.phi_max * DVec3::new(-p.y, p.x, 0.0)).as_vec3(),
            dpdv: (-width * DVec3::new(cos_phi, sin_phi, 0.0)).as_vec3(),
            uv: Vec2::new(
                (azimuth(p) / self.phi_max) as f32,
                if width > 0.0 { ((self.radius - distance) / width) as f32 } else { 0.0 },
            ),
        }
    }
}

/// The box around a disk in its object's space; `None` if it is not finite.
pub fn bounds(disk: &Disk) -> Option<Aabb> {
    let extent = DiskExtent::new(disk);
    let reach = DVec3::new(extent.radius, extent.radius, 0.0);
    let height = DVec3::new(0.0, 0.0, extent.height);
    let (min, max) = corner_bounds(&disk.to_object, height - reach, height + reach);
    rounded_out(min, max)
}
