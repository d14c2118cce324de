//! Lights, by the names and defaults of pbrt-v4.

use std::f64::consts::PI;

use glam::{Affine3A, DVec3, Vec2, Vec3};

use super::directives::Statement;
use super::params::{ParamType, Params};
use super::state::{Emission, Reader};
use super::textures::encoding;
use super::transforms::{inverse, unit};
use super::{Fault, Place, Result};
use crate::scene::light::{AreaLight, Environment, EnvironmentMap, Portal};
use crate::scene::texture::{Channels, luminance};
use crate::scene::{ImageId, Light, TextureImage};

impl Reader {
    pub fn area_light_source(&mut self, statement: &Statement) -> Result<()> {
        let params = self.params_for("light", statement);
        let kind = &statement.strings[0];
        if !["diffuse", "area"].contains(&kind.as_str()) {
            let message = format!("area light \"{kind}\"; diffuse is accepted");
            return Err(Fault::new(statement.place, message));
        }
        params.get("nsamples");
        params.get("samples");
        let radiance = self.light_color(&params, "L")?;
        let two_sided = params.bool_or("twosided", false)?;
        let power = params.positive("power")?;
        let image = params.string("filename")?.filter(|file| !file.is_empty());
        let image = image.map(|file| self.image(file, None, Channels::All, params.place));
        let light = AreaLight { radiance, image, two_sided };
        self.state.area_light = (radiance != Vec3::ZERO).then_some(Emission { light, power });
        statement.params.mark_used_in(&params);
        Ok(())
    }

    pub fn light_source(&mut self, statement: &Statement) -> Result<()> {
        let params = &*self.params_for("light", statement);
        if self.is_animated() {
            self.warnings.add(statement.place, "moving lights stand still where they are at the start");
        }
        if inverse(&self.to_render()).is_none() {
            let message = "a singular transform; one that can be inverted would be accepted";
            return Err(Fault::new(statement.place, message));
        }
        params.get("nsamples");
        params.get("samples");
        let light = match statement.strings[0].as_str() {
            "point" => self.point(params)?,
            "spot" => self.spot(params)?,
            "distant" => self.distant(params)?,
            "infinite" | "exinfinite" => self.infinite(params)?,
            "goniometric" => self.goniometric(params)?,
            "projection" => self.projection(params)?,
            other => {
                let accepted = "point, spot, goniometric, projection, distant and infinite are accepted";
                let message = format!("light \"{other}\"; {accepted}");
                return Err(Fault::new(statement.place, message));
            }
        };
        if !is_placed(&light) {
            let message = "a light that is not at a finite place; finite coordinates would be accepted";
            return Err(Fault::new(statement.place, message));
        }
        if emission(&light) != Vec3::ZERO {
            self.lights.push(light);
        }
        statement.params.mark_used_in(params);
        Ok(())
    }

    /// Brings lights whose power is given to it, once their images are read: pbrt-v4 takes the
    /// mean luminance of the image for that of the surface.
    ///
    /// # Errors
    /// For one that becomes brighter than numbers go.
    pub fn normalise_lights(&mut self) -> Result<()> {
        for (index, place) in std::mem::take(&mut self.powered_images) {
            let Some(light) = &mut self.groups[0].primitives[index].area_light else { continue };
            let Some(id) = light.image else { continue };
            let mean = luminance(self.textures.image(id).mean_light());
            if mean > 0.0 {
                light.radiance = brightened(light.radiance, f64::from(mean).recip(), place)?;
            }
        }
        self.normalise_projectors()?;
        for (index, illuminance, place) in std::mem::take(&mut self.lit_environments) {
            let Light::Environment(Environment { scale, map: Some(EnvironmentMap::EqualArea(id)), .. }) =
                &mut self.lights[index]
            else {
                continue;
            };
            let mapped = upper_illuminance(self.textures.image(*id));
            if mapped > 0.0 {
                *scale = brightened(*scale, illuminance / mapped, place)?;
            }
        }
        Ok(())
    }

    /// Colour times `scale`, per channel not below 0.
    pub fn light_color(&mut self, params: &Params, name: &str) -> Result<Vec3> {
        let color =
            self.spectrum(params, name)?.map_or(Vec3::ONE, |spectrum| self.dialect.light_of(&spectrum));
        // v3 has a colour for a scale.
        let scale = match params.get("scale").map(|param| param.kind) {
            Some(ParamType::Rgb | ParamType::Spectrum) => {
                self.spectrum(params, "scale")?.map_or(Vec3::ONE, |spectrum| spectrum.unadapted())
            }
            _ => Vec3::splat(params.float_or("scale", 1.0)? as f32),
        };
        let color = color * scale;
        if color.is_finite() && color.cmpge(Vec3::ZERO).all() {
            return Ok(color);
        }
        let accepted = "numbers from 0 would be accepted";
        Err(Fault::new(params.place, format!("a light of \"{name}\" {color}; {accepted}")))
    }

    pub fn point(&mut self, params: &Params) -> Result<Light> {
        let from = params.triple_or("from", DVec3::ZERO)?;
        let position = self.to_render().transform_point3(from).as_vec3();
        let mut intensity = self.light_color(params, "I")?;
        if let Some(power) = params.positive("power")? {
            intensity = brought_to(params, "power", intensity, power / (4.0 * PI))?;
        }
        Ok(Light::Point { position, intensity })
    }

    fn spot(&mut self, params: &Params) -> Result<Light> {
        let (from, axis) = self.source_and_axis(params)?;
        let total = params.float_or("coneangle", 30.0)?;
        let delta = params.float_or("conedeltaangle", 5.0)?;
        let cos_total_width = total.to_radians().cos();
        let cos_falloff_start = (total - delta).max(0.0).to_radians().cos().max(cos_total_width);
        let mut intensity = self.light_color(params, "I")?;
        if let Some(power) = params.positive("power")? {
            // The falloff is halfway between its ends in the mean.
            let solid_angle =
                2.0 * PI * ((1.0 - cos_falloff_start) + (cos_falloff_start - cos_total_width) / 2.0);
            if solid_angle > 0.0 {
                intensity = brought_to(params, "power", intensity, power / solid_angle)?;
            }
        }
        Ok(Light::Spot {
            position: self.to_render().transform_point3(from).as_vec3(),
            axis,
            intensity,
            cos_falloff_start: cos_falloff_start as f32,
            cos_total_width: cos_total_width as f32,
            falloff: self.dialect.spot_falloff(),
        })
    }

    fn distant(&mut self, params: &Params) -> Result<Light> {
        let (_, axis) = self.source_and_axis(params)?;
        let mut radiance = self.light_color(params, "L")?;
        if let Some(illuminance) = params.positive("illuminance")? {
            radiance = brought_to(params, "illuminance", radiance, illuminance)?;
        }
        Ok(Light::Distant { direction: -axis, radiance })
    }

    /// `from`, and the direction from there to `to` in render space.
    fn source_and_axis(&self, params: &Params) -> Result<(DVec3, Vec3)> {
        let from = params.triple_or("from", DVec3::ZERO)?;
        let to = params.triple_or("to", DVec3::Z)?;
        let axis = unit(to - from).and_then(|axis| unit(self.to_render().transform_vector3(axis)));
        let Some(axis) = axis else {
            let message = "a light from a point to the same point; two points would be accepted";
            return Err(Fault::new(params.place, message));
        };
        Ok((from, axis.as_vec3()))
    }

    fn infinite(&mut self, params: &Params) -> Result<Light> {
        let mut scale = self.light_color(params, "L")?;
        let map = match image_of(params)? {
            None => None,
            Some(file) => {
                let image = self.light_image(file, params)?;
                Some(self.environment_map(image))
            }
        };
        let portal = self.portal(params)?;
        match (map, params.positive("illuminance")?) {
            (None, Some(illuminance)) => {
                scale = brought_to(params, "illuminance", scale, illuminance / PI)?;
            }
            (Some(_), Some(illuminance)) if scale != Vec3::ZERO => {
                self.lit_environments.push((self.lights.len(), illuminance, params.place))
            }
            _ => {}
        }
        // Directions have no size.
        let to_render = self.to_render().matrix3;
        let to_render = to_render * to_render.determinant().abs().cbrt().recip();
        Ok(Light::Environment(Environment {
            to_render: Affine3A::from_mat3(to_render.as_mat3()),
            scale,
            map,
            portal,
        }))
    }

    pub fn light_image(&mut self, file: &str, params: &Params) -> Result<ImageId> {
        let encoding = encoding(params, self.dialect)?.or(self.dialect.light_encoding());
        Ok(self.image(file, encoding, Channels::All, params.place))
    }

    pub fn environment_map(&mut self, image: ImageId) -> EnvironmentMap {
        if self.dialect.environments_are_lat_long() {
            EnvironmentMap::LatLong(image)
        } else {
            self.image_must_be_square(image);
            EnvironmentMap::EqualArea(image)
        }
    }

    /// The rectangle that an environment is seen through. It stands in world space, whatever the
    /// current transform (as in pbrt-v4).
    fn portal(&self, params: &Params) -> Result<Option<Portal>> {
        /// Largest cosine of what passes for a right angle, and largest gap, as a share of an edge,
        /// of what passes for closed.
        const TOLERANCE: f64 = 1e-3;
        let Some(corners) = params.triples("portal")? else { return Ok(None) };
        let param = params.get("portal").expect("its numbers were just found");
        let &[corner, up, opposite, along] = &corners[..] else {
            return Err(param.fault(format_args!("{} points", corners.len()), "four"));
        };
        let edges = [along - corner, up - corner];
        let [length, height] = edges.map(DVec3::length);
        let closes = (corner + edges[0] + edges[1]).distance(opposite) <= TOLERANCE * length.min(height);
        let is_right = edges[0].dot(edges[1]).abs() <= TOLERANCE * length * height;
        if !(closes && is_right && length > 0.0 && height > 0.0) {
            return Err(param.fault("no rectangle", "its corners, one after the other,"));
        }
        Ok(Some(Portal { corner: (corner - self.origin()).as_vec3(), edges: edges.map(|e| e.as_vec3()) }))
    }
}

/// The file of a light's image, by its names in all dialects.
pub fn image_of(params: &Params) -> Result<Option<&str>> {
    let file = match params.string("filename")? {
        Some(file) => Some(file),
        None => params.string("mapname")?,
    };
    Ok(file.filter(|file| !file.is_empty()))
}

/// Illuminance that an environment image gives to what faces the top of its sphere.
fn upper_illuminance(image: &TextureImage) -> f64 {
    let size = Vec2::new(image.width() as f32, image.height() as f32);
    let texels = (0..image.height()).flat_map(|y| (0..image.width()).map(move |x| (x, y)));
    let sum: f64 = texels
        .map(|(x, y)| {
            let up = equal_area_height((Vec2::new(x as f32, y as f32) + 0.5) / size);
            f64::from(up.max(0.0) * luminance(image.rgb(x, y).max(Vec3::ZERO)))
        })
        .sum();
    sum * 4.0 * PI / f64::from(size.x * size.y)
}

/// Cosine to the top of the direction at a point of an equal-area octahedral map (Clarberg 2008).
fn equal_area_height(uv: Vec2) -> f32 {
    let from_middle = (2.0 * uv - 1.0).abs();
    // Signed distance from the equator, which is a square on its corner.
    let inside = 1.0 - from_middle.x - from_middle.y;
    let r = 1.0 - inside.abs();
    (1.0 - r * r).copysign(inside)
}

/// A light's colour times what a parameter makes of it.
fn brought_to(params: &Params, name: &str, colour: Vec3, factor: f64) -> Result<Vec3> {
    brightened(colour, factor, params.get(name).map_or(params.place, |param| param.place))
}

/// A light's colour times `factor`; `place` is what asks for it.
pub fn brightened(colour: Vec3, factor: f64, place: Place) -> Result<Vec3> {
    let product = (colour.as_dvec3() * factor).as_vec3();
    if product.is_finite() {
        return Ok(product);
    }
    let message =
        format!("this makes a light of {colour} {factor:e} times as bright; less would be accepted");
    Err(Fault::new(place, message))
}

/// Whether a light's place and axes are finite, as `f32`.
fn is_placed(light: &Light) -> bool {
    match light {
        Light::Point { position, .. } => position.is_finite(),
        Light::Spot { position, axis, .. } => position.is_finite() && axis.is_finite(),
        Light::Projector { position, from_render, .. } => position.is_finite() && from_render.is_finite(),
        Light::Distant { direction, .. } => direction.is_finite(),
        Light::Environment(Environment { to_render, portal, .. }) => {
            let is_finite =
                |portal: &Portal| portal.corner.is_finite() && portal.edges.iter().all(|e| e.is_finite());
            to_render.is_finite() && portal.as_ref().is_none_or(is_finite)
        }
    }
}

fn emission(light: &Light) -> Vec3 {
    match light {
        Light::Point { intensity, .. }
        | Light::Spot { intensity, .. }
        | Light::Projector { intensity, .. } => *intensity,
        Light::Distant { radiance, .. } => *radiance,
        Light::Environment(environment) => environment.scale,
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;
    use std::path::Path;

    use glam::Vec3;

    use crate::scene::light::Portal;
    use crate::scene::pbrt::read_str;
    use crate::scene::{Light, Scene, TextureImage};

    fn world(text: &str) -> Scene {
        read_str(&format!("WorldBegin {text}"), Path::new("")).unwrap_or_else(|error| panic!("{error}"))
    }

    /// As in pbrt-v4, where -1 says that there is none.
    #[test]
    fn powers_that_are_none_leave_a_light_as_it_is() {
        for none in ["-1", "0"] {
            let lights = format!(
                "LightSource \"point\" \"rgb I\" [1 2 3] \"float power\" {none}
                 LightSource \"spot\" \"rgb I\" [1 2 3] \"float power\" {none}
                 LightSource \"distant\" \"rgb L\" [1 2 3] \"float illuminance\" {none}"
            );
            for light in &world(&lights).lights {
                let (Light::Point { intensity: colour, .. }
                | Light::Spot { intensity: colour, .. }
                | Light::Distant { radiance: colour, .. }) = light
                else {
                    panic!("{light:?}")
                };
                assert_eq!(*colour, Vec3::new(1.0, 2.0, 3.0));
            }
        }
    }

    #[test]
    fn the_power_of_an_area_light_is_spread_over_its_surface() {
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
    fn colours_are_read_in_the_current_color_space() {
        let scene = world(
            "AttributeBegin ColorSpace \"rec2020\" LightSource \"point\" \"rgb I\" [0 1 0] AttributeEnd
             LightSource \"point\" \"rgb I\" [0 1 0]",
        );
        let intensity = |i: usize| super::emission(&scene.lights[i]);
        assert!((intensity(0) - Vec3::new(0.0, 1.1329, 0.0)).length() < 1e-3);
        assert_eq!(intensity(1), Vec3::Y);
        assert!(read_str("ColorSpace \"adobe\"", Path::new("")).is_err());
    }

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

    #[test]
    fn images_of_lights_are_brought_to_the_power_that_is_given() {
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
        let mapped = super::upper_illuminance(&scene.textures.images()[0]) as f32;
        assert!((environment.scale * mapped / 5.0 - 1.0).abs().max_element() < 1e-5, "{mapped}");
    }

    #[test]
    fn an_even_image_gives_the_illuminance_of_an_even_sky() {
        let image = TextureImage::from_floats(64, 64, 1, vec![2.0; 64 * 64]);
        let illuminance = super::upper_illuminance(&image);
        assert!((illuminance / (2.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3, "{illuminance}");
    }
}
