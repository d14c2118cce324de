//! Light from everywhere: of one colour, or an image, whose bright parts are sampled more often.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Mat3A, Vec2, Vec3, Vec3A};

use super::brightness;
use super::choice::Reach;
use super::distribution::Distribution2d;
use super::images::LightImages;
use super::portal::PortalView;
use crate::render::disk::sin_cos_of_turns;
use crate::render::sphere_map::SphereMap;
use crate::scene::Textures;
use crate::scene::light::{Environment, EnvironmentMap};

/// An environment, ready to be looked up and sampled.
#[derive(Clone, Debug)]
pub struct EnvironmentLight {
    to_render: Mat3A,
    from_render: Mat3A,
    scale: Vec3,
    image: Option<Arc<EnvironmentImage>>,
    portal: Option<PortalView>,
}

/// Rows of the table of what is seen through a portal, where there is no image to have any.
const PLAIN_ROWS: usize = 64;

impl EnvironmentLight {
    pub fn new(images: &mut LightImages, environment: &Environment) -> Self {
        let to_render = environment.to_render.matrix3;
        let image = environment.map.map(|map| images.around(map));
        let rows = image.as_ref().map_or(PLAIN_ROWS, |image| image.height);
        let mut light = Self {
            to_render,
            from_render: to_render.inverse(),
            scale: environment.scale,
            image,
            portal: None,
        };
        light.portal = environment
            .portal
            .map(|portal| PortalView::new(&portal, rows, |direction| brightness(light.unhidden(direction))));
        light
    }

    /// Radiance, if it is the same at every point and from everywhere.
    #[inline]
    pub fn constant(&self) -> Option<Vec3> {
        (self.image.is_none() && self.portal.is_none()).then_some(self.scale)
    }

    /// Radiance at a point from a unit direction.
    #[inline]
    pub fn radiance(&self, from: Vec3, direction: Vec3) -> Vec3 {
        match &self.portal {
            Some(portal) if !portal.shows(from, direction) => Vec3::ZERO,
            _ => self.unhidden(direction),
        }
    }

    /// Radiance from a unit direction, where no portal hides it.
    #[inline]
    fn unhidden(&self, direction: Vec3) -> Vec3 {
        let Some(image) = &self.image else { return self.scale };
        self.scale * image.towards(self.local(direction))
    }

    /// A direction from a point, the radiance from there and the density per solid angle.
    #[inline]
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<(Vec3, Vec3, f32)> {
        if let Some(portal) = &self.portal {
            let (direction, pdf) = portal.sample(from, u)?;
            return Some((direction, self.unhidden(direction), pdf));
        }
        let Some(image) = &self.image else {
            let (direction, pdf) = uniform_direction(u);
            return Some((direction, self.scale, pdf));
        };
        let (uv, density) = image.distribution.as_ref()?.sample(u);
        let solid_angle = image.map.solid_angle(uv);
        let direction = Vec3::from(self.to_render * Vec3A::from(image.map.direction(uv))).normalize();
        (solid_angle > 0.0).then(|| (direction, self.scale * image.lookup(uv), density / solid_angle))
    }

    /// Density with which [`Self::sample`] gives a unit direction.
    #[inline]
    pub fn pdf(&self, from: Vec3, direction: Vec3) -> f32 {
        if let Some(portal) = &self.portal {
            return portal.pdf(from, direction);
        }
        let Some(image) = &self.image else { return 1.0 / (4.0 * PI) };
        let Some(distribution) = &image.distribution else { return 0.0 };
        let uv = image.map.uv(self.local(direction));
        let solid_angle = image.map.solid_angle(uv);
        if solid_angle > 0.0 { distribution.density(uv) / solid_angle } else { 0.0 }
    }

    /// What it is chosen by: through a portal it shines as a lamp of that shape would.
    pub fn reach(&self) -> Reach {
        match &self.portal {
            Some(portal) => Reach::Within(portal.bounds()),
            None => Reach::Around { direction: None, irradiance: self.mean_irradiance() },
        }
    }

    /// Brightness of the irradiance, on average over surfaces of all orientations and as if there
    /// were no portal.
    pub fn mean_irradiance(&self) -> f32 {
        PI * brightness(self.image.as_ref().map_or(self.scale, |image| self.scale * image.mean))
    }

    fn local(&self, direction: Vec3) -> Vec3 {
        Vec3::from(self.from_render * Vec3A::from(direction)).normalize()
    }
}

/// An image around the sphere.
#[derive(Clone, Debug)]
pub struct EnvironmentImage {
    map: SphereMap,
    width: usize,
    height: usize,
    texels: Vec<Vec3>,
    distribution: Option<Distribution2d>,
    /// Mean over the sphere.
    mean: Vec3,
}

impl EnvironmentImage {
    pub fn of(textures: &Textures, map: EnvironmentMap) -> Self {
        let (map, id) = match map {
            EnvironmentMap::LatLong(id) => (SphereMap::LatLong, id),
            EnvironmentMap::EqualArea(id) => (SphereMap::EqualArea, id),
        };
        let image = textures.image(id);
        Self::new(map, image.width(), image.height(), |x, y| image.rgb(x, y))
    }

    fn new(map: SphereMap, width: usize, height: usize, texel: impl Fn(usize, usize) -> Vec3) -> Self {
        let cells = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let clean = |t: Vec3| if t.is_finite() { t.max(Vec3::ZERO) } else { Vec3::ZERO };
        let texels: Vec<Vec3> = cells().map(|(x, y)| clean(texel(x, y))).collect();
        let mut image = Self { map, width, height, texels, distribution: None, mean: Vec3::ZERO };
        let centre = |x: usize, y: usize| {
            Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / Vec2::new(width as f32, height as f32)
        };
        let mut sum = glam::DVec3::ZERO;
        let weights: Vec<f32> = cells()
            .map(|(x, y)| {
                let radiance = image.cell_mean(x, y) * map.solid_angle(centre(x, y));
                sum += radiance.as_dvec3();
                brightness(radiance)
            })
            .collect();
        image.distribution = Distribution2d::new(width, &weights);
        image.mean = (sum / (weights.len().max(1) as f64 * 4.0 * std::f64::consts::PI)).as_vec3();
        image
    }

    /// The value in a unit direction of the image's space.
    #[inline]
    pub fn towards(&self, direction: Vec3) -> Vec3 {
        self.lookup(self.map.uv(direction))
    }

    /// Mean over the sphere.
    pub fn mean(&self) -> Vec3 {
        self.mean
    }

    /// Bilinear interpolation between the centres of texels.
    #[inline]
    fn lookup(&self, uv: Vec2) -> Vec3 {
        let p = uv * Vec2::new(self.width as f32, self.height as f32) - 0.5;
        let floor = p.floor();
        let (x, y) = (floor.x as isize, floor.y as isize);
        let f = p - floor;
        let top = self.texel(x, y).lerp(self.texel(x + 1, y), f.x);
        let bottom = self.texel(x, y + 1).lerp(self.texel(x + 1, y + 1), f.x);
        top.lerp(bottom, f.y)
    }

    /// Mean of [`Self::lookup`] over a texel: positive wherever that is.
    fn cell_mean(&self, x: usize, y: usize) -> Vec3 {
        const SHARES: [f32; 3] = [0.125, 0.75, 0.125];
        let (x, y) = (x as isize, y as isize);
        let neighbours = (0..3).flat_map(|j| (0..3).map(move |i| (i, j)));
        neighbours
            .map(|(i, j)| SHARES[i] * SHARES[j] * self.texel(x + i as isize - 1, y + j as isize - 1))
            .sum()
    }

    #[inline]
    fn texel(&self, x: isize, y: isize) -> Vec3 {
        let (x, y) = self.map.wrap(x, y, self.width, self.height);
        self.texels[y * self.width + x]
    }
}

/// A direction of the unit sphere, with its density.
#[inline(always)]
pub fn uniform_direction(u: Vec2) -> (Vec3, f32) {
    let z = 1.0 - 2.0 * u.x;
    let (sin, cos) = sin_cos_of_turns(u.y);
    let r = (1.0 - z * z).max(0.0).sqrt();
    (Vec3::new(r * cos, r * sin, z), 1.0 / (4.0 * PI))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::chi_squared::{p_value, significance};

    fn light(image: Option<EnvironmentImage>) -> EnvironmentLight {
        let to_render = Mat3A::from_rotation_x(0.7) * Mat3A::from_rotation_z(2.0);
        EnvironmentLight {
            to_render,
            from_render: to_render.inverse(),
            scale: Vec3::new(1.0, 2.0, 3.0),
            image: image.map(Arc::new),
            portal: None,
        }
    }

    /// Constant, and for each map an image with a bright spot, a dark half and a black corner.
    fn lights() -> Vec<EnvironmentLight> {
        let texel = |x: usize, y: usize| match (x, y) {
            (5, 3) => Vec3::splat(200.0),
            (0..6, 0..4) => Vec3::ZERO,
            (_, 8..) => Vec3::new(0.1, 0.2, 0.1),
            _ => Vec3::splat(1.0 + (x * y % 7) as f32),
        };
        let image = |map| Some(EnvironmentImage::new(map, 16, 16, texel));
        vec![light(None), light(image(SphereMap::LatLong)), light(image(SphereMap::EqualArea))]
    }

    /// Bin of a direction: 8 in azimuth by 8 in height, of equal solid angle.
    fn bin(d: Vec3) -> usize {
        let phi = (d.y.atan2(d.x) / (2.0 * PI)).rem_euclid(1.0);
        ((d.z + 1.0) * 4.0).clamp(0.0, 7.0) as usize * 8 + (phi * 8.0).min(7.0) as usize
    }

    fn halton(i: u32, base: u32) -> f32 {
        let (mut i, mut f, mut r) = (i, 1.0, 0.0);
        while i > 0 {
            f /= base as f32;
            r += f * (i % base) as f32;
            i /= base;
        }
        r.min(0.999_999_9)
    }

    fn uniform_directions(n: u32) -> impl Iterator<Item = Vec3> {
        (0..n).map(|i| uniform_direction(Vec2::new(halton(i, 2), halton(i, 3))).0)
    }

    #[test]
    fn the_density_integrates_to_one() {
        let n = 200_000;
        for (k, light) in lights().iter().enumerate() {
            let sum: f64 = uniform_directions(n).map(|d| f64::from(light.pdf(Vec3::ZERO, d))).sum();
            let integral = sum / f64::from(n) * f64::from(4.0 * PI);
            assert!((integral - 1.0).abs() < 0.01, "light {k}: {integral}");
        }
    }

    #[test]
    fn sampled_directions_follow_the_density() {
        use rand::{RngExt, SeedableRng};
        let n = 100_000;
        for (k, light) in lights().iter().enumerate() {
            let mut expected = [0.0; 64];
            let m = 2_000_000;
            for d in uniform_directions(m) {
                expected[bin(d)] +=
                    f64::from(light.pdf(Vec3::ZERO, d)) * f64::from(4.0 * PI) * f64::from(n) / f64::from(m);
            }
            let mut counts = [0.0; 64];
            let mut rng = rand_pcg::Pcg32::seed_from_u64(k as u64);
            let mut strays = 0;
            for _ in 0..n {
                let (d, radiance, pdf) =
                    light.sample(Vec3::ZERO, Vec2::new(rng.random(), rng.random())).unwrap();
                counts[bin(d)] += 1.0;
                // Rounding carries a few samples into the neighbouring cell.
                strays += u32::from((pdf / light.pdf(Vec3::ZERO, d) - 1.0).abs() > 0.05);
                assert!(radiance.distance(light.radiance(Vec3::ZERO, d)) < 0.02 * radiance.length() + 1e-3);
            }
            assert!(strays < n / 1000, "light {k}: {strays} samples of another density");
            let p = p_value(&counts, &expected);
            assert!(p > significance(lights().len()), "light {k}: p = {p}");
        }
    }

    #[test]
    fn the_mean_irradiance_is_a_quarter_of_the_integral_of_the_brightness() {
        let n = 200_000;
        for (k, light) in lights().iter().enumerate() {
            let sum: f64 =
                uniform_directions(n).map(|d| f64::from(brightness(light.radiance(Vec3::ZERO, d)))).sum();
            let expected = sum / f64::from(n) * f64::from(PI);
            let found = f64::from(light.mean_irradiance());
            assert!((expected / found - 1.0).abs() < 0.02, "light {k}: {expected} {found}");
        }
    }

    #[test]
    fn a_black_image_is_never_sampled() {
        let black = light(Some(EnvironmentImage::new(SphereMap::LatLong, 4, 2, |_, _| Vec3::ZERO)));
        assert!(black.sample(Vec3::ZERO, Vec2::splat(0.5)).is_none());
        assert_eq!((black.pdf(Vec3::ZERO, Vec3::Z), black.mean_irradiance()), (0.0, 0.0));
    }
}
