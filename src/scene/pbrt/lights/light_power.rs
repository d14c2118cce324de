//! Scales lights to a given power or illuminance.

use std::f64::consts::PI;

use glam::{Vec2, Vec3};

use crate::image::luminance;
use crate::scene::light::{Environment, EnvironmentMap};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParseError, Result};
use crate::scene::{Light, TextureImage};

impl SceneBuilder {
    /// Scales lights with images to their given power, once the images are decoded. As in pbrt-v4,
    /// the mean luminance of an image stands for that of the surface.
    ///
    /// # Errors
    /// If a light's colour overflows.
    pub fn scale_lights_to_power(&mut self) -> Result<()> {
        // Scale area lights
        for (index, loc) in std::mem::take(&mut self.area_lights_with_power) {
            let Some(light) = &mut self.groups[0].primitives[index].area_light else { continue };
            let Some(id) = light.image else { continue };
            let mean = luminance(self.textures.image(id).mean_light().to_array());
            if mean > 0.0 {
                light.radiance = scale_light(light.radiance, f64::from(mean).recip(), loc)?;
            }
        }

        // Scale projectors and environment maps
        self.scale_projectors_to_power()?;
        for (index, illuminance, loc) in std::mem::take(&mut self.environments_with_illuminance) {
            let Light::Environment(Environment { scale, map: Some(EnvironmentMap::EqualArea(id)), .. }) =
                &mut self.lights[index]
            else {
                continue;
            };
            let mapped = zenith_illuminance(self.textures.image(*id));
            if mapped > 0.0 {
                *scale = scale_light(*scale, illuminance / mapped, loc)?;
            }
        }
        Ok(())
    }
}

/// Illuminance by an equal-area environment image of a surface that faces its zenith.
fn zenith_illuminance(image: &TextureImage) -> f64 {
    let size = Vec2::new(image.width() as f32, image.height() as f32);
    let texels = (0..image.height()).flat_map(|y| (0..image.width()).map(move |x| (x, y)));
    let sum: f64 = texels
        .map(|(x, y)| {
            let up = equal_area_cos_theta((Vec2::new(x as f32, y as f32) + 0.5) / size);
            f64::from(up.max(0.0) * luminance(image.rgb(x, y).max(Vec3::ZERO).to_array()))
        })
        .sum();
    sum * 4.0 * PI / f64::from(size.x * size.y)
}

/// Cosine to the zenith of the direction at a point of an equal-area octahedral map (Clarberg 2008).
fn equal_area_cos_theta(uv: Vec2) -> f32 {
    let from_centre = (2.0 * uv - 1.0).abs();
    // The equator is a square that stands on its corner
    let inside = 1.0 - from_centre.x - from_centre.y;
    let r = 1.0 - inside.abs();
    (1.0 - r * r).copysign(inside)
}

/// Scales a light's colour for the parameter called `name`.
pub fn scale_to_parameter(
    params: &ParameterDictionary,
    name: &str,
    colour: Vec3,
    factor: f64,
) -> Result<Vec3> {
    scale_light(colour, factor, params.get(name).map_or(params.loc, |param| param.loc))
}

/// Multiplies a light's colour by `factor`.
///
/// # Errors
/// Located at `loc`, if the product is not finite.
pub fn scale_light(colour: Vec3, factor: f64, loc: FileLoc) -> Result<Vec3> {
    let product = (colour.as_dvec3() * factor).as_vec3();
    if product.is_finite() {
        return Ok(product);
    }
    let message =
        format!("scaling the light's colour {colour} by {factor:e} overflows; expected a smaller power");
    Err(ParseError::new(loc, message))
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;
    use std::path::Path;

    use glam::Vec3;

    use crate::scene::pbrt::read_str;
    use crate::scene::{Light, Scene, TextureImage};

    fn world(text: &str) -> Scene {
        read_str(&format!("WorldBegin {text}"), Path::new("")).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn the_power_of_an_area_light_is_divided_by_its_area() {
        let cases = [
            ("Shape \"sphere\" \"float radius\" 2", 16.0 * PI),
            ("Scale 2 2 2 Shape \"sphere\"", 16.0 * PI),
            ("Scale 2 3 1 Shape \"disk\" \"float innerradius\" .5", 4.5 * PI),
            ("Shape \"trianglemesh\" \"point3 P\" [0 0 0 2 0 0 0 2 0]", 2.0),
        ];
        for (shape, area) in cases {
            for (sides, factor) in [("", 1.0), ("\"bool twosided\" true", 2.0)] {
                let light = "AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] \"float power\" 12";
                let scene = world(&format!("{light} {sides} {shape}"));
                let radiance = scene.primitives[0].area_light.unwrap().radiance;
                let expected = Vec3::new(1.0, 2.0, 3.0) * (12.0 / (PI * area * factor));
                assert!((radiance - expected).length() < 1e-4 * expected.length(), "{shape} {sides}");
            }
        }
    }

    #[test]
    fn lights_with_images_are_scaled_to_their_power() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = b"PF\n2 2\n-1.0\n".to_vec();
        let texels: [[f32; 3]; 4] = [[4.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
        file.extend(texels.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        std::fs::write(folder.path().join("a.pfm"), file).unwrap();
        let light = "AreaLightSource \"diffuse\" \"string filename\" \"a.pfm\" \"float power\" 12";
        let mut even = b"PF\n4 4\n-1.0\n".to_vec();
        even.extend([2.0f32; 48].iter().flat_map(|v| v.to_le_bytes()));
        std::fs::write(folder.path().join("sky.pfm"), even).unwrap();
        let sky = "LightSource \"infinite\" \"string filename\" \"sky.pfm\" \"float illuminance\" 5";
        let text = format!("WorldBegin {sky} {light} Shape \"disk\" Shape \"sphere\" \"float radius\" 2");
        let scene = read_str(&text, folder.path()).unwrap();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let mean = (4.0 * 0.2126 + 2.0 * 0.7152 + 0.0722 + 1.0) / 4.0;
        for (primitive, area) in scene.primitives.iter().zip([PI, 16.0 * PI]) {
            let radiance = primitive.area_light.unwrap().radiance;
            let expected = 12.0 / (PI * area * mean);
            assert!((radiance / expected - 1.0).abs().max_element() < 1e-5, "{radiance} {expected}");
        }
        let Light::Environment(environment) = &scene.lights[0] else { panic!() };
        let mapped = super::zenith_illuminance(&scene.textures.images()[0]) as f32;
        assert!((environment.scale * mapped / 5.0 - 1.0).abs().max_element() < 1e-5, "{mapped}");
    }

    #[test]
    fn a_constant_image_gives_the_illuminance_of_a_constant_sky() {
        let image = TextureImage::from_floats(64, 64, 1, vec![2.0; 64 * 64]);
        let illuminance = super::zenith_illuminance(&image);
        assert!((illuminance / (2.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3, "{illuminance}");
    }
}
