//! Irregularly sampled measured BRDFs: the text files (`.brdf`) of pbrt-v2.
//!
//! As in pbrt-v2, the BRDF is a Gaussian-weighted mean of near samples in the space
//! (sin θi sin θo, Δφ / π, cos θi cos θo).

use glam::{DVec3, Vec3};

use crate::scene::pbrt::spectrum::Spectrum;

/// Samples at scattered pairs of directions.
pub struct IrregularBrdf {
    /// Position and RGB value, sorted by the first coordinate.
    samples: Vec<(DVec3, DVec3)>,
}

impl IrregularBrdf {
    /// Squared radius of the first search; it doubles until enough samples are inside.
    const FIRST_RADIUS2: f64 = 1e-3;
    /// Number of samples that end the search.
    const ENOUGH: usize = 3;
    /// Squared radius that covers the whole space, whose squared diagonal is 3.
    const LAST_RADIUS2: f64 = 4.0;
    /// Largest number of wavelengths; converting them to RGB takes quadratic time.
    const MAX_WAVELENGTHS: f64 = 4096.0;
    /// Falloff of the Gaussian weight, per squared distance.
    const FALLOFF: f64 = 100.0;

    /// Parses a file's numbers: the number of wavelengths, the wavelengths, then θi, φi, θo, φo and a
    /// spectrum for each sample.
    ///
    /// # Errors
    /// One sentence, without the file's name.
    pub fn from_numbers(numbers: &[f64]) -> Result<Self, String> {
        let Some((&count, rest)) = numbers.split_first() else {
            return Err("the file is empty; expected a number of wavelengths".into());
        };
        if count.fract() != 0.0 || count < 1.0 || count > Self::MAX_WAVELENGTHS.min(rest.len() as f64) {
            let most = Self::MAX_WAVELENGTHS;
            return Err(format!(
                "{count} wavelengths in a file of {} numbers; expected 1 to {most}, in a longer file",
                numbers.len()
            ));
        }
        let (wavelengths, rows) = rest.split_at(count as usize);
        let width = 4 + wavelengths.len();
        if rows.is_empty() || !rows.len().is_multiple_of(width) {
            return Err(format!("{} numbers after the wavelengths; expected rows of {width}", rows.len()));
        }
        if !wavelengths.is_sorted_by(|a, b| a < b) {
            return Err("the wavelengths are not sorted; expected rising wavelengths".into());
        }
        let primaries = primaries(wavelengths);
        let mut samples: Vec<_> = rows
            .chunks_exact(width)
            .map(|row| {
                let rgb: DVec3 = row[4..].iter().zip(&primaries).map(|(value, rgb)| *value * *rgb).sum();
                let (sin_i, cos_i) = row[0].sin_cos();
                let (sin_o, cos_o) = row[2].sin_cos();
                (DVec3::new(sin_i * sin_o, half_turns(row[1] - row[3]), cos_i * cos_o), rgb)
            })
            .collect();
        samples.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
        Ok(Self { samples })
    }

    /// The BRDF for unit directions, z along the normal.
    pub fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let sines = f64::from((wo.truncate().length() * wi.truncate().length()).min(1.0));
        let angle = f64::from(wo.y.atan2(wo.x)) - f64::from(wi.y.atan2(wi.x));
        let position = DVec3::new(sines, half_turns(angle), f64::from(wo.z * wi.z));
        let mut radius2 = Self::FIRST_RADIUS2;
        loop {
            let radius = radius2.sqrt();
            let first = self.samples.partition_point(|(p, _)| p.x < position.x - radius);
            let last = self.samples.partition_point(|(p, _)| p.x <= position.x + radius);
            let (mut sum, mut weights, mut found) = (DVec3::ZERO, 0.0, 0);
            for (at, value) in &self.samples[first..last] {
                let distance2 = at.distance_squared(position);
                if distance2 < radius2 {
                    let weight = (-Self::FALLOFF * distance2).exp();
                    sum += weight * *value;
                    weights += weight;
                    found += 1;
                }
            }
            if found >= Self::ENOUGH || radius2 > Self::LAST_RADIUS2 {
                return (sum.max(DVec3::ZERO) / weights).as_vec3();
            }
            radius2 *= 2.0;
        }
    }
}

/// The angle between two azimuths in half turns, in [0, 1], from their difference in radians.
fn half_turns(radians: f64) -> f64 {
    let turns = (radians / std::f64::consts::TAU).rem_euclid(1.0);
    2.0 * turns.min(1.0 - turns)
}

/// RGB of a sampled spectrum that is 1 at one wavelength and 0 at the others, for each wavelength.
fn primaries(wavelengths: &[f64]) -> Vec<DVec3> {
    let unit = |i: usize| {
        let pairs = wavelengths.iter().enumerate().map(|(j, nm)| [*nm, f64::from(u8::from(i == j))]);
        Spectrum::Sampled(pairs.collect()).unadapted().as_dvec3()
    };
    (0..wavelengths.len()).map(unit).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::pbrt::files;

    fn direction(theta: f32, phi: f32) -> Vec3 {
        Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    }

    #[test]
    fn samples_of_a_gray_surface_give_a_gray_brdf() {
        let mut text = "# three wavelengths\n3 400 550 700\n".to_string();
        for (i, o, phi) in (0..8).flat_map(|i| (0..8).flat_map(move |o| (0..8).map(move |p| (i, o, p)))) {
            text += &format!("{} 0.5 {} {} 0.2 0.2 0.2\n", i as f32 * 0.2, o as f32 * 0.2, phi as f32 * 0.4);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("gray.brdf");
        std::fs::write(&path, text).unwrap();
        let table = IrregularBrdf::from_numbers(&files::numbers(&path).unwrap()).unwrap();
        let white = Spectrum::constant(0.2).unadapted();
        for (o, i) in [(0.1, 0.1), (0.8, 1.2), (1.5, 0.3)] {
            let value = table.value(direction(o, 0.0), direction(i, 2.0));
            assert!((value - white).abs().max_element() < 1e-4, "{value} {white}");
        }
    }

    #[test]
    fn the_nearest_sample_has_the_largest_weight() {
        let mut numbers = vec![1.0, 550.0];
        for i in 0..10 {
            numbers.extend([0.15 * f64::from(i), 0.0, 0.15 * f64::from(i), 3.0, f64::from(i)]);
        }
        let samples = IrregularBrdf::from_numbers(&numbers).unwrap();
        let value = |theta| samples.value(direction(theta, 0.0), direction(theta, 3.0)).y;
        assert!(value(0.15 * 8.0) > 1.5 * value(0.15 * 4.0));
    }

    #[test]
    fn invalid_files_are_errors() {
        for numbers in [&[] as &[f64], &[0.0], &[2.0, 400.0], &[1.0, 400.0, 0.1], &[2.0, 5.0, 4.0]] {
            assert!(IrregularBrdf::from_numbers(numbers).is_err(), "{numbers:?}");
        }
        let many: Vec<f64> = std::iter::once(5000.0).chain((0..10_004).map(f64::from)).collect();
        assert!(IrregularBrdf::from_numbers(&many).is_err_and(|message| message.contains("1 to 4096")));
    }
}
