//! Acceleration structure and intersection: instances, motion, robust offsets.
//!
//! Knows nothing of shading; the one thing it asks of the scene beyond shapes is the alpha
//! texture of cut-out surfaces.

mod bvh;
mod disk;
mod instances;
mod kernels;
mod local;
mod mesh;
mod object;
mod query;
mod rounding;
mod sampling;
mod sphere;
mod surface;
#[cfg(test)]
mod test_scenes;
mod traverse;
mod triangle;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::scene::Scene;
use instances::{InstanceAccel, search_instances};
use object::{ObjectAccel, search};
use query::Query;
pub use sampling::{ShapeSample, area, pdf_shape, sample_shape};
use traverse::TraversalRay;

/// A ray in render space.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: Vec3,
    /// Need not be normalised; distances are in units of its length.
    pub direction: Vec3,
    /// Hits at this distance or farther do not count.
    pub t_max: f32,
    /// Scene time, for moving instances.
    pub time: f32,
}

/// The nearest intersection of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    pub t: f32,
    /// Index into [`Scene::primitives`].
    pub primitive: u32,
    /// Triangle of a mesh; 0 for other shapes.
    pub element: u32,
    /// Index into [`Scene::instances`], or [`Hit::STATIC`].
    pub instance: u32,
    /// Barycentric coordinates of vertices 1 and 2, for triangles.
    pub barycentric: Vec2,
}

impl Hit {
    /// `instance` of what belongs to the static object.
    pub const STATIC: u32 = u32::MAX;
}

/// Everything shading needs to know of a point on a surface, in render space.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    pub position: Vec3,
    /// Bound on the absolute error of `position`, per axis (pbrt-v4, section 6.8).
    pub position_error: Vec3,
    /// Unit geometric normal: the side that an area light emits from. Not turned to the viewer.
    pub geometric_normal: Vec3,
    /// Unit interpolated normal, in the hemisphere of `geometric_normal`.
    pub shading_normal: Vec3,
    /// ∂p/∂u, perpendicular to nothing in particular; never zero.
    pub dpdu: Vec3,
    /// ∂p/∂v.
    pub dpdv: Vec3,
    pub uv: Vec2,
    /// Index into [`Scene::primitives`].
    pub primitive: u32,
    pub element: u32,
}

impl SurfacePoint {
    /// Origin for a ray that leaves in direction `w`, moved off the surface by the error bound.
    pub fn offset_origin(&self, w: Vec3) -> Vec3 {
        rounding::offset_origin(self.position, self.position_error, self.geometric_normal, w)
    }
}

/// The acceleration structure over a scene.
pub struct Accel<'s> {
    scene: &'s Scene,
    /// As the scene's.
    objects: Vec<ObjectAccel>,
    instances: InstanceAccel,
}

impl<'s> Accel<'s> {
    /// Builds it, on rayon's current pool. Triangles without area and whatever is not finite are
    /// left out.
    pub fn build(scene: &'s Scene) -> Self {
        let objects: Vec<_> =
            scene.objects.par_iter().map(|object| ObjectAccel::build(scene, object)).collect();
        let instances = InstanceAccel::build(scene, &objects);
        Self { scene, objects, instances }
    }

    /// The nearest hit that is not cut out by alpha.
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.find(ray, false)
    }

    /// Whether anything lies between the ray's origin and `t_max`.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.find(ray, true).is_some()
    }

    fn find(&self, ray: &Ray, any: bool) -> Option<Hit> {
        let mut walk = TraversalRay::new(ray.origin, ray.direction, ray.t_max)?;
        let mut query = Query { scene: self.scene, ray, any, hit: None };
        if let Some(fixed) = self.objects.first() {
            search(fixed, Hit::STATIC, &mut walk, &mut query);
        }
        if !self.instances.is_empty() && !(any && query.hit.is_some()) {
            search_instances(&self.instances, &self.objects, &mut walk, &mut query);
        }
        query.hit
    }

    /// The point of a hit.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        surface::surface_point(self.scene, ray, hit)
    }

    /// Smallest box around everything at any time of the shutter, in render space;
    /// `None` if the scene has no geometry.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let fixed = self.objects.first().and_then(ObjectAccel::bounds);
        let all = fixed.map_or(self.instances.bounds(), |bounds| bounds.union(&self.instances.bounds()));
        all.valid().then(|| (all.min.into(), all.max.into()))
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.instances.memory_bytes() + self.objects.iter().map(ObjectAccel::memory_bytes).sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::test_scenes::{Numbers, closed_sphere_mesh, mesh_of, ray, scene_of, sphere};
    use super::*;
    use crate::scene::Shape;

    #[test]
    fn the_nearest_of_random_triangles_is_found() {
        let mut numbers = Numbers::new(1);
        let triangles: Vec<_> = (0..500)
            .map(|_| {
                let centre = numbers.in_cube(10.0);
                [centre + numbers.in_cube(2.0), centre + numbers.in_cube(2.0), centre + numbers.in_cube(2.0)]
            })
            .collect();
        // Once as one mesh, and once each alone.
        let together = scene_of(vec![Shape::Mesh(mesh_of(&triangles))]);
        let accel = Accel::build(&together);
        let alone: Vec<_> = triangles.iter().map(|t| scene_of(vec![Shape::Mesh(mesh_of(&[*t]))])).collect();
        let each: Vec<_> = alone.iter().map(Accel::build).collect();
        let mut hits = 0;
        for _ in 0..1000 {
            let ray = ray(numbers.in_cube(12.0), numbers.direction());
            let expected = each
                .iter()
                .enumerate()
                .filter_map(|(index, accel)| accel.intersect(&ray).map(|hit| (index, hit.t)))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let found = accel.intersect(&ray).map(|hit| (hit.element as usize, hit.t));
            assert_eq!(found, expected);
            assert_eq!(accel.occluded(&ray), expected.is_some());
            hits += expected.is_some() as u32;
        }
        assert!(hits > 200, "{hits}");
    }

    #[test]
    fn the_nearest_of_random_spheres_is_found() {
        let mut numbers = Numbers::new(2);
        let balls: Vec<_> = (0..200).map(|_| (numbers.in_cube(10.0), 0.2 + numbers.next())).collect();
        let scene = scene_of(balls.iter().map(|&(centre, radius)| sphere(centre, radius)).collect());
        let accel = Accel::build(&scene);
        for _ in 0..1000 {
            let ray = ray(numbers.in_cube(12.0), numbers.direction());
            let expected = balls
                .iter()
                .enumerate()
                .filter_map(|(index, &(centre, radius))| {
                    let to_centre = (ray.origin - centre).as_dvec3();
                    let direction = ray.direction.as_dvec3();
                    let b = to_centre.dot(direction);
                    let c = to_centre.length_squared() - (radius as f64).powi(2);
                    let root = (b * b - c * direction.length_squared()).sqrt();
                    let a = direction.length_squared();
                    let t = [(-b - root) / a, (-b + root) / a].into_iter().find(|&t| t > 0.0)?;
                    Some((index as u32, t))
                })
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let found = accel.intersect(&ray);
            assert_eq!(found.map(|hit| hit.primitive), expected.map(|(index, _)| index));
            if let (Some(hit), Some((_, t))) = (found, expected) {
                assert!((hit.t as f64 - t).abs() < 1e-5 * t.max(1.0));
            }
        }
    }

    /// Rays from inside, at every vertex and at points of every edge.
    #[test]
    fn no_ray_leaves_a_closed_mesh_through_edges_or_vertices() {
        for (offset, scale) in [(0.0, 1.0), (50.0, 1.0), (1e6, 100.0), (0.0, 1e-3), (0.0, 1e3)] {
            let mesh = closed_sphere_mesh(Vec3::splat(offset), scale, 12, 24);
            let scene = scene_of(vec![Shape::Mesh(mesh.clone())]);
            let accel = Accel::build(&scene);
            let mut numbers = Numbers::new(3);
            for corners in &mesh.indices {
                let [a, b, c] = corners.map(|index| mesh.positions[index as usize]);
                for target in [a, b, c, a.midpoint(b), b.midpoint(c), a.lerp(c, 0.3)] {
                    let origin = Vec3::splat(offset) + scale * numbers.in_cube(0.4);
                    let ray = ray(origin, target - origin);
                    assert!(accel.intersect(&ray).is_some(), "{ray:?}");
                    assert!(accel.occluded(&ray), "{ray:?}");
                }
            }
        }
    }
}
