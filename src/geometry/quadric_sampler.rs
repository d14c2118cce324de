//! Samples points on emissive spheres and disks (pbrt-v4, sections 6.2.4 and 6.3.4), in double precision.

use glam::{DVec3, Vec2, Vec3};

use super::area::area_stretch;
use super::cone::Cone;
use super::local_interaction::Detail;
use super::quadric::{Extent, Quadric};
use super::shape_sample::ShapeSample;
use super::surface_interaction::SurfaceInteraction;
use crate::scene::Primitive;

/// A sphere or disk of the static object, ready to be sampled.
#[derive(Clone, Debug)]
pub struct QuadricSampler {
    quadric: Quadric,
    flip_normal: bool,
    detail: Detail,
    /// Area in the shape's own space; in render space for a disk, whose transform stretches it alike everywhere.
    area: f64,
}

impl QuadricSampler {
    /// The shape of the primitive at `index`; `None` if it is no sphere or disk, or not finite.
    pub fn new(owner: &Primitive, index: u32, detail: Detail) -> Option<Self> {
        let (quadric, _) = Quadric::new(index, &owner.shape)?;
        let area = match quadric.extent {
            Extent::Sphere(sphere) => sphere.area(),
            Extent::Disk(disk) => disk.area() * area_stretch(&quadric.to_object, DVec3::Z),
        };
        Some(Self { quadric, flip_normal: owner.flip_normal, detail, area })
    }

    /// As [`ShapeSampler::sample`](super::ShapeSampler::sample).
    pub fn sample(&self, reference: Vec3, u: Vec2) -> Option<ShapeSample> {
        // Sample a point in the shape's space, and transform it
        let (u, cone) = (u.as_dvec2(), self.cone(reference));
        let p = match (&self.quadric.extent, &cone) {
            (_, Some(cone)) => cone.sample(u),
            (Extent::Sphere(sphere), None) => sphere.sample(u),
            (Extent::Disk(disk), None) => disk.sample(u),
        };
        let point = self.quadric.interaction_at(p, self.flip_normal, self.detail);

        // Compute the density with respect to solid angle
        let to_point = point.position - reference.as_dvec3();
        let density = cone.map_or_else(
            || self.density_by_area(to_point, point.geometric_normal.as_dvec3()),
            |cone| cone.pdf(to_point),
        );
        let point = point.rounded(self.quadric.primitive, 0);
        let pdf = density as f32;
        (pdf > 0.0 && pdf.is_finite()).then_some(ShapeSample {
            position: point.position,
            position_error: point.position_error,
            normal: point.geometric_normal,
            uv: point.uv,
            pdf,
        })
    }

    /// As [`ShapeSampler::pdf`](super::ShapeSampler::pdf).
    pub fn pdf(&self, reference: Vec3, surface: &SurfaceInteraction) -> f32 {
        let to_surface = surface.position.as_dvec3() - reference.as_dvec3();
        let density = match self.cone(reference) {
            Some(cone) if cone.reaches(to_surface) => cone.pdf(to_surface),
            Some(_) => 0.0,
            None => self.density_by_area(to_surface, surface.geometric_normal.as_dvec3()),
        };
        let pdf = density as f32;
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// The cone that a full sphere fills, seen from outside.
    fn cone(&self, reference: Vec3) -> Option<Cone> {
        Cone::new(&self.quadric.sphere()?, reference)
    }

    /// Density with respect to solid angle of sampling uniformly by area in the shape's own space.
    fn density_by_area(&self, to_point: DVec3, normal: DVec3) -> f64 {
        let area = match self.quadric.extent {
            Extent::Disk(_) => self.area,
            Extent::Sphere(_) => {
                // The transpose of the linear part transforms normals back to the sphere's space.
                let to_object = &self.quadric.to_object;
                let own_normal = (to_object.matrix3.transpose() * normal).normalize_or_zero();
                self.area * area_stretch(to_object, own_normal)
            }
        };
        let squared = to_point.length_squared();
        squared * squared.sqrt() / to_point.dot(normal).abs() / area
    }
}
