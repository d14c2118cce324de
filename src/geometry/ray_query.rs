//! A query for the hits along one ray, with the alpha test: a surface of opacity α is hit with
//! probability α.

use glam::Vec2;

use super::{Hit, Ray, mesh};
use crate::hash::hash;
use crate::scene::texture::TexturePoint;
use crate::scene::{Scene, Shape};

/// A query for the nearest or any hit along one ray, through all objects.
pub struct RayQuery<'a> {
    pub scene: &'a Scene,
    /// Whether some primitive has an alpha texture.
    pub has_alpha: bool,
    /// In render space.
    pub ray: &'a Ray,
    /// Whether the first hit found ends the query.
    pub any_hit: bool,
    /// The nearest hit so far.
    pub hit: Option<Hit>,
}

impl RayQuery<'_> {
    /// Whether no further search is needed.
    #[inline(always)]
    pub fn is_settled(&self) -> bool {
        self.any_hit && self.hit.is_some()
    }

    /// Stores a candidate that is nearer than `hit`, unless it is cut out; returns whether it was
    /// stored. `uv` is called only for spheres and disks with an alpha texture.
    #[inline]
    pub fn accept(&mut self, candidate: Hit, uv: impl FnOnce() -> Vec2) -> bool {
        if self.has_alpha && self.is_cut_out(&candidate, uv) {
            return false;
        }
        self.hit = Some(candidate);
        true
    }

    fn is_cut_out(&self, candidate: &Hit, uv: impl FnOnce() -> Vec2) -> bool {
        let primitive = &self.scene.primitives[candidate.primitive as usize];
        let Some(alpha) = primitive.alpha else { return false };
        let uv = match &primitive.shape {
            Shape::Mesh(mesh) => mesh::uv(mesh, candidate.element, candidate.barycentric),
            Shape::Sphere(_) | Shape::Disk(_) => uv(),
        };
        let position = self.ray.origin + candidate.t * self.ray.direction;
        let opacity = self.scene.textures.float(alpha, TexturePoint { uv, position });
        opacity < 1.0 && hash_float(self.ray, candidate) >= opacity
    }
}

/// A random number in [0, 1) that is a function of the ray and the hit alone (pbrt-v4's `HashFloat`).
fn hash_float(ray: &Ray, hit: &Hit) -> f32 {
    let words = ray.origin.to_array().into_iter().chain(ray.direction.to_array()).map(f32::to_bits);
    let surface = [hit.primitive, hit.element, hit.instance, hit.t.to_bits()];
    let bits = words.chain(surface).fold(0u64, |state, word| hash(state ^ word as u64));
    // An f32 holds 24 bits exactly.
    (bits >> 40) as f32 / (1u32 << 24) as f32
}
