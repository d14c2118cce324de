//! A cache of the images of lights: each is converted once, however many lights use it.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;

use super::environment_image::EnvironmentImage;
use crate::scene::light::EnvironmentMap;
use crate::scene::texture::TextureImage;
use crate::scene::{ImageId, Textures};

/// The images of a scene's lights.
pub struct LightImages<'s> {
    textures: &'s Textures,
    /// By map, and whether the image is sampled.
    environments: HashMap<(EnvironmentMap, bool), Arc<EnvironmentImage>>,
    projections: HashMap<ImageId, ProjectionImage>,
}

/// The image of a projection light, and its mean over its area.
#[derive(Clone)]
pub struct ProjectionImage {
    pub image: Arc<TextureImage>,
    pub mean: Vec3,
}

impl<'s> LightImages<'s> {
    pub fn new(textures: &'s Textures) -> Self {
        Self { textures, environments: HashMap::new(), projections: HashMap::new() }
    }

    /// The image of an environment or a goniometric light; `is_sampled` if directions are sampled from it.
    pub fn environment(&mut self, map: EnvironmentMap, is_sampled: bool) -> Arc<EnvironmentImage> {
        let textures = self.textures;
        let from_textures = || Arc::new(EnvironmentImage::from_textures(textures, map, is_sampled));
        self.environments.entry((map, is_sampled)).or_insert_with(from_textures).clone()
    }

    /// The image of a projection light.
    pub fn projection(&mut self, id: ImageId) -> ProjectionImage {
        let with_mean = |image: Arc<TextureImage>| ProjectionImage { mean: image.mean_light(), image };
        self.projections.entry(id).or_insert_with(|| with_mean(self.textures.shared_image(id))).clone()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    #[test]
    fn lights_with_the_same_image_share_one_copy() {
        let mut textures = Textures::default();
        let id = textures.add_image(TextureImage::from_floats(2, 1, 1, vec![1.0, 3.0]));
        let mut images = LightImages::new(&textures);
        let map = EnvironmentMap::LatLong(id);
        let [sampled, unsampled] = [true, false].map(|is_sampled| images.environment(map, is_sampled));
        assert!(Arc::ptr_eq(&sampled, &images.environment(map, true)));
        assert!(sampled.sample(Vec2::splat(0.5)).is_some() && unsampled.sample(Vec2::splat(0.5)).is_none());
        assert_eq!(sampled.mean(), unsampled.mean());
        let projection = images.projection(id);
        assert_eq!(projection.mean, Vec3::splat(2.0));
        assert!(std::ptr::eq(&*projection.image, textures.image(id)), "no copy");
    }
}
