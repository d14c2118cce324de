//! A ray.

use glam::Vec3;

/// A ray in render space.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: Vec3,
    /// Of any length; distances are in units of that length.
    pub direction: Vec3,
    /// Only hits nearer than this distance count.
    pub t_max: f32,
    /// Scene time, at which moving instances are placed.
    pub time: f32,
}
