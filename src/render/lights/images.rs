//! Images of lights, each made ready once however many lights show it.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;

use super::environment::EnvironmentImage;
use crate::scene::light::EnvironmentMap;
use crate::scene::texture::TextureImage;
use crate::scene::{ImageId, Textures};

/// See the module.
pub struct LightImages<'s> {
    textures: &'s Textures,
    around: HashMap<EnvironmentMap, Arc<EnvironmentImage>>,
    windows: HashMap<ImageId, Window>,
}

/// An image that is seen through a window, and its mean.
#[derive(Clone)]
pub struct Window {
    pub image: Arc<TextureImage>,
    pub mean: Vec3,
}

impl<'s> LightImages<'s> {
    pub fn new(textures: &'s Textures) -> Self {
        Self { textures, around: HashMap::new(), windows: HashMap::new() }
    }

    pub fn around(&mut self, map: EnvironmentMap) -> Arc<EnvironmentImage> {
        let textures = self.textures;
        self.around.entry(map).or_insert_with(|| Arc::new(EnvironmentImage::of(textures, map))).clone()
    }

    pub fn window(&mut self, id: ImageId) -> Window {
        let of = |image: Arc<TextureImage>| Window { mean: image.mean_light(), image };
        self.windows.entry(id).or_insert_with(|| of(self.textures.shared_image(id))).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_of_one_image_share_it() {
        let mut textures = Textures::default();
        let id = textures.add_image(TextureImage::from_floats(2, 1, 1, vec![1.0, 3.0]));
        let mut images = LightImages::new(&textures);
        let map = EnvironmentMap::LatLong(id);
        assert!(Arc::ptr_eq(&images.around(map), &images.around(map)));
        let window = images.window(id);
        assert_eq!(window.mean, Vec3::splat(2.0));
        assert!(std::ptr::eq(&*window.image, textures.image(id)), "no copy");
    }
}
