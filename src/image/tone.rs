//! Luminance, and conversion between linear light and sRGB-encoded values (IEC 61966-2-1). There is no other
//! tone curve, so a PNG can be decoded to linear light again.

use rayon::prelude::*;

use super::Planes;

/// Relative luminance of linear RGB with the primaries of Rec. 709, which are those of sRGB (ITU-R BT.709).
#[inline]
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Encodes linear light as sRGB, both in [0, 1]. Values outside are clamped; NaN becomes 0.
pub fn srgb_encode(linear: f32) -> f32 {
    // `clamp` would return NaN for NaN.
    let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Decodes sRGB to linear light, both in [0, 1]: the inverse of [`srgb_encode`].
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Encodes the first three planes as interleaved 8-bit sRGB; fewer than three planes give the first one
/// as grey.
///
/// `exposure` is in stops: linear values are multiplied by 2^exposure before encoding.
pub fn to_srgb8(planes: &Planes, exposure: f32) -> Vec<u8> {
    let scale = exposure.exp2();
    let (width, grey) = (planes.width(), planes.count() < 3);
    let mut bytes = vec![0; 3 * planes.pixels()];
    if planes.count() == 0 || width == 0 {
        return bytes;
    }
    bytes.par_chunks_mut(3 * width).enumerate().for_each(|(y, row)| {
        for channel in 0..3 {
            let values = planes.row(if grey { 0 } else { channel }, y);
            for (pixel, &value) in row.chunks_exact_mut(3).zip(values) {
                pixel[channel] = (255.0 * srgb_encode(scale * value) + 0.5) as u8;
            }
        }
    });
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_has_the_values_of_the_standard() {
        assert_eq!(srgb_encode(0.0), 0.0);
        assert!((srgb_encode(1.0) - 1.0).abs() < 1e-6);
        assert!((srgb_encode(0.214_041_14) - 0.5).abs() < 1e-6);
        assert!((srgb_encode(0.002) - 0.025_84).abs() < 1e-6);
        assert!((srgb_decode(0.5) - 0.214_041_14).abs() < 1e-6);
    }

    #[test]
    fn values_outside_the_range_are_clamped() {
        assert_eq!(srgb_encode(-1.0), 0.0);
        assert_eq!(srgb_encode(f32::NAN), 0.0);
        assert_eq!(srgb_encode(f32::NEG_INFINITY), 0.0);
        assert!((srgb_encode(f32::INFINITY) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn every_byte_survives_decoding_and_encoding() {
        for byte in 0..=255_u8 {
            let mut planes = Planes::new(1, 1, 1);
            planes.data_mut()[0] = srgb_decode(f32::from(byte) / 255.0);
            assert_eq!(to_srgb8(&planes, 0.0), [byte; 3]);
        }
    }

    #[test]
    fn one_stop_doubles_the_light() {
        let mut planes = Planes::new(1, 1, 3);
        planes.data_mut().copy_from_slice(&[0.1, 0.2, 0.3]);
        let brighter = to_srgb8(&planes, 1.0);
        planes.data_mut().copy_from_slice(&[0.2, 0.4, 0.6]);
        assert_eq!(brighter, to_srgb8(&planes, 0.0));
    }
}
