//! Intersection, surface interaction and bounds of full and partial spheres, in double precision
//! (pbrt-v4, section 6.2).

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};
use obvhs::aabb::Aabb;

use super::bvh::rounded_out;
use super::local_interaction::{Detail, LocalInteraction, Parametrisation};
use super::rounding::DOUBLE_ROUNDING;
use crate::scene::Sphere;

/// The parameters of a sphere in its own space, clamped to valid ranges.
#[derive(Clone, Copy, Debug)]
pub struct SphereExtent {
    pub radius: f64,
    pub z_min: f64,
    pub z_max: f64,
    pub phi_max: f64,
    /// Polar angle at `z_min`, and polar angle at `z_max` minus that.
    theta_start: f32,
    theta_range: f32,
}

impl SphereExtent {
    pub fn new(sphere: &Sphere) -> Self {
        let radius = sphere.radius as f64;
        let within = |z: f32| (z as f64).max(-radius).min(radius);
        let (a, b) = (within(sphere.z_min), within(sphere.z_max));
        let (z_min, z_max) = (a.min(b), a.max(b));
        let theta = |z: f64| (z / radius).clamp(-1.0, 1.0).acos();
        Self {
            radius,
            z_min,
            z_max,
            // 2π rounded to single precision is slightly larger than in double precision.
            phi_max: (sphere.phi_max as f64).min(TAU),
            theta_start: theta(z_min) as f32,
            theta_range: (theta(z_max) - theta(z_min)) as f32,
        }
    }

    /// Whether no part of the sphere is missing.
    pub fn is_full(&self) -> bool {
        self.z_min <= -self.radius && self.z_max >= self.radius && self.phi_max >= TAU
    }

    fn contains(&self, p: DVec3) -> bool {
        let above = self.z_min <= -self.radius || p.z >= self.z_min;
        let below = self.z_max >= self.radius || p.z <= self.z_max;
        above && below && (self.phi_max >= TAU || azimuth(p) <= self.phi_max)
    }

    /// Distances along a ray in the sphere's space to its surface, in ascending order; NaN for no
    /// hit.
    pub fn distances(&self, origin: DVec3, direction: DVec3) -> [f64; 2] {
        let [first, last] = distances(self.radius, origin, direction);
        if self.is_full() {
            return [first, last];
        }
        let is_on_surface = |t: f64| self.contains(self.projected(origin + t * direction));
        [first, last].map(|t| if is_on_surface(t) { t } else { f64::NAN })
    }

    /// Area; a zone's depends on its height alone (Archimedes).
    #[inline]
    pub fn area(&self) -> f64 {
        self.phi_max * self.radius * (self.z_max - self.z_min)
    }

    /// Samples a point uniformly by area, with `u` in [0, 1)².
    #[inline]
    pub fn sample(&self, u: DVec2) -> DVec3 {
        let z = self.z_min + u.x * (self.z_max - self.z_min);
        let ring = (self.radius * self.radius - z * z).max(0.0).sqrt();
        let (sin, cos) = (u.y * self.phi_max).sin_cos();
        DVec3::new(ring * cos, ring * sin, z)
    }

    /// The point of the sphere closest to `p`.
    #[inline(always)]
    pub fn projected(&self, p: DVec3) -> DVec3 {
        p * (self.radius / p.length())
    }

    /// The surface at `p`, a point on the sphere.
    #[inline(always)]
    pub fn interaction(&self, p: DVec3, detail: Detail) -> LocalInteraction {
        let n = (p / self.radius).as_vec3();
        LocalInteraction {
            position: p,
            error: rounding_error(p),
            geometric_normal: n,
            shading_normal: None,
            parametrisation: detail.then(|| self.parametrisation(n)),
        }
    }

    /// The parametrisation at the point with this unit normal.
    fn parametrisation(&self, n: Vec3) -> Parametrisation {
        let (radius, phi_max, range) = (self.radius as f32, self.phi_max as f32, self.theta_range);
        let phi = n.y.atan2(n.x);
        let phi = if phi < 0.0 { phi + 2.0 * PI as f32 } else { phi }.min(phi_max);
        let ring = (n.x * n.x + n.y * n.y).sqrt();
        // The arc tangent is accurate near the poles, where the arc cosine is not.
        let v = if range == 0.0 { 0.0 } else { (ring.atan2(n.z) - self.theta_start) / range };
        let (cos_phi, sin_phi) = if ring > 0.0 { (n.x / ring, n.y / ring) } else { (1.0, 0.0) };
        Parametrisation {
            dpdu: phi_max * radius * Vec3::new(-n.y, n.x, 0.0),
            dpdv: range * radius * Vec3::new(n.z * cos_phi, n.z * sin_phi, -ring),
            uv: Vec2::new(phi / phi_max, v),
        }
    }
}

/// Distances along a ray to a full sphere around the origin, in ascending order; NaN for no hit.
/// Free of branches, so that loops over rays become vector code.
#[inline(always)]
pub fn distances(radius: f64, origin: DVec3, direction: DVec3) -> [f64; 2] {
    let squared_radius = radius * radius;
    let a = direction.length_squared();
    let inverse_a = 1.0 / a;
    let half_b = origin.dot(direction);
    let c = origin.length_squared() - squared_radius;
    // Computing the discriminant from the ray's closest point avoids cancellation (pbrt-v4, section
    // 6.8.3).
    let closest = origin - direction * (half_b * inverse_a);
    let root = ((squared_radius - closest.length_squared()) * a).sqrt();
    let q = -(half_b + root.copysign(half_b));
    let (t0, t1) = (q * inverse_a, c / q);
    if t0 <= t1 { [t0, t1] } else { [t1, t0] }
}

/// Angle around the z axis, in [0, 2π].
pub fn azimuth(p: DVec3) -> f64 {
    let phi = p.y.atan2(p.x);
    if phi < 0.0 { (phi + 2.0 * PI).min(TAU) } else { phi }
}

/// Bound on the error of a point on a sphere or disk that is computed in double precision, per axis.
#[inline(always)]
pub fn rounding_error(p: DVec3) -> Vec3 {
    Vec3::splat(DOUBLE_ROUNDING * p.as_vec3().abs().max_element())
}

/// The box around a sphere in its object's space; `None` if it is not finite.
pub fn bounds(sphere: &Sphere) -> Option<Aabb> {
    let extent = SphereExtent::new(sphere);
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

/// Minimum and maximum of a transformed box's corners.
pub fn corner_bounds(transform: &DAffine3, min: DVec3, max: DVec3) -> (DVec3, DVec3) {
    let mut bounds = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in 0..8 {
        let pick = |bit: usize| if corner >> bit & 1 == 0 { min[bit] } else { max[bit] };
        let p = transform.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
        bounds = (bounds.0.min(p), bounds.1.max(p));
    }
    bounds
}
