//! White balance of the film: the matrix by which an illuminant of a given temperature becomes white.
//!
//! Takes a temperature in kelvin; gives a matrix for linear sRGB. Source: `WhiteBalance` and `Spectra::D` of pbrt-v4
//! (`util/color.h`, `util/spectrum.cpp`), which is von Kries' adaptation with Bradford's cone responses.

use glam::{DMat3, DVec3, Mat3};

use crate::scene::pbrt::spectrum::{blackbody_xyz, rgb_from_xyz_matrix};

/// CIE 1931 chromaticity of D65, the white of linear sRGB.
const D65: [f64; 2] = [0.3127, 0.3290];

/// XYZ to Bradford's cone responses, rows.
const LMS_FROM_XYZ: [[f64; 3]; 3] =
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// The matrix that maps daylight of a temperature in kelvin to white. Elements overflow for temperatures near 0.
pub fn white_balance(kelvin: f64) -> Mat3 {
    let lms_from_xyz = DMat3::from_cols_array_2d(&LMS_FROM_XYZ).transpose();
    let rgb_from_xyz = rgb_from_xyz_matrix();
    let gains = lms_from_xyz * xyz_from_chromaticity(D65) / (lms_from_xyz * daylight_xyz(kelvin));
    let lms_from_rgb = lms_from_xyz * rgb_from_xyz.inverse();
    (lms_from_rgb.inverse() * DMat3::from_diagonal(gains) * lms_from_rgb).as_mat3()
}

/// XYZ of the CIE's daylight of a temperature in kelvin with a luminance of 1. Below 4000 K, where it is not defined,
/// it is a blackbody.
fn daylight_xyz(kelvin: f64) -> DVec3 {
    // Temperatures are stated for an older value of the second radiation constant
    let t = kelvin * 1.4388 / 1.4380;
    if t < 4000.0 {
        return blackbody_xyz(t);
    }
    let [c3, c2, c1, c0] = if t <= 7000.0 {
        [-4.607e9, 2.9678e6, 0.09911e3, 0.244_063]
    } else {
        [-2.0064e9, 1.9018e6, 0.24748e3, 0.23704]
    };
    let x = c3 / t.powi(3) + c2 / t.powi(2) + c1 / t + c0;
    xyz_from_chromaticity([x, -3.0 * x * x + 2.870 * x - 0.275])
}

/// XYZ of a chromaticity with a luminance of 1.
fn xyz_from_chromaticity([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use super::*;
    use crate::scene::pbrt::read_str;
    use crate::scene::pbrt::spectrum::Spectrum;

    #[test]
    fn the_illuminant_of_the_temperature_becomes_white() {
        let illuminant = |name: &str| Spectrum::named(name).expect("a known name").illuminant();
        let blackbody = Spectrum::Blackbody { kelvin: 3000.0 * 1.4388 / 1.4380, scale: 1.0 }.illuminant();
        for (kelvin, light) in
            [(5000.0, illuminant("stdillum-D50")), (6500.0, illuminant("stdillum-D65")), (3000.0, blackbody)]
        {
            let white = white_balance(kelvin) * light;
            assert!((white - 1.0).abs().max_element() < 3e-3, "{kelvin}: {white}");
        }
    }

    #[test]
    fn a_warm_balance_makes_colours_bluer_and_can_leave_the_gamut() {
        let matrix = white_balance(5000.0);
        assert!((matrix * Vec3::X - Vec3::new(0.9394, 0.0044, 0.0082)).abs().max_element() < 1e-3);
        assert!((matrix * Vec3::Y - Vec3::new(-0.0938, 1.0241, 0.0296)).abs().max_element() < 1e-3);
        assert!((matrix * Vec3::Z - Vec3::new(-0.0175, -0.0065, 1.3330)).abs().max_element() < 1e-3);
    }

    #[test]
    fn the_film_has_a_white_balance_if_a_temperature_is_given() {
        let balance = |params: &str| {
            let text = format!("Film \"rgb\" {params} WorldBegin");
            read_str(&text, Path::new("")).map(|scene| scene.film.white_balance)
        };
        for none in ["", "\"float whitebalance\" 0", "\"string sensor\" \"nikon_d850\""] {
            assert_eq!(balance(none).unwrap(), None, "{none}");
        }
        for sensor in ["", "\"string sensor\" \"nikon_d850\""] {
            let found = balance(&format!("\"float whitebalance\" 5000 {sensor}")).unwrap();
            assert_eq!(found, Some(white_balance(5000.0)), "{sensor}");
        }
        let error = balance("\"float whitebalance\" 1").unwrap_err();
        assert!(error.message.contains("whitebalance"), "{error}");
    }
}
