//! `Camera`: projection, lens, shutter and motion.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3};

use super::option_entity::OptionEntity;
use crate::scene::camera::{Projection, SphericalMapping, is_window};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::dialect::Dialect;
use crate::scene::pbrt::directives::transforms::inverse;
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result};
use crate::scene::{AnimatedTransform, Camera, Film};

/// Focal length in mm of the thin lens that replaces a realistic camera's lens system.
const REALISTIC_FOCAL_LENGTH: f64 = 50.0;
/// Diameter in mm of its aperture, pbrt's default.
const APERTURE_DIAMETER: f64 = 1.0;

/// The camera in render space, and its world position at shutter open; `diagonal` is that of the film in mm.
pub fn make_camera(
    builder: &mut SceneBuilder,
    entry: &OptionEntity,
    film: &Film,
    diagonal: f64,
) -> Result<(Camera, DVec3)> {
    // Evaluate the parameters
    let [shutter_open, shutter_close] = shutter(builder, entry)?;
    let screen_window = screen_window(builder, entry, film)?;
    let projection = projection(builder, entry, half_short_side(film, diagonal))?;
    let (lens_radius, focal_distance) = lens(entry, &projection)?;

    // Move the origin of render space to the camera. The CTM maps world to camera space
    let [Some(to_world_start), Some(to_world_end)] = entry.ctm.map(|ctm| inverse(&ctm)) else {
        return Err(ParseError::new(
            entry.loc,
            "the camera's transform is singular; expected an invertible transform",
        ));
    };
    let [t0, t1] = builder.transform_times;
    let to_world = AnimatedTransform::new(to_world_start, to_world_end, t0, t1);
    let origin = to_world.at_f64(shutter_open).translation;
    let shift = DAffine3::from_translation(-origin);
    let camera = Camera {
        to_render: AnimatedTransform::new(shift * to_world_start, shift * to_world_end, t0, t1),
        projection,
        screen_window,
        lens_radius,
        focal_distance,
        shutter_open,
        shutter_close,
    };
    Ok((camera, origin))
}

/// Times at which the shutter opens and closes.
fn shutter(builder: &mut SceneBuilder, entry: &OptionEntity) -> Result<[f32; 2]> {
    let OptionEntity { params, loc, .. } = entry;
    let mut shutter = [params.float_or("shutteropen", 0.0)?, params.float_or("shutterclose", 1.0)?];
    if shutter[0] > shutter[1] {
        builder.warnings.add(*loc, "the shutter closes before it opens; the times are swapped");
        shutter.reverse();
    }
    Ok(shutter.map(|time| time as f32))
}

/// The screen window: x min, x max, y min, y max. By default the shorter side spans [-1, 1]; as in pbrt, lists of
/// another length count as not given.
fn screen_window(builder: &mut SceneBuilder, entry: &OptionEntity, film: &Film) -> Result<[f32; 4]> {
    let OptionEntity { params, loc, .. } = entry;
    let aspect = params.positive_or("frameaspectratio", film.width as f64 / film.height as f64)?;
    let (x, y) = if aspect > 1.0 { (aspect, 1.0) } else { (1.0, 1.0 / aspect) };
    let window = match params.floats("screenwindow")? {
        None => [-x, x, -y, y],
        Some(&[x0, x1, y0, y1]) => [x0, x1, y0, y1],
        Some(numbers) => {
            let message =
                format!("\"screenwindow\" has {} numbers; expected 4; it is ignored", numbers.len());
            builder.warnings.add(*loc, message);
            [-x, x, -y, y]
        }
    };
    // Check the window in `f32`, the precision of the scene. One that is reversed mirrors the image
    let [x0, x1, y0, y1] = window.map(|side| side as f32);
    if is_window([x0, x1, y0, y1]) {
        return Ok([x0, x1, y0, y1]);
    }
    let message = "\"screenwindow\" is not a rectangle; expected x min, x max, y min, y max";
    Err(ParseError::new(*loc, message))
}

/// The projection from camera space to the screen window.
/// The projection; `half_short_side` is that of the film in mm, for realistic cameras.
fn projection(builder: &mut SceneBuilder, entry: &OptionEntity, half_short_side: f64) -> Result<Projection> {
    let OptionEntity { kind, params, loc, .. } = entry;
    Ok(match *kind {
        "perspective" => {
            let fov = match params.float("halffov")? {
                Some(half) => 2.0 * half,
                None => params.float_or("fov", 90.0)?,
            };
            if !(fov > 0.0 && fov < 180.0) {
                let message = format!("\"fov\" is {fov}; expected an angle between 0 and 180 degrees");
                return Err(ParseError::new(*loc, message));
            }
            Projection::Perspective { tan_half_fov: (fov.to_radians() / 2.0).tan() as f32 }
        }
        "orthographic" => Projection::Orthographic,
        "spherical" | "environment" => Projection::Spherical(spherical_mapping(kind, params)?),
        "realistic" => {
            builder.warnings.add(*loc, "camera \"realistic\" is not supported; using a thin lens of 50 mm");
            for name in ["lensfile", "aperture", "simpleweighting"] {
                params.get(name);
            }
            Projection::Perspective { tan_half_fov: (half_short_side / REALISTIC_FOCAL_LENGTH) as f32 }
        }
        other => {
            let expected = "perspective, orthographic, spherical or environment";
            let message = format!("unknown camera \"{other}\"; expected {expected}");
            return Err(ParseError::new(*loc, message));
        }
    })
}

/// Lens radius and focal distance, which is any number without a lens. A spherical camera is always a pinhole.
fn lens(entry: &OptionEntity, projection: &Projection) -> Result<(f32, f32)> {
    let OptionEntity { kind, params, loc, .. } = entry;
    let realistic = *kind == "realistic";
    let lens_radius = match realistic {
        // Convert a diameter in mm to a radius in m
        true => params.float_or("aperturediameter", APERTURE_DIAMETER)? / 2000.0,
        false => params.float_or("lensradius", 0.0)?,
    };
    if lens_radius < 0.0 {
        let message = format!("\"lensradius\" is {lens_radius}; expected a number of at least 0");
        return Err(ParseError::new(*loc, message));
    }
    let lens_radius = if matches!(projection, Projection::Spherical(_)) { 0.0 } else { lens_radius as f32 };
    let (name, default) = if realistic { ("focusdistance", 10.0) } else { ("focaldistance", 1e6) };
    let focal_distance = match params.float_or(name, default)? {
        found if lens_radius > 0.0 || found as f32 > 0.0 => {
            params.positive_or(name, default).map(|_| found)?
        }
        _ => default,
    };
    Ok((lens_radius, (focal_distance as f32).max(f32::MIN_POSITIVE)))
}

/// The mapping of a spherical camera. The older dialects' `environment` is always lat-long.
fn spherical_mapping(kind: &str, params: &ParameterDictionary) -> Result<SphericalMapping> {
    match params.string("mapping")? {
        None if kind == "environment" => Ok(SphericalMapping::LatLong),
        None | Some("equalarea") => Ok(SphericalMapping::EqualArea),
        Some("equirectangular") => Ok(SphericalMapping::LatLong),
        Some(other) => {
            let message = format!("unknown mapping \"{other}\"; expected equalarea or equirectangular");
            Err(ParseError::new(params.loc, message))
        }
    }
}

/// Fraction of the radiance that a camera measures: of realistic cameras of v4 that of its aperture's solid angle, seen from the film
/// (`RealisticCamera` in pbrt-v4's `cameras.cpp`, without the falloff towards the corners).
pub fn exposure(builder: &SceneBuilder, entry: &OptionEntity) -> Result<f64> {
    if entry.kind != "realistic" || builder.dialect != Dialect::V4 {
        return Ok(1.0);
    }
    let radius = entry.params.positive_or("aperturediameter", APERTURE_DIAMETER)? / 2.0;
    Ok(PI * (radius / REALISTIC_FOCAL_LENGTH).powi(2))
}

/// Half the shorter side, in mm, of a film with this diagonal.
fn half_short_side(film: &Film, diagonal: f64) -> f64 {
    let (width, height) = (film.width as f64, film.height as f64);
    diagonal / 2.0 * width.min(height) / width.hypot(height)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::Projection;
    use crate::scene::Scene;
    use crate::scene::camera::SphericalMapping;
    use crate::scene::pbrt::read_str;

    fn header(text: &str) -> Scene {
        read_str(&format!("{text} WorldBegin"), Path::new("")).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Parameters are parsed as `f64` and used as `f32`.
    #[test]
    fn values_beyond_single_precision_are_errors() {
        for text in [
            "Camera \"perspective\" \"float frameaspectratio\" 1e-45",
            "Camera \"perspective\" \"float screenwindow\" [0 1e-50 0 1]",
            "Camera \"perspective\" \"float screenwindow\" [-3e38 3e38 0 1]",
            "Film \"rgb\" \"float iso\" 1e30 \"float exposuretime\" 1e30",
            "Film \"rgb\" \"float iso\" 1e-30 \"float exposuretime\" 1e-30",
            "Film \"rgb\" \"integer xresolution\" 65536",
            "MakeNamedMaterial \"m\" \"string type\" \"dielectric\" \"float eta\" 1e-50",
        ] {
            let error = read_str(&format!("{text} WorldBegin"), Path::new("")).map(|_| ()).unwrap_err();
            assert!(error.to_string().contains("; expected "), "{text}: {error}");
        }
        let near = header("Camera \"perspective\" \"float focaldistance\" 1e-40");
        assert_eq!(near.camera.focal_distance, f32::MIN_POSITIVE);
    }

    #[test]
    fn a_pinhole_has_any_focal_distance_and_a_lens_one_above_zero() {
        for kind in ["perspective", "spherical"] {
            let scene =
                header(&format!("Camera \"{kind}\" \"float lensradius\" 0 \"float focaldistance\" 0"));
            assert_eq!((scene.camera.lens_radius, scene.camera.focal_distance), (0.0, 1e6));
        }
        let lens = "Camera \"perspective\" \"float lensradius\" 0.1 \"float focaldistance\" 0 WorldBegin";
        let error = read_str(lens, Path::new("")).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("\"focaldistance\" is 0; expected a number above 0"), "{error}");
    }

    #[test]
    fn a_reversed_screen_window_mirrors_the_image() {
        let scene = header("Camera \"perspective\" \"float screenwindow\" [1 -1 -1 1]");
        assert_eq!(scene.camera.screen_window, [1.0, -1.0, -1.0, 1.0]);
    }

    #[test]
    fn a_screen_window_without_four_values_is_ignored() {
        let scene = header("Camera \"perspective\" \"float screenwindow\" [-1 1]");
        assert_eq!(scene.warnings, ["<text>:1:1: \"screenwindow\" has 2 numbers; expected 4; it is ignored"]);
        assert_eq!(scene.camera.screen_window, header("Camera \"perspective\"").camera.screen_window);
    }

    #[test]
    fn a_realistic_camera_becomes_a_thin_lens_with_a_warning() {
        let scene = header(
            "Film \"rgb\" \"integer xresolution\" 300 \"integer yresolution\" 200
             Camera \"realistic\" \"string lensfile\" \"a.dat\" \"float aperturediameter\" 10
             \"float focusdistance\" 3",
        );
        let Projection::Perspective { tan_half_fov } = scene.camera.projection else { panic!() };
        // Half the short side of a film with a diagonal of 35 mm, over 50 mm
        assert!((tan_half_fov - 17.5 * 2.0 / 13f32.sqrt() / 50.0).abs() < 1e-5);
        assert_eq!((scene.camera.lens_radius, scene.camera.focal_distance), (0.005, 3.0));
        assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
        // At f/5 the aperture's solid angle is π ∕ 100
        assert!((scene.film.scale - 0.01 * std::f32::consts::PI).abs() < 1e-6);
        let large = header("Film \"rgb\" \"float diagonal\" 70 Camera \"realistic\"");
        let Projection::Perspective { tan_half_fov } = large.camera.projection else { panic!() };
        assert!((tan_half_fov - 35.0 * 720.0 / 1280f32.hypot(720.0) / 50.0).abs() < 1e-5);
    }

    #[test]
    fn exposure_and_halffov_are_read() {
        let scene = header(
            "Film \"rgb\" \"float iso\" 200 \"float exposuretime\" .25
             Camera \"perspective\" \"float halffov\" 45",
        );
        assert_eq!(scene.film.scale, 0.5);
        let Projection::Perspective { tan_half_fov } = scene.camera.projection else { panic!() };
        assert!((tan_half_fov - 1.0).abs() < 1e-6);
    }

    #[test]
    fn options_without_effect_are_ignored_and_others_reported() {
        let scene = header("Option \"bool disablepixeljitter\" true Option \"integer seed\" 3");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let scene = header("Option \"string forcediffuse\" \"x\"");
        assert!(scene.warnings[0].contains("forcediffuse"), "{:?}", scene.warnings);
        let scene = header(
            "Option \"seed\" 42 Option \"MSE_reference-out\" \"a\" Option \"disablepixeljitter\" true",
        );
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let scene = header("Option \"forcediffuse\" true");
        assert_eq!(scene.warnings, ["<text>:1:1: Option \"forcediffuse\" is not used"]);
        let error = read_str("Option \"seed\" [42] WorldBegin", Path::new("")).unwrap_err();
        assert!(error.message.contains("expected a value"), "{error}");
    }

    #[test]
    fn spherical_cameras_have_no_lens() {
        let camera = |text: &str, end: &str| {
            let text = format!("Camera {text} \"float lensradius\" 1 WorldBegin {end}");
            read_str(&text, Path::new("")).unwrap().camera
        };
        let projection = |text: &str, end: &str| camera(text, end).projection;
        let [equal_area, lat_long] =
            [SphericalMapping::EqualArea, SphericalMapping::LatLong].map(Projection::Spherical);
        assert_eq!(projection("\"spherical\"", ""), equal_area);
        assert_eq!(projection("\"spherical\" \"string mapping\" \"equirectangular\"", ""), lat_long);
        assert_eq!(projection("\"environment\"", "WorldEnd"), lat_long);
        assert_eq!(camera("\"environment\"", "WorldEnd").lens_radius, 0.0);
        assert!(read_str("Camera \"spherical\" \"string mapping\" \"x\" WorldBegin", Path::new("")).is_err());
    }
}
