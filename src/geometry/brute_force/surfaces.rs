//! Triangles and spheres, as the brute-force tests read them.

use glam::{DAffine3, DVec3, Vec3};

/// A triangle.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    pub corners: [Vec3; 3],
    /// Largest magnitude of a coordinate.
    pub size: f32,
}

/// A full sphere with its transform.
#[derive(Clone, Copy, Debug)]
pub struct FullSphere {
    pub to_shape: DAffine3,
    pub radius: f64,
    /// Centre and radius of a bounding sphere in render space.
    pub centre: Vec3,
    pub bounding_radius: f32,
}

impl Triangle {
    #[inline]
    pub fn new(corners: [Vec3; 3]) -> Self {
        let size = corners.iter().fold(0.0, |size, corner| corner.abs().max_element().max(size));
        Self { corners, size }
    }
}

impl FullSphere {
    pub fn new(to_shape: DAffine3, radius: f64) -> Self {
        let to_render = to_shape.inverse();
        // The matrix A stretches no vector by more than the root of the largest eigenvalue of AᵀA, which
        // is at most the largest sum of magnitudes in a row of AᵀA (Gershgorin).
        let [x, y, z] = [to_render.matrix3.x_axis, to_render.matrix3.y_axis, to_render.matrix3.z_axis];
        let row = |axis: DVec3| axis.dot(x).abs() + axis.dot(y).abs() + axis.dot(z).abs();
        let bounding_radius = radius * row(x).max(row(y)).max(row(z)).sqrt();
        Self {
            to_shape,
            radius,
            centre: to_render.translation.as_vec3(),
            bounding_radius: bounding_radius as f32,
        }
    }
}
