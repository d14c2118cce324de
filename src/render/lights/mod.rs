//! All lights of a scene in one table, chosen by power, and the densities of those choices.

mod delta;
mod distribution;
mod environment;
mod sphere_map;
mod surface;
mod table;

use std::f64::consts::PI;

use glam::{Vec2, Vec3};

use self::delta::DeltaLight;
use self::environment::EnvironmentLight;
use self::surface::SurfaceLights;
use self::table::AliasTable;
use crate::geometry::{Ray, SurfacePoint};
use crate::scene::{Light, Scene};

/// Shadow rays towards a point end this share of the way before it, beyond the error bounds of
/// both ends, since the length itself is rounded (as pbrt).
const SHADOW_EPSILON: f32 = 1e-4;

/// The lights of a scene: first those without a surface, in the scene's order, then every element
/// of every emissive surface.
pub struct Lights<'s> {
    table: AliasTable,
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
    /// `radius` is that of a sphere around the scene: what a light from infinitely far away sends
    /// through its disk counts as its power.
    pub fn new(scene: &'s Scene, radius: f32) -> Self {
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
        let disk = PI * f64::from(radius).powi(2);
        let power = |source: &Source| match source {
            Source::Delta(light) => light.power(disk),
            Source::Environment(light) => light.total() * disk,
        };
        let powers: Vec<f64> = sources.iter().map(power).chain(surfaces.powers()).collect();
        let is_environment = |i: &usize| matches!(sources[*i], Source::Environment(_)) && powers[*i] > 0.0;
        Self {
            table: AliasTable::new(&powers),
            environments: (0..sources.len()).filter(is_environment).collect(),
            sources,
            surfaces,
        }
    }

    /// Whether there is more than one light to choose from.
    pub fn need_choice(&self) -> bool {
        self.sources.len() + self.surfaces.len() > 1
    }

    /// Whether a ray that is not aimed at a light can find one.
    pub fn found_by_rays(&self) -> bool {
        !self.environments.is_empty() || self.surfaces.found_by_rays()
    }

    /// Light at `from`: `choice` picks the light, `u` a point of it. `None` if the sampled light
    /// cannot send any.
    #[inline]
    pub fn sample(&self, from: Vec3, choice: f32, u: Vec2) -> Option<LightSample> {
        let (light, probability) = self.table.sample(choice)?;
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

    /// Density with which [`Self::sample`] at `from` gives the direction to a point of an emissive
    /// surface.
    #[inline]
    pub fn pdf_surface(&self, from: Vec3, point: &SurfacePoint) -> f32 {
        self.surfaces
            .pdf(from, point)
            .map_or(0.0, |(light, pdf)| pdf * self.table.probability(self.sources.len() + light))
    }

    /// The environments: radiance from a unit direction, and the density with which
    /// [`Self::sample`] gives it.
    #[inline]
    pub fn environments(&self, direction: Vec3) -> impl Iterator<Item = (Vec3, f32)> {
        self.environments.iter().filter_map(move |&i| match &self.sources[i] {
            Source::Environment(light) => {
                let pdf = light.pdf(direction) * self.table.probability(i);
                Some((light.radiance(direction), pdf))
            }
            Source::Delta(_) => None,
        })
    }
}

/// What powers are compared by: the mean of the channels.
fn brightness(colour: Vec3) -> f32 {
    colour.element_sum() / 3.0
}
