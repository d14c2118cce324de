//! The local frame of scattering: z along the shading normal, x along ∂p/∂u.

use glam::Vec3;

/// An orthonormal, right-handed frame in render space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ShadingFrame {
    x: Vec3,
    y: Vec3,
    pub z: Vec3,
}

impl ShadingFrame {
    /// A frame with z along the unit `normal` and x along the projection of `tangent` onto the surface, or along
    /// an arbitrary tangent if `tangent` is parallel to the normal.
    pub fn new(normal: Vec3, tangent: Vec3) -> Self {
        let x = (tangent - normal * normal.dot(tangent))
            .try_normalize()
            .unwrap_or_else(|| normal.any_orthonormal_vector());
        Self { x, y: normal.cross(x), z: normal }
    }

    /// A frame with z along the unit `normal` and an arbitrary x. Branchless, for SIMD.
    #[inline(always)]
    pub fn from_normal(normal: Vec3) -> Self {
        let (x, y) = normal.any_orthonormal_pair();
        Self { x, y, z: normal }
    }

    #[inline(always)]
    pub fn to_local(self, w: Vec3) -> Vec3 {
        Vec3::new(w.dot(self.x), w.dot(self.y), w.dot(self.z))
    }

    #[inline(always)]
    pub fn to_render(self, w: Vec3) -> Vec3 {
        self.x * w.x + self.y * w.y + self.z * w.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_change_of_frame_is_invertible() {
        let frame = ShadingFrame::new(Vec3::new(1.0, 2.0, -0.5).normalize(), Vec3::new(3.0, 0.1, 0.2));
        let w = Vec3::new(-0.3, 0.4, 0.7).normalize();
        assert!((frame.to_render(frame.to_local(w)) - w).length() < 1e-6);
        assert!((frame.to_local(frame.z) - Vec3::Z).length() < 1e-6);
    }

    #[test]
    fn a_tangent_along_the_normal_gives_a_valid_frame() {
        let frame = ShadingFrame::new(Vec3::Y, Vec3::Y * 4.0);
        let w = frame.to_local(Vec3::X);
        assert!((w.length() - 1.0).abs() < 1e-6 && w.z.abs() < 1e-6);
    }
}
