//! Lights that are not surfaces, and the emission of those that are.

use glam::{Affine3A, Mat3, Vec2, Vec3};

use super::texture::{ImageId, Textures, Wrap};

/// A light without a surface, in render space. Radiometric quantities are linear RGB.
#[derive(Clone, Debug)]
pub enum Light {
    /// Radiant intensity in all directions from a point.
    Point { position: Vec3, intensity: Vec3 },
    /// A point light with a cone. `cos_falloff_start` ≥ `cos_total_width`.
    Spot {
        position: Vec3,
        axis: Vec3,
        intensity: Vec3,
        cos_falloff_start: f32,
        cos_total_width: f32,
        falloff: SpotFalloff,
    },
    /// A point light that shines an image: `intensity` is a factor of the image's, which is looked up in the
    /// direction that `from_render` makes of one of render space.
    Projector { position: Vec3, intensity: Vec3, from_render: Mat3, image: Projected },
    /// Parallel light. `direction` points from the scene towards the light; `radiance` is the
    /// irradiance on a surface facing it.
    Distant { direction: Vec3, radiance: Vec3 },
    /// Light from everywhere: constant, or an image.
    Environment(Environment),
}

/// How an image lies around a point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projected {
    /// On the whole sphere (pbrt's `goniometric` light).
    Around(EnvironmentMap),
    /// On a window across z, x to the right and y downwards, and nowhere else (pbrt's `projection` light).
    /// `tan_half_fov`: tangent of half the field of view across the image's shorter side.
    Window { image: ImageId, tan_half_fov: f32 },
}

impl Projected {
    /// The extent of a window's image in x / z and y / z, from the middle.
    pub fn half_window(tan_half_fov: f32, width: usize, height: usize) -> Vec2 {
        let size = Vec2::new(width as f32, height as f32);
        size * (tan_half_fov / size.min_element())
    }
}

/// How a spot's intensity falls from 1 to 0 between its two cosines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpotFalloff {
    /// pbrt-v4's.
    Smoothstep,
    /// The fourth power of the share of the way (pbrt-v2 and v3).
    FourthPower,
}

impl SpotFalloff {
    /// The intensity where `t` of the way from dark to full is left.
    pub fn at(self, t: f32) -> f32 {
        match self {
            SpotFalloff::Smoothstep => t * t * (3.0 - 2.0 * t),
            SpotFalloff::FourthPower => t.powi(4),
        }
    }
}

/// An environment around the scene.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Rotates light space to render space.
    pub to_render: Affine3A,
    /// Radiance, or factor of the image's.
    pub scale: Vec3,
    pub map: Option<EnvironmentMap>,
    /// It is seen through this rectangle and nowhere else.
    pub portal: Option<Portal>,
}

/// A rectangle in render space, seen from inside: its edges and the way out are right-handed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Portal {
    pub corner: Vec3,
    /// At right angles to each other.
    pub edges: [Vec3; 2],
}

/// How an image wraps around the sphere of directions of light space.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EnvironmentMap {
    /// Latitude-longitude, z up, as pbrt-v2 and v3 read them.
    LatLong(ImageId),
    /// Equal-area octahedral (Clarberg 2008), as pbrt-v4 reads them: a square image.
    EqualArea(ImageId),
}

/// Emission of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaLight {
    /// Emitted radiance, or factor of the image's.
    pub radiance: Vec3,
    /// On the surface by its texture coordinates, v = 0 at the bottom row.
    pub image: Option<ImageId>,
    /// Emits from both sides, not only from the side the normal points to.
    pub two_sided: bool,
}

impl AreaLight {
    /// Emitted radiance at a point with these texture coordinates.
    #[inline]
    pub fn radiance_at(&self, textures: &Textures, uv: Vec2) -> Vec3 {
        match self.image {
            None => self.radiance,
            Some(id) => {
                let st = Vec2::new(uv.x, 1.0 - uv.y);
                self.radiance * textures.image(id).bilinear::<Vec3>(st, Wrap::Clamp).max(Vec3::ZERO)
            }
        }
    }

    /// Emitted radiance, on average over the image.
    pub fn mean_radiance(&self, textures: &Textures) -> Vec3 {
        self.radiance * self.image.map_or(Vec3::ONE, |id| textures.image(id).mean_light())
    }
}
