//! The image of a projection or goniometric light, looked up by direction (pbrt-v4, sections 12.2.2 and
//! 12.2.3).

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::environment_image::EnvironmentImage;
use super::light_images::{LightImages, ProjectionImage};
use crate::scene::light::ImageProjection;
use crate::scene::texture::WrapMode;

/// An image projected from a point light.
pub struct ProjectedImage {
    from_render: Mat3,
    map: Map,
}

enum Map {
    Goniometric(Arc<EnvironmentImage>),
    /// `half_extent`: of the image in x / z and y / z, from its centre.
    Projection {
        projection: ProjectionImage,
        half_extent: Vec2,
    },
}

impl ProjectedImage {
    pub fn new(images: &mut LightImages, from_render: Mat3, image: ImageProjection) -> Self {
        let map = match image {
            ImageProjection::Spherical(map) => Map::Goniometric(images.environment(map, false)),
            ImageProjection::Perspective { image, tan_half_fov } => {
                let projection = images.projection(image);
                let (width, height) = (projection.image.width(), projection.image.height());
                let half_extent = ImageProjection::half_extent(tan_half_fov, width, height);
                Map::Projection { projection, half_extent }
            }
        };
        Self { from_render, map }
    }

    /// The image's value, at least 0, in a direction of render space away from the light; 0 beside the image.
    pub fn lookup(&self, direction: Vec3) -> Vec3 {
        let local = self.from_render * direction;
        match &self.map {
            Map::Goniometric(image) => image.lookup_direction(local.normalize()),
            Map::Projection { projection, half_extent } => {
                let p = local.truncate() / local.z;
                if local.z > 0.0 && p.abs().cmple(*half_extent).all() {
                    let uv = 0.5 + 0.5 * p / *half_extent;
                    projection.image.bilinear::<Vec3>(uv, WrapMode::Clamp).max(Vec3::ZERO)
                } else {
                    Vec3::ZERO
                }
            }
        }
    }

    /// The direction of the image's centre, a unit vector of render space.
    pub fn axis(&self) -> Vec3 {
        (self.from_render.inverse() * Vec3::Z).normalize_or(Vec3::Z)
    }

    /// Cosine of a bound on the angle between [`Self::axis`] and the directions of the image.
    pub fn cos_extent(&self) -> f32 {
        match &self.map {
            Map::Goniometric(_) => -1.0,
            Map::Projection { half_extent, .. } => {
                let axis = self.axis();
                let corner =
                    |sign: Vec2| (self.from_render.inverse() * (sign * *half_extent).extend(1.0)).normalize();
                let corners = [Vec2::ONE, Vec2::NEG_ONE, Vec2::new(1.0, -1.0), Vec2::new(-1.0, 1.0)];
                let least = corners.map(|sign| corner(sign).dot(axis)).into_iter().fold(1.0, f32::min);
                // Beyond a right angle an edge can be farther from the axis than its corners.
                if least > 0.0 { least } else { -1.0 }
            }
        }
    }

    /// Mean value of the image: over the sphere if it is goniometric, else over its area.
    pub fn mean(&self) -> Vec3 {
        match &self.map {
            Map::Goniometric(image) => image.mean(),
            Map::Projection { projection, .. } => projection.mean,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Textures;
    use crate::scene::light::EnvironmentMap;
    use crate::scene::texture::TextureImage;

    /// Two columns by one row, red and green.
    fn textures() -> (Textures, crate::scene::ImageId) {
        let mut textures = Textures::default();
        let texels = vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let id = textures.add_image(TextureImage::from_floats(2, 1, 3, texels));
        (textures, id)
    }

    #[test]
    fn a_projection_is_zero_beside_its_image() {
        let (textures, image) = textures();
        let projection = ImageProjection::Perspective { image, tan_half_fov: 0.5 };
        let projected = ProjectedImage::new(&mut LightImages::new(&textures), Mat3::IDENTITY, projection);
        let at = |x: f32, y: f32| projected.lookup(Vec3::new(x, y, 1.0).normalize());
        assert_eq!([at(-0.9, 0.0), at(0.9, 0.4)], [Vec3::X, Vec3::Y]);
        assert_eq!([at(-1.1, 0.0), at(0.9, 0.6), at(0.0, -0.6)], [Vec3::ZERO; 3]);
        assert_eq!(projected.lookup(Vec3::new(0.5, 0.0, -1.0)), Vec3::ZERO);
        let corner = Vec3::new(1.0, 0.5, 1.0).normalize();
        assert!((projected.cos_extent() - corner.z).abs() < 1e-6 && projected.axis() == Vec3::Z);
    }

    #[test]
    fn a_goniometric_image_rotates_with_its_light() {
        let (textures, image) = textures();
        let goniometric = ImageProjection::Spherical(EnvironmentMap::LatLong(image));
        let rotation = Mat3::from_rotation_y(std::f32::consts::PI);
        let mut images = LightImages::new(&textures);
        let [upright, rotated] =
            [Mat3::IDENTITY, rotation].map(|t| ProjectedImage::new(&mut images, t, goniometric));
        // An azimuth of about 90 degrees: the middle of the first column.
        let along_y = Vec3::new(0.1, 1.0, 0.0).normalize();
        assert!(upright.lookup(along_y).x > 0.9 && upright.lookup(-along_y).y > 0.9);
        assert_eq!(upright.lookup(along_y), rotated.lookup(Vec3::new(-0.1, 1.0, 0.0).normalize()));
        assert_eq!(upright.cos_extent(), -1.0);
    }
}
