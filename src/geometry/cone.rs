//! The cone of directions in which a sphere is seen from outside, sampled uniformly (pbrt-v4, section
//! 6.2.4).

use std::f64::consts::TAU;

use glam::{DAffine3, DVec2, DVec3, Vec3};

use super::quadric::TransformedSphere;

/// The directions in which a full sphere is seen from outside, in the sphere's space.
pub struct Cone {
    /// Unit vector from the sphere's centre to the reference.
    axis: DVec3,
    radius: f64,
    /// Sine of the half angle.
    sin_max: f64,
    /// 1 - cosine of the half angle.
    one_minus_cos_max: f64,
    to_shape: DAffine3,
}

impl Cone {
    /// The cone of a sphere as seen from `reference`; `None` for partial spheres, and from inside.
    pub fn new(sphere: &TransformedSphere, reference: Vec3) -> Option<Self> {
        let TransformedSphere { extent, to_shape, .. } = *sphere;
        let from = to_shape.transform_point3(reference.as_dvec3());
        let distance = from.length();
        let outside = extent.is_full() && distance > extent.radius && extent.radius > 0.0;
        outside.then(|| {
            let sin_max = extent.radius / distance;
            let squared = sin_max * sin_max;
            // Subtracting a cosine from 1 would cancel at small angles.
            let one_minus_cos_max = squared / (1.0 + (1.0 - squared).sqrt());
            Self { axis: from / distance, radius: extent.radius, sin_max, one_minus_cos_max, to_shape }
        })
    }

    /// Samples a direction in the cone uniformly, with `u` in [0, 1)², and returns the nearest point of
    /// the sphere in that direction.
    pub fn sample(&self, u: DVec2) -> DVec3 {
        let one_minus_cos = u.x * self.one_minus_cos_max;
        let cos = 1.0 - one_minus_cos;
        let sin_squared = one_minus_cos * (2.0 - one_minus_cos);
        // Angle at the sphere's centre between the axis and the point.
        let cos_centre = sin_squared / self.sin_max
            + cos * (1.0 - sin_squared / (self.sin_max * self.sin_max)).max(0.0).sqrt();
        let sin_centre = (1.0 - cos_centre * cos_centre).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (TAU * u.y).sin_cos();
        let (x, y) = self.axis.any_orthonormal_pair();
        self.radius * (sin_centre * (cos_phi * x + sin_phi * y) + cos_centre * self.axis)
    }

    /// Whether a point of the sphere is one of those that can be sampled: not on the far side. `to_point` leads to it from the
    /// reference, in the object's space.
    pub fn reaches(&self, to_point: DVec3) -> bool {
        let point = self.radius / self.sin_max * self.axis + self.to_shape.matrix3 * to_point;
        point.dot(self.axis) >= self.radius * self.sin_max
    }

    /// Density with respect to solid angle, in the object's space, of sampling `direction`.
    pub fn pdf(&self, direction: DVec3) -> f64 {
        let linear = self.to_shape.matrix3;
        let stretch = (linear * direction.normalize_or_zero()).length();
        linear.determinant().abs() / (stretch * stretch * stretch) / (TAU * self.one_minus_cos_max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cone_reaches_what_it_samples_and_not_the_far_side() {
        let from = DVec3::new(0.0, 0.0, 2.0);
        let one_minus_cos_max = 1.0 - 0.75f64.sqrt();
        let to_shape = DAffine3::IDENTITY;
        let cone = Cone { axis: DVec3::Z, radius: 1.0, sin_max: 0.5, one_minus_cos_max, to_shape };
        for k in 0..100 {
            let point = cone.sample(DVec2::new(0.0099 * f64::from(k), 0.37));
            let direction = (point - from).normalize();
            // The line meets the sphere again as far behind the middle
            let far = point - 2.0 * point.dot(direction) * direction;
            assert!((far.length() - 1.0).abs() < 1e-9);
            assert!(cone.reaches(point - from) && !cone.reaches(far - from), "{point} {far}");
        }
    }
}
