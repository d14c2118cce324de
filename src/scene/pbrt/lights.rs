//! Lights, by the names and defaults of pbrt-v4.

use std::f64::consts::PI;

use glam::{Affine3A, DVec3, Vec3};

use super::directives::Statement;
use super::params::{ParamType, Params};
use super::state::{Emission, Reader};
use super::textures::encoding;
use super::{Fault, Result};
use crate::scene::Light;
use crate::scene::light::{AreaLight, Environment, EnvironmentMap};

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
        let power = params.float("power")?.filter(|&power| power > 0.0);
        let light = AreaLight { radiance, two_sided };
        self.state.area_light = (radiance != Vec3::ZERO).then_some(Emission { light, power });
        statement.params.mark_used_in(&params);
        Ok(())
    }

    pub fn light_source(&mut self, statement: &Statement) -> Result<()> {
        let params = &*self.params_for("light", statement);
        if self.is_animated() {
            self.warnings.add(statement.place, "moving lights stand still where they are at the start");
        }
        if !self.to_render().inverse().is_finite() {
            let message = "a singular transform; one that can be inverted would be accepted";
            return Err(Fault::new(statement.place, message));
        }
        params.get("nsamples");
        params.get("samples");
        let light = match statement.strings[0].as_str() {
            "point" => self.point(params)?,
            "spot" => self.spot(params)?,
            "distant" => self.distant(params)?,
            "infinite" => self.infinite(params)?,
            other @ ("goniometric" | "projection") => {
                self.warnings.add(statement.place, format!("light \"{other}\" is left out"));
                statement.params.mark_all_used();
                return Ok(());
            }
            other => {
                let message = format!("light \"{other}\"; point, spot, distant and infinite are accepted");
                return Err(Fault::new(statement.place, message));
            }
        };
        if emission(&light) != Vec3::ZERO {
            self.lights.push(light);
        }
        statement.params.mark_used_in(params);
        Ok(())
    }

    /// Colour times `scale`, per channel not below 0.
    fn light_color(&mut self, params: &Params, name: &str) -> Result<Vec3> {
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

    fn point(&mut self, params: &Params) -> Result<Light> {
        let from = params.triple_or("from", DVec3::ZERO)?;
        let position = self.to_render().transform_point3(from).as_vec3();
        let mut intensity = self.light_color(params, "I")?;
        if let Some(power) = params.float("power")? {
            intensity *= (power / (4.0 * PI)) as f32;
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
        if let Some(power) = params.float("power")? {
            // The falloff is halfway between its ends in the mean.
            let solid_angle =
                2.0 * PI * ((1.0 - cos_falloff_start) + (cos_falloff_start - cos_total_width) / 2.0);
            if solid_angle > 0.0 {
                intensity *= (power / solid_angle) as f32;
            }
        }
        Ok(Light::Spot {
            position: self.to_render().transform_point3(from).as_vec3(),
            axis: self.to_render().transform_vector3(axis).normalize().as_vec3(),
            intensity,
            cos_falloff_start: cos_falloff_start as f32,
            cos_total_width: cos_total_width as f32,
            falloff: self.dialect.spot_falloff(),
        })
    }

    fn distant(&mut self, params: &Params) -> Result<Light> {
        let (_, axis) = self.source_and_axis(params)?;
        let direction = -self.to_render().transform_vector3(axis).normalize().as_vec3();
        let mut radiance = self.light_color(params, "L")?;
        if let Some(illuminance) = params.float("illuminance")? {
            radiance *= illuminance as f32;
        }
        Ok(Light::Distant { direction, radiance })
    }

    /// `from`, and `to` − `from`.
    fn source_and_axis(&self, params: &Params) -> Result<(DVec3, DVec3)> {
        let from = params.triple_or("from", DVec3::ZERO)?;
        let to = params.triple_or("to", DVec3::Z)?;
        if from == to {
            let message = "a light from a point to the same point; two points would be accepted";
            return Err(Fault::new(params.place, message));
        }
        Ok((from, to - from))
    }

    fn infinite(&mut self, params: &Params) -> Result<Light> {
        let mut scale = self.light_color(params, "L")?;
        let file = match params.string("filename")? {
            Some(file) => Some(file),
            None => params.string("mapname")?,
        };
        let map = match file.filter(|file| !file.is_empty()) {
            None => None,
            Some(file) => {
                let encoding = encoding(params, self.dialect.default_encoding())?;
                let image = self.image(file, encoding, params.place);
                if self.dialect.environments_are_lat_long() {
                    Some(EnvironmentMap::LatLong(image))
                } else {
                    self.image_must_be_square(image);
                    Some(EnvironmentMap::EqualArea(image))
                }
            }
        };
        if params.get("portal").is_some() {
            // It tells where light can come from, which changes the noise only.
            self.warnings.add(params.place, "a portal is not made use of: the whole environment is sampled");
        }
        // Of an image it would need a sum over a hemisphere; left to the warning on unused ones.
        if map.is_none()
            && let Some(illuminance) = params.float("illuminance")?
        {
            scale *= (illuminance / PI) as f32;
        }
        // Directions have no size.
        let to_render = self.to_render().matrix3;
        let to_render = to_render * to_render.determinant().abs().cbrt().recip();
        Ok(Light::Environment(Environment {
            to_render: Affine3A::from_mat3(to_render.as_mat3()),
            scale,
            map,
        }))
    }
}

fn emission(light: &Light) -> Vec3 {
    match light {
        Light::Point { intensity, .. } | Light::Spot { intensity, .. } => *intensity,
        Light::Distant { radiance, .. } => *radiance,
        Light::Environment(environment) => environment.scale,
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;
    use std::path::Path;

    use glam::Vec3;

    use crate::scene::Scene;
    use crate::scene::pbrt::read_str;

    fn world(text: &str) -> Scene {
        read_str(&format!("WorldBegin {text}"), Path::new("")).unwrap_or_else(|error| panic!("{error}"))
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
    fn portals_are_read_and_said_to_be_left_out() {
        let scene = world("LightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 0]");
        assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("portal"), "{:?}", scene.warnings);
    }
}
