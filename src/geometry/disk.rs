//! Partial disks and rings: intersection in double precision, surface, box.

use std::f64::consts::TAU;

use glam::{DVec3, Vec2, Vec3};
use obvhs::aabb::Aabb;

use super::bvh::rounded_out;
use super::local::{Detail, LocalPoint, Parametrisation};
use super::sphere::{azimuth, corner_bounds, rounding_error};
use crate::scene::Disk;

/// The parameters of a disk in its own space.
#[derive(Clone, Copy, Debug)]
pub struct DiskExtent {
    pub height: f64,
    pub radius: f64,
    pub inner_radius: f64,
    pub phi_max: f64,
}

impl DiskExtent {
    pub fn of(disk: &Disk) -> Self {
        Self {
            height: disk.height as f64,
            radius: disk.radius as f64,
            inner_radius: disk.inner_radius as f64,
            phi_max: (disk.phi_max as f64).min(TAU),
        }
    }

    /// The distance at which a ray in disk space meets the surface; NaN for none.
    pub fn distance(&self, origin: DVec3, direction: DVec3) -> f64 {
        // Not finite for a parallel ray.
        let t = (self.height - origin.z) / direction.z;
        let p = origin + t * direction;
        let from_axis = p.x.hypot(p.y);
        let on_ring = from_axis <= self.radius && from_axis >= self.inner_radius;
        if on_ring && (self.phi_max >= TAU || azimuth(p) <= self.phi_max) { t } else { f64::NAN }
    }

    /// The point of the disk's plane closest to `p`.
    pub fn projected(&self, p: DVec3) -> DVec3 {
        DVec3::new(p.x, p.y, self.height)
    }

    /// The surface at `p`, a point on the disk.
    pub fn local_point(&self, p: DVec3, detail: Detail) -> LocalPoint {
        LocalPoint {
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

/// A box around a disk, in its object's space.
pub fn bounds(disk: &Disk) -> Option<Aabb> {
    let extent = DiskExtent::of(disk);
    let reach = DVec3::new(extent.radius, extent.radius, 0.0);
    let height = DVec3::new(0.0, 0.0, extent.height);
    let (min, max) = corner_bounds(&disk.to_object, height - reach, height + reach);
    rounded_out(min, max)
}
