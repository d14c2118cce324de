//! Stand-in for shape sampling.

use glam::{Vec2, Vec3};

use super::SurfacePoint;
use crate::scene::Scene;

pub struct ShapeSample {
    pub position: Vec3,
    pub position_error: Vec3,
    pub normal: Vec3,
    pub uv: Vec2,
    pub pdf: f32,
}

pub fn sample_shape(_: &Scene, _: u32, _: u32, _: Vec3, _: Vec2) -> Option<ShapeSample> {
    todo!()
}

pub fn pdf_shape(_: &Scene, _: u32, _: u32, _: Vec3, _: &SurfacePoint) -> f32 {
    todo!()
}

pub fn area(_: &Scene, _: u32, _: u32) -> f32 {
    todo!()
}
