//! An image over the sphere of directions, with bilinear lookup and a distribution for sampling directions in
//! proportion to its values (pbrt-v4, section 12.5.2).

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::emission_bounds::average;
use super::piecewise_constant_2d::PiecewiseConstant2d;
use crate::render::sphere_map::SphereMap;
use crate::scene::Textures;
use crate::scene::light::EnvironmentMap;
use crate::scene::texture::floor;

/// An image over the sphere.
#[derive(Clone, Debug)]
pub struct EnvironmentImage {
    map: SphereMap,
    width: usize,
    height: usize,
    texels: Vec<Vec3>,
    /// `None` for a black image, and for an image that is not sampled.
    distribution: Option<PiecewiseConstant2d>,
    /// Mean over the sphere.
    mean: Vec3,
}

/// Texels whose radiances are held at once while an image is prepared.
const BLOCK: usize = 1 << 16;

impl EnvironmentImage {
    /// An image of the scene's textures, with a distribution if it `is_sampled`.
    pub fn from_textures(textures: &Textures, map: EnvironmentMap, is_sampled: bool) -> Self {
        let (map, id) = match map {
            EnvironmentMap::LatLong(id) => (SphereMap::LatLong, id),
            EnvironmentMap::EqualArea(id) => (SphereMap::EqualArea, id),
        };
        let image = textures.image(id);
        Self::new(map, image.width(), image.height(), is_sampled, |x, y| image.rgb(x, y))
    }

    /// Texels that are negative or not finite count as 0.
    pub fn new(
        map: SphereMap,
        width: usize,
        height: usize,
        is_sampled: bool,
        texel: impl Fn(usize, usize) -> Vec3 + Sync,
    ) -> Self {
        // Copy the texels
        let count = width * height;
        let clean = |t: Vec3| if t.is_finite() { t.max(Vec3::ZERO) } else { Vec3::ZERO };
        let texels: Vec<Vec3> =
            (0..count).into_par_iter().map(|i| clean(texel(i % width, i / width))).collect();
        let mut image = Self { map, width, height, texels, distribution: None, mean: Vec3::ZERO };

        // Add up the radiance, and weight the texels by it
        let solid_angles: Vec<f32> =
            (0..height).map(|y| map.solid_angle(Vec2::new(0.5, (y as f32 + 0.5) / height as f32))).collect();
        let mut sum = DVec3::ZERO;
        let mut weights: Vec<f32> = Vec::new();
        for first in (0..count).step_by(BLOCK) {
            let block = first..count.min(first + BLOCK);
            let radiance = |i: usize| image.texel_mean(i % width, i / width) * solid_angles[i / width];
            let radiances: Vec<Vec3> = block.into_par_iter().map(radiance).collect();
            // One by one, so that rounding does not depend on the threads
            for radiance in &radiances {
                sum += radiance.as_dvec3();
            }
            if is_sampled {
                weights.extend(radiances.into_iter().map(average));
            }
        }
        image.distribution = PiecewiseConstant2d::new(width, &weights);
        image.mean = (sum / (count.max(1) as f64 * 4.0 * std::f64::consts::PI)).as_vec3();
        image
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The value in a unit direction of the image's space.
    #[inline]
    pub fn lookup_direction(&self, direction: Vec3) -> Vec3 {
        self.lookup(self.map.uv(direction))
    }

    /// Samples a direction of the image's space, not exactly of unit length, and returns it with the value
    /// there and the density per solid angle; `None` if the image is black.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Option<(Vec3, Vec3, f32)> {
        let (uv, density) = self.distribution.as_ref()?.sample(u);
        let solid_angle = self.map.solid_angle(uv);
        (solid_angle > 0.0).then(|| (self.map.direction(uv), self.lookup(uv), density / solid_angle))
    }

    /// Density per solid angle with which [`Self::sample`] samples a unit direction.
    #[inline]
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let Some(distribution) = &self.distribution else { return 0.0 };
        let uv = self.map.uv(direction);
        let solid_angle = self.map.solid_angle(uv);
        if solid_angle > 0.0 { distribution.pdf(uv) / solid_angle } else { 0.0 }
    }

    /// Mean over the sphere.
    pub fn mean(&self) -> Vec3 {
        self.mean
    }

    /// Interpolates bilinearly between the centres of texels.
    #[inline]
    fn lookup(&self, uv: Vec2) -> Vec3 {
        let p = uv * Vec2::new(self.width as f32, self.height as f32) - 0.5;
        let floor = p.map(floor);
        let (x, y) = (floor.x as isize, floor.y as isize);
        let f = p - floor;
        let top = self.texel(x, y).lerp(self.texel(x + 1, y), f.x);
        let bottom = self.texel(x, y + 1).lerp(self.texel(x + 1, y + 1), f.x);
        top.lerp(bottom, f.y)
    }

    /// Mean of [`Self::lookup`] over a texel's area, positive wherever the interpolated image is.
    fn texel_mean(&self, x: usize, y: usize) -> Vec3 {
        const WEIGHTS: [f32; 3] = [0.125, 0.75, 0.125];
        let (x, y) = (x as isize, y as isize);
        let neighbours = (0..3).flat_map(|j| (0..3).map(move |i| (i, j)));
        neighbours
            .map(|(i, j)| WEIGHTS[i] * WEIGHTS[j] * self.texel(x + i as isize - 1, y + j as isize - 1))
            .sum()
    }

    #[inline]
    fn texel(&self, x: isize, y: isize) -> Vec3 {
        let (x, y) = self.map.wrap(x, y, self.width, self.height);
        self.texels[y * self.width + x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_of_several_blocks_has_the_mean_of_its_texels_in_their_order() {
        let (map, width, height) = (SphereMap::LatLong, 400, 200);
        assert!(width * height > BLOCK);
        let texel = |x: usize, y: usize| Vec3::new(1.0, 0.1, 0.01) * (x * y % 7) as f32;
        let image = EnvironmentImage::new(map, width, height, true, texel);
        let mut sum = DVec3::ZERO;
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / Vec2::new(width as f32, height as f32);
            sum += (image.texel_mean(x, y) * map.solid_angle(centre)).as_dvec3();
        }
        let solid_angle = (width * height) as f64 * 4.0 * std::f64::consts::PI;
        assert_eq!(image.mean(), (sum / solid_angle).as_vec3());
    }
}
