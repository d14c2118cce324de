//! Lights that are not surfaces, and the emission of those that are.

use glam::{Affine3A, Vec3};

use super::texture::ImageId;

/// A light without a surface, in render space. Radiometric quantities are linear RGB.
#[derive(Clone, Debug)]
pub enum Light {
    /// Radiant intensity in all directions from a point.
    Point { position: Vec3, intensity: Vec3 },
    /// A point light with a cone. `cos_falloff_start` ≥ `cos_total_width`; smoothstep between.
    Spot { position: Vec3, axis: Vec3, intensity: Vec3, cos_falloff_start: f32, cos_total_width: f32 },
    /// Parallel light. `direction` points from the scene towards the light; `radiance` is the
    /// irradiance on a surface facing it.
    Distant { direction: Vec3, radiance: Vec3 },
    /// Light from everywhere: constant, or an image.
    Environment(Environment),
}

/// An environment around the scene.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Rotates light space to render space.
    pub to_render: Affine3A,
    /// Radiance, or factor of the image's.
    pub scale: Vec3,
    pub map: Option<EnvironmentMap>,
}

/// How an image wraps around the sphere of directions of light space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvironmentMap {
    /// Latitude-longitude, z up, as pbrt-v2 and v3 read them.
    LatLong(ImageId),
    /// Equal-area octahedral (Clarberg 2008), as pbrt-v4 reads them: a square image.
    EqualArea(ImageId),
}

/// Emission of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaLight {
    /// Emitted radiance.
    pub radiance: Vec3,
    /// Emits from both sides, not only from the side the normal points to.
    pub two_sided: bool,
}
