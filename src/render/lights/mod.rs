//! Light sampling (next-event estimation): chooses one of a scene's lights by its estimated irradiance at a
//! point, samples a direction towards it, and evaluates the densities of both for multiple importance
//! sampling.
//!
//! Takes a [`LightSampleContext`], the point, and sample values in [0, 1); gives directions, incident radiance
//! and densities per solid angle. Source: pbrt-v4, chapter 12.

mod angle;
mod area_lights;
mod delta_light;
mod element_bounds;
mod emission_bounds;
mod environment_image;
mod environment_light;
mod light_bounds;
mod light_images;
mod light_sample;
mod light_sample_context;
mod light_sampler;
mod light_tree;
mod piecewise_constant_2d;
mod portal_sampler;
mod projected_image;
mod simd;
mod uniform_sphere;
mod uniform_triangle_light;
mod windowed_piecewise_constant_2d;

use glam::{Vec2, Vec3};

use self::area_lights::AreaLights;
use self::delta_light::DeltaLight;
use self::emission_bounds::EmissionBounds;
use self::environment_light::EnvironmentLight;
use self::light_images::LightImages;
pub use self::light_sample::{LightSample, LightSamples};
pub use self::light_sample_context::{LightSampleContext, LightSampleContexts};
use self::light_sampler::LightSampler;
use crate::geometry::SurfaceInteraction;
use crate::scene::{Light, Scene};
use crate::simd::{LANES, Lanes, group_lanes, lanes_in};

/// All lights of a scene, numbered: first those without a surface, in the scene's order, then the area lights.
pub struct Lights<'s> {
    sampler: LightSampler,
    surfaceless: Vec<SurfacelessLight>,
    /// Indices of the environments with a radiance above 0.
    environments: Vec<usize>,
    area_lights: AreaLights<'s>,
}

enum SurfacelessLight {
    Delta(DeltaLight),
    Environment(Box<EnvironmentLight>),
}

impl SurfacelessLight {
    fn new(images: &mut LightImages, light: &Light) -> Self {
        match light {
            Light::Environment(environment) => {
                Self::Environment(Box::new(EnvironmentLight::new(images, environment)))
            }
            Light::Point { .. } | Light::Spot { .. } | Light::Projector { .. } | Light::Distant { .. } => {
                Self::Delta(DeltaLight::new(images, light))
            }
        }
    }

    fn emission_bounds(&self) -> EmissionBounds {
        match self {
            Self::Delta(light) => light.emission_bounds(),
            Self::Environment(light) => light.emission_bounds(),
        }
    }

    fn is_visible_environment(&self) -> bool {
        matches!(self, Self::Environment(light) if light.mean_irradiance() > 0.0)
    }
}

impl<'s> Lights<'s> {
    pub fn new(scene: &'s Scene) -> Self {
        let mut images = LightImages::new(&scene.textures);
        let surfaceless: Vec<_> =
            scene.lights.iter().map(|light| SurfacelessLight::new(&mut images, light)).collect();
        let area_lights = AreaLights::new(scene);
        let bounds = surfaceless.iter().map(SurfacelessLight::emission_bounds);
        Self {
            sampler: LightSampler::new(bounds.chain(area_lights.bounds().map(EmissionBounds::Finite))),
            environments: (0..surfaceless.len())
                .filter(|&i| surfaceless[i].is_visible_environment())
                .collect(),
            surfaceless,
            area_lights,
        }
    }

    /// Whether there are several lights, so that light sampling needs a sample value to choose one.
    pub fn needs_choice(&self) -> bool {
        self.sampler.len() > 1
    }

    /// Whether rays of BSDF sampling can hit any of the lights.
    pub fn can_be_hit(&self) -> bool {
        !self.environments.is_empty() || self.area_lights.can_be_hit()
    }

    /// Whether a primitive is emissive.
    #[inline]
    pub fn is_emissive(&self, primitive: u32) -> bool {
        self.area_lights.is_emissive(primitive)
    }

    /// Radiance that a surface emits at a point in the unit direction `wo`; `None` if it does not emit there.
    #[inline]
    pub fn emitted_radiance(&self, point: &SurfaceInteraction, wo: Vec3) -> Option<Vec3> {
        self.area_lights.emitted_radiance(point, wo)
    }

    /// For each environment its index for [`Self::pdf_environment`], and its radiance at a reference point
    /// from a unit direction.
    #[inline]
    pub fn environments(&self, reference: Vec3, direction: Vec3) -> impl Iterator<Item = (usize, Vec3)> {
        self.environments.iter().filter_map(move |&i| match &self.surfaceless[i] {
            SurfacelessLight::Environment(light) => Some((i, light.radiance(reference, direction))),
            SurfacelessLight::Delta(_) => None,
        })
    }

    /// Estimated irradiance from all lights at a finite distance, at one point.
    pub fn finite_irradiance_at(&self, context: &LightSampleContext) -> f32 {
        self.sampler.finite_irradiance(context)
    }

    /// Estimated irradiance from all lights at a finite distance, in each lane:
    /// [`LightSampler::finite_irradiance`].
    pub fn finite_irradiance(&self, contexts: &LightSampleContexts) -> Lanes {
        let mut irradiance = [0.0; LANES];
        simd::finite_irradiances(self.sampler.finite_bounds(), contexts, &mut irradiance);
        irradiance
    }

    /// Samples one light, as [`Self::sample`] does in every lane; `None` if no light can illuminate the point.
    pub fn sample_one(&self, context: &LightSampleContext, u_light: f32, u: Vec2) -> Option<LightSample> {
        let finite = self.sampler.finite_irradiance(context);
        let (light, probability) = self.sampler.sample(context, finite, u_light)?;
        let sample = self.sample_light(light, context.position, u)?;
        Some(LightSample { pdf: sample.pdf * probability, ..sample })
    }

    /// Samples a light in each lane of a mask: `u_light` in [0, 1) chooses the light and `u` in [0, 1)² the
    /// direction.
    pub fn sample(
        &self,
        mask: u32,
        contexts: &LightSampleContexts,
        u_light: &Lanes,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) {
        // Choose a light for each lane
        let finite = self.finite_irradiance(contexts);
        let chosen = self.sampler.sample_lanes(mask, contexts, &finite, u_light);
        lanes_in(mask & !chosen.mask).for_each(|lane| samples.set(lane, None));

        // Sample each chosen light for all of its lanes
        group_lanes(&chosen.light, chosen.mask, |light, lanes| {
            let light = light as usize;
            match self.surfaceless.get(light) {
                Some(SurfacelessLight::Environment(environment)) if environment.constant().is_some() => {
                    let radiance = environment.constant().unwrap_or(Vec3::ZERO);
                    simd::sample_constant_environment(lanes, radiance, u, samples);
                }
                None if self.area_lights.uniform_triangle(light - self.surfaceless.len()).is_some() => {
                    if let Some(light) = self.area_lights.uniform_triangle(light - self.surfaceless.len()) {
                        let shape = light.shape;
                        simd::sample_uniform_triangle(lanes, &light, shape, &contexts.position, u, samples);
                    }
                }
                _ => {
                    for lane in lanes_in(lanes) {
                        let u = Vec2::new(u[0][lane], u[1][lane]);
                        samples.set(lane, self.sample_light(light, contexts.position.at(lane), u));
                    }
                }
            }
        });

        // Multiply the densities by the probabilities of the choices
        samples.pdf.iter_mut().zip(&chosen.probability).for_each(|(pdf, probability)| *pdf *= probability);
    }

    /// Samples one light from a reference point.
    #[inline]
    fn sample_light(&self, light: usize, reference: Vec3, u: Vec2) -> Option<LightSample> {
        match self.surfaceless.get(light) {
            Some(SurfacelessLight::Delta(delta)) => delta.sample(reference),
            Some(SurfacelessLight::Environment(environment)) => {
                let (wi, radiance, pdf) = environment.sample(reference, u)?;
                Some(LightSample { wi, radiance, pdf, can_be_hit: true, target: None })
            }
            None => self.area_lights.sample(light - self.surfaceless.len(), reference, u),
        }
    }

    /// Density per solid angle with which [`Self::sample`] samples the direction to a point of a surface; 0 if
    /// the surface is not emissive.
    #[inline]
    pub fn pdf_area_light(&self, context: &LightSampleContext, point: &SurfaceInteraction) -> f32 {
        self.area_lights.pdf(context.position, point).map_or(0.0, |(light, pdf)| {
            let finite = self.sampler.finite_irradiance(context);
            pdf * self.sampler.probability(self.surfaceless.len() + light, context, finite)
        })
    }

    /// Density per solid angle with which [`Self::sample`] samples a unit direction to an environment; `finite`
    /// is [`Self::finite_irradiance`] in the context's lane.
    #[inline]
    pub fn pdf_environment(
        &self,
        context: &LightSampleContext,
        finite: f32,
        environment: usize,
        direction: Vec3,
    ) -> f32 {
        match &self.surfaceless[environment] {
            SurfacelessLight::Environment(light) => {
                light.pdf(context.position, direction)
                    * self.sampler.probability(environment, context, finite)
            }
            SurfacelessLight::Delta(_) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests;
