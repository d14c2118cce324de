//! Intersects rays with a scene, and samples points on its shapes.
//!
//! [`Accel::build`] takes a [`Scene`](crate::scene::Scene) and builds a two-level acceleration
//! structure: a hierarchy of instances above a hierarchy of each object's triangles, spheres and
//! disks. [`Accel::intersect`] takes a [`Ray`] and gives the nearest [`Hit`];
//! [`Accel::interaction`] turns that into a [`SurfaceInteraction`] with an error bound.
//! [`ShapeSampler`] samples emissive shapes.
//!
//! The room does not shade. Of a material it reads the alpha texture only.

mod accel;
mod area;
mod brute_force;
mod bvh;
mod cone;
mod disk;
mod hit;
mod instances;
mod interaction;
mod interaction_lanes;
mod kernels;
mod lanes;
#[cfg(test)]
mod large_shape_tests;
mod local_interaction;
mod mesh;
mod object;
mod quadric;
mod quadric_sampler;
mod ray;
mod ray_query;
mod rounding;
mod search;
mod shape_sample;
mod shape_sampler;
mod sphere;
mod stack;
mod surface_interaction;
#[cfg(test)]
mod test_scenes;
#[cfg(test)]
mod tests;
mod traversal_ray;
mod traverse;
mod triangle;
mod triangle_sampler;

pub use accel::Accel;
pub use area::area;
pub use hit::Hit;
pub use lanes::{HitLanes, InteractionLanes, RayLanes};
pub use local_interaction::{Detail, face_forward};
pub use ray::Ray;
pub use rounding::offset_origin;
pub use shape_sample::ShapeSample;
pub use shape_sampler::ShapeSampler;
pub use surface_interaction::SurfaceInteraction;
pub use triangle_sampler::TriangleSampler;
