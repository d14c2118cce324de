//! Intersects rays with a scene of few surfaces without a hierarchy: sixteen rays at once, one in
//! each lane, with each surface in turn.
//!
//! In such a scene a ray would visit most leaves of a hierarchy anyway. Brute force saves the
//! traversal, and no lane is empty. The tests do the same operations in the same order as those of
//! the hierarchy and give the same bits (Woop, Benthin and Wald 2013 for triangles, double precision
//! for spheres). Rays through an edge or from close to a triangle need higher precision and are passed on to the hierarchy.

mod packet;
mod surfaces;
#[cfg(test)]
mod tests;

use super::lanes::{HitLanes, RayLanes};
use super::object::ObjectAccel;
use super::{Hit, Ray};
use crate::simd::{LANES, apply, lane_mask, lanes_in, multiversioned};
use packet::{NO_SURFACE, RayPacket};
use surfaces::{FullSphere, Triangle};

/// Largest number of triangles for which brute force is faster, a sphere counting as two triangles.
const MAX_TRIANGLES: usize = 48;

/// All surfaces of a scene that has few.
#[derive(Debug)]
pub struct BruteForce {
    triangles: Vec<Triangle>,
    spheres: Vec<FullSphere>,
    /// Primitive and element of each triangle, of each sphere, and of no surface.
    ids: Vec<(u32, u32)>,
}

impl BruteForce {
    /// The surfaces of `object`; `None` if they are too many, or are disks or partial spheres.
    pub fn new(object: &ObjectAccel) -> Option<Self> {
        let triangles: Vec<_> = object.triangles().map(|(corners, _, _)| Triangle::new(corners)).collect();
        let spheres: Vec<_> = object
            .quadrics()
            .iter()
            .map(|quadric| {
                let (to_shape, radius) = quadric.full_sphere()?;
                Some(FullSphere::new(to_shape, radius))
            })
            .collect::<Option<_>>()?;
        let ids = object.triangles().map(|(_, primitive, element)| (primitive, element));
        let quadrics = object.quadrics().iter().map(|quadric| quadric.primitive).zip(0..);
        let ids = ids.chain(quadrics).chain([(HitLanes::NO_HIT, 0)]).collect();
        (triangles.len() + 2 * spheres.len() <= MAX_TRIANGLES).then_some(Self { triangles, spheres, ids })
    }

    /// Finds the nearest hit of each of the first `count` rays. `search_bvh` searches the hierarchy,
    /// for rays that need its precision. Which ones do depends on the ray alone: of surfaces at the same distance the hierarchy may
    /// find another one.
    #[inline]
    pub fn intersect(
        &self,
        rays: &RayLanes,
        count: usize,
        search_bvh: impl Fn(&Ray) -> Option<Hit>,
        hits: &mut HitLanes,
    ) {
        let mut packet = RayPacket::new(rays, count);
        intersect_surfaces(self, &mut packet);
        let nearest = &packet.nearest;
        hits.t = nearest.t_max;
        hits.instance = [Hit::STATIC; LANES];
        hits.barycentric = nearest.barycentric;
        for lane in 0..count {
            let surface = (nearest.surface[lane] as usize).min(self.ids.len() - 1);
            (hits.primitive[lane], hits.element[lane]) = self.ids[surface];
        }
        for lane in lanes_in(nearest.undecided()).take_while(|&lane| lane < count) {
            hits.set(lane, search_bvh(&rays.at(lane)));
        }
    }

    /// The mask of those of the first `count` rays that hit a surface; `search_bvh` as for
    /// [`Self::intersect`].
    #[inline]
    pub fn occluded(&self, rays: &RayLanes, count: usize, search_bvh: impl Fn(&Ray) -> bool) -> u32 {
        let occluded_in_bvh = |lanes: u32| {
            let occluded = lanes_in(lanes).filter(|&lane| search_bvh(&rays.at(lane)));
            occluded.fold(0, |mask, lane| mask | 1 << lane)
        };
        let all = (1 << count) - 1;
        let mut packet = RayPacket::new(rays, count);
        intersect_surfaces(self, &mut packet);
        let undecided = all & packet.nearest.undecided();
        let occluded = lane_mask(|lane| packet.nearest.surface[lane] != NO_SURFACE);
        all & occluded & !undecided | occluded_in_bvh(undecided)
    }
}

/// Finds the nearest surface of each ray.
#[apply(multiversioned!)]
fn intersect_surfaces(surfaces: &BruteForce, packet: &mut RayPacket) {
    packet.prepare();
    let mut nearest = packet.nearest;
    let mut index = 0;
    for triangle in &surfaces.triangles {
        packet.intersect_triangle(&mut nearest, triangle, index);
        index += 1;
    }
    for sphere in &surfaces.spheres {
        if packet.may_hit(&nearest, sphere) {
            packet.intersect_sphere(&mut nearest, sphere, index);
        }
        index += 1;
    }
    nearest.normalise_barycentric(surfaces.triangles.len() as u32);
    packet.nearest = nearest;
}
