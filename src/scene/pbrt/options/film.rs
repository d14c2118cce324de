//! `Film`: resolution, pixel bounds, exposure and white balance.

use glam::Mat3;

use super::option_entity::OptionEntity;
use super::white_balance::white_balance;
use crate::scene::film::{MAX_PIXELS, MAX_SIDE};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result};
use crate::scene::{Film, PixelFilter};

/// Exposure time in seconds, from the camera's shutter. A shutter interval of length 0 freezes motion
/// and counts as one second.
pub fn exposure_time(builder: &SceneBuilder, camera: &OptionEntity) -> Result<f64> {
    let [open, close] =
        [camera.params.float_or("shutteropen", 0.0)?, camera.params.float_or("shutterclose", 1.0)?];
    let counts = builder.dialect.shutter_scales_exposure() && open != close;
    Ok(if counts { (close - open).abs() } else { 1.0 })
}

/// The film; `exposure_time` is in seconds.
pub fn make_film(
    builder: &mut SceneBuilder,
    entry: &OptionEntity,
    filter: PixelFilter,
    exposure_time: f64,
) -> Result<Film> {
    let OptionEntity { kind, params, loc, .. } = entry;
    if !["rgb", "gbuffer", "image"].contains(kind) {
        builder.warnings.add(*loc, format!("film \"{kind}\" is not supported; using \"rgb\""));
    }
    let [default_width, default_height] = builder.dialect.default_resolution();
    let width = params.integer_in("xresolution", default_width, 1..=MAX_SIDE)?;
    let height = params.integer_in("yresolution", default_height, 1..=MAX_SIDE)?;
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        let message = format!("film of {width}x{height} pixels; expected at most {MAX_PIXELS} pixels");
        return Err(ParseError::new(*loc, message));
    }
    let pixel_bounds = pixel_bounds(entry, width, height)?;
    let scale = imaging_ratio(entry, exposure_time)?;
    match params.string("sensor")? {
        None | Some("cie1931") => {}
        Some(sensor) => {
            builder
                .warnings
                .add(*loc, format!("film sensor \"{sensor}\" is not supported; using \"cie1931\""));
        }
    }
    let filename = params.string("filename")?.filter(|name| !name.is_empty()).map(String::from);
    Ok(Film {
        width: width as usize,
        height: height as usize,
        pixel_bounds,
        filter,
        filename,
        scale,
        white_balance: white_balance_matrix(params)?,
    })
}

/// The part of the film that is rendered: x0, x1, y0, y1 in pixels, half open.
fn pixel_bounds(entry: &OptionEntity, width: u32, height: u32) -> Result<[usize; 4]> {
    let OptionEntity { params, loc, .. } = entry;
    let (w, h) = (f64::from(width), f64::from(height));
    let four = |name: &str, numbers: Option<&[f64]>| match numbers {
        None => Ok(None),
        Some(&[a, b, c, d]) => Ok(Some([a, b, c, d])),
        Some(numbers) => {
            Err(ParseError::new(*loc, format!("\"{name}\" has {} numbers; expected 4", numbers.len())))
        }
    };
    let mut bounds = [0.0, w, 0.0, h];
    if let Some([x0, x1, y0, y1]) = four("pixelbounds", params.integers("pixelbounds")?)? {
        bounds = [x0.clamp(0.0, w), x1.clamp(0.0, w), y0.clamp(0.0, h), y1.clamp(0.0, h)];
    }
    if let Some([x0, x1, y0, y1]) = four("cropwindow", params.floats("cropwindow")?)? {
        let pixel = |fraction: f64, size: f64| (fraction.clamp(0.0, 1.0) * size).ceil();
        bounds = [pixel(x0.min(x1), w), pixel(x0.max(x1), w), pixel(y0.min(y1), h), pixel(y0.max(y1), h)];
    }
    let bounds = bounds.map(|b| b as usize);
    if bounds[0] >= bounds[1] || bounds[2] >= bounds[3] {
        return Err(ParseError::new(*loc, "the pixel bounds are empty; expected at least one pixel"));
    }
    Ok(bounds)
}

/// Factor from radiance to pixel value. Positive and finite as `f32`.
fn imaging_ratio(entry: &OptionEntity, exposure_time: f64) -> Result<f32> {
    let OptionEntity { params, loc, .. } = entry;
    // Compute the imaging ratio of pbrt-v4's default sensor
    let imaging_ratio =
        params.positive_or("iso", 100.0)? / 100.0 * params.positive_or("exposuretime", exposure_time)?;
    // Apply the scale of pbrt-v3, which has no sensor
    let scale = (imaging_ratio * params.positive_or("scale", 1.0)?) as f32;
    if !(scale > 0.0 && scale.is_finite()) {
        let message = format!("the film's imaging ratio is {scale}; expected a finite number above 0");
        return Err(ParseError::new(*loc, message));
    }
    Ok(scale)
}

/// The matrix of the parameter `whitebalance`, a temperature in kelvin, if it is above 0.
fn white_balance_matrix(params: &ParameterDictionary) -> Result<Option<Mat3>> {
    // pbrt-v4's named sensors default to 6500 K, which is the white of sRGB
    let Some(param) = params.get("whitebalance") else { return Ok(None) };
    let Some(kelvin) = params.positive("whitebalance")? else { return Ok(None) };
    let matrix = white_balance(kelvin);
    if matrix.is_finite() { Ok(Some(matrix)) } else { Err(param.error(kelvin, "a temperature such as 6500")) }
}
