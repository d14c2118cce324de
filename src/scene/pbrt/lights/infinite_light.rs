//! `infinite`: environment lights.

use std::f64::consts::PI;

use glam::{Affine3A, DVec3, Vec3};

use super::light_power::scale_to_parameter;
use crate::scene::light::{Environment, EnvironmentMap, Portal};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{ParameterDictionary, Result};
use crate::scene::pbrt::textures::image_encoding;
use crate::scene::texture::Content;
use crate::scene::{ImageId, Light};

impl SceneBuilder {
    /// `infinite`.
    pub fn infinite(&mut self, params: &ParameterDictionary) -> Result<Light> {
        let file = image_filename(params)?;
        let default = if file.is_some() { Vec3::ONE } else { self.illuminant() };
        let mut scale = self.light_colour(params, "L", default)?;
        let map = match file {
            None => None,
            Some(file) => {
                let image = self.light_image(file, params)?;
                Some(self.environment_map(image))
            }
        };
        let portal = self.portal(params)?;
        match (map, params.positive("illuminance")?) {
            (None, Some(illuminance)) => {
                scale = scale_to_parameter(params, "illuminance", scale, illuminance / PI)?;
            }
            (Some(_), Some(illuminance)) if scale != Vec3::ZERO => {
                self.environments_with_illuminance.push((self.lights.len(), illuminance, params.loc))
            }
            _ => {}
        }
        // Remove the uniform part of the transform's scale
        let to_render = self.to_render().matrix3;
        let to_render = to_render * to_render.determinant().abs().cbrt().recip();
        Ok(Light::Environment(Environment {
            to_render: Affine3A::from_mat3(to_render.as_mat3()),
            scale,
            map,
            portal,
        }))
    }

    /// The image of a light.
    pub fn light_image(&mut self, file: &str, params: &ParameterDictionary) -> Result<ImageId> {
        let encoding = image_encoding(params, self.dialect)?.or(self.dialect.light_encoding());
        Ok(self.image(file, encoding, Content::Light, self.dialect.missing_light_value(), params.loc))
    }

    /// The mapping of an image to the sphere in this dialect.
    pub fn environment_map(&mut self, image: ImageId) -> EnvironmentMap {
        if self.dialect.environment_maps_are_lat_long() {
            EnvironmentMap::LatLong(image)
        } else {
            self.images.require_square(image);
            EnvironmentMap::EqualArea(image)
        }
    }

    /// The portal of an environment, given in world space whatever the current transform (as in
    /// pbrt-v4).
    fn portal(&self, params: &ParameterDictionary) -> Result<Option<Portal>> {
        /// Tolerance of the right angle (its cosine) and of the fourth corner (as a fraction of an
        /// edge).
        const TOLERANCE: f64 = 1e-3;
        let Some(corners) = params.triples("portal")? else { return Ok(None) };
        let param = params.get("portal").expect("its numbers were just found");
        let &[corner, up, opposite, along] = &corners[..] else {
            return Err(param.error(format_args!("a list of {} points", corners.len()), "four points"));
        };
        let edges = [along - corner, up - corner];
        let [length, height] = edges.map(DVec3::length);
        let closes = (corner + edges[0] + edges[1]).distance(opposite) <= TOLERANCE * length.min(height);
        let is_right = edges[0].dot(edges[1]).abs() <= TOLERANCE * length * height;
        if !(closes && is_right && length > 0.0 && height > 0.0) {
            return Err(param.error("not a rectangle", "its four corners in order"));
        }
        Ok(Some(Portal { corner: (corner - self.origin()).as_vec3(), edges: edges.map(|e| e.as_vec3()) }))
    }
}

/// The file name of a light's image; the parameter's name depends on the dialect.
pub fn image_filename(params: &ParameterDictionary) -> Result<Option<&str>> {
    let file = match params.string("filename")? {
        Some(file) => Some(file),
        None => params.string("mapname")?,
    };
    Ok(file.filter(|file| !file.is_empty()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use crate::scene::Light;
    use crate::scene::light::Portal;
    use crate::scene::pbrt::read_str;

    #[test]
    fn portals_are_rectangles_in_world_space() {
        let light = |portal: &str| {
            let light = format!("LightSource \"infinite\" \"point3 portal\" [{portal}]");
            read_str(
                &format!("LookAt 1 0 0 2 0 0 0 0 1 Camera \"perspective\" WorldBegin Scale 9 9 9 {light}"),
                Path::new(""),
            )
        };
        let scene = light("0 0 0 0 1 0 2 1 0 2 0 0").unwrap();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let Light::Environment(environment) = &scene.lights[0] else { panic!() };
        let expected = Portal { corner: Vec3::NEG_X, edges: [2.0 * Vec3::X, Vec3::Y] };
        assert_eq!(environment.portal, Some(expected));
        for wrong in [
            "0 0 0 0 1 0 2 1 0",
            "0 0 0 0 1 0 2 1 0 1 0 0",
            "0 0 0 1 1 0 3 1 0 2 0 0",
            "0 0 0 0 0 0 2 0 0 2 0 0",
        ] {
            assert!(light(wrong).unwrap_err().message.contains("portal"), "{wrong}");
        }
    }
}
