//! Blinn's microfacets, as pbrt-v2 has them: normals about the mean normal by a power of the
//! cosine, with one exponent for each tangent direction, and V-shaped cavities for masking.
//!
//! Sources: Blinn 1977; Ashikhmin and Shirley, *An anisotropic Phong BRDF model* (2000), for two
//! exponents and their sampling; Torrance and Sparrow 1967 for the masking.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec2, Vec3};

use super::frame::{on_side_of, same_side};

/// Largest exponent, as in pbrt-v2. What is sharper is taken for this sharp.
const MAX_EXPONENT: f32 = 1e4;

/// The microfacet distribution, by its exponents along x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blinn {
    x: f32,
    y: f32,
}

impl Blinn {
    /// Exponents from 0; what is no number is taken for the largest.
    pub fn new(x: f32, y: f32) -> Self {
        let bounded = |e: f32| if e < MAX_EXPONENT { e.max(0.0) } else { MAX_EXPONENT };
        Self { x: bounded(x), y: bounded(y) }
    }

    /// |cos|^e with the exponent in the direction of `m`.
    fn power(self, m: Vec3) -> f32 {
        let sin2 = m.x * m.x + m.y * m.y;
        if sin2 == 0.0 {
            return 1.0;
        }
        let exponent = (self.x * m.x * m.x + self.y * m.y * m.y) / sin2;
        m.z.abs().powf(exponent)
    }

    /// Density of microfacet normals over projected area, per steradian.
    pub fn density(self, m: Vec3) -> f32 {
        ((self.x + 2.0) * (self.y + 2.0)).sqrt() / (2.0 * PI) * self.power(m)
    }

    /// f |cos wi| but for Fresnel's factor, and the cosine to the microfacet. Both directions are
    /// on the same side.
    pub fn reflect_eval(self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let Some(m) = (wo + wi).try_normalize() else { return (0.0, 1.0) };
        let cos = wo.dot(m);
        let least = wo.z.abs().min(wi.z.abs());
        let masking = (2.0 * m.z.abs() * least / cos.max(f32::MIN_POSITIVE)).min(1.0);
        (self.density(m) * masking / (4.0 * wo.z.abs()), cos)
    }

    /// Density of [`Self::reflect_sample`], per steradian of `wi`.
    pub fn reflect_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        let Some(m) = (wo + wi).try_normalize() else { return 0.0 };
        let cos = wo.dot(m);
        if cos <= 0.0 {
            return 0.0;
        }
        ((self.x + 1.0) * (self.y + 1.0)).sqrt() / (2.0 * PI) * self.power(m) / (4.0 * cos)
    }

    /// Reflects at a normal of the distribution; `None` where that leads below the surface.
    pub fn reflect_sample(self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        // The first quadrant, mirrored into the others.
        let quadrants = 4.0 * u.x;
        let quadrant = quadrants.floor();
        let within = FRAC_PI_2 * (quadrants - quadrant);
        let stretch = ((self.x + 1.0) / (self.y + 1.0)).sqrt();
        let (mut sin, mut cos) = within.sin_cos();
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
        let m = on_side_of(Vec3::new(radius * x, radius * y, height), wo);
        let cos = wo.dot(m);
        let wi = (m * (2.0 * cos) - wo).normalize_or(m);
        (cos > 0.0 && same_side(wo, wi)).then_some(wi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projected_area_of_isotropic_microfacets_is_that_of_the_surface() {
        // ∫ (e + 2) / 2π cosᵉ cos dω = 1, by a midpoint rule in cos.
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
    fn exponents_out_of_range_are_brought_back() {
        assert_eq!(Blinn::new(f32::INFINITY, f32::NAN), Blinn { x: 1e4, y: 1e4 });
        assert_eq!(Blinn::new(-1.0, 3.0), Blinn { x: 0.0, y: 3.0 });
    }
}
