//! Samples points on emissive shapes, and computes the densities of these samples.
//!
//! Triangles, disks and partial spheres are sampled uniformly by area, full spheres seen from outside
//! uniformly in the cone of directions that they fill (pbrt-v4, sections 6.2.4, 6.3.4 and 6.5.4).
//! Shapes are sampled in their own space; the Jacobian of the transform converts the densities, so
//! every affine transform is supported.

#[cfg(test)]
mod tests;

use glam::{Vec2, Vec3};

use super::local_interaction::Detail;
use super::quadric_sampler::QuadricSampler;
use super::shape_sample::ShapeSample;
use super::surface_interaction::SurfaceInteraction;
use super::triangle_sampler::TriangleSampler;
use crate::scene::{Primitive, Shape};

/// An element of a shape of the static object, ready to be sampled.
#[derive(Clone, Debug)]
pub enum ShapeSampler {
    Triangle(TriangleSampler),
    Quadric(QuadricSampler),
}

impl ShapeSampler {
    /// `index` is that of `owner` in the scene. Samples of spheres and disks have texture coordinates for
    /// [`Detail::All`] only. `None` for a shape that is not finite.
    pub fn new(owner: &Primitive, index: u32, element: u32, detail: Detail) -> Option<Self> {
        match &owner.shape {
            Shape::Mesh(mesh) => Some(Self::Triangle(TriangleSampler::new(mesh, element, owner.flip_normal))),
            Shape::Sphere(_) | Shape::Disk(_) => QuadricSampler::new(owner, index, detail).map(Self::Quadric),
        }
    }

    /// Samples a point as seen from `reference`, with `u` in [0, 1)²; `None` if the shape has no area, or is seen
    /// edge-on.
    #[inline]
    pub fn sample(&self, reference: Vec3, u: Vec2) -> Option<ShapeSample> {
        match self {
            Self::Triangle(triangle) => triangle.sample(reference, u),
            Self::Quadric(quadric) => quadric.sample(reference, u),
        }
    }

    /// Density with respect to solid angle with which [`Self::sample`] samples `surface`, a point of the shape, as seen from
    /// `reference`; 0 if it never does.
    #[inline]
    pub fn pdf(&self, reference: Vec3, surface: &SurfaceInteraction) -> f32 {
        match self {
            Self::Triangle(triangle) => triangle.pdf(reference, surface.position),
            Self::Quadric(quadric) => quadric.pdf(reference, surface),
        }
    }

    /// The triangle, or the parallelogram of two.
    #[inline]
    pub fn triangle(&self) -> Option<&TriangleSampler> {
        match self {
            Self::Triangle(triangle) => Some(triangle),
            Self::Quadric(_) => None,
        }
    }
}
