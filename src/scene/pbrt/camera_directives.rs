//! Writes a camera as directives of a scene file, as `--camera` reads them.
//!
//! Takes a camera in render space and the world position of render space's origin; gives one directive a line.

use glam::{DAffine3, DMat4, DVec3};

use crate::scene::Camera;
use crate::scene::camera::{Projection, SphericalMapping, fitted_screen_window};

/// Significant digits of positions: one fewer than a double holds, which removes the traces of rounding.
const DIGITS: usize = 15;
/// Deviation of a rotation's columns from orthonormal ones.
const TOLERANCE: f64 = 1e-9;

/// Returns the directives of a camera for a film of this aspect ratio (width over height).
pub fn camera_directives(camera: &Camera, origin: DVec3, aspect: f32) -> String {
    let to_world = |time: f32| DAffine3::from_translation(origin) * camera.to_render.at_f64(time);
    let mut lines = Vec::new();
    if camera.to_render.is_animated() {
        let times = [camera.to_render.start_time, camera.to_render.end_time];
        for (name, time) in ["StartTime", "EndTime"].into_iter().zip(times) {
            lines.push(format!("ActiveTransform {name}"));
            lines.extend(transform(to_world(time)));
        }
        lines.push("ActiveTransform All".to_owned());
    } else {
        lines.extend(transform(to_world(0.0)));
    }
    lines.push(projection(camera, aspect));
    lines.join("\n")
}

/// Returns the directives of a transform from camera to world space: `LookAt`, or `Transform` if the axes are not of unit
/// length and perpendicular to each other.
fn transform(to_world: DAffine3) -> Vec<String> {
    let axes = to_world.matrix3;
    let product = axes.transpose() * axes - glam::DMat3::IDENTITY;
    let is_rotation = product.to_cols_array().iter().all(|v| v.abs() < TOLERANCE);
    if !is_rotation {
        let numbers = DMat4::from(to_world.inverse()).to_cols_array().map(|v| v.to_string());
        return vec![format!("Transform [ {} ]", numbers.join(" "))];
    }
    let (eye, up) = (to_world.translation, axes.y_axis);
    let look_at = format!("LookAt {}  {}  {}", point(eye), point(eye + axes.z_axis), point(up));
    let mirror = (axes.determinant() < 0.0).then(|| "Scale -1 1 1".to_owned());
    mirror.into_iter().chain([look_at]).collect()
}

/// Returns the `Camera` directive; parameters at their defaults are left out.
fn projection(camera: &Camera, aspect: f32) -> String {
    let mut words = Vec::new();
    match camera.projection {
        Projection::Perspective { tan_half_fov } => {
            words.push(format!("Camera \"perspective\" \"float fov\" {}", field_of_view(tan_half_fov)));
        }
        Projection::Orthographic => words.push("Camera \"orthographic\"".to_owned()),
        Projection::Spherical(mapping) => {
            let mapping = match mapping {
                SphericalMapping::LatLong => "equirectangular",
                SphericalMapping::EqualArea => "equalarea",
            };
            words.push(format!("Camera \"spherical\" \"string mapping\" \"{mapping}\""));
        }
    }
    let [x0, x1, y0, y1] = camera.screen_window;
    let parameters = [
        (camera.lens_radius > 0.0, "lensradius", camera.lens_radius.to_string()),
        (camera.lens_radius > 0.0, "focaldistance", camera.focal_distance.to_string()),
        (camera.shutter_open != 0.0, "shutteropen", camera.shutter_open.to_string()),
        (camera.shutter_close != 1.0, "shutterclose", camera.shutter_close.to_string()),
        (
            camera.screen_window != fitted_screen_window(aspect),
            "screenwindow",
            format!("[ {x0} {x1} {y0} {y1} ]"),
        ),
    ];
    for (_, name, value) in parameters.into_iter().filter(|(is_given, ..)| *is_given) {
        words.push(format!("\"float {name}\" {value}"));
    }
    words.join(" ")
}

/// Returns the field of view in degrees, in as few digits as give this tangent of its half again.
fn field_of_view(tan_half_fov: f32) -> String {
    let degrees = 2.0 * f64::from(tan_half_fov).atan().to_degrees();
    let tangent = |text: &str| text.parse::<f64>().map(|fov| (fov.to_radians() / 2.0).tan() as f32);
    let texts = (1..=DIGITS).map(|digits| rounded(degrees, digits));
    texts.into_iter().find(|text| tangent(text) == Ok(tan_half_fov)).unwrap_or_else(|| degrees.to_string())
}

fn point(v: DVec3) -> String {
    v.to_array().map(|v| rounded(v, DIGITS)).join(" ")
}

/// Rounds to a number of significant digits.
fn rounded(value: f64, digits: usize) -> String {
    let text = format!("{value:.*e}", digits - 1);
    text.parse::<f64>().map_or(text, |value| if value == 0.0 { "0".to_owned() } else { value.to_string() })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::Scene;
    use crate::scene::pbrt::read_str;

    /// Reads a scene whose film is twice as wide as high.
    fn scene(header: &str) -> Scene {
        let film = "Film \"rgb\" \"integer xresolution\" 20 \"integer yresolution\" 10";
        read_str(&format!("{film} {header} WorldBegin"), Path::new("")).unwrap()
    }

    fn written(scene: &Scene) -> String {
        camera_directives(&scene.camera, scene.origin, 2.0)
    }

    #[test]
    fn a_camera_is_written_as_people_write_it() {
        let header = "LookAt 0 1.5 -4  0 1.5 0  0 1 0 Camera \"perspective\" \"float fov\" 40";
        let lines = written(&scene(header));
        assert_eq!(lines, "LookAt 0 1.5 -4  0 1.5 -3  0 1 0\nCamera \"perspective\" \"float fov\" 40");
    }

    #[test]
    fn what_is_written_reads_as_the_same_camera() {
        for header in [
            "LookAt 1 2 3  4 -5 6  0.2 1 0.1 Camera \"perspective\" \"float fov\" 33.3 \"float lensradius\" 0.1 \
             \"float focaldistance\" 7.7 \"float shutteropen\" 0.25 \"float shutterclose\" 0.5",
            "Scale -1 1 1 LookAt 1 2 3  4 5 6  0 0 1 Camera \"perspective\"",
            "Scale 2 2 2 Rotate 30 1 1 0 Camera \"orthographic\" \"float screenwindow\" [ -3 1 -2 2 ]",
            "Camera \"spherical\" \"string mapping\" \"equirectangular\"",
            "ActiveTransform EndTime Translate 1 0 0 ActiveTransform All Rotate 20 0 1 0 Camera \"perspective\"",
            "LookAt 1e6 -2e6 3e6  1e6 2e6 1  0 1 0 Camera \"perspective\" \"float fov\" 71.12345",
        ] {
            let before = scene(header);
            let lines = written(&before);
            let after = scene(&lines);
            for time in [0.0, 0.5, 1.0] {
                let at = |scene: &Scene| {
                    DAffine3::from_translation(scene.origin) * scene.camera.to_render.at_f64(time)
                };
                assert!(at(&before).abs_diff_eq(at(&after), 1e-8), "{header}: {lines}");
            }
            let to_render = before.camera.to_render.clone();
            assert_eq!(Camera { to_render, ..after.camera }, before.camera, "{header}: {lines}");
        }
    }
}
