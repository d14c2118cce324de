//! A sampled point on a shape.

use glam::{Vec2, Vec3};

use super::rounding;

/// A sampled point on a shape (pbrt-v4's `ShapeSample`), in render space.
#[derive(Clone, Copy, Debug)]
pub struct ShapeSample {
    pub position: Vec3,
    /// As [`SurfaceInteraction::position_error`](super::SurfaceInteraction::position_error).
    pub position_error: Vec3,
    /// As [`SurfaceInteraction::geometric_normal`](super::SurfaceInteraction::geometric_normal).
    pub normal: Vec3,
    pub uv: Vec2,
    /// Density with respect to solid angle at the reference point; positive and finite.
    pub pdf: f32,
}

impl ShapeSample {
    /// As [`SurfaceInteraction::offset_origin`](super::SurfaceInteraction::offset_origin).
    pub fn offset_origin(&self, w: Vec3) -> Vec3 {
        rounding::offset_origin(self.position, self.position_error, self.normal, w)
    }
}
