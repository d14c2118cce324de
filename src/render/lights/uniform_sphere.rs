//! Uniform sampling of directions over the unit sphere.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::render::disk::sin_cos_of_turns;

/// Density per solid angle of [`sample_uniform_sphere`].
pub const UNIFORM_SPHERE_PDF: f32 = 1.0 / (4.0 * PI);

/// Maps `u` in [0, 1)² to a unit direction.
#[inline(always)]
pub fn sample_uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let (sin, cos) = sin_cos_of_turns(u.y);
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * cos, r * sin, z)
}
