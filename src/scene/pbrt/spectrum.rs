//! Converts spectra to linear sRGB (Rec. 709 primaries, D65 white).
//!
//! Colour matching functions: Wyman, Sloan and Shirley 2013, "Simple analytic approximations to
//! the CIE XYZ color matching functions", equation 4 (the multi-lobe fit). Blackbodies: Planck's
//! law. Named metals: the tabulated indices that pbrt-v4 names, integrated with the functions
//! below. Named illuminants: their CIE 1931 chromaticities.

use glam::{DMat3, DVec3, Vec3};

/// The visible range in nm, sampled in steps of 1 nm.
const WAVELENGTHS: std::ops::RangeInclusive<u32> = 360..=830;

/// XYZ → linear sRGB (IEC 61966-2-1), rows.
const RGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266_0, 1.876_010_8, 0.041_556_0],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];

/// Wavelength of the helium d line in nm, at which glass is measured.
const D_LINE: f64 = 587.56;

/// Wien's displacement constant, nm·K.
const WIEN_DISPLACEMENT: f64 = 2.897_772e6;

/// A spectrum parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// Linear sRGB.
    Rgb(Vec3),
    /// Pairs of wavelength in nm and value, sorted by wavelength and not empty. The spectrum is
    /// constant beyond the ends.
    Sampled(Vec<[f64; 2]>),
    /// Temperature in kelvin, and a factor (pbrt-v2 and v3).
    Blackbody { kelvin: f64, scale: f64 },
    /// CIE 1931 x and y of an illuminant.
    Chromaticity(f64, f64),
}

impl Spectrum {
    /// A constant spectrum.
    pub fn constant(value: f64) -> Self {
        Spectrum::Sampled(vec![[D_LINE, value]])
    }

    /// A spectrum that pbrt-v4 knows by name.
    pub fn named(name: &str) -> Option<Self> {
        let rgb = |values: [f32; 3]| Spectrum::Rgb(Vec3::from(values));
        let found = |table: &[(&str, [f32; 3])]| table.iter().find(|(n, _)| *n == name).map(|(_, v)| rgb(*v));
        let glass = || GLASSES.iter().find(|(n, _)| *n == name).map(|(_, eta)| Spectrum::constant(*eta));
        let illuminant =
            || ILLUMINANTS.iter().find(|(n, _)| *n == name).map(|(_, [x, y])| Spectrum::Chromaticity(*x, *y));
        found(METALS).or_else(glass).or_else(illuminant)
    }

    /// Parses pairs of wavelength and value with rising wavelengths, or one constant. Returns `None`
    /// for any other list.
    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let (pairs, rest) = numbers.as_chunks::<2>();
        match (pairs, rest) {
            ([], [value]) => Some(Spectrum::constant(*value)),
            ([_, ..], []) if pairs.is_sorted_by(|a, b| a[0] < b[0]) => {
                Some(Spectrum::Sampled(pairs.to_vec()))
            }
            _ => None,
        }
    }

    /// Like [`Self::from_numbers`], but sorts the pairs and accepts equal wavelengths (pbrt-v2 and v3).
    pub fn from_unsorted_numbers(numbers: &[f64]) -> Option<Self> {
        let (pairs, rest) = numbers.as_chunks::<2>();
        if pairs.is_empty() || !rest.is_empty() {
            return Self::from_numbers(numbers);
        }
        let mut pairs = pairs.to_vec();
        pairs.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        Some(Spectrum::Sampled(pairs))
    }

    /// Makes a sampled spectrum 0 beyond its ends. A constant spectrum stays constant.
    pub fn zero_outside(self) -> Self {
        match self {
            Spectrum::Sampled(mut samples) if samples.len() > 1 => {
                let [first, last] = [samples[0][0], samples[samples.len() - 1][0]];
                samples.insert(0, [first.next_down(), 0.0]);
                samples.push([last.next_up(), 0.0]);
                Spectrum::Sampled(samples)
            }
            other => other,
        }
    }

    /// RGB of a reflectance or an index of refraction. A constant spectrum has equal channels.
    pub fn reflectance(&self) -> Vec3 {
        match self {
            Spectrum::Rgb(rgb) => *rgb,
            _ => {
                let white = rgb_from_xyz(xyz(|_| 1.0));
                (rgb_from_xyz(xyz(|nm| self.at(nm))) / white).as_vec3()
            }
        }
    }

    /// RGB as pbrt-v2 and v3 compute it: relative to an equal-energy illuminant, so that a constant
    /// spectrum is reddish. Blackbodies have the peak `scale`.
    pub fn unadapted(&self) -> Vec3 {
        let xyz = match self {
            Spectrum::Rgb(rgb) => return *rgb,
            Spectrum::Chromaticity(x, y) => DVec3::new(*x, *y, 1.0 - x - y) / *y,
            Spectrum::Blackbody { kelvin, scale } => {
                xyz(|nm| scale / blackbody_peak_over(nm, *kelvin)) / xyz(|_| 1.0).y
            }
            Spectrum::Sampled(_) => xyz(|nm| self.at(nm)) / xyz(|_| 1.0).y,
        };
        rgb_from_xyz(xyz).as_vec3()
    }

    /// RGB of a light's emission. As in pbrt-v4, spectra other than RGB are normalised to a luminance
    /// of 1.
    pub fn illuminant(&self) -> Vec3 {
        let xyz = match self {
            Spectrum::Rgb(rgb) => return *rgb,
            Spectrum::Chromaticity(x, y) => DVec3::new(*x, *y, 1.0 - x - y),
            _ => xyz(|nm| self.at(nm)),
        };
        if xyz.y > 0.0 { rgb_from_xyz(xyz / xyz.y).max(DVec3::ZERO).as_vec3() } else { Vec3::ZERO }
    }

    /// Index of refraction of glass at the d line, or at the nearest sample if that is 0.
    pub fn refractive_index(&self) -> f64 {
        match self {
            Spectrum::Rgb(rgb) => f64::from(rgb.y),
            Spectrum::Sampled(samples) => {
                let apart = |sample: &&[f64; 2]| (sample[0] - D_LINE).abs();
                let nearest = |a: &&[f64; 2], b: &&[f64; 2]| apart(a).total_cmp(&apart(b));
                let at_line = self.at(D_LINE);
                match samples.iter().filter(|sample| sample[1] != 0.0).min_by(nearest) {
                    Some([_, value]) if at_line == 0.0 => *value,
                    _ => at_line,
                }
            }
            _ => self.at(D_LINE),
        }
    }

    /// Value at a wavelength in nm; 1 for RGB and chromaticities, which have no unique spectrum.
    fn at(&self, nm: f64) -> f64 {
        match self {
            Spectrum::Sampled(samples) => {
                let after = samples.partition_point(|[wavelength, _]| *wavelength <= nm);
                match (samples.get(after.wrapping_sub(1)), samples.get(after)) {
                    (Some([x0, y0]), Some([x1, y1])) => y0 + (y1 - y0) * (nm - x0) / (x1 - x0),
                    (Some([_, value]), None) | (None, Some([_, value])) => *value,
                    (None, None) => 0.0,
                }
            }
            Spectrum::Blackbody { kelvin, .. } => planck(nm, *kelvin),
            Spectrum::Rgb(_) | Spectrum::Chromaticity(..) => 1.0,
        }
    }
}

/// Planck's law up to a factor.
fn planck(nm: f64, kelvin: f64) -> f64 {
    /// hc/k in nm·K.
    const SECOND_RADIATION_CONSTANT: f64 = 1.438_776_877e7;
    // The factor (500 nm)⁵ keeps the values near 1
    (500.0 / nm).powi(5) / (SECOND_RADIATION_CONSTANT / (nm * kelvin)).exp_m1()
}

/// The greatest value of a blackbody's spectrum over that at a wavelength in nm.
pub fn blackbody_peak_over(nm: f64, kelvin: f64) -> f64 {
    planck(WIEN_DISPLACEMENT / kelvin, kelvin) / planck(nm, kelvin)
}

/// The three colour matching functions at a wavelength in nm.
fn matching_functions(nm: f64) -> DVec3 {
    let lobe = |height: f64, centre: f64, below: f64, above: f64| {
        let t = (nm - centre) * if nm < centre { below } else { above };
        height * (-0.5 * t * t).exp()
    };
    DVec3::new(
        lobe(0.362, 442.0, 0.0624, 0.0374)
            + lobe(1.056, 599.8, 0.0264, 0.0323)
            + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    )
}

/// Integral of a spectrum with the colour matching functions.
fn xyz(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    WAVELENGTHS.map(f64::from).map(|nm| matching_functions(nm) * spectrum(nm)).sum()
}

/// XYZ of a blackbody with a luminance of 1.
pub fn blackbody_xyz(kelvin: f64) -> DVec3 {
    let xyz = xyz(|nm| planck(nm, kelvin));
    xyz / xyz.y
}

/// The matrix from XYZ to linear sRGB.
pub fn rgb_from_xyz_matrix() -> DMat3 {
    DMat3::from_cols_array_2d(&RGB_FROM_XYZ).transpose()
}

/// Converts XYZ to linear sRGB.
pub fn rgb_from_xyz(xyz: DVec3) -> DVec3 {
    rgb_from_xyz_matrix() * xyz
}

/// Index of refraction (eta) and absorption (k) by channel.
const METALS: &[(&str, [f32; 3])] = &[
    ("metal-Ag-eta", [0.1288, 0.1232, 0.1522]),
    ("metal-Ag-k", [3.9986, 3.2989, 2.3602]),
    ("metal-Al-eta", [1.3692, 0.9326, 0.5727]),
    ("metal-Al-k", [7.6438, 6.6203, 5.3183]),
    ("metal-Au-eta", [0.1214, 0.3929, 1.5872]),
    ("metal-Au-k", [3.2966, 2.5221, 1.7621]),
    ("metal-Cu-eta", [0.1693, 0.9709, 1.2129]),
    ("metal-Cu-k", [3.2360, 2.5940, 2.3553]),
    ("metal-CuZn-eta", [0.4326, 0.5141, 1.1463]),
    ("metal-CuZn-k", [3.5845, 2.6945, 1.7495]),
    ("metal-MgO-eta", [1.7344, 1.7408, 1.7540]),
    ("metal-MgO-k", [0.0, 0.0, 0.0]),
    ("metal-TiO2-eta", [2.8696, 2.9540, 3.1952]),
    ("metal-TiO2-k", [0.0, 0.0, 0.0]),
];

/// Index of refraction at the d line, from the manufacturers' catalogues. Some glasses have two names.
const GLASSES: &[(&str, f64)] = &[
    ("glass-BK7", 1.5168),
    ("glass-BAF10", 1.6700),
    ("glass-FK51A", 1.4866),
    ("glass-LASF9", 1.8503),
    ("glass-F5", 1.6727),
    ("glass-SF5", 1.6727),
    ("glass-F10", 1.7283),
    ("glass-SF10", 1.7283),
    ("glass-F11", 1.7847),
    ("glass-SF11", 1.7847),
];

/// CIE 1931 chromaticities, 2° observer.
const ILLUMINANTS: &[(&str, [f64; 2])] = &[
    ("stdillum-A", [0.447_57, 0.407_45]),
    ("stdillum-D50", [0.345_67, 0.358_50]),
    ("stdillum-D65", [0.312_71, 0.329_02]),
    ("stdillum-F1", [0.313_10, 0.337_27]),
    ("stdillum-F2", [0.372_08, 0.375_29]),
    ("stdillum-F3", [0.409_10, 0.394_30]),
    ("stdillum-F4", [0.440_18, 0.403_29]),
    ("stdillum-F5", [0.313_79, 0.345_31]),
    ("stdillum-F6", [0.377_90, 0.388_35]),
    ("stdillum-F7", [0.312_92, 0.329_33]),
    ("stdillum-F8", [0.345_88, 0.358_75]),
    ("stdillum-F9", [0.374_17, 0.372_81]),
    ("stdillum-F10", [0.346_09, 0.359_86]),
    ("stdillum-F11", [0.380_52, 0.377_13]),
    ("stdillum-F12", [0.436_95, 0.404_41]),
    ("illum-acesD60", [0.321_68, 0.337_67]),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::luminance;

    fn assert_close(a: Vec3, b: Vec3, tolerance: f32) {
        assert!((a - b).abs().max_element() < tolerance, "{a} is not {b}");
    }

    #[test]
    fn a_constant_reflectance_is_gray() {
        let spectrum = Spectrum::from_numbers(&[300.0, 0.5, 900.0, 0.5]).unwrap();
        assert_close(spectrum.reflectance(), Vec3::splat(0.5), 1e-6);
        assert_close(Spectrum::constant(0.25).reflectance(), Vec3::splat(0.25), 1e-6);
    }

    #[test]
    fn a_red_reflectance_is_red() {
        let rgb = Spectrum::from_numbers(&[590.0, 0.0, 610.0, 1.0]).unwrap().reflectance();
        assert!(rgb.x > 0.8 && rgb.y < 0.1 && rgb.z.abs() < 0.05, "{rgb}");
    }

    #[test]
    fn lights_have_luminance_one_whatever_their_spectrum() {
        for spectrum in [
            Spectrum::Blackbody { kelvin: 6500.0, scale: 1.0 },
            Spectrum::Blackbody { kelvin: 3000.0, scale: 1.0 },
            Spectrum::named("stdillum-D65").unwrap(),
            Spectrum::from_numbers(&[400.0, 7.0, 700.0, 7.0]).unwrap(),
        ] {
            let luminance = luminance(spectrum.illuminant().to_array());
            assert!((luminance - 1.0).abs() < 2e-3, "{spectrum:?}");
        }
    }

    #[test]
    fn daylight_is_white_and_a_cool_blackbody_is_orange() {
        assert_close(Spectrum::named("stdillum-D65").unwrap().illuminant(), Vec3::ONE, 2e-3);
        let rgb = Spectrum::Blackbody { kelvin: 2856.0, scale: 1.0 }.illuminant();
        assert!(rgb.x > rgb.y && rgb.y > rgb.z, "{rgb}");
        // Illuminant A is a blackbody of 2856 K.
        assert_close(rgb, Spectrum::named("stdillum-A").unwrap().illuminant(), 0.05);
    }

    #[test]
    fn sampled_spectra_are_interpolated_and_constant_beyond_their_ends_or_zero_there() {
        let spectrum = Spectrum::from_numbers(&[400.0, 1.0, 500.0, 3.0]).unwrap();
        assert_eq!([300.0, 400.0, 450.0, 500.0, 600.0].map(|nm| spectrum.at(nm)), [1.0, 1.0, 2.0, 3.0, 3.0]);
        let zero_outside = spectrum.zero_outside();
        assert_eq!(
            [399.0, 400.0, 450.0, 500.0, 501.0].map(|nm| zero_outside.at(nm)),
            [0.0, 1.0, 2.0, 3.0, 0.0]
        );
        assert_eq!(Spectrum::constant(2.0).zero_outside().at(400.0), 2.0);
        assert_eq!(zero_outside.refractive_index(), 3.0);
        assert_eq!(Spectrum::named("glass-BK7").unwrap().refractive_index(), 1.5168);
    }

    #[test]
    fn unadapted_constant_spectra_have_an_equal_energy_white() {
        // The linear sRGB of XYZ = 1, 1, 1.
        assert_close(Spectrum::constant(1.0).unadapted(), Vec3::new(1.2048, 0.9482, 0.9088), 1e-2);
    }

    #[test]
    fn invalid_lists_are_rejected() {
        assert_eq!(Spectrum::from_numbers(&[]), None);
        assert_eq!(Spectrum::from_numbers(&[400.0, 1.0, 500.0]), None);
        assert_eq!(Spectrum::from_numbers(&[500.0, 1.0, 400.0, 1.0]), None);
    }
}
