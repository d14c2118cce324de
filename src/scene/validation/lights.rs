//! Checks of lights without a surface.

use super::textures::image_id;
use super::validation_error::Result;
use super::values::{emission, finite_vector, positive, require};
use crate::scene::light::{Environment, EnvironmentMap, ImageProjection, Portal};
use crate::scene::{Light, Textures};

/// Checks the emission, geometry and images of all lights.
pub fn check_lights(lights: &[Light], textures: &Textures) -> Result {
    lights
        .iter()
        .enumerate()
        .try_for_each(|(i, light)| check_light(light, textures, &|name| format!("lights[{i}].{name}")))
}

fn check_light(light: &Light, textures: &Textures, field: &impl Fn(&str) -> String) -> Result {
    match light {
        // Point lights
        Light::Point { position, intensity } => {
            finite_vector(*position, || field("position"))?;
            emission(*intensity, || field("intensity"))
        }
        Light::Spot { position, axis, intensity, cos_falloff_start, cos_total_width, .. } => {
            finite_vector(*position, || field("position"))?;
            require(axis.is_normalized(), || field("axis"), axis, "a vector of length 1")?;
            emission(*intensity, || field("intensity"))?;
            let in_range = (-1.0..=1.0).contains(cos_total_width);
            require(in_range, || field("cos_total_width"), cos_total_width, "a cosine")?;
            let in_range = (*cos_total_width..=1.0).contains(cos_falloff_start);
            let expected = "a cosine of at least cos_total_width";
            require(in_range, || field("cos_falloff_start"), cos_falloff_start, expected)
        }
        Light::Projector { position, intensity, from_render, image } => {
            finite_vector(*position, || field("position"))?;
            emission(*intensity, || field("intensity"))?;
            let valid = from_render.is_finite() && from_render.determinant() != 0.0;
            require(valid, || field("from_render"), from_render, "a finite, invertible matrix")?;
            match *image {
                ImageProjection::Spherical(map) => check_map(map, textures, || field("image")),
                ImageProjection::Perspective { image, tan_half_fov } => {
                    image_id(textures, image, || field("image"))?;
                    positive(tan_half_fov, || field("image.tan_half_fov"))
                }
            }
        }

        // Lights at infinity
        Light::Distant { direction, radiance } => {
            require(direction.is_normalized(), || field("direction"), direction, "a vector of length 1")?;
            emission(*radiance, || field("radiance"))
        }
        Light::Environment(Environment { to_render, scale, map, portal }) => {
            let valid = to_render.is_finite() && to_render.matrix3.determinant() != 0.0;
            let value = format_args!("{to_render:?}");
            require(valid, || field("to_render"), value, "a finite, invertible transform")?;
            emission(*scale, || field("scale"))?;
            if let Some(map) = map {
                check_map(*map, textures, || field("map"))?;
            }
            portal.map_or(Ok(()), |portal| check_portal(&portal, field))
        }
    }
}

fn check_map(map: EnvironmentMap, textures: &Textures, field: impl Fn() -> String) -> Result {
    let (EnvironmentMap::LatLong(id) | EnvironmentMap::EqualArea(id)) = map;
    image_id(textures, id, &field)?;
    let (width, height) = (textures.image(id).width(), textures.image(id).height());
    let valid = matches!(map, EnvironmentMap::LatLong(_)) || width == height;
    require(valid, field, format_args!("{width}x{height} texels"), "a square equal-area image")
}

fn check_portal(portal: &Portal, field: &impl Fn(&str) -> String) -> Result {
    finite_vector(portal.corner, || field("portal.corner"))?;
    let [a, b] = portal.edges;
    let lengths = a.length() * b.length();
    let valid = lengths > 0.0 && lengths.is_finite() && a.dot(b).abs() <= 1e-2 * lengths;
    let value = format_args!("{a} and {b}");
    require(valid, || field("portal.edges"), value, "two perpendicular vectors of nonzero length")
}
