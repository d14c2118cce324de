//! Samples points on emissive shapes, and computes the densities of these samples.
//!
//! Triangles, disks and partial spheres are sampled uniformly by area, full spheres seen from outside
//! uniformly in the cone of directions that they fill (pbrt-v4, sections 6.2.4, 6.3.4 and 6.5.4).
//! Shapes are sampled in their own space; the Jacobian of the transform converts the densities, so
//! every affine transform is supported.

#[cfg(test)]
mod tests;

use glam::{DAffine3, Vec2, Vec3};

use super::area::{area_density, area_to_solid_angle};
use super::cone::Cone;
use super::disk::DiskExtent;
use super::local_interaction::{Detail, LocalInteraction};
use super::shape_sample::ShapeSample;
use super::sphere::SphereExtent;
use super::surface_interaction::SurfaceInteraction;
use super::triangle_sampler::TriangleSampler;
use crate::scene::{Primitive, Scene, Shape};

/// Samples a point on a primitive's element, as seen from `reference`, with `u` in [0, 1)².
///
/// The primitive must belong to the static object. `None` if the element has no area, or is seen
/// edge-on.
pub fn sample_shape(
    scene: &Scene,
    primitive: u32,
    element: u32,
    reference: Vec3,
    u: Vec2,
) -> Option<ShapeSample> {
    // Sample a point in the shape's space, and transform it
    let owner = &scene.primitives[primitive as usize];
    let (point, cone_pdf) = match &owner.shape {
        Shape::Mesh(mesh) => {
            return TriangleSampler::new(mesh, element, owner.flip_normal).sample(reference, u);
        }
        Shape::Sphere(sphere) => {
            let extent = SphereExtent::new(sphere);
            let cone = Cone::new(sphere, reference);
            let p = match &cone {
                Some(cone) => cone.sample(u.as_dvec2()),
                None => extent.sample(u.as_dvec2()),
            };
            let point = in_object(owner, &sphere.to_object, extent.interaction(p, Detail::All));
            let pdf = cone.map(|cone| cone.pdf(point.position - reference.as_dvec3()));
            (point, pdf)
        }
        Shape::Disk(disk) => {
            let extent = DiskExtent::new(disk);
            let p = extent.sample(u.as_dvec2());
            (in_object(owner, &disk.to_object, extent.interaction(p, Detail::All)), None)
        }
    };

    // Compute the density with respect to solid angle
    let density = cone_pdf.unwrap_or_else(|| {
        let normal = point.geometric_normal.as_dvec3();
        area_density(owner, element, normal)
            * area_to_solid_angle(point.position - reference.as_dvec3(), normal)
    });
    let point = point.rounded(primitive, element);
    let pdf = density as f32;
    (pdf > 0.0 && pdf.is_finite()).then_some(ShapeSample {
        position: point.position,
        position_error: point.position_error,
        normal: point.geometric_normal,
        uv: point.uv,
        pdf,
    })
}

/// Density with respect to solid angle with which [`sample_shape`] samples the direction from
/// `reference` to `surface`, a point of that element; 0 if it never does.
pub fn pdf_shape(
    scene: &Scene,
    primitive: u32,
    element: u32,
    reference: Vec3,
    surface: &SurfaceInteraction,
) -> f32 {
    let owner = &scene.primitives[primitive as usize];
    let to_surface = surface.position.as_dvec3() - reference.as_dvec3();
    let cone = match &owner.shape {
        Shape::Sphere(sphere) => Cone::new(sphere, reference),
        Shape::Mesh(_) | Shape::Disk(_) => None,
    };
    let density = match cone {
        Some(cone) => cone.pdf(to_surface),
        None => {
            let normal = surface.geometric_normal.as_dvec3();
            area_density(owner, element, normal) * area_to_solid_angle(to_surface, normal)
        }
    };
    let pdf = density as f32;
    if pdf.is_finite() { pdf } else { 0.0 }
}

/// Transforms an interaction from the shape's to the object's space.
fn in_object(owner: &Primitive, to_object: &DAffine3, local: LocalInteraction) -> LocalInteraction {
    let interaction = local.transformed(to_object, &to_object.inverse());
    if owner.flip_normal { interaction.flipped() } else { interaction }
}
