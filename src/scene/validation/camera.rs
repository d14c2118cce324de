//! Checks of the camera and the film.

use super::validation_error::Result;
use super::values::{animated_transform, finite, positive, require};
use crate::scene::camera::{Projection, is_window};
use crate::scene::film::{MAX_PIXELS, MAX_SIDE};
use crate::scene::{Camera, Film, PixelFilter};

/// Checks projection, screen window, lens, shutter and motion of a camera.
pub fn check_camera(camera: &Camera) -> Result {
    animated_transform(&camera.to_render, || "camera.to_render".into())?;
    if let Projection::Perspective { tan_half_fov } = camera.projection {
        positive(tan_half_fov, || "camera.projection.tan_half_fov".into())?;
    }
    let valid = is_window(camera.screen_window);
    let value = format_args!("{:?}", camera.screen_window);
    require(valid, || "camera.screen_window".into(), value, "x min, x max, y min, y max of a rectangle")?;

    let radius = camera.lens_radius;
    let valid = radius >= 0.0 && radius.is_finite();
    require(valid, || "camera.lens_radius".into(), radius, "a finite number of at least 0")?;
    positive(camera.focal_distance, || "camera.focal_distance".into())?;

    finite(camera.shutter_open, || "camera.shutter_open".into())?;
    let close = camera.shutter_close;
    let valid = close.is_finite() && close >= camera.shutter_open;
    require(valid, || "camera.shutter_close".into(), close, "a finite time not before shutter_open")
}

/// Checks resolution, pixel bounds, filter, exposure and white balance of a film.
pub fn check_film(film: &Film) -> Result {
    // Check the resolution
    for (name, side) in [("film.width", film.width), ("film.height", film.height)] {
        let valid = (1..=MAX_SIDE as usize).contains(&side);
        require(valid, || name.into(), side, "1 to 65535 pixels")?;
    }
    let pixels = film.width as u64 * film.height as u64;
    require(pixels <= MAX_PIXELS, || "film.width times film.height".into(), pixels, "at most 2^27 pixels")?;

    // Check the rendered part
    let [x0, x1, y0, y1] = film.pixel_bounds;
    let valid = x0 < x1 && x1 <= film.width && y0 < y1 && y1 <= film.height;
    let value = format_args!("{:?}", film.pixel_bounds);
    require(valid, || "film.pixel_bounds".into(), value, "x0 < x1 and y0 < y1 inside the film")?;

    positive(film.scale, || "film.scale".into())?;
    for element in film.white_balance.iter().flat_map(|matrix| matrix.to_cols_array()) {
        finite(element, || "film.white_balance".into())?;
    }
    check_pixel_filter(&film.filter)
}

fn check_pixel_filter(filter: &PixelFilter) -> Result {
    let (radius, parameters) = match *filter {
        PixelFilter::Box { radius } | PixelFilter::Triangle { radius } => (radius, [None; 2]),
        PixelFilter::Gaussian { radius, sigma } => {
            positive(sigma, || "film.filter.sigma".into())?;
            (radius, [None; 2])
        }
        PixelFilter::Mitchell { radius, b, c } => (radius, [Some(("b", b)), Some(("c", c))]),
        PixelFilter::Sinc { radius, tau } => {
            positive(tau, || "film.filter.tau".into())?;
            (radius, [None; 2])
        }
    };
    for (axis, side) in radius.into_iter().enumerate() {
        positive(side, || format!("film.filter.radius[{axis}]"))?;
    }
    for (name, value) in parameters.into_iter().flatten() {
        finite(value, || format!("film.filter.{name}"))?;
    }
    Ok(())
}
