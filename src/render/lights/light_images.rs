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
    environments: HashMap<EnvironmentMap, Arc<EnvironmentImage>>,
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

    /// The image of an environment or a goniometric light.
    pub fn environment(&mut self, map: EnvironmentMap) -> Arc<EnvironmentImage> {
        let textures = self.textures;
        let from_textures = || Arc::new(EnvironmentImage::from_textures(textures, map));
        self.environments.entry(map).or_insert_with(from_textures).clone()
    }

    /// The image of a projection light.
    pub fn projection(&mut self, id: ImageId) -> ProjectionImage {
        let with_mean = |image: Arc<TextureImage>| ProjectionImage { mean: image.mean_light(), image };
        self.projections.entry(id).or_insert_with(|| with_mean(self.textures.shared_image(id))).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_with_the_same_image_share_one_copy() {
        let mut textures = Textures::default();
        let id = textures.add_image(TextureImage::from_floats(2, 1, 1, vec![1.0, 3.0]));
        let mut images = LightImages::new(&textures);
        let map = EnvironmentMap::LatLong(id);
        assert!(Arc::ptr_eq(&images.environment(map), &images.environment(map)));
        let projection = images.projection(id);
        assert_eq!(projection.mean, Vec3::splat(2.0));
        assert!(std::ptr::eq(&*projection.image, textures.image(id)), "no copy");
    }
}
