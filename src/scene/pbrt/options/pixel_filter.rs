//! `PixelFilter`.

use super::option_entity::OptionEntity;
use crate::scene::PixelFilter;
use crate::scene::pbrt::dialect::Dialect;
use crate::scene::pbrt::parser::{ParseError, Result};

/// Largest radius of a pixel filter, in pixels.
const MAX_FILTER_RADIUS: f64 = 64.0;

/// The pixel filter that the directive describes.
pub fn make_pixel_filter(dialect: Dialect, entry: &OptionEntity) -> Result<PixelFilter> {
    let OptionEntity { kind, params, loc, .. } = entry;
    let side = |name: &str, default: f64| -> Result<f32> {
        let radius = params.positive_or(name, default)?;
        if radius > MAX_FILTER_RADIUS {
            let message = format!("\"{name}\" is {radius}; expected at most {MAX_FILTER_RADIUS} pixels");
            return Err(ParseError::new(*loc, message));
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
            // The older dialects give alpha, for exp(−αx²)
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
            let message = format!(
                "unknown pixel filter \"{other}\"; expected box, triangle, gaussian, mitchell or sinc"
            );
            return Err(ParseError::new(*loc, message));
        }
    })
}
