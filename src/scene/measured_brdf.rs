//! Measured isotropic BRDFs, resampled to a table with inexpensive lookup.
//!
//! The table's axes are functions of the cosines of Rusinkiewicz's half angle (θh) and difference
//! angles (θd, φd) (*A new change of variables for efficient BRDF representation*, 1998). Lookup needs
//! no inverse trigonometric functions:
//!
//! * (1 − cos θh)^¼, nearly √θh, which is dense at highlights,
//! * (1 − cos θd)^½, nearly θd,
//! * cos² φd: a reciprocal isotropic BRDF with mirror symmetry is even about both ends of [0, π/2], and
//!   so is smooth in cos² φd.
//!
//! The table is reciprocal by construction.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Nodes along the axes of θh, θd and φd; fewer for fuzzing, which builds a table for every input.
const HALF: usize = if cfg!(fuzzing) { 8 } else { 96 };
const DIFFERENCE: usize = if cfg!(fuzzing) { 8 } else { 48 };
const AZIMUTH: usize = if cfg!(fuzzing) { 4 } else { 12 };
/// Nodes of the albedo table.
const ALBEDO: usize = if cfg!(fuzzing) { 4 } else { 24 };
/// Uniform fraction of the density of half vectors, so that every half vector can be sampled.
const UNIFORM_FRACTION: f32 = 0.05;
/// Greatest value of a table, beyond any material's: sums over the table stay finite.
const LARGEST_VALUE: f32 = 1e12;

/// A table of BRDF values in 1/sr.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredBrdf {
    /// `[half][difference][azimuth]`
    values: Vec<Vec3>,
    /// CDF of half vectors over θh, weighted by reflected light.
    cdf: Vec<f32>,
    /// Directional albedo at evenly spaced cosines.
    albedo: Vec<Vec3>,
}

/// 1 − cos θh at a node.
fn half_height(node: usize) -> f32 {
    (node as f32 / (HALF - 1) as f32).powi(4)
}

/// The two directions of a node, which may be below the surface.
fn directions(half: usize, difference: usize, azimuth: usize) -> [Vec3; 2] {
    let sin = |cos: f32| (1.0 - cos * cos).max(0.0).sqrt();
    let cos_h = 1.0 - half_height(half);
    let cos_d = 1.0 - (difference as f32 / (DIFFERENCE - 1) as f32).powi(2);
    let cos_phi = (azimuth as f32 / (AZIMUTH - 1) as f32).sqrt();
    let (sin_h, sin_d) = (sin(cos_h), sin(cos_d));
    let along = Vec3::new(cos_h, 0.0, -sin_h) * (sin_d * cos_phi) + Vec3::Y * (sin_d * sin(cos_phi));
    let half = Vec3::new(sin_h, 0.0, cos_h) * cos_d;
    [half + along, half - along]
}

impl MeasuredBrdf {
    /// Resamples a BRDF given as `value(wo, wi)` for unit directions, z along the normal. Directions of
    /// nodes below the horizon are moved to the horizon.
    pub fn new(value: impl Fn(Vec3, Vec3) -> Vec3 + Sync) -> Self {
        let raised = |w: Vec3| Vec3::new(w.x, w.y, w.z.max(0.0)).normalize_or(Vec3::Z);
        let node = |i: usize| {
            let (half, rest) = (i / (DIFFERENCE * AZIMUTH), i % (DIFFERENCE * AZIMUTH));
            let [a, b] = directions(half, rest / AZIMUTH, rest % AZIMUTH);
            let found = value(raised(a), raised(b));
            if found.is_finite() { found.clamp(Vec3::ZERO, Vec3::splat(LARGEST_VALUE)) } else { Vec3::ZERO }
        };
        let values = (0..HALF * DIFFERENCE * AZIMUTH).into_par_iter().map(node).collect();
        let mut table = Self { values, cdf: Vec::new(), albedo: Vec::new() };
        table.cdf = table.compute_cdf();
        table.albedo = (0..ALBEDO)
            .into_par_iter()
            .map(|i| table.integrate_albedo(i as f32 / (ALBEDO - 1) as f32))
            .collect();
        table
    }

    /// The BRDF value, without the cosine, for unit directions on the same side of the surface.
    pub fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let sum = wo + wi;
        let length = sum.length();
        if length <= f32::MIN_POSITIVE {
            return Vec3::ZERO;
        }
        // |wo + wi| is twice the cosine of half the angle between them
        let (cos_h, cos_d) = ((sum.z / length).abs().min(1.0), (0.5 * length).min(1.0));
        let (sin2_h, sin2_d) = (1.0 - cos_h * cos_h, 1.0 - cos_d * cos_d);
        // Project wi on the half vector's direction of steepest descent
        let along = cos_d * cos_h - wi.z.abs();
        let spread = sin2_h * sin2_d;
        let cos2_phi = if spread > 0.0 { (along * along / spread).min(1.0) } else { 0.0 };
        let (h, th) = locate((1.0 - cos_h).sqrt().sqrt(), HALF);
        let (d, td) = locate((1.0 - cos_d).sqrt(), DIFFERENCE);
        let (a, ta) = locate(cos2_phi, AZIMUTH);
        let row = |h: usize, d: usize| {
            let first = (h * DIFFERENCE + d) * AZIMUTH + a;
            self.values[first].lerp(self.values[first + 1], ta)
        };
        let plane = |h: usize| row(h, d).lerp(row(h, d + 1), td);
        plane(h).lerp(plane(h + 1), th)
    }

    /// Density of [`Self::sample_half_vector`] per steradian; `cos` is the cosine to the normal.
    pub fn half_vector_pdf(&self, cos: f32) -> f32 {
        let (node, _) = locate((1.0 - cos).max(0.0).sqrt().sqrt(), HALF);
        self.probability(node) / (2.0 * PI * (half_height(node + 1) - half_height(node)))
    }

    /// Samples a half vector above the surface from two uniform numbers in [0, 1).
    pub fn sample_half_vector(&self, u: Vec2) -> Vec3 {
        let node = self.cdf.partition_point(|&c| c <= u.x).clamp(1, HALF - 1) - 1;
        let within = ((u.x - self.cdf[node]) / self.probability(node)).clamp(0.0, 1.0);
        let (low, high) = (half_height(node), half_height(node + 1));
        let z = 1.0 - (low + (high - low) * within);
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = (2.0 * PI * u.y).sin_cos();
        Vec3::new(radius * cos, radius * sin, z)
    }

    /// Directional albedo for the cosine of the viewing angle.
    pub fn albedo(&self, cos: f32) -> Vec3 {
        let (node, t) = locate(cos, ALBEDO);
        self.albedo[node].lerp(self.albedo[node + 1], t)
    }

    /// Probability of the interval from a node to the next.
    fn probability(&self, node: usize) -> f32 {
        self.cdf[node + 1] - self.cdf[node]
    }

    /// The CDF of half vectors: the mean of the BRDF over θd and φd, times cos θh, times the solid
    /// angle.
    fn compute_cdf(&self) -> Vec<f32> {
        let bright = |h: usize| {
            let values = &self.values[h * DIFFERENCE * AZIMUTH..(h + 1) * DIFFERENCE * AZIMUTH];
            values.iter().map(|value| value.element_sum()).sum::<f32>() * (1.0 - half_height(h))
        };
        let solid_angle = |h: usize| half_height(h + 1) - half_height(h);
        let weights: Vec<f32> = (0..HALF - 1).map(|h| (bright(h) + bright(h + 1)) * solid_angle(h)).collect();
        let total: f32 = weights.iter().sum();
        let mut sum = 0.0;
        let mut cdf = vec![0.0];
        for (h, weight) in weights.iter().enumerate() {
            let probability = if total > 0.0 { weight / total } else { solid_angle(h) };
            sum += probability * (1.0 - UNIFORM_FRACTION) + UNIFORM_FRACTION * solid_angle(h);
            cdf.push(sum);
        }
        cdf.iter().map(|c| c / sum).collect()
    }

    /// Integrates the albedo at a cosine with half vectors on a lattice.
    fn integrate_albedo(&self, cos: f32) -> Vec3 {
        const ROWS: usize = 128;
        const COLUMNS: usize = 32;
        let cos = cos.max(1e-3);
        let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let node = |i: usize, n: usize| (i as f32 + 0.5) / n as f32;
        let term = |i: usize| {
            let half = self.sample_half_vector(Vec2::new(node(i % ROWS, ROWS), node(i / ROWS, COLUMNS)));
            let cos = wo.dot(half);
            let wi = half * (2.0 * cos) - wo;
            if cos <= 0.0 || wi.z <= 0.0 {
                return Vec3::ZERO;
            }
            self.value(wo, wi) * (wi.z * 4.0 * cos / self.half_vector_pdf(half.z))
        };
        (0..ROWS * COLUMNS).map(term).sum::<Vec3>() / (ROWS * COLUMNS) as f32
    }
}

/// The node below a coordinate in [0, 1], and the fraction to the next node.
fn locate(coordinate: f32, nodes: usize) -> (usize, f32) {
    let x = coordinate.clamp(0.0, 1.0) * (nodes - 1) as f32;
    let node = (x as usize).min(nodes - 2);
    (node, x - node as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn enormous_values_have_finite_densities() {
        let brdf = MeasuredBrdf::new(|_, _| Vec3::splat(1e37));
        assert!(brdf.cdf.iter().all(|c| c.is_finite()) && brdf.half_vector_pdf(0.5) > 0.0);
    }

    fn direction(cos: f32, phi: f32) -> Vec3 {
        let sin = (1.0 - cos * cos).sqrt();
        Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
    }

    /// A diffuse base with a highlight, reciprocal and mirror symmetric.
    fn shiny(wo: Vec3, wi: Vec3) -> Vec3 {
        let half = (wo + wi).normalize();
        let highlight = 2.0 * half.z.powi(60) * (1.0 - wo.dot(half)).powi(2);
        Vec3::new(0.3, 0.1, 0.02) / PI + Vec3::splat(highlight + 0.05 * (wo.x * wi.x + wo.y * wi.y).powi(2))
    }

    #[test]
    fn the_table_reproduces_its_source() {
        let table = MeasuredBrdf::new(shiny);
        for (co, ci, phi) in [(0.9, 0.9, 3.1), (0.5, 0.6, 2.0), (0.3, 0.95, 0.4), (0.7, 0.2, 5.0)] {
            let (wo, wi) = (direction(co, 0.7), direction(ci, 0.7 + phi));
            let error = (table.value(wo, wi) - shiny(wo, wi)).abs().max_element();
            assert!(error < 0.01 * shiny(wo, wi).max_element(), "{wo} {wi}: {error}");
        }
    }

    #[test]
    fn the_table_is_reciprocal() {
        let table = MeasuredBrdf::new(|wo, wi| Vec3::new(wo.z, wi.z, wo.x));
        let (a, b) = (direction(0.8, 0.3), direction(0.4, 2.0));
        assert!((table.value(a, b) - table.value(b, a)).abs().max_element() < 1e-5);
    }

    #[test]
    fn a_diffuse_table_has_its_albedo_and_grazing_pairs_are_finite() {
        let table = MeasuredBrdf::new(|_, _| Vec3::splat(0.6 / PI));
        for cos in [0.05, 0.4, 1.0] {
            assert!((table.albedo(cos).x - 0.6).abs() < 0.02, "{}", table.albedo(cos));
        }
        for (a, b) in [(Vec3::X, -Vec3::X), (Vec3::X, Vec3::X), (Vec3::Z, Vec3::Z)] {
            assert!(table.value(a, b).is_finite());
        }
    }

    #[test]
    fn the_density_of_half_vectors_integrates_to_one() {
        for table in [MeasuredBrdf::new(shiny), MeasuredBrdf::new(|_, _| Vec3::ZERO)] {
            let n = 200_000;
            // cos = 1 − t⁴ is dense at the pole
            let integral: f64 = (0..n)
                .map(|i| {
                    let t = (i as f32 + 0.5) / n as f32;
                    f64::from(table.half_vector_pdf(1.0 - t.powi(4)) * 4.0 * t.powi(3) * 2.0 * PI)
                })
                .sum::<f64>()
                / f64::from(n);
            assert!((integral - 1.0).abs() < 1e-2, "{integral}");
        }
    }
}
