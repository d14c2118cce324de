//! Partial spheres: intersection in double precision, surface, box.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec3, Vec2};
use obvhs::aabb::Aabb;

use super::bvh::rounded_out;
use super::local::LocalPoint;
use crate::scene::Sphere;

/// The parameters of a sphere in its own space.
#[derive(Clone, Copy, Debug)]
pub struct SphereExtent {
    pub radius: f64,
    pub z_min: f64,
    pub z_max: f64,
    pub phi_max: f64,
}

impl SphereExtent {
    pub fn of(sphere: &Sphere) -> Self {
        let radius = sphere.radius as f64;
        let within = |z: f32| (z as f64).max(-radius).min(radius);
        let (a, b) = (within(sphere.z_min), within(sphere.z_max));
        Self {
            radius,
            z_min: a.min(b),
            z_max: a.max(b),
            // The single precision 2π is a little more than the double one.
            phi_max: (sphere.phi_max as f64).min(TAU),
        }
    }

    pub fn is_full(&self) -> bool {
        self.z_min <= -self.radius && self.z_max >= self.radius && self.phi_max >= TAU
    }

    fn contains(&self, p: DVec3) -> bool {
        let above = self.z_min <= -self.radius || p.z >= self.z_min;
        let below = self.z_max >= self.radius || p.z <= self.z_max;
        above && below && (self.phi_max >= TAU || azimuth(p) <= self.phi_max)
    }

    /// The distances, in order, at which a ray in sphere space meets the surface; NaN for none.
    pub fn distances(&self, origin: DVec3, direction: DVec3) -> [f64; 2] {
        let a = direction.length_squared();
        let half_b = origin.dot(direction);
        let distance = origin.length();
        let c = (distance - self.radius) * (distance + self.radius);
        // The point closest to the centre gives a discriminant without cancellation.
        let closest = (origin - direction * (half_b / a)).length();
        let discriminant = (self.radius - closest) * (self.radius + closest) * a;
        // Of a negative number this is NaN.
        let root = discriminant.sqrt();
        let q = -(half_b + root.copysign(half_b));
        let (t0, t1) = (q / a, c / q);
        let (first, last) = if t0 <= t1 { (t0, t1) } else { (t1, t0) };
        [first, last].map(
            |t| {
                if self.contains(self.projected(origin + t * direction)) { t } else { f64::NAN }
            },
        )
    }

    /// The point of the sphere closest to `p`.
    pub fn projected(&self, p: DVec3) -> DVec3 {
        p * (self.radius / p.length())
    }

    /// The surface at `p`, a point on the sphere.
    pub fn local_point(&self, p: DVec3) -> LocalPoint {
        let phi = azimuth(p).min(self.phi_max);
        let theta = |z: f64| (z / self.radius).clamp(-1.0, 1.0).acos();
        let (theta_start, theta_end) = (theta(self.z_min), theta(self.z_max));
        let range = theta_end - theta_start;
        let v = if range == 0.0 { 0.0 } else { (theta(p.z) - theta_start) / range };
        let ring = p.x.hypot(p.y);
        let (cos_phi, sin_phi) = if ring > 0.0 { (p.x / ring, p.y / ring) } else { (1.0, 0.0) };
        LocalPoint {
            position: p,
            error: rounding_error(p),
            geometric_normal: p / self.radius,
            shading_normal: None,
            dpdu: self.phi_max * DVec3::new(-p.y, p.x, 0.0),
            dpdv: range * DVec3::new(p.z * cos_phi, p.z * sin_phi, -ring),
            uv: Vec2::new((phi / self.phi_max) as f32, v as f32),
        }
    }
}

/// Angle around z, in [0, 2π).
pub fn azimuth(p: DVec3) -> f64 {
    let phi = p.y.atan2(p.x);
    if phi < 0.0 { (phi + 2.0 * PI).min(TAU) } else { phi }
}

/// Bound on the error of a position that is computed in double precision and used in single.
pub fn rounding_error(p: DVec3) -> DVec3 {
    super::rounding::gamma(2) as f64 * p.abs()
}

/// A box around a sphere, in its object's space.
pub fn bounds(sphere: &Sphere) -> Option<Aabb> {
    let extent = SphereExtent::of(sphere);
    let rows = sphere.to_object.matrix3.transpose();
    let centre = sphere.to_object.translation;
    let reach = extent.radius * DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
    let (low, high) = corner_bounds(
        &sphere.to_object,
        DVec3::new(-extent.radius, -extent.radius, extent.z_min),
        DVec3::new(extent.radius, extent.radius, extent.z_max),
    );
    rounded_out(low.max(centre - reach), high.min(centre + reach))
}

/// The box around a transformed box.
pub fn corner_bounds(transform: &DAffine3, min: DVec3, max: DVec3) -> (DVec3, DVec3) {
    let mut bounds = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in 0..8 {
        let pick = |bit: usize| if corner >> bit & 1 == 0 { min[bit] } else { max[bit] };
        let p = transform.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
        bounds = (bounds.0.min(p), bounds.1.max(p));
    }
    bounds
}
