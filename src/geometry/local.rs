//! A point on a surface in double precision, in its shape's or object's space, and its way to
//! render space.

use glam::{DAffine3, DMat3, DVec3, Vec2};

use super::SurfacePoint;
use super::rounding::{UNIT_ROUNDOFF, gamma};

/// What [`SurfacePoint`] holds, before it is moved to render space and rounded.
#[derive(Clone, Copy, Debug)]
pub struct LocalPoint {
    pub position: DVec3,
    pub error: DVec3,
    pub geometric_normal: DVec3,
    /// Interpolated normal, if the shape has one that differs from the geometric normal.
    pub shading_normal: Option<DVec3>,
    pub dpdu: DVec3,
    pub dpdv: DVec3,
    pub uv: Vec2,
}

impl LocalPoint {
    /// Moves it to another space; `inverse` is that of `transform`.
    ///
    /// Rays come back to this space through a rounded origin, so the error bound covers a rounding
    /// here as well as in the other space.
    pub fn transformed(self, transform: &DAffine3, inverse: &DAffine3) -> Self {
        let linear = transform.matrix3;
        let normal_matrix = inverse.matrix3.transpose();
        let absolute = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
        let position = transform.transform_point3(self.position);
        let round_trip = self.error + gamma(1) as f64 * self.position.abs();
        Self {
            position,
            error: absolute * round_trip + gamma(2) as f64 * position.abs(),
            geometric_normal: (normal_matrix * self.geometric_normal).normalize_or_zero(),
            shading_normal: self.shading_normal.map(|n| normal_matrix * n),
            dpdu: linear * self.dpdu,
            dpdv: linear * self.dpdv,
            uv: self.uv,
        }
    }

    /// Turns the geometric normal over.
    pub fn flipped(self) -> Self {
        Self { geometric_normal: -self.geometric_normal, ..self }
    }

    /// Rounds to single precision; turns the shading normal to the geometric one's side, and
    /// replaces tangents that span no plane.
    pub fn rounded(self, primitive: u32, element: u32) -> SurfacePoint {
        let geometric_normal = match self.geometric_normal.as_vec3().try_normalize() {
            Some(normal) => normal,
            None => glam::Vec3::Z,
        };
        let shading_normal = self
            .shading_normal
            .and_then(|normal| normal.try_normalize())
            .map_or(geometric_normal, |normal| normal.as_vec3().normalize());
        let facing =
            if shading_normal.dot(geometric_normal) < 0.0 { -shading_normal } else { shading_normal };
        let (mut dpdu, mut dpdv) = (self.dpdu.as_vec3(), self.dpdv.as_vec3());
        let area = self.dpdu.cross(self.dpdv).length_squared();
        // Written so that NaN is degenerate too.
        if !(area > 0.0 && area.is_finite()) || dpdu == glam::Vec3::ZERO || dpdv == glam::Vec3::ZERO {
            (dpdu, dpdv) = geometric_normal.any_orthonormal_pair();
        }
        let rounding = UNIT_ROUNDOFF as f64 * self.position.abs();
        SurfacePoint {
            position: self.position.as_vec3(),
            position_error: (self.error + rounding).as_vec3(),
            geometric_normal,
            shading_normal: facing,
            dpdu,
            dpdv,
            uv: self.uv,
            primitive,
            element,
        }
    }
}
