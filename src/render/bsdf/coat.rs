//! The dielectric coat of layered materials: its own GGX reflection, and its transmittance to the base.
//!
//! pbrt-v4 evaluates layers by a random walk. Here all light that the coat's lobe does not reflect crosses the coat to the
//! base; no energy is lost at the interface, unlike in a random walk with rough interfaces, which lacks multiple
//! scattering between microfacets. The coat absorbs as in pbrt-v4, whatever its albedo: of light at the angle θ within it,
//! exp(−t ∕ cos θ) cross it, with the thickness t. For diffuse light the mean is 2 E₃(t), with the exponential integral E₃.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::clamp::clamp_or_zero;
use super::directions::reflect;
use super::fresnel;
use super::ggx::{Ggx, MicrofacetReflection};
use super::interface_table::{InterfaceRow, InterfaceTable, MAX_ETA};

/// A dielectric layer in air, on both sides of the base.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat {
    /// Index of refraction, at least 1.
    pub eta: f32,
    pub ggx: Ggx,
    /// In mean free paths.
    thickness: f32,
    /// Where its reflectance is tabulated.
    row: InterfaceRow,
}

/// Beyond this thickness hardly any light crosses.
const MAX_THICKNESS: f32 = 100.0;

/// Directional albedo of a rough interface's reflection.
static REFLECTANCE: LazyLock<InterfaceTable> = LazyLock::new(|| {
    InterfaceTable::new(|cos, alpha, eta| {
        let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        mean_over_reflections(Ggx::new(alpha, alpha), wo, |r| fresnel::dielectric(r.cos, eta))
    })
});

/// Integral over `wi` of microfacet reflection with `factor` in place of the Fresnel reflectance, estimated by
/// sampling with a grid of sample values.
pub(super) fn mean_over_reflections(
    ggx: Ggx,
    wo: Vec3,
    factor: impl Fn(&MicrofacetReflection) -> f32,
) -> f32 {
    const GRID: u16 = 14;
    let node = |i: u16| (f32::from(i) + 0.5) / f32::from(GRID);
    let value = |i: u16| {
        // By symmetry, half of the range of u.x is enough. u.y = 1 - t² is dense for normals far from the mean,
        // in the long tails of the distribution.
        let t = node(i % GRID);
        let reflection = ggx.sample_reflection(wo, Vec2::new(node(i / GRID) / 2.0, 1.0 - t * t));
        reflection.map_or(0.0, |r| 2.0 * t * r.weight * factor(&r))
    };
    (0..GRID * GRID).map(value).sum::<f32>() / f32::from(GRID * GRID)
}

impl Coat {
    /// `eta` is clamped to [1, 3], `thickness` to [0, 100].
    pub fn new(eta: f32, ggx: Ggx, thickness: f32) -> Self {
        let eta = eta.clamp(1.0, MAX_ETA);
        let thickness = clamp_or_zero(thickness, MAX_THICKNESS);
        Self { eta, ggx, thickness, row: InterfaceRow::new(ggx.mean_alpha(), eta) }
    }

    /// Fraction of light that is not absorbed on its way through the coat; `cos` is that of its angle outside.
    pub fn crossing(&self, cos: f32) -> f32 {
        let inside = (1.0 - (1.0 - cos * cos) / (self.eta * self.eta)).max(f32::MIN_POSITIVE).sqrt();
        (-self.thickness / inside).exp()
    }

    /// The same of diffuse light.
    pub fn mean_crossing(&self) -> f32 {
        crossing_below(1.0, self.thickness)
    }

    /// Squared cosine of the critical angle: the fraction of diffuse light within the coat that is beyond it.
    fn beyond_critical(&self) -> f32 {
        1.0 - 1.0 / (self.eta * self.eta)
    }

    /// Mean of exp(−`thickness` ∕ cos θ) over diffuse light within the coat that the coat may let out.
    fn escaping_crossing(&self, thickness: f32) -> f32 {
        let beyond = self.beyond_critical();
        (crossing_below(1.0, thickness) - crossing_below(beyond.sqrt(), thickness)) / (1.0 - beyond)
    }

    /// Fraction of diffuse light from the base that leaves the coat.
    pub fn escape(&self) -> f32 {
        (1.0 - self.internal_reflectance()) * self.escaping_crossing(self.thickness)
    }

    /// Fraction of diffuse light from the base that the coat reflects back to it: all beyond the critical angle, and a part
    /// below it.
    pub fn return_to_base(&self) -> f32 {
        let (twice, beyond) = (2.0 * self.thickness, self.beyond_critical());
        let partly = (self.internal_reflectance() - beyond).max(0.0);
        crossing_below(beyond.sqrt(), twice) + partly * self.escaping_crossing(twice)
    }

    /// Fraction of light at this angle that the coat itself reflects.
    pub fn reflectance(&self, cos: f32) -> f32 {
        if self.ggx.is_smooth() { fresnel::dielectric(cos, self.eta) } else { REFLECTANCE.at(cos, self.row) }
    }

    /// Fraction of light at this angle that reaches the base: 1 minus [`Self::reflectance`]. By reciprocity, also
    /// the factor of light that leaves the base at this angle.
    pub fn transmittance(&self, cos: f32) -> f32 {
        1.0 - self.reflectance(cos)
    }

    /// Mean of [`Self::transmittance`] over diffuse (cosine-weighted) light from outside.
    pub fn mean_transmittance(&self) -> f32 {
        1.0 - if self.ggx.is_smooth() {
            fresnel::dielectric_mean(self.eta)
        } else {
            REFLECTANCE.mean(self.row)
        }
    }

    /// Fraction of diffuse light from inside that the coat reflects back. By reciprocity, the transmittance from
    /// inside is 1/η² of that from outside.
    fn internal_reflectance(&self) -> f32 {
        1.0 - self.mean_transmittance() / (self.eta * self.eta)
    }

    /// [`Self::eval`] and [`Self::pdf`].
    pub fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        if self.ggx.is_smooth() {
            return (0.0, 0.0);
        }
        let (value, cos, pdf) = self.ggx.reflection_eval_and_pdf(wo, wi);
        (value * fresnel::dielectric(cos, self.eta), pdf)
    }

    /// f |cos wi| of the coat's reflection; 0 if it is smooth. Both directions are in the same hemisphere.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.ggx.is_smooth() {
            return 0.0;
        }
        let (value, cos) = self.ggx.reflection_eval(wo, wi);
        value * fresnel::dielectric(cos, self.eta)
    }

    /// Density per solid angle of sampling the coat's reflection; 0 if it is smooth.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.ggx.is_smooth() { 0.0 } else { self.ggx.reflection_pdf(wo, wi) }
    }

    /// The specular reflection of a smooth coat, sampled with `probability`.
    pub fn specular_sample(&self, wo: Vec3, probability: f32) -> BsdfSample {
        BsdfSample::specular(reflect(wo), Vec3::splat(self.reflectance(wo.z.abs()) / probability))
    }
}

/// Integral of 2 μ exp(−t ∕ μ) from 0 to a cosine: cos² · 2 E₃(t ∕ cos).
fn crossing_below(cos: f32, thickness: f32) -> f32 {
    if cos <= 0.0 {
        return 0.0;
    }
    let t = thickness / cos;
    // The recurrence of Abramowitz and Stegun 1964, eq. 5.1.14
    cos * cos * ((-t).exp() * (1.0 - t) + t * t * exponential_integral(t)).max(0.0)
}

/// The exponential integral E₁(x), times x² within 10⁻⁶ of it (Abramowitz and Stegun 1964, eqs. 5.1.53 and 5.1.56).
fn exponential_integral(x: f32) -> f32 {
    let polynomial = |terms: &[f32]| terms.iter().fold(0.0, |sum, term| sum * x + term);
    if x <= 0.0 {
        0.0
    } else if x <= 1.0 {
        polynomial(&[0.00107857, -0.00976004, 0.05519968, -0.24991055, 0.99999193, -0.577_215_7]) - x.ln()
    } else {
        polynomial(&[1.0, 2.334733, 0.250621]) / polynomial(&[1.0, 3.330657, 1.681534]) * (-x).exp() / x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_crossing_is_that_of_a_fine_quadrature() {
        for (cos, thickness) in [(1.0, 0.01), (0.7, 0.01), (0.7, 0.3), (1.0, 2.0), (0.5, 5.0), (0.4, 0.0)] {
            let n = 20_000;
            let node = |i: i32| f64::from(cos) * (f64::from(i) + 0.5) / f64::from(n);
            let value = |i: i32| 2.0 * node(i) * (-f64::from(thickness) / node(i)).exp();
            let fine = (0..n).map(value).sum::<f64>() * f64::from(cos) / f64::from(n);
            let found = f64::from(crossing_below(cos, thickness));
            assert!((found - fine).abs() < 1e-5, "{cos} {thickness}: {found} {fine}");
        }
    }

    #[test]
    fn the_table_agrees_with_a_fine_quadrature() {
        for (cos, alpha, eta) in [
            (0.12, 0.15, 1.45),
            (0.5, 0.5, 1.33),
            (0.9, 0.03, 1.7),
            (0.3, 0.97, 2.4),
            (0.03, 0.3, 1.05),
            (0.2, 0.01, 1.5),
        ] {
            let ggx = Ggx::new(alpha, alpha);
            let wo = Vec3::new((1.0f32 - cos * cos).sqrt(), 0.0, cos);
            let n = 300;
            let node = |i: i32| (i as f32 + 0.5) / n as f32;
            let fine = (0..n * n)
                .filter_map(|i| ggx.sample_reflection(wo, Vec2::new(node(i / n), node(i % n))))
                .map(|r| f64::from(r.weight * fresnel::dielectric(r.cos, eta)))
                .sum::<f64>()
                / f64::from(n * n);
            let tabulated = f64::from(Coat::new(eta, ggx, 0.0).reflectance(cos));
            assert!((tabulated - fine).abs() < 5e-3, "{cos} {alpha} {eta}: {tabulated} {fine}");
        }
    }

    #[test]
    fn a_barely_rough_coat_transmits_like_a_smooth_one() {
        let [rough, smooth] = [1e-2, 0.0].map(|alpha| Coat::new(1.5, Ggx::new(alpha, alpha), 0.0));
        assert!((rough.mean_transmittance() - smooth.mean_transmittance()).abs() < 5e-3);
        for cos in [0.2, 0.6, 1.0] {
            let (r, s) = (rough.transmittance(cos), smooth.transmittance(cos));
            assert!((r - s).abs() < 1e-2, "{cos}: {r} {s}");
        }
    }

    #[test]
    fn the_internal_diffuse_reflectance_of_glass_is_the_known_one() {
        // For an index of refraction of 1.5.
        let internal = Coat::new(1.5, Ggx::new(0.0, 0.0), 0.0).internal_reflectance();
        assert!((internal - 0.596).abs() < 1e-3, "{internal}");
    }
}
