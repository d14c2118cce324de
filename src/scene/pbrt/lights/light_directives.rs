//! The light directives, and the lights without images.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::light_power::scale_to_parameter;
use crate::scene::Light;
use crate::scene::light::{AreaLight, Environment, Portal};
use crate::scene::pbrt::builder::{AreaLightSource, SceneBuilder};
use crate::scene::pbrt::dialect::Dialect;
use crate::scene::pbrt::directives::transforms::{inverse, normalized};
use crate::scene::pbrt::parser::{ParameterDictionary, ParameterType, ParseError, Result, Statement};
use crate::scene::texture::Content;

impl SceneBuilder {
    /// `AreaLightSource`: the emission of the shapes that follow.
    pub fn area_light_source(&mut self, statement: &Statement) -> Result<()> {
        let params = self.params_for("light", statement);
        let kind = &statement.strings[0];
        if !["diffuse", "area"].contains(&kind.as_str()) {
            let message = format!("unknown area light \"{kind}\"; expected diffuse");
            self.warn_or_fail(ParseError::new(statement.loc, message), "the light is ignored")?;
            statement.params.mark_all_used();
            self.state.area_light = None;
            return Ok(());
        }
        params.get("nsamples");
        params.get("samples");
        let image = params.string("filename")?.filter(|file| !file.is_empty());
        let default = if image.is_some() { Vec3::ONE } else { self.illuminant() };
        let radiance = self.light_colour(&params, "L", default)?;
        let two_sided = params.bool_or("twosided", false)?;
        let power = params.positive("power")?;
        let replacement = self.dialect.missing_light_value();
        let image = image.map(|file| self.image(file, None, Content::Light, replacement, params.loc));
        let light = AreaLight { radiance, image, two_sided };
        self.state.area_light = (radiance != Vec3::ZERO).then_some(AreaLightSource { light, power });
        statement.params.mark_used_from(&params);
        Ok(())
    }

    /// `LightSource`.
    pub fn light_source(&mut self, statement: &Statement) -> Result<()> {
        let params = &*self.params_for("light", statement);
        if self.state.is_animated() {
            self.warnings
                .add(statement.loc, "moving lights are not supported; using their position at the start");
        }
        if inverse(&self.to_render()).is_none() {
            let message = "the current transform is singular; expected an invertible transform";
            return Err(ParseError::new(statement.loc, message));
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
                let expected = "point, spot, goniometric, projection, distant or infinite";
                let message = format!("unknown light \"{other}\"; expected {expected}");
                statement.params.mark_all_used();
                return self.warn_or_fail(ParseError::new(statement.loc, message), "the light is ignored");
            }
        };
        if !has_valid_geometry(&light) {
            let message =
                "the light does not have a finite position and an invertible transform; expected both";
            return Err(ParseError::new(statement.loc, message));
        }
        if emission(&light) != Vec3::ZERO {
            self.lights.push(light);
        }
        statement.params.mark_used_from(params);
        Ok(())
    }

    /// The illuminant of the current colour space: the colour of a light that has neither colour nor image.
    pub fn illuminant(&self) -> Vec3 {
        self.state.color_space.light_to_srgb(DVec3::ONE).as_vec3()
    }

    /// The colour called `name`, or else `default`, times `scale`; an error if a channel is negative.
    pub fn light_colour(&mut self, params: &ParameterDictionary, name: &str, default: Vec3) -> Result<Vec3> {
        let spectrum = self.light_spectrum(params, name)?;
        let color = spectrum.map_or(default, |spectrum| self.dialect.light_colour(&spectrum));
        // The scale of v3 is a spectrum
        let scale = match params.get("scale").map(|param| param.kind) {
            Some(ParameterType::Rgb | ParameterType::Spectrum) => {
                self.spectrum(params, "scale")?.map_or(Vec3::ONE, |spectrum| spectrum.unadapted())
            }
            _ => Vec3::splat(params.float_or("scale", 1.0)? as f32),
        };
        let color = color * scale;
        if color.is_finite() && color.cmpge(Vec3::ZERO).all() {
            return Ok(color);
        }
        let expected = "numbers of at least 0";
        Err(ParseError::new(params.loc, format!("the light's \"{name}\" is {color}; expected {expected}")))
    }

    /// `point`.
    pub fn point(&mut self, params: &ParameterDictionary) -> Result<Light> {
        let from = params.triple_or("from", DVec3::ZERO)?;
        let to_render = self.to_render();
        let position = match self.dialect {
            // Moved by the transformation, and neither rotated nor scaled
            Dialect::V2 | Dialect::V3 => to_render.translation + from,
            Dialect::V4 => to_render.transform_point3(from),
        }
        .as_vec3();
        let mut intensity = self.light_colour(params, "I", self.illuminant())?;
        if let Some(power) = params.positive("power")? {
            intensity = scale_to_parameter(params, "power", intensity, power / (4.0 * PI))?;
        }
        Ok(Light::Point { position, intensity })
    }

    /// `spot`.
    fn spot(&mut self, params: &ParameterDictionary) -> Result<Light> {
        let (from, axis) = self.source_and_axis(params)?;
        let total = params.float_or("coneangle", 30.0)?;
        let delta = params.float_or("conedeltaangle", 5.0)?;
        let cos_total_width = total.to_radians().cos();
        let cos_falloff_start = (total - delta).to_radians().cos().max(cos_total_width);
        let mut intensity = self.light_colour(params, "I", self.illuminant())?;
        if let Some(power) = params.positive("power")? {
            // The mean of the falloff is one half
            let solid_angle =
                2.0 * PI * ((1.0 - cos_falloff_start) + (cos_falloff_start - cos_total_width) / 2.0);
            if solid_angle > 0.0 {
                intensity = scale_to_parameter(params, "power", intensity, power / solid_angle)?;
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

    /// `distant`.
    fn distant(&mut self, params: &ParameterDictionary) -> Result<Light> {
        let (_, axis) = self.source_and_axis(params)?;
        let mut radiance = self.light_colour(params, "L", self.illuminant())?;
        if let Some(illuminance) = params.positive("illuminance")? {
            radiance = scale_to_parameter(params, "illuminance", radiance, illuminance)?;
        }
        Ok(Light::Distant { direction: -axis, radiance })
    }

    /// `from` in current space, and the unit direction from there to `to` in render space.
    fn source_and_axis(&self, params: &ParameterDictionary) -> Result<(DVec3, Vec3)> {
        let from = params.triple_or("from", DVec3::ZERO)?;
        let to = params.triple_or("to", DVec3::Z)?;
        let axis =
            normalized(to - from).and_then(|axis| normalized(self.to_render().transform_vector3(axis)));
        let Some(axis) = axis else {
            let message = "the light has \"from\" and \"to\" at the same point; expected two points";
            return Err(ParseError::new(params.loc, message));
        };
        Ok((from, axis.as_vec3()))
    }
}

/// Whether a light's position and axes are finite as `f32`, and its transforms can be inverted.
fn has_valid_geometry(light: &Light) -> bool {
    match light {
        Light::Point { position, .. } => position.is_finite(),
        Light::Spot { position, axis, .. } => position.is_finite() && axis.is_finite(),
        Light::Projector { position, from_render, .. } => {
            position.is_finite() && from_render.is_finite() && from_render.determinant() != 0.0
        }
        Light::Distant { direction, .. } => direction.is_finite(),
        Light::Environment(Environment { to_render, portal, .. }) => {
            let is_usable = |portal: &Portal| {
                let mut edges = portal.edges.iter();
                portal.corner.is_finite() && edges.all(|e| e.is_finite() && e.length_squared() > 0.0)
            };
            let is_invertible = to_render.is_finite() && to_render.matrix3.determinant() != 0.0;
            is_invertible && portal.as_ref().is_none_or(is_usable)
        }
    }
}

/// The emitted colour of a light, without its image.
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
    use std::path::Path;

    use glam::Vec3;

    use crate::scene::pbrt::read_str;
    use crate::scene::{Light, Scene};

    fn world(text: &str) -> Scene {
        read_str(&format!("WorldBegin {text}"), Path::new("")).unwrap_or_else(|error| panic!("{error}"))
    }

    /// A power of -1 means "not given", as in pbrt-v4.
    #[test]
    fn powers_that_are_not_positive_are_ignored() {
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
    fn colours_are_converted_from_the_current_colour_space() {
        let scene = world(
            "AttributeBegin ColorSpace \"rec2020\" LightSource \"point\" \"rgb I\" [0 1 0] AttributeEnd
             LightSource \"point\" \"rgb I\" [0 1 0]",
        );
        let intensity = |i: usize| super::emission(&scene.lights[i]);
        assert!((intensity(0) - Vec3::new(0.0, 1.1329, 0.0)).length() < 1e-3);
        assert_eq!(intensity(1), Vec3::Y);
        assert!(read_str("ColorSpace \"adobe\"", Path::new("")).is_err());
    }
}
