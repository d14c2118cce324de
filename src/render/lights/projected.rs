//! Images that shine from a point: around it, or through a window.

use glam::{Mat3, Vec2, Vec3};

use std::sync::Arc;

use super::environment::EnvironmentImage;
use super::images::{LightImages, Window};
use crate::scene::light::Projected;
use crate::scene::texture::Wrap;

/// An image around a point light, ready to be looked up.
pub struct ProjectedImage {
    from_render: Mat3,
    map: Map,
}

enum Map {
    Around(Arc<EnvironmentImage>),
    /// Of this extent in x / z and y / z, from the middle.
    Window {
        window: Window,
        half: Vec2,
    },
}

impl ProjectedImage {
    pub fn new(images: &mut LightImages, from_render: Mat3, image: Projected) -> Self {
        let map = match image {
            Projected::Around(map) => Map::Around(images.around(map)),
            Projected::Window { image, tan_half_fov } => {
                let window = images.window(image);
                let half = Projected::half_window(tan_half_fov, window.image.width(), window.image.height());
                Map::Window { window, half }
            }
        };
        Self { from_render, map }
    }

    /// The image's value, not below 0, in a direction of render space away from the light.
    pub fn at(&self, direction: Vec3) -> Vec3 {
        let local = self.from_render * direction;
        match &self.map {
            Map::Around(image) => image.towards(local.normalize()),
            Map::Window { window, half } => {
                let place = local.truncate() / local.z;
                if local.z > 0.0 && place.abs().cmple(*half).all() {
                    window.image.bilinear::<Vec3>(0.5 + 0.5 * place / *half, Wrap::Clamp).max(Vec3::ZERO)
                } else {
                    Vec3::ZERO
                }
            }
        }
    }

    /// The middle of the directions in which it shines, a unit vector of render space.
    pub fn axis(&self) -> Vec3 {
        (self.from_render.inverse() * Vec3::Z).normalize_or(Vec3::Z)
    }

    /// Cosine of the widest angle from there at which it shines.
    pub fn cos_widest(&self) -> f32 {
        match &self.map {
            Map::Around(_) => -1.0,
            Map::Window { half, .. } => {
                let axis = self.axis();
                let corner =
                    |sign: Vec2| (self.from_render.inverse() * (sign * *half).extend(1.0)).normalize();
                let corners = [Vec2::ONE, Vec2::NEG_ONE, Vec2::new(1.0, -1.0), Vec2::new(-1.0, 1.0)];
                let widest = corners.map(|sign| corner(sign).dot(axis)).into_iter().fold(1.0, f32::min);
                // Beyond a right angle an edge can reach further than its corners.
                if widest > 0.0 { widest } else { -1.0 }
            }
        }
    }

    /// The image's mean.
    pub fn mean(&self) -> Vec3 {
        match &self.map {
            Map::Around(image) => image.mean(),
            Map::Window { window, .. } => window.mean,
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
    fn a_window_shows_its_image_and_nothing_beside_it() {
        let (textures, image) = textures();
        let window = Projected::Window { image, tan_half_fov: 0.5 };
        let projected = ProjectedImage::new(&mut LightImages::new(&textures), Mat3::IDENTITY, window);
        let at = |x: f32, y: f32| projected.at(Vec3::new(x, y, 1.0).normalize());
        assert_eq!([at(-0.9, 0.0), at(0.9, 0.4)], [Vec3::X, Vec3::Y]);
        assert_eq!([at(-1.1, 0.0), at(0.9, 0.6), at(0.0, -0.6)], [Vec3::ZERO; 3]);
        assert_eq!(projected.at(Vec3::new(0.5, 0.0, -1.0)), Vec3::ZERO);
        let corner = Vec3::new(1.0, 0.5, 1.0).normalize();
        assert!((projected.cos_widest() - corner.z).abs() < 1e-6 && projected.axis() == Vec3::Z);
    }

    #[test]
    fn an_image_around_the_light_turns_with_it() {
        let (textures, image) = textures();
        let around = Projected::Around(EnvironmentMap::LatLong(image));
        let turned = Mat3::from_rotation_y(std::f32::consts::PI);
        let mut images = LightImages::new(&textures);
        let [as_it_is, turned] =
            [Mat3::IDENTITY, turned].map(|t| ProjectedImage::new(&mut images, t, around));
        // A quarter of a turn from x: the middle of the first column.
        let along_y = Vec3::new(0.1, 1.0, 0.0).normalize();
        assert!(as_it_is.at(along_y).x > 0.9 && as_it_is.at(-along_y).y > 0.9);
        assert_eq!(as_it_is.at(along_y), turned.at(Vec3::new(-0.1, 1.0, 0.0).normalize()));
        assert_eq!(as_it_is.cos_widest(), -1.0);
    }
}
