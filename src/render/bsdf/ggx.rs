//! The Trowbridge–Reitz (GGX) microfacet distribution: density of normals, height-correlated Smith masking and
//! sampling of visible normals.
//!
//! Sources: Heitz, *Understanding the masking-shadowing function* (2014) and *Sampling the GGX distribution of
//! visible normals* (2018); the sampling routine by spherical caps is Dupuy and Benyoub's (2023). Masking is
//! expressed through L(w) = √(z² + ax²x² + ay²y²), in which the cosines of the usual formulas cancel, so that
//! nothing is 0/0 at the horizon.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::clamp::clamp_or_zero;
use super::directions::{same_hemisphere, to_hemisphere_of};
use crate::render::disk::sin_cos_of_turns;
use crate::scene::material::RoughnessScale;

/// A surface whose larger alpha is below this counts as smooth.
const MIN_ROUGH_ALPHA: f32 = RoughnessScale::MIN_ROUGH_ALPHA;
/// Largest alpha: pbrt has no bound, and v3's roughness of 1 is 1.62.
const MAX_ALPHA: f32 = 4.0;
/// Smallest alpha of a rough surface (pbrt-v4).
const MIN_ALPHA: f32 = 1e-4;

/// The distribution with roughnesses alpha along x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ggx {
    x: f32,
    y: f32,
}

/// A reflection at a sampled visible normal.
pub(super) struct MicrofacetReflection {
    pub wi: Vec3,
    /// Cosine between either direction and the microfacet's normal.
    pub cos: f32,
    /// G(wo, wi) / G1(wo): f |cos| / pdf without the Fresnel reflectance.
    pub weight: f32,
}

impl Ggx {
    /// Alphas are clamped to [0, 4]; NaN becomes 0.
    pub fn new(x: f32, y: f32) -> Self {
        let (x, y) = (clamp_or_zero(x, MAX_ALPHA), clamp_or_zero(y, MAX_ALPHA));
        if x.max(y) < MIN_ROUGH_ALPHA {
            Self { x: 0.0, y: 0.0 }
        } else {
            Self { x: x.max(MIN_ALPHA), y: y.max(MIN_ALPHA) }
        }
    }

    /// As [`Self::new`], but never smooth.
    pub fn rough(x: f32, y: f32) -> Self {
        Self::new(x.max(MIN_ROUGH_ALPHA), y.max(MIN_ROUGH_ALPHA))
    }

    /// Whether the surface is perfectly specular. Of the other methods, only [`Self::mean_alpha`] and
    /// [`Self::convolved`] are defined then.
    pub fn is_smooth(self) -> bool {
        self.x == 0.0
    }

    /// Alpha of an equivalent isotropic distribution: the geometric mean.
    pub fn mean_alpha(self) -> f32 {
        (self.x * self.y).sqrt()
    }

    /// The distribution whose slope variance is the sum of this one's and `weight` times the other's. Slope
    /// variances are in proportion to squared alphas.
    pub fn convolved(self, other: Self, weight: f32) -> Self {
        let add = |a: f32, b: f32| (a * a + weight * b * b).sqrt();
        let (x, y) = (add(self.x, other.x), add(self.y, other.y));
        let both_smooth = self.is_smooth() && other.is_smooth();
        let least = if both_smooth { 0.0 } else { MIN_ROUGH_ALPHA };
        Self::new(x.max(least), y.max(least))
    }

    /// D(m): area of microfacets per solid angle of normals and surface area.
    #[inline(always)]
    pub fn density(self, m: Vec3) -> f32 {
        let e = (m.x / self.x).powi(2) + (m.y / self.y).powi(2) + m.z * m.z;
        1.0 / (PI * self.x * self.y * e * e)
    }

    #[inline(always)]
    fn stretched_length(self, w: Vec3) -> f32 {
        (w.z * w.z + (self.x * w.x).powi(2) + (self.y * w.y).powi(2)).sqrt()
    }

    /// G(wo, wi) / |cos wo cos wi|, with height-correlated masking and shadowing.
    #[inline(always)]
    pub fn masking_over_cosines(self, wo: Vec3, wi: Vec3) -> f32 {
        2.0 / (self.stretched_length(wo) * wi.z.abs() + self.stretched_length(wi) * wo.z.abs())
            .max(f32::MIN_POSITIVE)
    }

    /// G(wo, wi) / G1(wo).
    #[inline(always)]
    pub fn masking_ratio(self, wo: Vec3, wi: Vec3) -> f32 {
        let g1 = 2.0 / (wo.z.abs() + self.stretched_length(wo)); // over |cos wo|
        self.masking_over_cosines(wo, wi) * wi.z.abs() / g1
    }

    /// Density per solid angle of the normals visible from `w`.
    pub fn visible_density(self, w: Vec3, m: Vec3) -> f32 {
        2.0 / (w.z.abs() + self.stretched_length(w)) * self.density(m) * w.dot(m).abs()
    }

    /// D(m) G(wo, wi) / |cos wo|, a factor of both reflection and transmission.
    #[inline(always)]
    pub fn distribution_and_masking(self, wo: Vec3, wi: Vec3, m: Vec3) -> f32 {
        self.density(m) * self.masking_over_cosines(wo, wi) * wi.z.abs()
    }

    /// Samples a normal visible from `w`, on the side of `w`, by `u` in [0, 1)².
    #[inline(always)]
    pub fn sample_visible(self, w: Vec3, u: Vec2) -> Vec3 {
        // Stretch to the hemisphere, where visible normals are those of reflection into a spherical cap.
        let stretched = Vec3::new(self.x * w.x, self.y * w.y, w.z.abs()).normalize_or(Vec3::Z);
        let height = (1.0 - u.y) * (1.0 + stretched.z); // of the normal; the point of the cap is lower
        let z = height - stretched.z;
        let (sin_phi, cos_phi) = sin_cos_of_turns(u.x);
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let m = Vec3::new(
            self.x * (radius * cos_phi + stretched.x),
            self.y * (radius * sin_phi + stretched.y),
            height.max(0.0),
        );
        to_hemisphere_of(m.normalize_or(Vec3::Z), w)
    }

    /// f |cos wi| of reflection without the Fresnel reflectance, and the cosine to the microfacet's normal.
    /// Both directions are in the same hemisphere.
    #[inline(always)]
    pub fn reflection_eval(self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let m = (wo + wi).normalize_or(Vec3::Z);
        (self.distribution_and_masking(wo, wi, m) / 4.0, wo.dot(m))
    }

    /// [`Self::reflection_eval`] and [`Self::reflection_pdf`]: value, cosine and density.
    #[inline(always)]
    pub fn reflection_eval_and_pdf(self, wo: Vec3, wi: Vec3) -> (f32, f32, f32) {
        let m = (wo + wi).normalize_or(Vec3::Z);
        let density = self.density(m);
        let value = density * self.masking_over_cosines(wo, wi) * wi.z.abs() / 4.0;
        (value, wo.dot(m), density / (2.0 * (wo.z.abs() + self.stretched_length(wo))))
    }

    /// Density per solid angle of [`Self::sample_reflection`]. Both directions are in the same hemisphere.
    #[inline(always)]
    pub fn reflection_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        let m = (wo + wi).normalize_or(Vec3::Z);
        self.density(m) / (2.0 * (wo.z.abs() + self.stretched_length(wo)))
    }

    /// Reflects `wo` at a sampled visible normal; `None` if the reflection is below the surface.
    pub fn sample_reflection(self, wo: Vec3, u: Vec2) -> Option<MicrofacetReflection> {
        let reflection = self.sample_unchecked_reflection(wo, u);
        same_hemisphere(wo, reflection.wi).then_some(reflection)
    }

    /// Reflects `wo` at a sampled visible normal, even to below the surface. Branchless, for SIMD.
    #[inline(always)]
    pub fn sample_unchecked_reflection(self, wo: Vec3, u: Vec2) -> MicrofacetReflection {
        let m = self.sample_visible(wo, u);
        let cos = wo.dot(m);
        let wi = (m * (2.0 * cos) - wo).normalize_or(m);
        MicrofacetReflection { wi, cos, weight: self.masking_ratio(wo, wi) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integral over the hemisphere by the midpoint rule in (cos, φ).
    fn integrate(f: impl Fn(Vec3) -> f32) -> f64 {
        let (rows, columns) = (800, 400);
        let mut sum = 0.0;
        for i in 0..rows {
            // cos = 1 - t² makes the nodes dense at the pole.
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
    fn the_projected_area_of_the_microfacets_is_that_of_the_surface() {
        for (x, y) in [(0.05, 0.05), (0.1, 0.4), (1.0, 1.0)] {
            let ggx = Ggx::new(x, y);
            let area = integrate(|m| ggx.density(m) * m.z);
            assert!((area - 1.0).abs() < 2e-3, "{x} {y}: {area}");
        }
    }

    #[test]
    fn the_density_of_visible_normals_integrates_to_one() {
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
        assert!(!Ggx::new(0.0, 0.0).convolved(Ggx::new(1e-3, 1e-3), 0.01).is_smooth());
    }

    #[test]
    fn normals_visible_from_below_are_below() {
        let ggx = Ggx::new(0.3, 0.6);
        let m = ggx.sample_visible(Vec3::new(0.5, 0.5, -0.7).normalize(), Vec2::new(0.3, 0.6));
        assert!(m.z < 0.0);
    }
}
