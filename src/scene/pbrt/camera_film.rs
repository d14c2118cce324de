//! The header of a scene: camera, film, filter, sampler and integrator.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};

use super::dialect::Dialect;
use super::directives::Statement;
use super::params::Params;
use super::state::{Kept, Keys, Reader};
use super::transforms::inverse;
use super::{Fault, Place, Result};
use crate::scene::camera::{Projection, SphericalMapping};
use crate::scene::film::{MAX_PIXELS, MAX_SIDE};
use crate::scene::{AnimatedTransform, Camera, Film, Integrator, PixelFilter, SamplerKind};

/// Most samples per pixel.
const MAX_SPP: u32 = 1 << 30;
/// Deepest path that may be asked for: longer ones carry no light that could be seen.
const MAX_DEPTH: u32 = 1 << 20;
/// Widest pixel filter.
const MAX_FILTER_RADIUS: f64 = 64.0;

/// What stands for a realistic camera's lens and film, in millimetres: the normal lens of a small
/// picture, and the diagonal that pbrt gives a film.
const REALISTIC_FOCAL_LENGTH: f64 = 50.0;
const REALISTIC_DIAGONAL: f64 = 35.0;

/// What the header says.
pub struct View {
    /// World position of the camera at shutter open.
    pub origin: DVec3,
    pub camera: Camera,
    pub film: Film,
    pub integrator: Integrator,
    pub sampler: SamplerKind,
    pub spp: u32,
}

/// A directive of the header, or what stands for it if there is none.
struct Entry<'k> {
    kind: &'k str,
    params: &'k Params,
    place: Place,
    ctm: Keys,
}

impl View {
    /// Makes sense of the header. `place` is that of `WorldBegin`.
    pub fn new(reader: &mut Reader, header: &BTreeMap<&'static str, Kept>, place: Place) -> Result<Self> {
        let none = Params::none(place);
        let entry = |names: &[&'static str], default: &'static str| match names
            .iter()
            .find_map(|name| header.get(name))
        {
            Some(Kept { statement: Statement { strings, params, place, .. }, ctm }) => {
                Entry { kind: strings[0].as_str(), params, place: *place, ctm: *ctm }
            }
            None => Entry { kind: default, params: &none, place, ctm: [DAffine3::IDENTITY; 2] },
        };
        let filter = match header.get("PixelFilter") {
            Some(_) => pixel_filter(reader.dialect, &entry(&["PixelFilter"], ""))?,
            None => reader.dialect.default_filter(),
        };
        let camera_entry = entry(&["Camera"], "perspective");
        let film = film(reader, &entry(&["Film"], "rgb"), filter, exposure_time(reader, &camera_entry)?)?;
        let (camera, origin) = camera(reader, &camera_entry, &film)?;
        let default_integrator = reader.dialect.default_integrator();
        let integrator =
            integrator(reader, &entry(&["Integrator", "SurfaceIntegrator"], default_integrator))?;
        let (sampler, spp) = sampler(reader, &entry(&["Sampler"], "zsobol"))?;
        Ok(Self { origin, camera, film, integrator, sampler, spp })
    }
}

/// Seconds for which the film is exposed. A shutter that does not stay open stops all motion, and counts as one
/// second.
fn exposure_time(reader: &Reader, camera: &Entry) -> Result<f64> {
    let [open, close] =
        [camera.params.float_or("shutteropen", 0.0)?, camera.params.float_or("shutterclose", 1.0)?];
    let counts = reader.dialect.shutter_exposes() && open != close;
    Ok(if counts { (close - open).abs() } else { 1.0 })
}

/// `exposure_time` in seconds.
fn film(reader: &mut Reader, entry: &Entry, filter: PixelFilter, exposure_time: f64) -> Result<Film> {
    let Entry { kind, params, place, .. } = entry;
    if !["rgb", "gbuffer", "image"].contains(kind) {
        reader.warnings.add(*place, format!("film \"{kind}\" is read as \"rgb\""));
    }
    let [default_width, default_height] = reader.dialect.default_resolution();
    let width = params.integer_in("xresolution", default_width, 1..=MAX_SIDE)?;
    let height = params.integer_in("yresolution", default_height, 1..=MAX_SIDE)?;
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        let message =
            format!("a film of {width}x{height} pixels; up to {MAX_PIXELS} pixels would be accepted");
        return Err(Fault::new(*place, message));
    }
    let (w, h) = (f64::from(width), f64::from(height));
    let four = |name: &str, numbers: Option<&[f64]>| match numbers {
        None => Ok(None),
        Some(&[a, b, c, d]) => Ok(Some([a, b, c, d])),
        Some(numbers) => Err(Fault::new(
            *place,
            format!("{} numbers for \"{name}\"; four would be accepted", numbers.len()),
        )),
    };
    let mut bounds = [0.0, w, 0.0, h];
    if let Some([x0, x1, y0, y1]) = four("pixelbounds", params.integers("pixelbounds")?)? {
        bounds = [x0.clamp(0.0, w), x1.clamp(0.0, w), y0.clamp(0.0, h), y1.clamp(0.0, h)];
    }
    if let Some([x0, x1, y0, y1]) = four("cropwindow", params.floats("cropwindow")?)? {
        let pixel = |fraction: f64, size: f64| (fraction.clamp(0.0, 1.0) * size).ceil();
        bounds = [pixel(x0.min(x1), w), pixel(x0.max(x1), w), pixel(y0.min(y1), h), pixel(y0.max(y1), h)];
    }
    let pixel_bounds = bounds.map(|b| b as usize);
    if pixel_bounds[0] >= pixel_bounds[1] || pixel_bounds[2] >= pixel_bounds[3] {
        return Err(Fault::new(*place, "a film without pixels; bounds that hold one would be accepted"));
    }
    // The imaging ratio of pbrt-v4's default sensor.
    let imaging_ratio =
        params.positive_or("iso", 100.0)? / 100.0 * params.positive_or("exposuretime", exposure_time)?;
    // v3 has a factor instead.
    let scale = (imaging_ratio * params.positive_or("scale", 1.0)?) as f32;
    if !(scale > 0.0 && scale.is_finite()) {
        let message = format!("a film that multiplies by {scale}; a finite number above 0 would be accepted");
        return Err(Fault::new(*place, message));
    }
    match params.string("sensor")? {
        None | Some("cie1931") => {}
        Some(sensor) => {
            reader.warnings.add(*place, format!("film sensor \"{sensor}\" is read as \"cie1931\""));
        }
    }
    let filename = params.string("filename")?.filter(|name| !name.is_empty()).map(String::from);
    Ok(Film { width: width as usize, height: height as usize, pixel_bounds, filter, filename, scale })
}

fn pixel_filter(dialect: Dialect, entry: &Entry) -> Result<PixelFilter> {
    let Entry { kind, params, place, .. } = entry;
    let side = |name: &str, default: f64| -> Result<f32> {
        let radius = params.positive_or(name, default)?;
        if radius > MAX_FILTER_RADIUS {
            let message =
                format!("\"{name}\" is {radius}; up to {MAX_FILTER_RADIUS} pixels would be accepted");
            return Err(Fault::new(*place, message));
        }
        Ok(radius as f32)
    };
    let [x_name, y_name] = dialect.filter_radius_names();
    let radius = |default: f64| -> Result<[f32; 2]> { Ok([side(x_name, default)?, side(y_name, default)?]) };
    Ok(match *kind {
        "box" => PixelFilter::Box { radius: radius(0.5)? },
        "triangle" => PixelFilter::Triangle { radius: radius(2.0)? },
        "gaussian" => {
            let radius = radius(dialect.default_gaussian_radius())?;
            // The older dialects give alpha, of exp(−αx²).
            let sigma = match dialect {
                Dialect::V4 => params.positive_or("sigma", 0.5)?,
                Dialect::V2 | Dialect::V3 => (0.5 / params.positive_or("alpha", 2.0)?).sqrt(),
            };
            PixelFilter::Gaussian { radius, sigma: sigma as f32 }
        }
        "mitchell" => PixelFilter::Mitchell {
            radius: radius(2.0)?,
            b: params.float_or("B", 1.0 / 3.0)? as f32,
            c: params.float_or("C", 1.0 / 3.0)? as f32,
        },
        "sinc" => PixelFilter::Sinc { radius: radius(4.0)?, tau: params.positive_or("tau", 3.0)? as f32 },
        other => {
            let message =
                format!("pixel filter \"{other}\"; box, triangle, gaussian, mitchell and sinc are accepted");
            return Err(Fault::new(*place, message));
        }
    })
}

fn camera(reader: &mut Reader, entry: &Entry, film: &Film) -> Result<(Camera, DVec3)> {
    let Entry { kind, params, place, ctm } = entry;
    let mut shutter = [params.float_or("shutteropen", 0.0)?, params.float_or("shutterclose", 1.0)?];
    if shutter[0] > shutter[1] {
        reader.warnings.add(*place, "the shutter closes before it opens: the two are swapped");
        shutter.reverse();
    }
    let [shutter_open, shutter_close] = shutter.map(|time| time as f32);

    // Fit the shorter side of the image to [-1, 1].
    let aspect = params.positive_or("frameaspectratio", film.width as f64 / film.height as f64)?;
    let (x, y) = if aspect > 1.0 { (aspect, 1.0) } else { (1.0, 1.0 / aspect) };
    let screen_window = match params.floats("screenwindow")? {
        None => Some([-x, x, -y, y]),
        Some(&[x0, x1, y0, y1]) => Some([x0, x1, y0, y1]),
        Some(_) => None,
    };
    // As `f32`, which it will become.
    let is_window =
        |&[x0, x1, y0, y1]: &[f32; 4]| x0 < x1 && y0 < y1 && (x1 - x0).is_finite() && (y1 - y0).is_finite();
    let screen_window = screen_window.map(|window| window.map(|side| side as f32)).filter(is_window);
    let Some(screen_window) = screen_window else {
        let message = "\"screenwindow\" is not a window; x min, x max, y min, y max would be accepted";
        return Err(Fault::new(*place, message));
    };
    let projection = match *kind {
        "perspective" => {
            let fov = match params.float("halffov")? {
                Some(half) => 2.0 * half,
                None => params.float_or("fov", 90.0)?,
            };
            if !(fov > 0.0 && fov < 180.0) {
                let message =
                    format!("\"fov\" is {fov}; an angle between 0 and 180 degrees would be accepted");
                return Err(Fault::new(*place, message));
            }
            Projection::Perspective { tan_half_fov: (fov.to_radians() / 2.0).tan() as f32 }
        }
        "orthographic" => Projection::Orthographic,
        "spherical" | "environment" => Projection::Spherical(spherical_mapping(kind, params)?),
        "realistic" => {
            reader.warnings.add(*place, "camera \"realistic\" is read as a thin lens of 50 mm");
            for name in ["lensfile", "aperture", "simpleweighting"] {
                params.get(name);
            }
            Projection::Perspective { tan_half_fov: (half_short_side(film) / REALISTIC_FOCAL_LENGTH) as f32 }
        }
        other => {
            let accepted = "perspective, orthographic, spherical and environment are accepted";
            let message = format!("camera \"{other}\"; {accepted}");
            return Err(Fault::new(*place, message));
        }
    };
    let realistic = *kind == "realistic";
    let lens_radius = match realistic {
        // Millimetres across to metres from the middle.
        true => params.float_or("aperturediameter", 1.0)? / 2000.0,
        false => params.float_or("lensradius", 0.0)?,
    };
    if lens_radius < 0.0 {
        let message = format!("\"lensradius\" is {lens_radius}; a number from 0 would be accepted");
        return Err(Fault::new(*place, message));
    }
    // A camera that sees all around has none, whatever is said.
    let has_lens = !matches!(projection, Projection::Spherical(_));
    let focal_distance = match realistic {
        true => params.positive_or("focusdistance", 10.0)?,
        false => params.positive_or("focaldistance", 1e6)?,
    };

    // The transform at the camera is world to camera. Render space has its origin at the camera.
    let [Some(to_world_start), Some(to_world_end)] = ctm.map(|ctm| inverse(&ctm)) else {
        return Err(Fault::new(
            *place,
            "a camera with a singular transform; one that can be inverted would be accepted",
        ));
    };
    let [t0, t1] = reader.transform_times;
    let to_world = AnimatedTransform::new(to_world_start, to_world_end, t0, t1);
    let origin = to_world.at_f64(shutter_open).translation;
    let shift = DAffine3::from_translation(-origin);
    let camera = Camera {
        to_render: AnimatedTransform::new(shift * to_world_start, shift * to_world_end, t0, t1),
        projection,
        screen_window,
        lens_radius: if has_lens { lens_radius as f32 } else { 0.0 },
        focal_distance: (focal_distance as f32).max(f32::MIN_POSITIVE),
        shutter_open,
        shutter_close,
    };
    Ok((camera, origin))
}

/// v4 says which mapping; the older dialects' `environment` has only one.
fn spherical_mapping(kind: &str, params: &Params) -> Result<SphericalMapping> {
    match params.string("mapping")? {
        None if kind == "environment" => Ok(SphericalMapping::LatLong),
        None | Some("equalarea") => Ok(SphericalMapping::EqualArea),
        Some("equirectangular") => Ok(SphericalMapping::LatLong),
        Some(other) => {
            let message = format!("mapping \"{other}\"; equalarea and equirectangular are accepted");
            Err(Fault::new(params.place, message))
        }
    }
}

/// Half the shorter side of a film of [`REALISTIC_DIAGONAL`], in millimetres.
fn half_short_side(film: &Film) -> f64 {
    let (width, height) = (film.width as f64, film.height as f64);
    REALISTIC_DIAGONAL / 2.0 * width.min(height) / width.hypot(height)
}

fn integrator(reader: &mut Reader, entry: &Entry) -> Result<Integrator> {
    let Entry { kind, params, place, .. } = entry;
    let max_depth = params.integer_in("maxdepth", 5, 0..=MAX_DEPTH)?;
    let events = reader.dialect.scattering_events(max_depth);
    Ok(match *kind {
        "path" | "volpath" => Integrator::Path { max_depth: events },
        "directlighting" => Integrator::Direct { max_depth },
        other => {
            reader.warnings.add(*place, format!("integrator \"{other}\" is read as \"path\""));
            Integrator::Path { max_depth: events }
        }
    })
}

fn sampler(reader: &mut Reader, entry: &Entry) -> Result<(SamplerKind, u32)> {
    let Entry { kind, params, place, .. } = entry;
    let sampler = match *kind {
        "independent" | "random" => SamplerKind::Independent,
        "sobol" | "zsobol" | "paddedsobol" | "halton" | "stratified" | "pmj02bn" | "lowdiscrepancy"
        | "02sequence" => SamplerKind::Sobol,
        other => {
            reader.warnings.add(*place, format!("sampler \"{other}\" is read as \"zsobol\""));
            SamplerKind::Sobol
        }
    };
    let default = match *kind {
        "stratified" => {
            let side = |name| params.integer_in(name, 4, 1..=1 << 12);
            side("xsamples")? * side("ysamples")?
        }
        "independent" => 4,
        _ => 16,
    };
    Ok((sampler, params.integer_in("pixelsamples", default, 1..=MAX_SPP)?))
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

    /// They are read in double precision, and used in single.
    #[test]
    fn what_single_precision_cannot_hold_is_refused() {
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
            assert!(error.to_string().contains("would be accepted"), "{text}: {error}");
        }
        let near = header("Camera \"perspective\" \"float focaldistance\" 1e-40");
        assert_eq!(near.camera.focal_distance, f32::MIN_POSITIVE);
    }

    #[test]
    fn a_realistic_camera_is_a_normal_lens_and_says_so() {
        let scene = header(
            "Film \"rgb\" \"integer xresolution\" 300 \"integer yresolution\" 200
             Camera \"realistic\" \"string lensfile\" \"a.dat\" \"float aperturediameter\" 10
             \"float focusdistance\" 3",
        );
        let Projection::Perspective { tan_half_fov } = scene.camera.projection else { panic!() };
        // Half the short side of a film of 35 mm across its diagonal, over 50 mm.
        assert!((tan_half_fov - 17.5 * 2.0 / 13f32.sqrt() / 50.0).abs() < 1e-5);
        assert_eq!((scene.camera.lens_radius, scene.camera.focal_distance), (0.005, 3.0));
        assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    }

    #[test]
    fn exposure_and_halved_angles_count() {
        let scene = header(
            "Film \"rgb\" \"float iso\" 200 \"float exposuretime\" .25
             Camera \"perspective\" \"float halffov\" 45",
        );
        assert_eq!(scene.film.scale, 0.5);
        let Projection::Perspective { tan_half_fov } = scene.camera.projection else { panic!() };
        assert!((tan_half_fov - 1.0).abs() < 1e-6);
    }

    #[test]
    fn options_of_the_machinery_are_accepted_and_those_of_the_image_reported() {
        let scene = header("Option \"bool disablepixeljitter\" true Option \"integer seed\" 3");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let scene = header("Option \"string forcediffuse\" \"x\"");
        assert!(scene.warnings[0].contains("forcediffuse"), "{:?}", scene.warnings);
    }

    #[test]
    fn cameras_that_see_all_around_have_no_lens() {
        let camera = |text: &str, end: &str| {
            let text = format!("Camera {text} \"float lensradius\" 1 WorldBegin {end}");
            read_str(&text, Path::new("")).unwrap().camera
        };
        let of = |text: &str, end: &str| camera(text, end).projection;
        let [equal_area, lat_long] =
            [SphericalMapping::EqualArea, SphericalMapping::LatLong].map(Projection::Spherical);
        assert_eq!(of("\"spherical\"", ""), equal_area);
        assert_eq!(of("\"spherical\" \"string mapping\" \"equirectangular\"", ""), lat_long);
        assert_eq!(of("\"environment\"", "WorldEnd"), lat_long);
        assert_eq!(camera("\"environment\"", "WorldEnd").lens_radius, 0.0);
        assert!(read_str("Camera \"spherical\" \"string mapping\" \"x\" WorldBegin", Path::new("")).is_err());
    }
}
