//! A point on a surface in its shape's or object's space, and its way to render space.
//!
//! Only positions are kept in double precision on the way: the rest has no cancellation left in it.

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3};

use super::SurfacePoint;
use super::rounding::{UNIT_ROUNDOFF, gamma};

/// What [`SurfacePoint`] holds, before it is moved to render space and rounded.
#[derive(Clone, Copy, Debug)]
pub struct LocalPoint {
    pub position: DVec3,
    pub error: Vec3,
    /// Unit.
    pub geometric_normal: Vec3,
    /// Interpolated normal of any length, if the shape has one that differs from the geometric
    /// normal.
    pub shading_normal: Option<Vec3>,
    /// If it was asked for.
    pub parametrisation: Option<Parametrisation>,
}

/// Texture coordinates, and how the surface changes with them.
#[derive(Clone, Copy, Debug)]
pub struct Parametrisation {
    pub uv: Vec2,
    pub dpdu: Vec3,
    pub dpdv: Vec3,
}

/// How much of a point is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// All but the parametrisation.
    Plain,
    Full,
}

impl Detail {
    #[inline]
    pub fn then<T>(self, value: impl FnOnce() -> T) -> Option<T> {
        (self == Self::Full).then(value)
    }
}

impl LocalPoint {
    /// Moves it to another space; `inverse` is that of `transform`.
    ///
    /// Rays come back to this space through a rounded origin, so the error bound covers a rounding
    /// here as well as in the other space.
    #[inline(always)]
    pub fn transformed(self, transform: &DAffine3, inverse: &DAffine3) -> Self {
        let linear = transform.matrix3.as_mat3();
        let normal_matrix = inverse.matrix3.as_mat3().transpose();
        let absolute = Mat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
        let position = transform.transform_point3(self.position);
        let round_trip = self.error + gamma(1) * self.position.as_vec3().abs();
        Self {
            position,
            error: absolute * round_trip + gamma(2) * position.as_vec3().abs(),
            geometric_normal: unit(normal_matrix * self.geometric_normal),
            shading_normal: self.shading_normal.map(|n| normal_matrix * n),
            parametrisation: self.parametrisation.map(|Parametrisation { uv, dpdu, dpdv }| Parametrisation {
                uv,
                dpdu: linear * dpdu,
                dpdv: linear * dpdv,
            }),
        }
    }

    /// Turns the geometric normal over.
    #[inline(always)]
    pub fn flipped(self) -> Self {
        Self { geometric_normal: -self.geometric_normal, ..self }
    }

    /// Rounds to single precision; turns the shading normal to the geometric one's side, and
    /// replaces tangents that span no plane.
    #[inline(always)]
    pub fn rounded(self, primitive: u32, element: u32) -> SurfacePoint {
        let geometric_normal = self.geometric_normal;
        let shading_normal = self.shading_normal.map_or(geometric_normal, unit);
        let Parametrisation { uv, dpdu, dpdv } =
            self.parametrisation.filter(Parametrisation::spans_a_plane).unwrap_or_else(|| {
                let (dpdu, dpdv) = geometric_normal.any_orthonormal_pair();
                let uv = self.parametrisation.map_or(Vec2::ZERO, |it| it.uv);
                Parametrisation { uv, dpdu, dpdv }
            });
        let position = self.position.as_vec3();
        SurfacePoint {
            position,
            position_error: with_rounding(self.error, position),
            geometric_normal,
            shading_normal: facing(shading_normal, geometric_normal),
            dpdu,
            dpdv,
            uv,
            primitive,
            element,
        }
    }
}

impl Parametrisation {
    fn spans_a_plane(&self) -> bool {
        // In double precision, which neither overflows nor underflows.
        let area = self.dpdu.as_dvec3().cross(self.dpdv.as_dvec3()).length_squared();
        area > 0.0 && area.is_finite()
    }
}

/// A bound on the error of a position, with that of its rounding to single precision.
#[inline(always)]
pub fn with_rounding(error: Vec3, position: Vec3) -> Vec3 {
    error + UNIT_ROUNDOFF * position.abs()
}

/// The normal on the side of another one.
#[inline(always)]
pub fn facing(normal: Vec3, side: Vec3) -> Vec3 {
    if normal.dot(side) < 0.0 { -normal } else { normal }
}

/// The vector's direction; any unit vector where it has none.
#[inline(always)]
pub fn unit(v: Vec3) -> Vec3 {
    v.normalize_or(Vec3::Z)
}
