//! Blinn's microfacet distribution as in pbrt-v2: the density of normals is a power of their cosine, with an
//! exponent for each tangent direction; masking is that of V-shaped grooves.
//!
//! Sources: Blinn 1977; Ashikhmin and Shirley, *An anisotropic Phong BRDF model* (2000), for two exponents and
//! their sampling; Torrance and Sparrow 1967 for the masking.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec2, Vec3};

use super::directions::{same_hemisphere, to_hemisphere_of};

/// Upper bound of the exponents, as in pbrt-v2.
const MAX_EXPONENT: f32 = 1e4;

/// The distribution with exponents along x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blinn {
    x: f32,
    y: f32,
}

impl Blinn {
    /// Exponents are clamped to [0, 10⁴]; NaN becomes 10⁴.
    pub fn new(x: f32, y: f32) -> Self {
        let clamped = |e: f32| if e < MAX_EXPONENT { e.max(0.0) } else { MAX_EXPONENT };
        Self { x: clamped(x), y: clamped(y) }
    }

    /// |cos|^e with the exponent for the azimuth of `m`.
    fn power(self, m: Vec3) -> f32 {
        let sin2 = m.x * m.x + m.y * m.y;
        if sin2 == 0.0 {
            return 1.0;
        }
        let exponent = (self.x * m.x * m.x + self.y * m.y * m.y) / sin2;
        m.z.abs().powf(exponent)
    }

    /// D(m): area of microfacets per solid angle of normals and surface area.
    pub fn density(self, m: Vec3) -> f32 {
        ((self.x + 2.0) * (self.y + 2.0)).sqrt() / (2.0 * PI) * self.power(m)
    }

    /// f |cos wi| of reflection without the Fresnel reflectance, and the cosine to the microfacet's normal.
    /// Both directions are in the same hemisphere.
    pub fn reflection_eval(self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let Some(m) = (wo + wi).try_normalize() else { return (0.0, 1.0) };
        let cos = wo.dot(m);
        let least = wo.z.abs().min(wi.z.abs());
        let masking = (2.0 * m.z.abs() * least / cos.max(f32::MIN_POSITIVE)).min(1.0);
        (self.density(m) * masking / (4.0 * wo.z.abs()), cos)
    }

    /// Density per solid angle of [`Self::sample_reflection`].
    pub fn reflection_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        let Some(m) = (wo + wi).try_normalize() else { return 0.0 };
        let cos = wo.dot(m);
        if cos <= 0.0 {
            return 0.0;
        }
        ((self.x + 1.0) * (self.y + 1.0)).sqrt() / (2.0 * PI) * self.power(m) / (4.0 * cos)
    }

    /// Reflects `wo` at a normal of the distribution; `None` if the reflection is below the surface.
    pub fn sample_reflection(self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        // Sample the first quadrant and mirror it into the others.
        let quadrants = 4.0 * u.x;
        let quadrant = quadrants.floor();
        let phi = FRAC_PI_2 * (quadrants - quadrant);
        let stretch = ((self.x + 1.0) / (self.y + 1.0)).sqrt();
        let (mut sin, mut cos) = phi.sin_cos();
        sin *= stretch;
        let length = sin.hypot(cos);
        (sin, cos) = (sin / length, cos / length);
        let exponent = self.x * cos * cos + self.y * sin * sin;
        let height = (1.0 - u.y).powf(1.0 / (exponent + 1.0));
        let radius = (1.0 - height * height).max(0.0).sqrt();
        let (x, y) = match quadrant as u32 {
            0 => (cos, sin),
            1 => (-cos, sin),
            2 => (-cos, -sin),
            _ => (cos, -sin),
        };
        let m = to_hemisphere_of(Vec3::new(radius * x, radius * y, height), wo);
        let cos = wo.dot(m);
        let wi = (m * (2.0 * cos) - wo).normalize_or(m);
        (cos > 0.0 && same_hemisphere(wo, wi)).then_some(wi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_projected_area_of_isotropic_microfacets_is_that_of_the_surface() {
        // ∫ (e + 2) / 2π cosᵉ cos dω = 1, by the midpoint rule in cos.
        for exponent in [0.5, 7.0, 40.0, 1000.0] {
            let blinn = Blinn::new(exponent, exponent);
            let n = 100_000;
            let area: f64 = (0..n)
                .map(|i| {
                    let z = (i as f32 + 0.5) / n as f32;
                    let m = Vec3::new((1.0 - z * z).sqrt(), 0.0, z);
                    f64::from(blinn.density(m) * z * 2.0 * PI)
                })
                .sum::<f64>()
                / f64::from(n);
            assert!((area - 1.0).abs() < 2e-3, "{exponent}: {area}");
        }
    }

    #[test]
    fn exponents_are_clamped() {
        assert_eq!(Blinn::new(f32::INFINITY, f32::NAN), Blinn { x: 1e4, y: 1e4 });
        assert_eq!(Blinn::new(-1.0, 3.0), Blinn { x: 0.0, y: 3.0 });
    }
}
