//! The acceleration structure over a scene, and the queries that it answers.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::brute_force::BruteForce;
use super::instances::InstanceAccel;
use super::lanes::{HitLanes, InteractionLanes, RayLanes};
use super::local_interaction::Detail;
use super::object::ObjectAccel;
use super::search::SceneBvh;
use super::{Hit, Ray, SurfaceInteraction, interaction, interaction_lanes, mesh};
use crate::scene::{Scene, Shape};
use crate::simd::LANES;

/// The acceleration structure over a scene.
pub struct Accel<'s> {
    bvh: SceneBvh<'s>,
    /// All surfaces once more, if they are few enough to be tested without a hierarchy.
    pub(super) brute_force: Option<BruteForce>,
}

impl<'s> Accel<'s> {
    /// Builds the structure, on rayon's current pool. Triangles without area and shapes that are
    /// not finite are left out.
    pub fn build(scene: &'s Scene) -> Self {
        let objects: Vec<_> =
            scene.objects.par_iter().map(|object| ObjectAccel::build(scene, object)).collect();
        let instances = InstanceAccel::build(scene, &objects);
        let has_alpha = scene.primitives.iter().any(|primitive| primitive.alpha.is_some());
        let only_object = objects.first().filter(|_| instances.is_empty() && !has_alpha);
        let brute_force = only_object.and_then(BruteForce::new);
        Self { bvh: SceneBvh { scene, objects, instances, has_alpha }, brute_force }
    }

    /// The nearest hit that is not cut out by alpha.
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut hit = None;
        self.bvh.search(std::iter::once(*ray), false, |found| hit = found);
        hit
    }

    /// [`Self::intersect`] for many rays, which is faster than one by one: calls `found` with the
    /// hit of each, in their order.
    #[inline]
    pub fn intersect_all(&self, mut rays: impl Iterator<Item = Ray>, mut found: impl FnMut(Option<Hit>)) {
        if self.brute_force.is_none() {
            return self.bvh.search(rays, false, found);
        }
        let (mut packet, mut hits) = (RayLanes::NONE, HitLanes::NONE);
        loop {
            let mut count = 0;
            for (lane, ray) in rays.by_ref().take(LANES).enumerate() {
                packet.set(lane, ray);
                count += 1;
            }
            if count == 0 {
                return;
            }
            self.intersect_lanes(&packet, count, &mut hits);
            (0..count).for_each(|lane| found(hits.at(lane)));
        }
    }

    /// [`Self::intersect`] for the rays of the first `count` lanes.
    #[inline]
    pub fn intersect_lanes(&self, rays: &RayLanes, count: usize, hits: &mut HitLanes) {
        if let Some(brute_force) = &self.brute_force {
            return brute_force.intersect(rays, count, |ray| self.intersect(ray), hits);
        }
        let mut lanes = 0..count;
        self.bvh.search((0..count).map(|lane| rays.at(lane)), false, |hit| {
            lanes.by_ref().take(1).for_each(|lane| hits.set(lane, hit));
        });
    }

    /// Whether anything lies between the ray's origin and `t_max`.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut hit = None;
        self.bvh.search(std::iter::once(*ray), true, |found| hit = found);
        hit.is_some()
    }

    /// [`Self::occluded`] for many rays, as [`Self::intersect_all`].
    #[inline]
    pub fn occluded_all(&self, rays: impl Iterator<Item = Ray>, mut found: impl FnMut(bool)) {
        match &self.brute_force {
            Some(_) => self.intersect_all(rays, |hit| found(hit.is_some())),
            None => self.bvh.search(rays, true, |hit| found(hit.is_some())),
        }
    }

    /// [`Self::occluded`] for the rays of the first `count` lanes: the mask of the occluded ones.
    #[inline]
    pub fn occluded_lanes(&self, rays: &RayLanes, count: usize) -> u32 {
        if let Some(brute_force) = &self.brute_force {
            return brute_force.occluded(rays, count, |ray| self.occluded(ray));
        }
        let (mut mask, mut lane) = (0, 0);
        self.occluded_all((0..count).map(|lane| rays.at(lane)), |occluded| {
            mask |= u32::from(occluded) << lane;
            lane += 1;
        });
        mask
    }

    /// The surface at a hit.
    #[inline]
    pub fn interaction(&self, ray: &Ray, hit: &Hit) -> SurfaceInteraction {
        interaction::interaction(self.bvh.scene, &self.bvh.objects, ray, hit, Detail::All)
    }

    /// The surface at a hit without its parametrisation, which takes half of the work: texture
    /// coordinates are 0 except on surfaces that emit an image, and tangents are an arbitrary pair
    /// perpendicular to the normal.
    #[inline]
    pub fn minimal_interaction(&self, ray: &Ray, hit: &Hit) -> SurfaceInteraction {
        interaction::interaction(self.bvh.scene, &self.bvh.objects, ray, hit, Detail::Minimal)
    }

    /// [`Self::minimal_interaction`] for the lanes of a mask.
    #[inline]
    pub fn minimal_interactions(
        &self,
        rays: &RayLanes,
        hits: &HitLanes,
        mask: u32,
        interactions: &mut InteractionLanes,
    ) {
        let SceneBvh { scene, objects, .. } = &self.bvh;
        interaction_lanes::minimal_interactions(scene, objects, rays, hits, mask, interactions);
    }

    /// Texture coordinates of a hit on a triangle of a mesh; 0 on other shapes.
    #[inline]
    pub fn triangle_uv(&self, hit: &Hit) -> Vec2 {
        match &self.bvh.scene.primitives[hit.primitive as usize].shape {
            Shape::Mesh(mesh) => mesh::uv(mesh, hit.element, hit.barycentric),
            Shape::Sphere(_) | Shape::Disk(_) => Vec2::ZERO,
        }
    }

    /// Minimum and maximum corner of a box in render space that holds all surfaces at all times of the shutter, and is larger than the
    /// smallest one by rounding only; `None` if the scene has no geometry.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let instances = self.bvh.instances.bounds();
        let static_object = self.bvh.objects.first().and_then(ObjectAccel::bounds);
        let all = static_object.map_or(instances, |bounds| bounds.union(&instances));
        all.valid().then(|| (all.min.into(), all.max.into()))
    }

    /// Memory of the structure in bytes.
    pub fn memory_bytes(&self) -> usize {
        let objects = self.bvh.objects.iter().map(ObjectAccel::memory_bytes).sum::<usize>();
        self.bvh.instances.memory_bytes() + objects
    }
}

#[cfg(test)]
impl<'s> Accel<'s> {
    /// The hierarchy, for tests that compare other searches with it.
    pub fn bvh(&self) -> &SceneBvh<'s> {
        &self.bvh
    }
}
