//! Conversion from pbrt-v4's colour spaces, of parameters and of EXR files, to linear sRGB. White of a reflectance maps to white, and white
//! light keeps the colour of the space's illuminant, which is D60 for ACES2065-1 and D65 for the others.
//!
//! Sources: IEC 61966-2-1, SMPTE EG 432-1 (P3 with D65), ITU-R BT.2020, SMPTE ST 2065-1; for reflectances the white
//! point of the last is adapted to D65 by Bradford's method.

use glam::{DMat3, DVec3};

/// A colour space for RGB values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorSpace {
    Srgb,
    DciP3,
    Rec2020,
    Aces2065,
}

/// The names of the spaces.
const NAMES: [(&str, ColorSpace); 4] = [
    ("srgb", ColorSpace::Srgb),
    ("dci-p3", ColorSpace::DciP3),
    ("rec2020", ColorSpace::Rec2020),
    ("aces2065-1", ColorSpace::Aces2065),
];

/// Chromaticities (x, y) of red, green and blue.
const PRIMARIES: [([[f32; 2]; 3], ColorSpace); 4] = [
    ([[0.64, 0.33], [0.3, 0.6], [0.15, 0.06]], ColorSpace::Srgb),
    ([[0.68, 0.32], [0.265, 0.69], [0.15, 0.06]], ColorSpace::DciP3),
    ([[0.708, 0.292], [0.17, 0.797], [0.131, 0.046]], ColorSpace::Rec2020),
    ([[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077]], ColorSpace::Aces2065),
];

/// Rows of the matrices to linear sRGB.
const FROM_DCI_P3: [[f64; 3]; 3] = [
    [1.224_940_176, -0.224_940_176, 0.0],
    [-0.042_056_955, 1.042_056_955, 0.0],
    [-0.019_637_555, -0.078_636_046, 1.098_273_600],
];
const FROM_REC2020: [[f64; 3]; 3] = [
    [1.660_491_002, -0.587_641_139, -0.072_849_863],
    [-0.124_550_475, 1.132_899_897, -0.008_349_423],
    [-0.018_150_763, -0.100_578_898, 1.118_729_661],
];
const FROM_ACES2065: [[f64; 3]; 3] = [
    [2.521_686_187, -1.134_130_988, -0.387_555_199],
    [-0.276_479_914, 1.372_719_088, -0.096_239_173],
    [-0.015_378_065, -0.152_975_336, 1.168_353_401],
];

/// The same for light, without adaptation.
const LIGHT_FROM_ACES2065: [[f64; 3]; 3] = [
    [2.558_385, -1.119_470, -0.391_812],
    [-0.277_985, 1.366_016, -0.093_487],
    [-0.017_171, -0.148_529, 1.081_018],
];

impl ColorSpace {
    /// The colour space that pbrt calls `name`.
    pub fn named(name: &str) -> Option<Self> {
        NAMES.iter().find(|(known, _)| *known == name).map(|(_, space)| *space)
    }

    /// The colour space of these chromaticities of red, green and blue.
    pub fn from_primaries(primaries: [[f32; 2]; 3]) -> Option<Self> {
        const TOLERANCE: f32 = 1e-3;
        let is_near = |known: &[[f32; 2]; 3]| {
            let pairs = known.as_flattened().iter().zip(primaries.as_flattened());
            pairs.into_iter().all(|(a, b)| (a - b).abs() < TOLERANCE)
        };
        PRIMARIES.iter().find(|(known, _)| is_near(known)).map(|(_, space)| *space)
    }

    /// The accepted names, for messages.
    pub fn names() -> String {
        NAMES.map(|(name, _)| name).join(", ")
    }

    /// Converts a reflectance to linear sRGB, clamping negative channels to 0.
    pub fn to_srgb(self, rgb: DVec3) -> DVec3 {
        match self {
            ColorSpace::Srgb => rgb,
            ColorSpace::DciP3 => convert(&FROM_DCI_P3, rgb),
            ColorSpace::Rec2020 => convert(&FROM_REC2020, rgb),
            ColorSpace::Aces2065 => convert(&FROM_ACES2065, rgb),
        }
    }

    /// Converts light to linear sRGB, clamping negative channels to 0.
    pub fn light_to_srgb(self, rgb: DVec3) -> DVec3 {
        match self {
            ColorSpace::Aces2065 => convert(&LIGHT_FROM_ACES2065, rgb),
            _ => self.to_srgb(rgb),
        }
    }
}

fn convert(rows: &[[f64; 3]; 3], rgb: DVec3) -> DVec3 {
    (DMat3::from_cols_array_2d(rows).transpose() * rgb).max(DVec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_white_in_every_space() {
        for (name, space) in NAMES {
            let white = space.to_srgb(DVec3::ONE);
            assert!((white - 1.0).abs().max_element() < 1e-6, "{name}: {white}");
        }
        assert_eq!(ColorSpace::named("adobe"), None);
        assert_eq!(
            ColorSpace::from_primaries([[0.64, 0.33], [0.3, 0.6], [0.1501, 0.06]]),
            Some(ColorSpace::Srgb)
        );
        assert_eq!(ColorSpace::from_primaries([[0.64, 0.33], [0.21, 0.71], [0.15, 0.06]]), None);
    }

    #[test]
    fn white_light_keeps_the_colour_of_its_illuminant() {
        for (name, space) in &NAMES[..3] {
            assert_eq!(space.light_to_srgb(DVec3::ONE), space.to_srgb(DVec3::ONE), "{name}");
        }
        // Chromaticities of D60 (SMPTE ST 2065-1) in linear sRGB, with a luminance of 1
        let (x, y) = (0.32168, 0.33767);
        let xyz = DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
        let d60 = DVec3::new(
            DVec3::new(3.240_97, -1.537_383, -0.498_611).dot(xyz),
            DVec3::new(-0.969_244, 1.875_968, 0.041_555).dot(xyz),
            DVec3::new(0.055_63, -0.203_977, 1.056_972).dot(xyz),
        );
        let white = ColorSpace::Aces2065.light_to_srgb(DVec3::ONE);
        assert!((white - d60).abs().max_element() < 1e-3, "{white} {d60}");
    }

    #[test]
    fn wide_gamuts_exceed_srgb() {
        for (name, space) in &NAMES[1..] {
            let red = space.to_srgb(DVec3::X);
            assert!(red.x > 1.2 && red.y == 0.0, "{name}: {red}");
        }
    }
}
