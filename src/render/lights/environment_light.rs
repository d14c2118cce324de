//! Environment lights: infinitely far emission of constant radiance or from an image, optionally visible
//! through a portal only.
//!
//! Directions are sampled uniformly, or in proportion to the image. Source: pbrt-v4, section 12.5.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Mat3A, Vec2, Vec3, Vec3A};

use super::emission_bounds::{EmissionBounds, average};
use super::environment_image::EnvironmentImage;
use super::light_images::LightImages;
use super::portal_sampler::PortalSampler;
use super::uniform_sphere::{UNIFORM_SPHERE_PDF, sample_uniform_sphere};
use crate::scene::light::Environment;

/// An environment, prepared for lookup and sampling.
#[derive(Clone, Debug)]
pub struct EnvironmentLight {
    to_render: Mat3A,
    from_render: Mat3A,
    scale: Vec3,
    image: Option<Arc<EnvironmentImage>>,
    portal: Option<PortalSampler>,
}

/// Rows of a portal's table for an environment of constant radiance.
const CONSTANT_ROWS: usize = 64;

impl EnvironmentLight {
    pub fn new(images: &mut LightImages, environment: &Environment) -> Self {
        let to_render = environment.to_render.matrix3;
        let image = environment.map.map(|map| images.environment(map, environment.portal.is_none()));
        let rows = image.as_ref().map_or(CONSTANT_ROWS, |image| image.height());
        let mut light = Self {
            to_render,
            from_render: to_render.inverse(),
            scale: environment.scale,
            image,
            portal: None,
        };
        light.portal = environment.portal.map(|portal| {
            PortalSampler::new(&portal, rows, |direction| average(light.unoccluded_radiance(direction)))
        });
        light
    }

    /// The radiance, if it is independent of point and direction.
    #[inline]
    pub fn constant(&self) -> Option<Vec3> {
        (self.image.is_none() && self.portal.is_none()).then_some(self.scale)
    }

    /// Radiance at a reference point from a unit direction.
    #[inline]
    pub fn radiance(&self, reference: Vec3, direction: Vec3) -> Vec3 {
        match &self.portal {
            Some(portal) if !portal.contains(reference, direction) => Vec3::ZERO,
            _ => self.unoccluded_radiance(direction),
        }
    }

    /// Radiance from a unit direction, regardless of the portal.
    #[inline]
    fn unoccluded_radiance(&self, direction: Vec3) -> Vec3 {
        let Some(image) = &self.image else { return self.scale };
        self.scale * image.lookup_direction(self.to_local(direction))
    }

    /// Samples a unit direction from a reference point and returns it with the radiance and the density per
    /// solid angle; `None` if no light arrives there.
    #[inline]
    pub fn sample(&self, reference: Vec3, u: Vec2) -> Option<(Vec3, Vec3, f32)> {
        if let Some(portal) = &self.portal {
            let (direction, pdf) = portal.sample(reference, u)?;
            return Some((direction, self.unoccluded_radiance(direction), pdf));
        }
        let Some(image) = &self.image else {
            return Some((sample_uniform_sphere(u), self.scale, UNIFORM_SPHERE_PDF));
        };
        let (local, value, pdf) = image.sample(u)?;
        let direction = Vec3::from(self.to_render * Vec3A::from(local)).normalize();
        Some((direction, self.scale * value, pdf * self.jacobian(direction)))
    }

    /// Density per solid angle with which [`Self::sample`] samples a unit direction.
    #[inline]
    pub fn pdf(&self, reference: Vec3, direction: Vec3) -> f32 {
        match (&self.portal, &self.image) {
            (Some(portal), _) => portal.pdf(reference, direction),
            (None, Some(image)) => image.pdf(self.to_local(direction)) * self.jacobian(direction),
            (None, None) => UNIFORM_SPHERE_PDF,
        }
    }

    /// Bounds for the light sampler: those of a one-sided area light in the portal's place if there is one.
    pub fn emission_bounds(&self) -> EmissionBounds {
        match &self.portal {
            Some(portal) => EmissionBounds::Finite(portal.bounds()),
            None => EmissionBounds::Infinite { direction: None, irradiance: self.mean_irradiance() },
        }
    }

    /// Mean irradiance over the channels and over surfaces of all orientations, regardless of the portal and
    /// of a non-uniform scale: an estimate that chooses between lights.
    pub fn mean_irradiance(&self) -> f32 {
        PI * average(self.image.as_ref().map_or(self.scale, |image| self.scale * image.mean()))
    }

    fn to_local(&self, direction: Vec3) -> Vec3 {
        Vec3::from(self.from_render * Vec3A::from(direction)).normalize()
    }

    /// Solid angle in light space per solid angle in render space, around a unit direction of render space;
    /// 1 for rotations and uniform scales.
    fn jacobian(&self, direction: Vec3) -> f32 {
        let local = self.from_render * Vec3A::from(direction);
        self.from_render.determinant().abs() / (local.length_squared() * local.length())
    }
}

#[cfg(test)]
mod tests;
