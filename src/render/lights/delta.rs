//! Lights without extent: they reach a point along one direction only, and no scattered ray ever
//! finds them.

use glam::Vec3;

use super::bounds::LightBounds;
use super::choice::Reach;
use super::images::LightImages;
use super::projected::ProjectedImage;
use super::{LightSample, brightness};
use crate::scene::Light;
use crate::scene::light::SpotFalloff;

/// A light at a point, or a distant one.
pub enum DeltaLight {
    Point { position: Vec3, intensity: Vec3, beam: Beam },
    Distant { direction: Vec3, irradiance: Vec3 },
}

/// Where a light at a point shines, as a factor of its intensity.
pub enum Beam {
    Everywhere,
    Cone(Cone),
    Image(ProjectedImage),
}

/// Where a spot light shines.
pub struct Cone {
    axis: Vec3,
    cos_start: f32,
    cos_end: f32,
    falloff: SpotFalloff,
}

impl DeltaLight {
    /// # Panics
    /// For an environment, which has an extent.
    pub fn new(images: &mut LightImages, light: &Light) -> Self {
        match *light {
            Light::Point { position, intensity } => {
                Self::Point { position, intensity, beam: Beam::Everywhere }
            }
            Light::Spot { position, axis, intensity, cos_falloff_start, cos_total_width, falloff } => {
                let (cos_start, cos_end) = (cos_falloff_start, cos_total_width);
                let cone = Cone { axis: axis.normalize(), cos_start, cos_end, falloff };
                Self::Point { position, intensity, beam: Beam::Cone(cone) }
            }
            Light::Projector { position, intensity, from_render, image } => {
                let image = ProjectedImage::new(images, from_render, image);
                Self::Point { position, intensity, beam: Beam::Image(image) }
            }
            Light::Distant { direction, radiance } => {
                Self::Distant { direction: direction.normalize(), irradiance: radiance }
            }
            Light::Environment(_) => unreachable!("an environment has an extent"),
        }
    }

    /// What the choice among lights goes by.
    pub fn reach(&self) -> Reach {
        match self {
            Self::Point { position, intensity, beam } => {
                let (axis, cos_axes, cos_emission, mean) = match beam {
                    Beam::Everywhere => (Vec3::Z, -1.0, 0.0, Vec3::ONE),
                    Beam::Cone(cone) => (cone.axis, cone.cos_start, cone.cos_falloff(), Vec3::ONE),
                    Beam::Image(image) => (image.axis(), image.cos_widest(), 1.0, image.mean()),
                };
                Reach::Within(LightBounds {
                    centre: *position,
                    radius: 0.0,
                    axis,
                    cos_axes,
                    cos_emission,
                    two_sided: false,
                    intensity: brightness(*intensity * mean),
                })
            }
            Self::Distant { direction, irradiance } => {
                Reach::Around { direction: Some(*direction), irradiance: brightness(*irradiance) }
            }
        }
    }

    /// The light at a point, with probability 1.
    #[inline]
    pub fn sample(&self, from: Vec3) -> Option<LightSample> {
        let sample =
            |wi, radiance, target| LightSample { wi, radiance, pdf: 1.0, found_by_rays: false, target };
        match self {
            Self::Point { position, intensity, beam } => {
                let to_light = position - from;
                let squared = to_light.length_squared();
                if squared == 0.0 {
                    return None;
                }
                let wi = to_light / squared.sqrt();
                let share = match beam {
                    Beam::Everywhere => Vec3::ONE,
                    Beam::Cone(cone) => Vec3::splat(cone.share(-wi)),
                    Beam::Image(image) => image.at(-wi),
                };
                (share != Vec3::ZERO).then(|| sample(wi, intensity * share / squared, Some(*position)))
            }
            Self::Distant { direction, irradiance } => Some(sample(*direction, *irradiance, None)),
        }
    }
}

impl Cone {
    /// Share of the intensity in a direction.
    fn share(&self, direction: Vec3) -> f32 {
        let cos = direction.dot(self.axis);
        if cos >= self.cos_start {
            return 1.0;
        }
        let t = ((cos - self.cos_end) / (self.cos_start - self.cos_end)).clamp(0.0, 1.0);
        self.falloff.at(t)
    }

    /// Cosine of the angle over which the intensity falls off.
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
    fn a_spot_light_shines_within_its_cone_only() {
        let falling =
            |falloff, cos: f32| spot(falloff).sample(Vec3::new((1.0 - cos * cos).sqrt(), 0.0, -cos));
        let at = |cos| falling(SpotFalloff::Smoothstep, cos);
        let old = falling(SpotFalloff::FourthPower, 0.7).unwrap();
        assert!((old.radiance.x - 1.0 / 16.0).abs() < 1e-4);
        assert!((at(0.95).unwrap().radiance.x - 1.0).abs() < 1e-5);
        assert!((at(0.7).unwrap().radiance.x - 0.5).abs() < 1e-4);
        assert!(at(0.49).is_none());
    }

    #[test]
    fn a_distant_light_is_the_same_everywhere() {
        let light = delta(Light::Distant { direction: Vec3::Y * 2.0, radiance: Vec3::ONE });
        let sample = light.sample(Vec3::splat(7.0)).unwrap();
        assert_eq!((sample.wi, sample.radiance, sample.target), (Vec3::Y, Vec3::ONE, None));
    }
}
