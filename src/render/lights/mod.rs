//! All lights of a scene, the choice of one of them by what could arrive from it at a point, and
//! the densities of those choices.

mod bounds;
mod choice;
mod delta;
mod distribution;
mod environment;
mod extent;
mod sphere_map;
mod surface;
mod tree;

use glam::{Vec2, Vec3};

pub use self::bounds::Receiver;
use self::choice::{LightChoice, Reach};
use self::delta::DeltaLight;
use self::environment::EnvironmentLight;
use self::surface::SurfaceLights;
use crate::geometry::{Ray, SurfacePoint};
use crate::scene::{Light, Scene};

/// Shadow rays towards a point end this share of the way before it, beyond the error bounds of
/// both ends, since the length itself is rounded (as pbrt).
const SHADOW_EPSILON: f32 = 1e-4;

/// The lights of a scene: first those without a surface, in the scene's order, then every element
/// of every emissive surface.
pub struct Lights<'s> {
    choice: LightChoice,
    sources: Vec<Source>,
    /// Which of the sources are environments that shine.
    environments: Vec<usize>,
    surfaces: SurfaceLights<'s>,
}

/// A light without a surface.
enum Source {
    Delta(DeltaLight),
    Environment(EnvironmentLight),
}

/// Light that could arrive at a point, if nothing is in between.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction towards the light.
    pub wi: Vec3,
    pub radiance: Vec3,
    /// Density per solid angle, or probability for a light without extent; the choice of the
    /// light is included.
    pub pdf: f32,
    /// A scattered ray can find this light as well.
    pub found_by_rays: bool,
    /// Where the shadow ray ends; `None` is infinitely far.
    target: Option<Vec3>,
}

impl LightSample {
    /// The ray whose way must be free for the light to arrive at `point`.
    #[inline]
    pub fn shadow_ray(&self, point: &SurfacePoint, time: f32) -> Ray {
        let origin = point.offset_origin(self.wi);
        match self.target {
            None => Ray { origin, direction: self.wi, t_max: f32::INFINITY, time },
            Some(target) => Ray { origin, direction: target - origin, t_max: 1.0 - SHADOW_EPSILON, time },
        }
    }
}

impl<'s> Lights<'s> {
    pub fn new(scene: &'s Scene) -> Self {
        let sources: Vec<Source> = scene
            .lights
            .iter()
            .map(|light| match light {
                Light::Environment(environment) => {
                    Source::Environment(EnvironmentLight::new(scene, environment))
                }
                Light::Point { .. } | Light::Spot { .. } | Light::Distant { .. } => {
                    Source::Delta(DeltaLight::new(light))
                }
            })
            .collect();
        let surfaces = SurfaceLights::new(scene);
        let reach = |source: &Source| match source {
            Source::Delta(light) => light.reach(),
            Source::Environment(light) => {
                Reach::Around { direction: None, irradiance: light.mean_irradiance() }
            }
        };
        let shines =
            |i: &usize| matches!(&sources[*i], Source::Environment(light) if light.mean_irradiance() > 0.0);
        Self {
            choice: LightChoice::new(sources.iter().map(reach).chain(surfaces.bounds().map(Reach::Within))),
            environments: (0..sources.len()).filter(shines).collect(),
            sources,
            surfaces,
        }
    }

    /// Whether there is more than one light to choose from.
    pub fn need_choice(&self) -> bool {
        self.choice.len() > 1
    }

    /// Whether a ray that is not aimed at a light can find one.
    pub fn found_by_rays(&self) -> bool {
        !self.environments.is_empty() || self.surfaces.found_by_rays()
    }

    /// Light at a receiver: `choice` picks the light, `u` a point of it. `None` if the sampled
    /// light cannot send any.
    #[inline]
    pub fn sample(&self, receiver: &Receiver, choice: f32, u: Vec2) -> Option<LightSample> {
        let (light, probability) = self.choice.sample(receiver, choice)?;
        let from = receiver.position;
        let mut sample = match self.sources.get(light) {
            Some(Source::Delta(delta)) => delta.sample(from)?,
            Some(Source::Environment(environment)) => {
                let (wi, radiance, pdf) = environment.sample(u)?;
                LightSample { wi, radiance, pdf, found_by_rays: true, target: None }
            }
            None => self.surfaces.sample(light - self.sources.len(), from, u)?,
        };
        sample.pdf *= probability;
        Some(sample)
    }

    /// Radiance that a surface emits at a point in direction `wo`; `None` if it is no light.
    #[inline]
    pub fn emitted(&self, point: &SurfacePoint, wo: Vec3) -> Option<Vec3> {
        self.surfaces.emitted(point, wo)
    }

    /// Density with which [`Self::sample`] gives the direction to a point of an emissive surface.
    #[inline]
    pub fn pdf_surface(&self, receiver: &Receiver, point: &SurfacePoint) -> f32 {
        self.surfaces
            .pdf(receiver.position, point)
            .map_or(0.0, |(light, pdf)| pdf * self.choice.probability(self.sources.len() + light, receiver))
    }

    /// The environments: radiance from a unit direction, and what [`Self::pdf_environment`] takes.
    #[inline]
    pub fn environments(&self, direction: Vec3) -> impl Iterator<Item = (usize, Vec3)> {
        self.environments.iter().filter_map(move |&i| match &self.sources[i] {
            Source::Environment(light) => Some((i, light.radiance(direction))),
            Source::Delta(_) => None,
        })
    }

    /// Density with which [`Self::sample`] gives a unit direction to an environment.
    #[inline]
    pub fn pdf_environment(&self, receiver: &Receiver, environment: usize, direction: Vec3) -> f32 {
        match &self.sources[environment] {
            Source::Environment(light) => {
                light.pdf(direction) * self.choice.probability(environment, receiver)
            }
            Source::Delta(_) => 0.0,
        }
    }
}

/// The largest number below 1.
const BELOW_ONE: f32 = 1.0 - 0.5 * f32::EPSILON;

/// What lights are compared by: the mean of the channels.
fn brightness(colour: Vec3) -> f32 {
    colour.element_sum() / 3.0
}
