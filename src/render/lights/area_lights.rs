//! Area lights: samples points of emissive triangles, spheres and disks, and evaluates their emission and the
//! densities of sampling.
//!
//! Each triangle of a mesh is a light of its own, except that two consecutive triangles that form a
//! parallelogram are one light. Source: pbrt-v4, section 12.4.

use std::ops::Range;

use glam::{Vec2, Vec3};

use super::element_bounds::ElementBounds;
use super::emission_bounds::average;
use super::light_bounds::LightBounds;
use super::light_sample::LightSample;
use super::uniform_triangle_light::UniformTriangleLight;
use crate::geometry::{Detail, ShapeSampler, SurfaceInteraction, TriangleSampler, area};
use crate::scene::texture::TexturePoint;
use crate::scene::{AreaLight, FloatTextureId, Scene, Shape, TriangleMesh};

/// The area lights of a scene, numbered by primitive, then by element.
pub struct AreaLights<'s> {
    scene: &'s Scene,
    emitters: Vec<Emitter>,
    /// For each primitive the index of its emitter, or [`NO_EMITTER`].
    emitter_of_primitive: Vec<u32>,
    /// For each element of each emitter the index of its light.
    light_of_element: Vec<u32>,
    lights: Vec<ElementLight>,
}

const NO_EMITTER: u32 = u32::MAX;

/// A light: one element of an emitter, or two triangles that form a parallelogram.
struct ElementLight {
    /// Index into [`AreaLights::emitters`].
    emitter: u32,
    elements: Range<u32>,
    /// `None` for a shape that is not finite.
    shape: Option<ShapeSampler>,
}

/// An emissive primitive.
struct Emitter {
    primitive: u32,
    /// Index of its first element in [`AreaLights::light_of_element`].
    first: usize,
    emission: AreaLight,
    /// Radiance averaged over the surface and the channels.
    mean_radiance: f32,
    /// Opacity, by which the emission is multiplied.
    alpha: Option<FloatTextureId>,
    /// The opacity is not 0 everywhere. As in pbrt-v4, an emitter of opacity 0 illuminates the scene without
    /// being visible, which scenes use to hide their lights.
    can_be_hit: bool,
}

impl<'s> AreaLights<'s> {
    pub fn new(scene: &'s Scene) -> Self {
        let mut lights = Self {
            scene,
            emitters: Vec::new(),
            emitter_of_primitive: Vec::new(),
            light_of_element: Vec::new(),
            lights: Vec::new(),
        };
        for (i, primitive) in (0..).zip(&scene.primitives) {
            let emission = primitive.area_light.filter(|light| light.radiance != Vec3::ZERO);
            let Some(emission) = emission else {
                lights.emitter_of_primitive.push(NO_EMITTER);
                continue;
            };
            let emitter = lights.emitters.len() as u32;
            let is_hidden = primitive.alpha.is_some_and(|id| scene.textures.constant_float(id) == Some(0.0));
            lights.emitter_of_primitive.push(emitter);
            lights.emitters.push(Emitter {
                primitive: i,
                first: lights.light_of_element.len(),
                emission,
                mean_radiance: average(emission.mean_radiance(&scene.textures)),
                alpha: primitive.alpha.filter(|_| !is_hidden),
                can_be_hit: !is_hidden,
            });
            match &primitive.shape {
                Shape::Mesh(mesh) => {
                    // Alpha textures and images need the texture coordinates of each triangle.
                    let merges = (primitive.alpha.is_none() || is_hidden) && emission.image.is_none();
                    lights.add_triangles(emitter, mesh, primitive.flip_normal, merges);
                }
                Shape::Sphere(_) | Shape::Disk(_) => {
                    let is_textured = primitive.alpha.is_some() || emission.image.is_some();
                    let detail = if is_textured { Detail::All } else { Detail::Minimal };
                    lights.add(emitter, 0..1, ShapeSampler::new(primitive, i, 0, detail));
                }
            }
        }
        lights
    }

    fn add_triangles(&mut self, emitter: u32, mesh: &TriangleMesh, flip_normal: bool, merges: bool) {
        let count = mesh.indices.len() as u32;
        let mut element = 0;
        while element < count {
            let next = element + 1;
            let parallelogram = (merges && next < count)
                .then(|| TriangleSampler::new_parallelogram(mesh, [element, next], flip_normal))
                .flatten();
            let end = if parallelogram.is_some() { next + 1 } else { next };
            let sampler = parallelogram.unwrap_or_else(|| TriangleSampler::new(mesh, element, flip_normal));
            self.add(emitter, element..end, Some(ShapeSampler::Triangle(sampler)));
            element = end;
        }
    }

    fn add(&mut self, emitter: u32, elements: Range<u32>, shape: Option<ShapeSampler>) {
        self.light_of_element.extend(elements.clone().map(|_| self.lights.len() as u32));
        self.lights.push(ElementLight { emitter, elements, shape });
    }

    /// Whether a ray can hit any of the lights.
    pub fn can_be_hit(&self) -> bool {
        self.emitters.iter().any(|emitter| emitter.can_be_hit)
    }

    /// The bounds of each light, for the light sampler.
    pub fn bounds(&self) -> impl Iterator<Item = LightBounds> {
        self.lights.iter().map(|light| {
            let mut elements =
                light.elements.clone().map(|element| self.light_bounds(light.emitter, element));
            let first = elements.next().expect("a light has an element");
            elements.fold(first, |a, b| {
                let centre = light.triangle().map_or(a.centre, TriangleSampler::centroid);
                a.union(&b, centre)
            })
        })
    }

    /// Bounds of one element of an emitter.
    fn light_bounds(&self, emitter: u32, element: u32) -> LightBounds {
        let Emitter { primitive, emission, mean_radiance, .. } = self.emitters[emitter as usize];
        let ElementBounds { centre, radius, normal, projected_fraction } =
            ElementBounds::new(self.scene, primitive, element);
        LightBounds {
            centre,
            radius,
            axis: normal.unwrap_or(Vec3::Z),
            cos_axes: if normal.is_some() { 1.0 } else { -1.0 },
            cos_emission: 0.0,
            two_sided: emission.two_sided,
            intensity: area(self.scene, primitive, element) * projected_fraction * mean_radiance,
        }
    }

    /// Samples a point of a light from a reference point; `None` if no radiance arrives from there.
    #[inline]
    pub fn sample(&self, light: usize, reference: Vec3, u: Vec2) -> Option<LightSample> {
        let light = &self.lights[light];
        let emitter = &self.emitters[light.emitter as usize];
        let point = light.shape.as_ref()?.sample(reference, u)?;
        let wi = (point.position - reference).try_normalize()?;
        let radiance = emitter.radiance(self.scene, point.normal.dot(-wi), point.uv)?;
        // Rays hit a partly transparent surface with the probability of its opacity; this is the mean.
        let opacity = emitter.alpha.map_or(1.0, |alpha| {
            let at = TexturePoint { uv: point.uv, position: point.position };
            self.scene.textures.float(alpha, at).clamp(0.0, 1.0)
        });
        Some(LightSample {
            wi,
            radiance: radiance * opacity,
            pdf: point.pdf,
            can_be_hit: emitter.can_be_hit,
            target: Some(point.offset_origin(-wi)),
        })
    }

    /// A light as [`UniformTriangleLight`], if it is one.
    #[inline]
    pub fn uniform_triangle(&self, light: usize) -> Option<UniformTriangleLight<'_>> {
        let light = &self.lights[light];
        let emitter = &self.emitters[light.emitter as usize];
        let is_uniform = emitter.alpha.is_none() && emitter.emission.image.is_none();
        let shape = light.triangle().filter(|shape| is_uniform && shape.has_constant_normal())?;
        Some(UniformTriangleLight {
            shape,
            radiance: emitter.emission.radiance,
            two_sided: emitter.emission.two_sided,
            can_be_hit: emitter.can_be_hit,
        })
    }

    /// Whether a primitive is emissive.
    #[inline]
    pub fn is_emissive(&self, primitive: u32) -> bool {
        self.emitter_of_primitive[primitive as usize] != NO_EMITTER
    }

    /// Emitted radiance at a point in the unit direction `wo`; `None` if it does not emit there.
    #[inline]
    pub fn emitted_radiance(&self, point: &SurfaceInteraction, wo: Vec3) -> Option<Vec3> {
        self.emitter(point)?.radiance(self.scene, point.geometric_normal.dot(wo), point.uv)
    }

    /// The light that contains a point, and the density per solid angle with which [`Self::sample`] samples
    /// the direction from the reference point to it; `None` for points of other surfaces.
    #[inline]
    pub fn pdf(&self, reference: Vec3, point: &SurfaceInteraction) -> Option<(usize, f32)> {
        let emitter = self.emitter(point)?;
        let light = self.light_of_element[emitter.first + point.element as usize] as usize;
        Some((light, self.lights[light].shape.as_ref()?.pdf(reference, point)))
    }

    #[inline]
    fn emitter(&self, point: &SurfaceInteraction) -> Option<&Emitter> {
        self.emitters.get(self.emitter_of_primitive[point.primitive as usize] as usize)
    }
}

impl ElementLight {
    fn triangle(&self) -> Option<&TriangleSampler> {
        self.shape.as_ref().and_then(ShapeSampler::triangle)
    }
}

impl Emitter {
    /// Emitted radiance at texture coordinates in a direction with this cosine to the normal; `None` on the
    /// side that does not emit.
    #[inline]
    fn radiance(&self, scene: &Scene, cos: f32, uv: Vec2) -> Option<Vec3> {
        (self.emission.two_sided || cos > 0.0).then(|| self.emission.radiance_at(&scene.textures, uv))
    }
}

#[cfg(test)]
mod tests;
