//! What a traversal looks for, and the decision whether a candidate counts: surfaces with an
//! opacity below one are hit with that probability.

use glam::Vec2;

use super::{Hit, Ray, mesh};
use crate::scene::texture::TexturePoint;
use crate::scene::{Scene, Shape};

/// A search along one ray, through all objects.
pub struct Query<'a> {
    pub scene: &'a Scene,
    /// Some primitive has an alpha texture.
    pub has_alpha: bool,
    /// In render space.
    pub ray: &'a Ray,
    /// Any hit will do.
    pub any: bool,
    /// The nearest so far.
    pub hit: Option<Hit>,
}

impl Query<'_> {
    /// Takes a candidate nearer than all before, unless it is cut out. `uv` is asked for only if
    /// there is an alpha texture, and not for triangles.
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
        opacity < 1.0 && uniform(self.ray, candidate) >= opacity
    }
}

/// A number in [0, 1) that depends on the ray and on the surface, and on nothing else.
fn uniform(ray: &Ray, hit: &Hit) -> f32 {
    let words = ray.origin.to_array().into_iter().chain(ray.direction.to_array()).map(f32::to_bits);
    let surface = [hit.primitive, hit.element, hit.instance, hit.t.to_bits()];
    let hash = words.chain(surface).fold(0u64, |state, word| mixed(state ^ word as u64));
    // The upper 24 bits are what an f32 holds exactly.
    (hash >> 40) as f32 / (1u32 << 24) as f32
}

/// Finaliser of SplitMix64 (Steele, Lea and Flood 2014), after its increment.
fn mixed(state: u64) -> u64 {
    let mut z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}
