//! A conductor under a dielectric coat: a closed-form layered approximation.
//!
//! Light reaches the conductor refracted at the flat mean interface (Weidlich and Wilkie, *Arbitrarily layered
//! micro-facet surfaces*, 2007). The reflected light has three parts:
//!
//! * the coat's own reflection;
//! * the conductor's reflection through the coat, f(wo', wi') T(wo) T(wi) / η², times the series of specular
//!   interreflections between the layers, 1 / (1 − F R), with the smaller of both directions' Fresnel reflectances
//!   F and the conductor's R. This part is exact if both layers are smooth;
//! * trapped light: light that the conductor scatters and the coat reflects back in other than the specular
//!   direction, mostly beyond the critical angle. It leaves diffusely after further bounces, by a reciprocal
//!   product as in Kulla and Conty, *Revisiting physically based shading at Imageworks* (2017), so that a white
//!   conductor loses about as much energy as without a coat.
//!
//! What the coat absorbs is left out of all three but the first; trapped light crosses it at least four times. A rough coat
//! widens the conductor's lobe. pbrt-v4's random walk differs in the directional distribution of the
//! trapped light, and in the energy that its rough interfaces lose.

use std::f32::consts::FRAC_1_PI;
use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::bsdf_sample::BsdfSample;
use super::bxdf::Bxdf;
use super::coat::{Coat, mean_over_reflections};
use super::conductor::Conductor;
use super::directions::{
    cosine_hemisphere_pdf, reflect, same_hemisphere, sample_cosine_hemisphere, to_hemisphere_of,
};
use super::fresnel;
use super::ggx::Ggx;
use super::interface_table::{InterfaceRow, InterfaceTable};

#[derive(Clone, Copy, Debug)]
pub(super) struct CoatedConductor {
    coat: Coat,
    /// Relative to the coat; smooth only if the coat is.
    base: Conductor,
    /// Colour of the trapped light that leaves the coat.
    trapped_colour: Vec3,
    /// Where its fraction is tabulated.
    trapped_row: InterfaceRow,
}

/// Fraction of light from outside that is trapped under a smooth coat over a white conductor.
static TRAPPED: LazyLock<InterfaceTable> = LazyLock::new(|| {
    InterfaceTable::new(|cos, alpha, eta| {
        let coat = Coat::new(eta, Ggx::new(0.0, 0.0), 0.0);
        let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        let trapped = mean_over_reflections(Ggx::new(alpha, alpha), inside(wo, eta), |r| {
            outside(r.wi, eta)
                .map_or(1.0, |wi| 1.0 - coat.transmittance(wi.z) * interreflections(&coat, wo, wi, 1.0))
        });
        coat.transmittance(cos) * trapped
    })
});

/// The direction within the coat that refracts to `w` outside, in the same hemisphere.
pub(super) fn inside(w: Vec3, eta: f32) -> Vec3 {
    let cos = (eta * eta - 1.0 + w.z * w.z).sqrt() / eta;
    Vec3::new(w.x / eta, w.y / eta, cos.copysign(w.z))
}

/// The inverse of [`inside`]; `None` at total internal reflection.
fn outside(w: Vec3, eta: f32) -> Option<Vec3> {
    let cos2 = 1.0 - eta * eta + (eta * w.z).powi(2);
    (cos2 > 0.0).then(|| Vec3::new(w.x * eta, w.y * eta, cos2.sqrt().copysign(w.z)).normalize())
}

/// Sum of the series of specular interreflections between the coat and a conductor of this reflectance.
fn interreflections(coat: &Coat, wo: Vec3, wi: Vec3, reflectance: f32) -> f32 {
    let internal = |w: Vec3| fresnel::dielectric(w.z.abs(), coat.eta) * coat.crossing(w.z.abs()).powi(2);
    let smaller = internal(wo).min(internal(wi));
    1.0 / (1.0 - smaller * reflectance).max(f32::EPSILON)
}

/// Probabilities of sampling the three parts; their sum is 1.
struct Probabilities {
    coat: f32,
    conductor: f32,
    trapped: f32,
}

impl CoatedConductor {
    /// The index of refraction of `base` is relative to air.
    pub fn new(coat: Coat, base: Conductor) -> Self {
        // Widen the conductor's lobe by the coat's roughness: a tilt of the interface deflects light by 1 - 1/η
        // of the tilt at both crossings, a tilt of the conductor by twice the tilt.
        let variance_ratio = (1.0 - 1.0 / coat.eta).powi(2) / 2.0;
        let ggx = base.ggx.convolved(coat.ggx, variance_ratio);
        let (eta, k) = (base.eta / coat.eta, base.k / coat.eta);

        // Sum the series of trapped light: at least two reflections, then diffuse ones
        const MEAN_DIFFUSE_COS: f32 = 2.0 / 3.0;
        let reflectance = fresnel::conductor(MEAN_DIFFUSE_COS, eta, k);
        let three_crossings = coat.mean_crossing().powi(3);
        let trapped_colour = reflectance * reflectance * three_crossings * coat.escape()
            / (1.0 - reflectance * coat.return_to_base());
        let trapped_row = InterfaceRow::new(ggx.mean_alpha(), coat.eta);
        Self { coat, base: Conductor { eta, k, ggx }, trapped_colour, trapped_row }
    }

    /// Fraction of light at this angle that is trapped, under a white conductor.
    fn trapped_fraction(&self, cos: f32) -> f32 {
        TRAPPED.at(cos, self.trapped_row)
    }

    /// Fresnel reflectance of the conductor for light from `wo` outside.
    fn conductor_reflectance(&self, wo: Vec3) -> Vec3 {
        fresnel::conductor(inside(wo, self.coat.eta).z.abs(), self.base.eta, self.base.k)
    }

    /// Estimates of the albedos of the coat, the conductor and the trapped light.
    fn albedos(&self, wo: Vec3) -> (f32, Vec3, Vec3) {
        let cos = wo.z.abs();
        let (coat, trapped) = (self.coat.reflectance(cos), self.trapped_fraction(cos));
        let there_and_back = self.coat.crossing(cos).powi(2);
        let conductor = self.conductor_reflectance(wo) * ((1.0 - coat - trapped).max(0.0) * there_and_back);
        (coat, conductor, self.trapped_colour * trapped)
    }

    /// `None` if nothing scatters.
    fn probabilities(&self, wo: Vec3) -> Option<Probabilities> {
        let (coat, conductor, trapped) = self.albedos(wo);
        let (conductor, trapped) = (conductor.max_element(), trapped.max_element());
        let total = coat + conductor + trapped;
        (total > 0.0).then(|| Probabilities {
            coat: coat / total,
            conductor: conductor / total,
            trapped: trapped / total,
        })
    }

    /// Reflectance with all interreflections if both layers are smooth.
    fn specular_reflectance(&self, wo: Vec3) -> Vec3 {
        let (coat, conductor) = (self.coat.reflectance(wo.z.abs()), self.conductor_reflectance(wo));
        let series = conductor.map(|r| r * interreflections(&self.coat, wo, wo, r));
        series * ((1.0 - coat) * self.coat.crossing(wo.z.abs())).powi(2) + coat
    }

    /// Solid angle within the coat per solid angle outside.
    fn compression(&self, wi: Vec3, wi_inside: Vec3) -> f32 {
        wi.z / (wi_inside.z * self.coat.eta * self.coat.eta)
    }

    /// f |cos wi| of the conductor through the coat.
    fn conductor_eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let (wo_inside, wi_inside) = (inside(wo, self.coat.eta), inside(wi, self.coat.eta));
        let through = |w: Vec3| self.coat.transmittance(w.z.abs()) * self.coat.crossing(w.z.abs());
        let transmittance = through(wo) * through(wi);
        let (value, cos) = self.base.ggx.reflection_eval(wo_inside, wi_inside);
        let reflectance = fresnel::conductor(cos, self.base.eta, self.base.k);
        let colour = reflectance.map(|r| r * interreflections(&self.coat, wo, wi, r));
        colour * (value * transmittance * self.compression(wi, wi_inside))
    }

    /// f |cos wi| of the trapped light.
    fn trapped_eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let mean = TRAPPED.mean(self.trapped_row);
        let product = self.trapped_fraction(wo.z.abs()) * self.trapped_fraction(wi.z.abs());
        if product > 0.0 {
            self.trapped_colour * (product / mean * FRAC_1_PI * wi.z.abs())
        } else {
            Vec3::ZERO
        }
    }
}

impl Bxdf for CoatedConductor {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if self.is_specular() || !same_hemisphere(wo, wi) {
            return Vec3::ZERO;
        }
        self.conductor_eval(wo, wi) + self.trapped_eval(wo, wi) + self.coat.eval(wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.is_specular() || !same_hemisphere(wo, wi) {
            return 0.0;
        }
        let Some(p) = self.probabilities(wo) else { return 0.0 };
        let (wo_inside, wi_inside) = (inside(wo, self.coat.eta), inside(wi, self.coat.eta));
        let conductor_pdf =
            self.base.ggx.reflection_pdf(wo_inside, wi_inside) * self.compression(wi, wi_inside);
        p.coat * self.coat.pdf(wo, wi) + p.conductor * conductor_pdf + p.trapped * cosine_hemisphere_pdf(wi)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if self.is_specular() {
            return Some(BsdfSample::specular(reflect(wo), self.specular_reflectance(wo)));
        }
        let p = self.probabilities(wo)?;
        let wi = if u_lobe < p.coat {
            if self.coat.ggx.is_smooth() {
                return Some(self.coat.specular_sample(wo, p.coat));
            }
            self.coat.ggx.sample_reflection(wo, u)?.wi
        } else if u_lobe < p.coat + p.trapped {
            to_hemisphere_of(sample_cosine_hemisphere(u), wo)
        } else {
            let reflection = self.base.ggx.sample_reflection(inside(wo, self.coat.eta), u)?;
            outside(reflection.wi, self.coat.eta)?
        };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf))
    }

    fn is_specular(&self) -> bool {
        self.base.ggx.is_smooth()
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        let (coat, conductor, trapped) = self.albedos(wo);
        conductor + trapped + coat
    }
}
