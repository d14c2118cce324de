//! Images computed from functions of (u, v), as PNG files.

use std::io::Cursor;

use glam::DVec3;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

/// Samples along each side of a pixel.
const SUPERSAMPLING: usize = 3;

/// A colour image from linear RGB in [0, 1], sRGB encoded. (0, 0) is the lower left corner, as where
/// pbrt looks it up.
pub fn colour(width: usize, height: usize, f: impl Fn(f64, f64) -> DVec3) -> Vec<u8> {
    let pixels = pixels(width, height, f, |mean| mean.to_array().map(|linear| quantise(encode_srgb(linear))));
    encode(&pixels, width, height, ExtendedColorType::Rgb8)
}

/// A mask: 1 where `inside` holds. Pixels at the outline are rounded to 0 or 1, so that the encoding
/// does not matter.
pub fn mask(width: usize, height: usize, inside: impl Fn(f64, f64) -> bool) -> Vec<u8> {
    let coverage = |u, v| DVec3::splat(f64::from(u8::from(inside(u, v))));
    let pixels = pixels(width, height, coverage, |mean| [if mean.x >= 0.5 { 255 } else { 0 }]);
    encode(&pixels, width, height, ExtendedColorType::L8)
}

fn pixels<const N: usize>(
    width: usize,
    height: usize,
    f: impl Fn(f64, f64) -> DVec3,
    finish: impl Fn(DVec3) -> [u8; N],
) -> Vec<u8> {
    let mut pixels = Vec::with_capacity(width * height * N);
    let sub = |i: usize, k: usize, n: usize| (i as f64 + (k as f64 + 0.5) / SUPERSAMPLING as f64) / n as f64;
    for y in 0..height {
        for x in 0..width {
            let mut sum = DVec3::ZERO;
            for ky in 0..SUPERSAMPLING {
                for kx in 0..SUPERSAMPLING {
                    sum += f(sub(x, kx, width), 1.0 - sub(y, ky, height));
                }
            }
            pixels.extend(finish(sum / (SUPERSAMPLING * SUPERSAMPLING) as f64));
        }
    }
    pixels
}

fn encode(pixels: &[u8], width: usize, height: usize, colour: ExtendedColorType) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(pixels, width as u32, height as u32, colour)
        .expect("the buffer has the image's size and memory accepts all bytes");
    bytes.into_inner()
}

fn quantise(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// IEC 61966-2-1.
fn encode_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn v_grows_upwards_and_colours_are_srgb_encoded() {
        let png = colour(1, 2, |_, v| DVec3::new(if v > 0.5 { 1.0 } else { 0.0 }, 0.214, 0.0));
        let image = image::load_from_memory(&png).expect("is a PNG").to_rgb8();
        assert_eq!(image.get_pixel(0, 0).0, [255, 127, 0]);
        assert_eq!(image.get_pixel(0, 1).0, [0, 127, 0]);
    }
}
