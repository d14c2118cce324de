//! Delta lights: point, spot, projection, goniometric and distant lights, which illuminate a point from one
//! direction, so that rays of BSDF sampling never hit them.
//!
//! Source: pbrt-v4, sections 12.2 and 12.3.

use glam::Vec3;

use super::emission_bounds::{EmissionBounds, average};
use super::light_bounds::LightBounds;
use super::light_images::LightImages;
use super::light_sample::LightSample;
use super::projected_image::ProjectedImage;
use crate::scene::Light;
use crate::scene::light::SpotFalloff;

/// A light at a point, or at infinity with parallel light.
pub enum DeltaLight {
    /// Radiant intensity: `intensity` times the factor of the direction.
    Point { position: Vec3, intensity: Vec3, factor: DirectionalFactor },
    /// Irradiance of a surface facing the unit `direction` towards the light.
    Distant { direction: Vec3, irradiance: Vec3 },
}

/// The factor of a point light's intensity by direction.
pub enum DirectionalFactor {
    One,
    Spot(SpotCone),
    Image(ProjectedImage),
}

/// The cone of a spot light: the factor is 1 within the angle of `cos_start` and falls to 0 at that of
/// `cos_end`.
pub struct SpotCone {
    axis: Vec3,
    cos_start: f32,
    cos_end: f32,
    falloff: SpotFalloff,
}

impl DeltaLight {
    /// # Panics
    /// For an environment, which is no delta light.
    pub fn new(images: &mut LightImages, light: &Light) -> Self {
        match *light {
            Light::Point { position, intensity } => {
                Self::Point { position, intensity, factor: DirectionalFactor::One }
            }
            Light::Spot { position, axis, intensity, cos_falloff_start, cos_total_width, falloff } => {
                let (cos_start, cos_end) = (cos_falloff_start, cos_total_width);
                let cone = SpotCone { axis: axis.normalize(), cos_start, cos_end, falloff };
                Self::Point { position, intensity, factor: DirectionalFactor::Spot(cone) }
            }
            Light::Projector { position, intensity, from_render, image } => {
                let image = ProjectedImage::new(images, from_render, image);
                Self::Point { position, intensity, factor: DirectionalFactor::Image(image) }
            }
            Light::Distant { direction, radiance } => {
                Self::Distant { direction: direction.normalize(), irradiance: radiance }
            }
            Light::Environment(_) => unreachable!("an environment is no delta light"),
        }
    }

    /// Bounds for the light sampler.
    pub fn emission_bounds(&self) -> EmissionBounds {
        match self {
            Self::Point { position, intensity, factor } => {
                let (axis, cos_axes, cos_emission, mean) = match factor {
                    DirectionalFactor::One => (Vec3::Z, -1.0, 0.0, Vec3::ONE),
                    DirectionalFactor::Spot(cone) => {
                        (cone.axis, cone.cos_start, cone.cos_falloff(), Vec3::ONE)
                    }
                    DirectionalFactor::Image(image) => (image.axis(), image.cos_extent(), 1.0, image.mean()),
                };
                EmissionBounds::Finite(LightBounds {
                    centre: *position,
                    radius: 0.0,
                    axis,
                    cos_axes,
                    cos_emission,
                    two_sided: false,
                    intensity: average(*intensity * mean),
                })
            }
            Self::Distant { direction, irradiance } => {
                EmissionBounds::Infinite { direction: Some(*direction), irradiance: average(*irradiance) }
            }
        }
    }

    /// The light at a reference point, with probability 1; `None` if there is none.
    #[inline]
    pub fn sample(&self, reference: Vec3) -> Option<LightSample> {
        let sample = |wi, radiance, target| LightSample { wi, radiance, pdf: 1.0, can_be_hit: false, target };
        match self {
            Self::Point { position, intensity, factor } => {
                let to_light = position - reference;
                let squared = to_light.length_squared();
                if squared == 0.0 {
                    return None;
                }
                let wi = to_light / squared.sqrt();
                let factor = match factor {
                    DirectionalFactor::One => Vec3::ONE,
                    DirectionalFactor::Spot(cone) => Vec3::splat(cone.factor(-wi)),
                    DirectionalFactor::Image(image) => image.lookup(-wi),
                };
                (factor != Vec3::ZERO).then(|| sample(wi, intensity * factor / squared, Some(*position)))
            }
            Self::Distant { direction, irradiance } => Some(sample(*direction, *irradiance, None)),
        }
    }
}

impl SpotCone {
    /// Factor of the intensity in a unit direction away from the light.
    fn factor(&self, direction: Vec3) -> f32 {
        let cos = direction.dot(self.axis);
        if cos >= self.cos_start {
            return 1.0;
        }
        let t = ((cos - self.cos_end) / (self.cos_start - self.cos_end)).clamp(0.0, 1.0);
        self.falloff.at(t)
    }

    /// Cosine of the angle between the two ends of the falloff.
    fn cos_falloff(&self) -> f32 {
        let angle = |cos: f32| cos.clamp(-1.0, 1.0).acos();
        (angle(self.cos_end) - angle(self.cos_start)).max(0.0).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Textures;

    fn delta(light: Light) -> DeltaLight {
        DeltaLight::new(&mut LightImages::new(&Textures::default()), &light)
    }

    #[test]
    fn a_point_light_falls_off_with_the_squared_distance() {
        let light = delta(Light::Point { position: Vec3::Z * 3.0, intensity: Vec3::splat(18.0) });
        let sample = light.sample(Vec3::ZERO).unwrap();
        assert_eq!((sample.wi, sample.radiance, sample.pdf), (Vec3::Z, Vec3::splat(2.0), 1.0));
        assert!(light.sample(Vec3::Z * 3.0).is_none());
    }

    fn spot(falloff: SpotFalloff) -> DeltaLight {
        delta(Light::Spot {
            position: Vec3::ZERO,
            axis: Vec3::NEG_Z,
            intensity: Vec3::ONE,
            cos_falloff_start: 0.9,
            cos_total_width: 0.5,
            falloff,
        })
    }

    #[test]
    fn a_spot_light_emits_within_its_cone_only() {
        let sample = |falloff, cos: f32| spot(falloff).sample(Vec3::new((1.0 - cos * cos).sqrt(), 0.0, -cos));
        let at = |cos| sample(SpotFalloff::Smoothstep, cos);
        let fourth_power = sample(SpotFalloff::FourthPower, 0.7).unwrap();
        assert!((fourth_power.radiance.x - 1.0 / 16.0).abs() < 1e-4);
        assert!((at(0.95).unwrap().radiance.x - 1.0).abs() < 1e-5);
        assert!((at(0.7).unwrap().radiance.x - 0.5).abs() < 1e-4);
        assert!(at(0.49).is_none());
    }

    #[test]
    fn a_distant_light_is_independent_of_the_reference_point() {
        let light = delta(Light::Distant { direction: Vec3::Y * 2.0, radiance: Vec3::ONE });
        let sample = light.sample(Vec3::splat(7.0)).unwrap();
        assert_eq!((sample.wi, sample.radiance, sample.target), (Vec3::Y, Vec3::ONE, None));
    }
}
