//! Area lights that are sampled in SIMD: a triangle, or a parallelogram of two, of constant radiance and
//! opacity.

use glam::{Vec2, Vec3};

use crate::geometry::{TriangleSampler, offset_origin};

/// A triangle or a parallelogram of constant radiance.
pub struct UniformTriangleLight<'l> {
    pub shape: &'l TriangleSampler,
    pub radiance: Vec3,
    pub two_sided: bool,
    pub can_be_hit: bool,
}

/// A point of a [`UniformTriangleLight`] as seen from a reference point.
pub struct TrianglePointSample {
    /// Unit direction towards the point.
    pub wi: Vec3,
    /// Density per solid angle; 0 on the side that does not emit.
    pub pdf: f32,
    /// Where the shadow ray ends.
    pub target: Vec3,
}

/// Samples a point of a triangle light. Branchless, so that the compiler vectorises loops over reference points.
#[inline(always)]
pub fn sample_triangle_point(
    shape: &TriangleSampler,
    two_sided: bool,
    reference: Vec3,
    u: Vec2,
) -> TrianglePointSample {
    let position = shape.point(u).0;
    let wi = (position - reference).normalize_or_zero();
    let (normal, error) = (shape.normal(), shape.position_error());
    let emits = two_sided | (normal.dot(-wi) > 0.0);
    let pdf = shape.pdf(reference, position);
    let target = offset_origin(position, error, normal, -wi);
    TrianglePointSample { wi, pdf: if emits { pdf } else { 0.0 }, target }
}
