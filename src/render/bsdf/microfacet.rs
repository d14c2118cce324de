//! Trowbridge–Reitz (GGX) microfacets: normal distribution, height-correlated Smith masking and
//! sampling of visible normals.
//!
//! Sources: Heitz, *Understanding the masking-shadowing function* (2014) and *Sampling the GGX
//! distribution of visible normals* (2018); the sampling routine is the spherical-cap one of
//! Dupuy and Benyoub (2023). Masking is written through L(w) = √(z² + ax²x² + ay²y²), so that the
//! cosines of the usual formulas cancel on paper and nothing is 0/0 at the horizon.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::bounded;
use super::frame::{on_side_of, same_side};
use crate::render::disk::sin_cos_of_turns;

/// A surface whose larger alpha is below this is a perfect mirror (pbrt-v4).
const SMOOTH_BELOW: f32 = 1e-3;
/// Smallest alpha of a surface that is not smooth (pbrt-v4).
const MIN_ALPHA: f32 = 1e-4;

/// The microfacet distribution, by its alphas along x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ggx {
    x: f32,
    y: f32,
}

/// A visible normal's reflection.
pub(super) struct Reflection {
    pub wi: Vec3,
    /// Cosine between either direction and the microfacet's normal.
    pub cos: f32,
    /// G(wo, wi) / G1(wo): f |cos| / pdf but for Fresnel's factor.
    pub weight: f32,
}

impl Ggx {
    /// Alphas in [0, 1]; what is outside, or not a number, is taken as the nearest bound or 0.
    pub fn new(x: f32, y: f32) -> Self {
        let (x, y) = (bounded(x, 1.0), bounded(y, 1.0));
        if x.max(y) < SMOOTH_BELOW {
            Self { x: 0.0, y: 0.0 }
        } else {
            Self { x: x.max(MIN_ALPHA), y: y.max(MIN_ALPHA) }
        }
    }

    /// As [`Self::new`], but never smooth.
    pub fn rough(x: f32, y: f32) -> Self {
        Self::new(x.max(SMOOTH_BELOW), y.max(SMOOTH_BELOW))
    }

    /// Whether the microfacets are so flat that the surface is perfectly specular. No other
    /// method may then be called but [`Self::mean_alpha`].
    pub fn is_smooth(self) -> bool {
        self.x == 0.0
    }

    /// The alpha of the isotropic surface nearest to this one.
    pub fn mean_alpha(self) -> f32 {
        (self.x * self.y).sqrt()
    }

    /// The surface that spreads light as this and another one do together, `weight` being the
    /// other's share: slope variances, hence squared alphas, add.
    pub fn spread_by(self, other: Self, weight: f32) -> Self {
        let add = |a: f32, b: f32| (a * a + weight * b * b).sqrt();
        let (x, y) = (add(self.x, other.x), add(self.y, other.y));
        let both_smooth = self.is_smooth() && other.is_smooth();
        let least = if both_smooth { 0.0 } else { SMOOTH_BELOW };
        Self::new(x.max(least), y.max(least))
    }

    /// Density of microfacet normals over projected area, per steradian.
    #[inline(always)]
    pub fn density(self, m: Vec3) -> f32 {
        let e = (m.x / self.x).powi(2) + (m.y / self.y).powi(2) + m.z * m.z;
        1.0 / (PI * self.x * self.y * e * e)
    }

    #[inline(always)]
    fn length(self, w: Vec3) -> f32 {
        (w.z * w.z + (self.x * w.x).powi(2) + (self.y * w.y).powi(2)).sqrt()
    }

    /// G(wo, wi) / |cos wo cos wi|: Smith's height-correlated masking.
    #[inline(always)]
    pub fn masking_over_cosines(self, wo: Vec3, wi: Vec3) -> f32 {
        2.0 / (self.length(wo) * wi.z.abs() + self.length(wi) * wo.z.abs()).max(f32::MIN_POSITIVE)
    }

    /// G(wo, wi) / G1(wo).
    #[inline(always)]
    pub fn masking_ratio(self, wo: Vec3, wi: Vec3) -> f32 {
        let g1 = 2.0 / (wo.z.abs() + self.length(wo)); // over |cos wo|
        self.masking_over_cosines(wo, wi) * wi.z.abs() / g1
    }

    /// Density of the normals visible from `w`, per steradian.
    pub fn visible_density(self, w: Vec3, m: Vec3) -> f32 {
        2.0 / (w.z.abs() + self.length(w)) * self.density(m) * w.dot(m).abs()
    }

    /// D(m) G(wo, wi) / |cos wo|: the factor that reflection and transmission share.
    #[inline(always)]
    pub fn projected(self, wo: Vec3, wi: Vec3, m: Vec3) -> f32 {
        self.density(m) * self.masking_over_cosines(wo, wi) * wi.z.abs()
    }

    /// A normal visible from `w`, on its side.
    #[inline(always)]
    pub fn sample_visible(self, w: Vec3, u: Vec2) -> Vec3 {
        // Stretch to the sphere, where the visible normals are a cap's reflections.
        let stretched = Vec3::new(self.x * w.x, self.y * w.y, w.z.abs()).normalize_or(Vec3::Z);
        let height = (1.0 - u.y) * (1.0 + stretched.z); // of the normal; the cap's point is lower
        let z = height - stretched.z;
        let (sin_phi, cos_phi) = sin_cos_of_turns(u.x);
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let m = Vec3::new(
            self.x * (radius * cos_phi + stretched.x),
            self.y * (radius * sin_phi + stretched.y),
            height.max(0.0),
        );
        on_side_of(m.normalize_or(Vec3::Z), w)
    }

    /// f |cos wi| but for Fresnel's factor, and the cosine to the microfacet that it depends on.
    /// Both directions are on the same side.
    #[inline(always)]
    pub fn reflect_eval(self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let m = (wo + wi).normalize_or(Vec3::Z);
        (self.projected(wo, wi, m) / 4.0, wo.dot(m))
    }

    /// Density of [`Self::reflect_sample`], per steradian of `wi`. Both directions are on the same side.
    #[inline(always)]
    pub fn reflect_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        let m = (wo + wi).normalize_or(Vec3::Z);
        self.density(m) / (2.0 * (wo.z.abs() + self.length(wo)))
    }

    /// Reflects at a visible normal; `None` where that leads below the surface.
    pub fn reflect_sample(self, wo: Vec3, u: Vec2) -> Option<Reflection> {
        let reflection = self.reflect(wo, u);
        same_side(wo, reflection.wi).then_some(reflection)
    }

    /// Reflects at a visible normal, wherever that leads.
    #[inline(always)]
    pub fn reflect(self, wo: Vec3, u: Vec2) -> Reflection {
        let m = self.sample_visible(wo, u);
        let cos = wo.dot(m);
        let wi = (m * (2.0 * cos) - wo).normalize_or(m);
        Reflection { wi, cos, weight: self.masking_ratio(wo, wi) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ over the hemisphere by a midpoint rule in (cos, φ).
    fn integrate(f: impl Fn(Vec3) -> f32) -> f64 {
        let (rows, columns) = (800, 400);
        let mut sum = 0.0;
        for i in 0..rows {
            // cos = 1 - t² has its nodes dense at the pole
            let t = (i as f32 + 0.5) / rows as f32;
            let z = 1.0 - t * t;
            let r = (1.0 - z * z).sqrt();
            for j in 0..columns {
                let phi = 2.0 * PI * (j as f32 + 0.5) / columns as f32;
                sum += f64::from(f(Vec3::new(r * phi.cos(), r * phi.sin(), z)) * 2.0 * t);
            }
        }
        sum * f64::from(2.0 * PI) / f64::from(rows * columns)
    }

    #[test]
    fn projected_area_of_the_microfacets_is_that_of_the_surface() {
        for (x, y) in [(0.05, 0.05), (0.1, 0.4), (1.0, 1.0)] {
            let ggx = Ggx::new(x, y);
            let area = integrate(|m| ggx.density(m) * m.z);
            assert!((area - 1.0).abs() < 2e-3, "{x} {y}: {area}");
        }
    }

    #[test]
    fn visible_normals_have_a_density_of_integral_one() {
        for w in [Vec3::Z, Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.1, -0.99, 0.05).normalize()] {
            let ggx = Ggx::new(0.2, 0.5);
            let total = integrate(|m| if m.dot(w) > 0.0 { ggx.visible_density(w, m) } else { 0.0 });
            assert!((total - 1.0).abs() < 5e-3, "{w}: {total}");
        }
    }

    #[test]
    fn roughness_is_smooth_only_if_both_alphas_are_small() {
        assert!(Ggx::new(9e-4, 0.0).is_smooth());
        assert!(Ggx::new(f32::NAN, -1.0).is_smooth());
        assert_eq!(Ggx::new(0.5, 0.0), Ggx { x: 0.5, y: MIN_ALPHA });
        assert!(!Ggx::new(0.0, 0.0).spread_by(Ggx::new(1e-3, 1e-3), 0.01).is_smooth());
    }

    #[test]
    fn normals_seen_from_below_are_below() {
        let ggx = Ggx::new(0.3, 0.6);
        let m = ggx.sample_visible(Vec3::new(0.5, 0.5, -0.7).normalize(), Vec2::new(0.3, 0.6));
        assert!(m.z < 0.0);
    }
}
