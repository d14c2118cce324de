//! A surface interaction in the space of its shape or object, and its transform to render space.
//!
//! Positions are in double precision. Normals and tangents need single precision only, because no
//! cancellation follows.

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::SurfaceInteraction;
use super::rounding::{DOUBLE_ROUNDING, UNIT_ROUNDOFF, gamma};

/// A [`SurfaceInteraction`] before it is transformed to render space and rounded.
#[derive(Clone, Copy, Debug)]
pub struct LocalInteraction {
    pub position: DVec3,
    /// Bound on the absolute error of `position`, per axis.
    pub error: Vec3,
    /// Unit length.
    pub geometric_normal: Vec3,
    /// Interpolated normal of any length; `None` where it equals the geometric normal.
    pub shading_normal: Option<Vec3>,
    /// Present for [`Detail::All`].
    pub parametrisation: Option<Parametrisation>,
}

/// Texture coordinates, and the derivatives of position with respect to them.
#[derive(Clone, Copy, Debug)]
pub struct Parametrisation {
    pub uv: Vec2,
    pub dpdu: Vec3,
    pub dpdv: Vec3,
}

/// The parts of a surface interaction to compute (Mitsuba's `RayFlags`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// All but the parametrisation.
    Minimal,
    All,
}

impl Detail {
    /// Calls `value` for [`Self::All`].
    #[inline]
    pub fn then<T>(self, value: impl FnOnce() -> T) -> Option<T> {
        (self == Self::All).then(value)
    }
}

impl LocalInteraction {
    /// Transforms to another space; `inverse` is the inverse of `transform`.
    ///
    /// A ray spawned there is transformed back with a rounded origin, so the error bound covers a
    /// rounding in both spaces.
    #[inline(always)]
    pub fn transformed(self, transform: &DAffine3, inverse: &DAffine3) -> Self {
        let round_trip = self.error + gamma(1) * self.position.as_vec3().abs();
        let moved = self.moved(transform, inverse, round_trip);
        Self { error: moved.error + gamma(2) * moved.position.as_vec3().abs(), ..moved }
    }

    /// Transforms to another space, between which and this one rays are transformed in double precision.
    #[inline(always)]
    pub fn transformed_in_double(self, transform: &DAffine3, inverse: &DAffine3) -> Self {
        let round_trip = self.error + DOUBLE_ROUNDING * self.position.as_vec3().abs();
        let moved = self.moved(transform, inverse, round_trip);
        let terms = moved.position.as_vec3().abs() + transform.translation.as_vec3().abs();
        Self { error: moved.error + DOUBLE_ROUNDING * terms, ..moved }
    }

    /// Transforms to another space, with the bound `error` on the error of the position.
    #[inline(always)]
    fn moved(self, transform: &DAffine3, inverse: &DAffine3, error: Vec3) -> Self {
        let linear = transform.matrix3.as_mat3();
        let normal_matrix = inverse.matrix3.as_mat3().transpose();
        Self {
            position: transform.transform_point3(self.position),
            error: linear.abs() * error,
            geometric_normal: unit(normal_matrix * self.geometric_normal),
            shading_normal: self.shading_normal.map(|n| normal_matrix * n),
            parametrisation: self.parametrisation.map(|Parametrisation { uv, dpdu, dpdv }| Parametrisation {
                uv,
                dpdu: linear * dpdu,
                dpdv: linear * dpdv,
            }),
        }
    }

    /// Reverses the geometric normal.
    #[inline(always)]
    pub fn flipped(self) -> Self {
        Self { geometric_normal: -self.geometric_normal, ..self }
    }

    /// Rounds to single precision, turns the shading normal to the side of the geometric normal, and
    /// replaces tangents that span no plane.
    #[inline(always)]
    pub fn rounded(self, primitive: u32, element: u32) -> SurfaceInteraction {
        let geometric_normal = self.geometric_normal;
        let shading_normal = self.shading_normal.map_or(geometric_normal, unit);
        let Parametrisation { uv, dpdu, dpdv } =
            self.parametrisation.filter(Parametrisation::spans_a_plane).unwrap_or_else(|| {
                let (dpdu, dpdv) = geometric_normal.any_orthonormal_pair();
                let uv = self.parametrisation.map_or(Vec2::ZERO, |parametrisation| parametrisation.uv);
                Parametrisation { uv, dpdu, dpdv }
            });
        let position = self.position.as_vec3();
        SurfaceInteraction {
            position,
            position_error: with_rounding(self.error, position),
            geometric_normal,
            shading_normal: face_forward(shading_normal, geometric_normal),
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
        // Single precision could overflow or underflow.
        let area = self.dpdu.as_dvec3().cross(self.dpdv.as_dvec3()).length_squared();
        area > 0.0 && area.is_finite()
    }
}

/// Adds the rounding of `position` to single precision to a bound on its error.
#[inline(always)]
pub fn with_rounding(error: Vec3, position: Vec3) -> Vec3 {
    error + UNIT_ROUNDOFF * position.abs()
}

/// `normal` or its opposite, whichever is in the hemisphere of `reference` (pbrt-v4's `FaceForward`).
#[inline(always)]
pub fn face_forward(normal: Vec3, reference: Vec3) -> Vec3 {
    if normal.dot(reference) < 0.0 { -normal } else { normal }
}

/// The normalised vector; the z axis where `v` is zero or not finite.
#[inline(always)]
pub fn unit(v: Vec3) -> Vec3 {
    v.normalize_or(Vec3::Z)
}
