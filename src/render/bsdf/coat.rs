//! The dielectric coat of layered materials: what it reflects itself, and what it lets through.
//!
//! pbrt-v4 evaluates layers by a random walk. Here a coat is its own GGX lobe, and whatever that
//! lobe does not reflect reaches the base. So nothing is lost between the layers, unlike in a walk
//! whose rough interface lacks multiple scattering, nor on the way through the coat, for which
//! pbrt-v4 has an absorption of about 1 % a crossing.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::microfacet::{Ggx, Reflection};
use super::table::{MAX_ETA, Table};
use super::{BsdfSample, frame::mirror, fresnel};

/// A dielectric layer in air, over both sides of whatever it covers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat {
    /// Index of refraction, at least 1.
    pub eta: f32,
    pub ggx: Ggx,
}

/// Share of light that a rough interface's lobe reflects.
static REFLECTANCE: LazyLock<Table> = LazyLock::new(|| {
    Table::new(|cos, alpha, eta| {
        let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        mean_over_reflections(Ggx::new(alpha, alpha), wo, |r| fresnel::dielectric(r.cos, eta))
    })
});

/// Integral over wi of a microfacet lobe without Fresnel's factor, times `factor`: its sampling
/// routine run over a grid of numbers.
pub(super) fn mean_over_reflections(ggx: Ggx, wo: Vec3, factor: impl Fn(&Reflection) -> f32) -> f32 {
    const GRID: u16 = 14;
    let node = |i: u16| (f32::from(i) + 0.5) / f32::from(GRID);
    let value = |i: u16| {
        // The other half of u.x is the mirror image; u.y = 1 - t² is dense where normals are far
        // from the mean, in the long tails of the distribution.
        let t = node(i % GRID);
        let reflection = ggx.reflect_sample(wo, Vec2::new(node(i / GRID) / 2.0, 1.0 - t * t));
        reflection.map_or(0.0, |r| 2.0 * t * r.weight * factor(&r))
    };
    (0..GRID * GRID).map(value).sum::<f32>() / f32::from(GRID * GRID)
}

impl Coat {
    /// `eta` is brought into [1, 3].
    pub fn new(eta: f32, ggx: Ggx) -> Self {
        Self { eta: eta.clamp(1.0, MAX_ETA), ggx }
    }

    /// Share of light at this angle that the coat's own lobe reflects.
    pub fn reflectance(&self, cos: f32) -> f32 {
        if self.ggx.is_smooth() {
            fresnel::dielectric(cos, self.eta)
        } else {
            REFLECTANCE.at(cos, self.ggx.mean_alpha(), self.eta)
        }
    }

    /// The rest of it, which reaches the base; by reciprocity also what light from the base loses
    /// on its way out.
    pub fn transmittance(&self, cos: f32) -> f32 {
        1.0 - self.reflectance(cos)
    }

    /// [`Self::transmittance`] for diffuse light from outside.
    pub fn mean_transmittance(&self) -> f32 {
        1.0 - if self.ggx.is_smooth() {
            fresnel::dielectric_mean(self.eta)
        } else {
            REFLECTANCE.mean(self.ggx.mean_alpha(), self.eta)
        }
    }

    /// Share of diffuse light from inside that is turned back; by reciprocity, what is let out is
    /// 1/η² of what is let in.
    pub fn inner_reflectance(&self) -> f32 {
        1.0 - self.mean_transmittance() / (self.eta * self.eta)
    }

    /// f |cos wi| of the coat's lobe, if it is rough. Both directions are on the same side.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.ggx.is_smooth() {
            return 0.0;
        }
        let (value, cos) = self.ggx.reflect_eval(wo, wi);
        value * fresnel::dielectric(cos, self.eta)
    }

    /// Density of what a rough coat's lobe reflects.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.ggx.is_smooth() { 0.0 } else { self.ggx.reflect_pdf(wo, wi) }
    }

    /// The mirror image seen in a smooth coat, drawn with `probability`.
    pub fn mirror_sample(&self, wo: Vec3, probability: f32) -> BsdfSample {
        BsdfSample::specular(mirror(wo), Vec3::splat(self.reflectance(wo.z.abs()) / probability))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_near_a_fine_quadrature() {
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
                .filter_map(|i| ggx.reflect_sample(wo, Vec2::new(node(i / n), node(i % n))))
                .map(|r| f64::from(r.weight * fresnel::dielectric(r.cos, eta)))
                .sum::<f64>()
                / f64::from(n * n);
            let tabulated = f64::from(Coat::new(eta, ggx).reflectance(cos));
            assert!((tabulated - fine).abs() < 5e-3, "{cos} {alpha} {eta}: {tabulated} {fine}");
        }
    }

    #[test]
    fn a_barely_rough_coat_transmits_like_a_smooth_one() {
        let (rough, smooth) = (Coat::new(1.5, Ggx::new(1e-2, 1e-2)), Coat::new(1.5, Ggx::new(0.0, 0.0)));
        assert!((rough.mean_transmittance() - smooth.mean_transmittance()).abs() < 5e-3);
        for cos in [0.2, 0.6, 1.0] {
            let (r, s) = (rough.transmittance(cos), smooth.transmittance(cos));
            assert!((r - s).abs() < 1e-2, "{cos}: {r} {s}");
        }
    }

    #[test]
    fn diffuse_light_inside_glass_is_mostly_turned_back() {
        // The known internal diffuse reflectance of an index of 1.5.
        let inner = Coat::new(1.5, Ggx::new(0.0, 0.0)).inner_reflectance();
        assert!((inner - 0.596).abs() < 1e-3, "{inner}");
    }
}
