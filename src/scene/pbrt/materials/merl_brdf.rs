//! Tables of the MERL BRDF database, by half angle and difference angle.
//!
//! Matusik et al., "A data-driven reflectance model", 2003.

use std::f32::consts::{FRAC_PI_2, PI};
use std::io::Read;
use std::path::Path;

use glam::Vec3;

use crate::memory::check_available;
use crate::scene::pbrt::files;

/// A MERL table. φd varies fastest, then θd, then √θh, then the channel.
pub struct MerlBrdf {
    /// Number of entries along θh, θd and φd.
    steps: [usize; 3],
    values: Vec<f64>,
}

impl MerlBrdf {
    /// Scale factors of the stored channels (MERL's `BRDFRead`).
    const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

    /// Reads a binary table.
    ///
    /// # Errors
    /// One sentence, without the file's name.
    pub fn read(path: &Path) -> Result<Self, String> {
        let files::Source { mut reader, max_length } = files::open(path)?;
        let error = |error: std::io::Error| error.to_string();
        let mut header = [0; 12];
        reader.read_exact(&mut header).map_err(error)?;
        let (words, _) = header.as_chunks::<4>();
        let steps: Vec<usize> =
            words.iter().map(|&word| usize::try_from(i32::from_le_bytes(word)).unwrap_or(0)).collect();
        let steps = [steps[0], steps[1], steps[2]];
        let bytes = steps.iter().try_fold(3 * size_of::<f64>(), |size, &n| size.checked_mul(n));
        let Some(bytes) = bytes.filter(|&bytes| bytes > 0 && bytes as u64 <= max_length) else {
            return Err(format!("the file is too short for a table of {steps:?} steps"));
        };
        check_available(2 * bytes as u64)?;
        let mut data = vec![0; bytes];
        reader.read_exact(&mut data).map_err(error)?;
        let (numbers, _) = data.as_chunks::<8>();
        Ok(Self { steps, values: numbers.iter().map(|&number| f64::from_le_bytes(number)).collect() })
    }

    /// The BRDF for unit directions, z along the normal: the nearest entry.
    pub fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(half) = (wo + wi).try_normalize() else { return Vec3::ZERO };
        let radius = half.truncate().length();
        let theta_half = radius.atan2(half.z);
        let (cos, sin) = if radius > 0.0 { (half.x / radius, half.y / radius) } else { (1.0, 0.0) };
        let along = Vec3::new(cos * half.z, sin * half.z, -radius);
        let across = Vec3::new(-sin, cos, 0.0);
        let theta_difference = wi.dot(half).clamp(-1.0, 1.0).acos();
        // By reciprocity, φ and φ + π are equivalent
        let phi = wi.dot(across).atan2(wi.dot(along)).rem_euclid(PI);
        let index = |fraction: f32, n: usize| ((fraction * n as f32) as usize).min(n - 1);
        let [h, d, p] = self.steps;
        let entry = (index((theta_half / FRAC_PI_2).max(0.0).sqrt(), h) * d
            + index(theta_difference / FRAC_PI_2, d))
            * p
            + index(phi / PI, p);
        let channel = |c: usize| (self.values[c * h * d * p + entry] * Self::SCALES[c]).max(0.0) as f32;
        Vec3::new(channel(0), channel(1), channel(2))
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn direction(theta: f32, phi: f32) -> Vec3 {
        Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    }

    #[test]
    fn a_merl_table_is_read_and_scaled() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.binary");
        let steps = [4i32, 3, 2];
        let mut bytes: Vec<u8> = steps.iter().flat_map(|n| n.to_le_bytes()).collect();
        for channel in 0..3 {
            let value = 1500.0 * f64::from(channel + 1) / [1.0, 1.15, 1.66][channel as usize];
            (0..24).for_each(|_| bytes.extend(value.to_le_bytes()));
        }
        std::fs::write(&path, &bytes).unwrap();
        let value = MerlBrdf::read(&path).unwrap().value(direction(0.4, 0.3), direction(0.9, 2.0));
        assert!((value - Vec3::new(1.0, 2.0, 3.0)).abs().max_element() < 1e-4, "{value}");
        bytes[0] = 5;
        std::fs::write(&path, &bytes).unwrap();
        assert!(MerlBrdf::read(&path).map(drop).unwrap_err().contains("[5, 3, 2]"));
    }
}
