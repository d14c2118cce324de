//! Lights without a surface, and the emission of surfaces.

use glam::{Affine3A, Mat3, Vec2, Vec3};

use super::texture::{ImageId, Textures, WrapMode};

/// A light without a surface, in render space. Radiometric quantities are in linear sRGB.
#[derive(Clone, Debug)]
pub enum Light {
    /// An isotropic point light; `intensity` is radiant intensity.
    Point { position: Vec3, intensity: Vec3 },
    /// A spot light. The intensity falls from `cos_falloff_start` to `cos_total_width`, which is not
    /// larger.
    Spot {
        position: Vec3,
        axis: Vec3,
        intensity: Vec3,
        cos_falloff_start: f32,
        cos_total_width: f32,
        falloff: SpotFalloff,
    },
    /// A point light that projects an image. `intensity` scales the image; `from_render` rotates
    /// directions from render space to the image's space.
    Projector { position: Vec3, intensity: Vec3, from_render: Mat3, image: ImageProjection },
    /// A distant light. `direction` is the unit direction towards the light; `radiance` is the
    /// irradiance on a surface that faces it.
    Distant { direction: Vec3, radiance: Vec3 },
    /// An infinite area light around the scene.
    Environment(Environment),
}

/// The image of a point light, and its projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageProjection {
    /// Mapped to the whole sphere (pbrt's `goniometric` light).
    Spherical(EnvironmentMap),
    /// Projected along z, with x to the right and y downwards; black elsewhere (pbrt's `projection`
    /// light). `tan_half_fov` is the tangent of half the field of view across the image's shorter side.
    Perspective { image: ImageId, tan_half_fov: f32 },
}

impl ImageProjection {
    /// Half the extent of a projected image in x / z and y / z. `width` and `height` are in texels.
    pub fn half_extent(tan_half_fov: f32, width: usize, height: usize) -> Vec2 {
        let size = Vec2::new(width as f32, height as f32);
        size * (tan_half_fov / size.min_element())
    }
}

/// Falloff of a spot light's intensity between its two cosines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpotFalloff {
    /// A cubic from 0 to 1 (pbrt-v4).
    Smoothstep,
    /// The fourth power (pbrt-v2 and v3).
    FourthPower,
}

impl SpotFalloff {
    /// The relative intensity at `t`, which is 0 at the outer cosine and 1 at the inner one.
    pub fn at(self, t: f32) -> f32 {
        match self {
            SpotFalloff::Smoothstep => t * t * (3.0 - 2.0 * t),
            SpotFalloff::FourthPower => t.powi(4),
        }
    }
}

/// An environment light: constant, or an image.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Maps directions of light space to render space: a rotation, or a transform that stretches the image.
    pub to_render: Affine3A,
    /// Radiance, or scale factor of the image.
    pub scale: Vec3,
    /// The image; `None` for a constant environment.
    pub map: Option<EnvironmentMap>,
    /// If set, light arrives through this rectangle only.
    pub portal: Option<Portal>,
}

/// A rectangle in render space. Its two edges and the direction out of it are right-handed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Portal {
    pub corner: Vec3,
    /// Perpendicular to each other.
    pub edges: [Vec3; 2],
}

/// Mapping of an image to the sphere of directions in light space.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EnvironmentMap {
    /// Latitude-longitude with z up, as in pbrt-v2 and v3.
    LatLong(ImageId),
    /// Equal-area octahedral (Clarberg 2008), as in pbrt-v4. The image is square.
    EqualArea(ImageId),
}

/// Emission of a surface (pbrt's diffuse area light).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaLight {
    /// Emitted radiance, or scale factor of the image.
    pub radiance: Vec3,
    /// Image of the emission, mapped by texture coordinates with v = 0 at the bottom row.
    pub image: Option<ImageId>,
    /// Whether both sides emit, and not only the side of the normal.
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
                self.radiance * textures.image(id).bilinear::<Vec3>(st, WrapMode::Clamp).max(Vec3::ZERO)
            }
        }
    }

    /// Emitted radiance, averaged over the image.
    pub fn mean_radiance(&self, textures: &Textures) -> Vec3 {
        self.radiance * self.image.map_or(Vec3::ONE, |id| textures.image(id).mean_light())
    }
}
