//! Files of measured BRDFs: pbrt-v2's `.brdf`, irregular samples as text, and MERL's binary table
//! of half angles (Matusik et al., *A data-driven reflectance model*, 2003).
//!
//! Irregular samples become a function as in pbrt-v2: in the space (sin θi sin θo, Δφ / π,
//! cos θi cos θo), near samples are averaged, weighted by a Gaussian of their distance.

use std::f32::consts::{FRAC_PI_2, PI};
use std::io::Read;
use std::path::Path;

use glam::{DVec3, Vec3};

use super::files;
use super::spectrum::Spectrum;
use crate::scene::measured::MeasuredBrdf;

/// Reads a measured BRDF, whose format follows from the name.
///
/// # Errors
/// One sentence, without the file's name.
pub fn read(path: &Path) -> Result<MeasuredBrdf, String> {
    let is_text = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("brdf"));
    if is_text {
        let samples = Irregular::from_numbers(&files::numbers(path)?)?;
        Ok(MeasuredBrdf::new(|wo, wi| samples.value(wo, wi)))
    } else {
        let table = HalfAngles::read(path)?;
        Ok(MeasuredBrdf::new(|wo, wi| table.value(wo, wi)))
    }
}

/// Samples that lie anywhere.
struct Irregular {
    /// By the first coordinate of their place.
    samples: Vec<(DVec3, DVec3)>,
}

impl Irregular {
    /// Squared radius of the first search, doubled until enough samples are inside.
    const FIRST_RADIUS2: f64 = 1e-3;
    const ENOUGH: usize = 3;
    /// Beyond the whole space, whose diagonal squared is 3.
    const LAST_RADIUS2: f64 = 4.0;
    /// Most wavelengths: their part in a colour takes a time that grows with their number squared.
    const MAX_WAVELENGTHS: f64 = 4096.0;
    /// Of the Gaussian, per squared distance.
    const FALLOFF: f64 = 100.0;

    /// Number of wavelengths, wavelengths, then θi, φi, θo, φo and the spectrum of each sample.
    fn from_numbers(numbers: &[f64]) -> Result<Self, String> {
        let Some((&count, rest)) = numbers.split_first() else {
            return Err("no numbers; a count of wavelengths would be accepted".into());
        };
        if count.fract() != 0.0 || count < 1.0 || count > Self::MAX_WAVELENGTHS.min(rest.len() as f64) {
            let most = Self::MAX_WAVELENGTHS;
            return Err(format!(
                "{count} wavelengths in a file of {} numbers; 1 to {most} in a longer one are accepted",
                numbers.len()
            ));
        }
        let (wavelengths, rows) = rest.split_at(count as usize);
        let width = 4 + wavelengths.len();
        if rows.is_empty() || !rows.len().is_multiple_of(width) {
            return Err(format!(
                "{} numbers after the wavelengths; rows of {width} are accepted",
                rows.len()
            ));
        }
        if !wavelengths.is_sorted_by(|a, b| a < b) {
            return Err("wavelengths that do not rise; rising ones would be accepted".into());
        }
        let primaries = primaries(wavelengths);
        let mut samples: Vec<_> = rows
            .chunks_exact(width)
            .map(|row| {
                let rgb: DVec3 = row[4..].iter().zip(&primaries).map(|(value, rgb)| *value * *rgb).sum();
                let (sin_i, cos_i) = row[0].sin_cos();
                let (sin_o, cos_o) = row[2].sin_cos();
                (DVec3::new(sin_i * sin_o, turn(row[1] - row[3]), cos_i * cos_o), rgb)
            })
            .collect();
        samples.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
        Ok(Self { samples })
    }

    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let sines = f64::from((wo.truncate().length() * wi.truncate().length()).min(1.0));
        let angle = f64::from(wo.y.atan2(wo.x)) - f64::from(wi.y.atan2(wi.x));
        let place = DVec3::new(sines, turn(angle), f64::from(wo.z * wi.z));
        let mut radius2 = Self::FIRST_RADIUS2;
        loop {
            let radius = radius2.sqrt();
            let first = self.samples.partition_point(|(p, _)| p.x < place.x - radius);
            let last = self.samples.partition_point(|(p, _)| p.x <= place.x + radius);
            let (mut sum, mut weights, mut found) = (DVec3::ZERO, 0.0, 0);
            for (at, value) in &self.samples[first..last] {
                let distance2 = at.distance_squared(place);
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

/// The angle between two directions on a circle, in half turns: [0, 1].
fn turn(radians: f64) -> f64 {
    let turns = (radians / std::f64::consts::TAU).rem_euclid(1.0);
    2.0 * turns.min(1.0 - turns)
}

/// The colour that the value at each wavelength stands for, in a sampled spectrum.
fn primaries(wavelengths: &[f64]) -> Vec<DVec3> {
    let unit = |i: usize| {
        let pairs = wavelengths.iter().enumerate().map(|(j, nm)| [*nm, f64::from(u8::from(i == j))]);
        Spectrum::Sampled(pairs.collect()).unadapted().as_dvec3()
    };
    (0..wavelengths.len()).map(unit).collect()
}

/// MERL's table: φd runs fastest, then θd, then √θh; one colour after the other.
struct HalfAngles {
    /// Steps of θh, θd and φd.
    steps: [usize; 3],
    values: Vec<f64>,
}

impl HalfAngles {
    /// Factors of the stored values (MERL's `BRDFRead`).
    const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

    fn read(path: &Path) -> Result<Self, String> {
        let files::Source { mut reader, max_length } = files::open(path)?;
        let fault = |error: std::io::Error| error.to_string();
        let mut header = [0; 12];
        reader.read_exact(&mut header).map_err(fault)?;
        let (words, _) = header.as_chunks::<4>();
        let steps: Vec<usize> =
            words.iter().map(|&word| usize::try_from(i32::from_le_bytes(word)).unwrap_or(0)).collect();
        let steps = [steps[0], steps[1], steps[2]];
        let bytes = steps.iter().try_fold(3 * size_of::<f64>(), |size, &n| size.checked_mul(n));
        let Some(bytes) = bytes.filter(|&bytes| bytes > 0 && bytes as u64 <= max_length) else {
            return Err(format!("a table of {steps:?} steps, which the file is too short for"));
        };
        let mut data = vec![0; bytes];
        reader.read_exact(&mut data).map_err(fault)?;
        let (numbers, _) = data.as_chunks::<8>();
        Ok(Self { steps, values: numbers.iter().map(|&number| f64::from_le_bytes(number)).collect() })
    }

    /// The value of the nearest entry.
    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(half) = (wo + wi).try_normalize() else { return Vec3::ZERO };
        let radius = half.truncate().length();
        let theta_half = radius.atan2(half.z);
        let (cos, sin) = if radius > 0.0 { (half.x / radius, half.y / radius) } else { (1.0, 0.0) };
        let along = Vec3::new(cos * half.z, sin * half.z, -radius);
        let across = Vec3::new(-sin, cos, 0.0);
        let theta_difference = wi.dot(half).clamp(-1.0, 1.0).acos();
        // Reciprocity: φ and φ + π are the same.
        let phi = wi.dot(across).atan2(wi.dot(along)).rem_euclid(PI);
        let index = |share: f32, n: usize| ((share * n as f32) as usize).min(n - 1);
        let [h, d, p] = self.steps;
        let place = (index((theta_half / FRAC_PI_2).max(0.0).sqrt(), h) * d
            + index(theta_difference / FRAC_PI_2, d))
            * p
            + index(phi / PI, p);
        let channel = |c: usize| (self.values[c * h * d * p + place] * Self::SCALES[c]).max(0.0) as f32;
        Vec3::new(channel(0), channel(1), channel(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(theta: f32, phi: f32) -> Vec3 {
        Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    }

    #[test]
    fn samples_of_a_gray_surface_give_a_table_of_its_colour() {
        let mut text = "# three wavelengths\n3 400 550 700\n".to_string();
        for (i, o, phi) in (0..8).flat_map(|i| (0..8).flat_map(move |o| (0..8).map(move |p| (i, o, p)))) {
            text += &format!("{} 0.5 {} {} 0.2 0.2 0.2\n", i as f32 * 0.2, o as f32 * 0.2, phi as f32 * 0.4);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("gray.brdf");
        std::fs::write(&path, text).unwrap();
        let table = read(&path).unwrap();
        let white = Spectrum::constant(0.2).unadapted();
        for (o, i) in [(0.1, 0.1), (0.8, 1.2), (1.5, 0.3)] {
            let value = table.value(direction(o, 0.0), direction(i, 2.0));
            assert!((value - white).abs().max_element() < 1e-4, "{value} {white}");
        }
    }

    #[test]
    fn the_nearest_of_the_samples_counts_most() {
        let mut numbers = vec![1.0, 550.0];
        for i in 0..10 {
            numbers.extend([0.15 * f64::from(i), 0.0, 0.15 * f64::from(i), 3.0, f64::from(i)]);
        }
        let samples = Irregular::from_numbers(&numbers).unwrap();
        let value = |theta| samples.value(direction(theta, 0.0), direction(theta, 3.0)).y;
        assert!(value(0.15 * 8.0) > 1.5 * value(0.15 * 4.0));
    }

    #[test]
    fn a_table_of_half_angles_is_read_by_its_factors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.binary");
        let steps = [4i32, 3, 2];
        let mut bytes: Vec<u8> = steps.iter().flat_map(|n| n.to_le_bytes()).collect();
        for channel in 0..3 {
            let value = 1500.0 * f64::from(channel + 1) / [1.0, 1.15, 1.66][channel as usize];
            (0..24).for_each(|_| bytes.extend(value.to_le_bytes()));
        }
        std::fs::write(&path, &bytes).unwrap();
        let value = read(&path).unwrap().value(direction(0.4, 0.3), direction(0.9, 2.0));
        assert!((value - Vec3::new(1.0, 2.0, 3.0)).abs().max_element() < 1e-4, "{value}");
        bytes[0] = 5;
        std::fs::write(&path, &bytes).unwrap();
        assert!(read(&path).unwrap_err().contains("[5, 3, 2]"));
    }

    #[test]
    fn files_that_are_no_measurements_are_refused() {
        for numbers in [&[] as &[f64], &[0.0], &[2.0, 400.0], &[1.0, 400.0, 0.1], &[2.0, 5.0, 4.0]] {
            assert!(Irregular::from_numbers(numbers).is_err(), "{numbers:?}");
        }
        let many: Vec<f64> = std::iter::once(5000.0).chain((0..10_004).map(f64::from)).collect();
        assert!(Irregular::from_numbers(&many).is_err_and(|message| message.contains("1 to 4096")));
    }
}
