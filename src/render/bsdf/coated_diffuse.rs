//! A diffuse base under a dielectric coat, in closed form.
//!
//! With T the transmittance of the coat, F the reflectance of its inside for diffuse light and k
//! the base's albedo, light that enters, bounces between base and coat any number of times and
//! leaves gives the geometric series
//!
//! ```text
//! f(wo, wi) = T(wo) T(wi) / η² · k / π / (1 − k F)
//! ```
//!
//! (Wolff, *Diffuse-reflectance model for smooth dielectric surfaces*, 1994; exact for a smooth
//! coat over a Lambertian base.) A white base reflects all that the coat's lobe does not.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::coat::Coat;
use super::diffuse::{cosine_pdf, cosine_sample};
use super::frame::{on_side_of, same_side};
use super::{BsdfSample, Scatter};

#[derive(Clone, Copy, Debug)]
pub(super) struct CoatedDiffuse {
    coat: Coat,
    /// k / (1 − k F) / η²
    base: Vec3,
    /// Share of what enters the coat that leaves it again: (1 − F) k / (1 − k F).
    base_albedo: Vec3,
}

impl CoatedDiffuse {
    /// `reflectance` in [0, 1].
    pub fn new(coat: Coat, reflectance: Vec3) -> Self {
        let inner = coat.inner_reflectance();
        // 1 - k F is 0 only for a coat that lets nothing through, of an index beyond any allowed.
        let summed = reflectance / (1.0 - reflectance * inner);
        Self { coat, base: summed / (coat.eta * coat.eta), base_albedo: summed * (1.0 - inner) }
    }

    /// Probability of drawing from the coat's lobe: its share of the light, by the brightest
    /// channel. `None` if nothing scatters.
    fn coat_probability(&self, wo: Vec3) -> Option<f32> {
        let coat = self.coat.reflectance(wo.z.abs());
        let total = coat + (1.0 - coat) * self.base_albedo.max_element();
        (total > 0.0).then(|| coat / total)
    }
}

impl Scatter for CoatedDiffuse {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if !same_side(wo, wi) {
            return Vec3::ZERO;
        }
        let (cos_o, cos_i) = (wo.z.abs(), wi.z.abs());
        let through = self.coat.transmittance(cos_o) * self.coat.transmittance(cos_i);
        self.base * (through * FRAC_1_PI * cos_i) + self.coat.eval(wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        match self.coat_probability(wo) {
            Some(p) if same_side(wo, wi) => p * self.coat.pdf(wo, wi) + (1.0 - p) * cosine_pdf(wi),
            _ => 0.0,
        }
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let p = self.coat_probability(wo)?;
        let wi = if u_lobe >= p {
            on_side_of(cosine_sample(u), wo)
        } else if self.coat.ggx.is_smooth() {
            return Some(self.coat.mirror_sample(wo, p));
        } else {
            self.coat.ggx.reflect_sample(wo, u)?.wi
        };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf))
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        let coat = self.coat.reflectance(wo.z.abs());
        self.base_albedo * (1.0 - coat) + coat
    }
}
