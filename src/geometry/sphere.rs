//! Partial spheres: intersection in double precision, surface, box.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec3, Vec2, Vec3};
use obvhs::aabb::Aabb;

use super::bvh::rounded_out;
use super::local::{Detail, LocalPoint, Parametrisation};
use crate::scene::Sphere;

/// The parameters of a sphere in its own space.
#[derive(Clone, Copy, Debug)]
pub struct SphereExtent {
    pub radius: f64,
    pub z_min: f64,
    pub z_max: f64,
    pub phi_max: f64,
    /// Polar angle of `z_min`, and how much less that of `z_max` is.
    theta_start: f32,
    theta_range: f32,
}

impl SphereExtent {
    pub fn of(sphere: &Sphere) -> Self {
        let radius = sphere.radius as f64;
        let within = |z: f32| (z as f64).max(-radius).min(radius);
        let (a, b) = (within(sphere.z_min), within(sphere.z_max));
        let (z_min, z_max) = (a.min(b), a.max(b));
        let theta = |z: f64| (z / radius).clamp(-1.0, 1.0).acos();
        Self {
            radius,
            z_min,
            z_max,
            // The single precision 2π is a little more than the double one.
            phi_max: (sphere.phi_max as f64).min(TAU),
            theta_start: theta(z_min) as f32,
            theta_range: (theta(z_max) - theta(z_min)) as f32,
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
        let [first, last] = distances(self.radius, origin, direction);
        if self.is_full() {
            return [first, last];
        }
        let is_there = |t: f64| self.contains(self.projected(origin + t * direction));
        [first, last].map(|t| if is_there(t) { t } else { f64::NAN })
    }

    /// The point of the sphere closest to `p`.
    #[inline(always)]
    pub fn projected(&self, p: DVec3) -> DVec3 {
        p * (self.radius / p.length())
    }

    /// The surface at `p`, a point on the sphere.
    #[inline(always)]
    pub fn local_point(&self, p: DVec3, detail: Detail) -> LocalPoint {
        let n = (p / self.radius).as_vec3();
        LocalPoint {
            position: p,
            error: rounding_error(p),
            geometric_normal: n,
            shading_normal: None,
            parametrisation: detail.then(|| self.parametrisation(n)),
        }
    }

    /// At the point with this unit normal.
    fn parametrisation(&self, n: Vec3) -> Parametrisation {
        let (radius, phi_max, range) = (self.radius as f32, self.phi_max as f32, self.theta_range);
        let phi = n.y.atan2(n.x);
        let phi = if phi < 0.0 { phi + 2.0 * PI as f32 } else { phi }.min(phi_max);
        let ring = (n.x * n.x + n.y * n.y).sqrt();
        // The arc tangent is exact near the poles too, where the arc cosine is not.
        let v = if range == 0.0 { 0.0 } else { (ring.atan2(n.z) - self.theta_start) / range };
        let (cos_phi, sin_phi) = if ring > 0.0 { (n.x / ring, n.y / ring) } else { (1.0, 0.0) };
        Parametrisation {
            dpdu: phi_max * radius * Vec3::new(-n.y, n.x, 0.0),
            dpdv: range * radius * Vec3::new(n.z * cos_phi, n.z * sin_phi, -ring),
            uv: Vec2::new(phi / phi_max, v),
        }
    }
}

/// The distances, in order, at which a ray meets the whole of a sphere around the origin; NaN for
/// none. Without a branch, so that it can be done for many rays at once.
#[inline(always)]
pub fn distances(radius: f64, origin: DVec3, direction: DVec3) -> [f64; 2] {
    let squared_radius = radius * radius;
    let a = direction.length_squared();
    let inverse_a = 1.0 / a;
    let half_b = origin.dot(direction);
    let c = origin.length_squared() - squared_radius;
    // The point closest to the centre gives a discriminant without cancellation.
    let closest = origin - direction * (half_b * inverse_a);
    let root = ((squared_radius - closest.length_squared()) * a).sqrt();
    let q = -(half_b + root.copysign(half_b));
    let (t0, t1) = (q * inverse_a, c / q);
    if t0 <= t1 { [t0, t1] } else { [t1, t0] }
}

/// Angle around z, in [0, 2π).
pub fn azimuth(p: DVec3) -> f64 {
    let phi = p.y.atan2(p.x);
    if phi < 0.0 { (phi + 2.0 * PI).min(TAU) } else { phi }
}

/// Bound on the error of a position that is computed in double precision and used in single.
#[inline(always)]
pub fn rounding_error(p: DVec3) -> Vec3 {
    super::rounding::gamma(3) * p.as_vec3().abs()
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
