//! A metal under a dielectric coat: a simple layered approximation.
//!
//! Light reaches the metal refracted at the flat mean interface (Weidlich and Wilkie, *Arbitrarily
//! layered micro-facet surfaces*, 2007), and three things come back:
//!
//! * the coat's own reflection;
//! * what the metal reflects and the coat lets out, f(wo', wi') T(wo) T(wi) / η², times the
//!   mirror-like bounces between the layers, 1 / (1 − F R) with the smaller of both directions'
//!   Fresnel reflectances F and the metal's R. It is exact if both layers are smooth;
//! * *trapped* light: what the metal scatters but the coat turns back in other than mirror-like
//!   ways, mostly beyond the critical angle. It is taken to leave diffusely after further bounces, by
//!   a reciprocal product as in Kulla and Conty, *Revisiting physically based shading at
//!   Imageworks* (2017), so that a white metal loses about as much as it does uncoated.
//!
//! A rough coat widens the metal's lobe. Where pbrt-v4's random walk would differ is the shape of
//! the trapped light, and the light that its rough interfaces lose.

use std::f32::consts::FRAC_1_PI;
use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::coat::{Coat, mean_over_reflections};
use super::conductor::Conductor;
use super::diffuse::{cosine_pdf, cosine_sample};
use super::frame::{mirror, on_side_of, same_side};
use super::microfacet::Ggx;
use super::table::Table;
use super::{BsdfSample, Scatter, fresnel};

#[derive(Clone, Copy, Debug)]
pub(super) struct CoatedConductor {
    coat: Coat,
    /// Seen from within the coat; smooth only if the coat is.
    base: Conductor,
    /// Colour of trapped light that gets out at last.
    trapped_colour: Vec3,
}

/// Share of light from outside that is trapped under a smooth coat over a white metal.
static TRAPPED: LazyLock<Table> = LazyLock::new(|| {
    Table::new(|cos, alpha, eta| {
        let coat = Coat::new(eta, Ggx::new(0.0, 0.0));
        let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        let trapped = mean_over_reflections(Ggx::new(alpha, alpha), inside(wo, eta), |r| {
            outside(r.wi, eta).map_or(1.0, |wi| 1.0 - coat.transmittance(wi.z) * bounces(&coat, wo, wi, 1.0))
        });
        coat.transmittance(cos) * trapped
    })
});

/// The direction within the coat of light that is in direction `w` outside, on the same side.
pub(super) fn inside(w: Vec3, eta: f32) -> Vec3 {
    let cos = (eta * eta - 1.0 + w.z * w.z).sqrt() / eta;
    Vec3::new(w.x / eta, w.y / eta, cos.copysign(w.z))
}

/// The reverse of [`inside`]; `None` at total internal reflection.
fn outside(w: Vec3, eta: f32) -> Option<Vec3> {
    let cos2 = 1.0 - eta * eta + (eta * w.z).powi(2);
    (cos2 > 0.0).then(|| Vec3::new(w.x * eta, w.y * eta, cos2.sqrt().copysign(w.z)).normalize())
}

/// Sum of mirror-like bounces between metal, of this reflectance, and coat.
fn bounces(coat: &Coat, wo: Vec3, wi: Vec3, metal: f32) -> f32 {
    let turned_back = |w: Vec3| fresnel::dielectric(w.z.abs(), coat.eta);
    let both = turned_back(wo).min(turned_back(wi));
    1.0 / (1.0 - both * metal).max(f32::EPSILON)
}

/// Probabilities of the three parts; their sum is 1.
struct Shares {
    coat: f32,
    metal: f32,
    trapped: f32,
}

impl CoatedConductor {
    /// `base` has its index relative to air.
    pub fn new(coat: Coat, base: Conductor) -> Self {
        // A tilt of the interface turns light by 1 - 1/η of it, twice, and a tilt of the metal by
        // double: so this is the share of the coat's slope variance in the metal's.
        let share = (1.0 - 1.0 / coat.eta).powi(2) / 2.0;
        let (eta, k) = (base.eta / coat.eta, base.k / coat.eta);
        // Mean cosine of diffuse light.
        const TRAPPED_COS: f32 = 2.0 / 3.0;
        let metal = fresnel::conductor(TRAPPED_COS, eta, k);
        let inner = coat.inner_reflectance();
        // Two reflections at least, then a series of diffuse light's.
        let trapped_colour = metal * metal * (1.0 - inner) / (1.0 - metal * inner);
        Self { coat, base: Conductor { eta, k, ggx: base.ggx.spread_by(coat.ggx, share) }, trapped_colour }
    }

    /// Share of light at this angle that is trapped, before colour.
    fn trapped(&self, cos: f32) -> f32 {
        TRAPPED.at(cos, self.base.ggx.mean_alpha(), self.coat.eta)
    }

    fn metal_reflectance(&self, wo: Vec3) -> Vec3 {
        fresnel::conductor(inside(wo, self.coat.eta).z.abs(), self.base.eta, self.base.k)
    }

    /// Estimates of what each part reflects.
    fn albedos(&self, wo: Vec3) -> (f32, Vec3, Vec3) {
        let cos = wo.z.abs();
        let (coat, trapped) = (self.coat.reflectance(cos), self.trapped(cos));
        let metal = self.metal_reflectance(wo) * (1.0 - coat - trapped).max(0.0);
        (coat, metal, self.trapped_colour * trapped)
    }

    /// `None` if nothing scatters.
    fn shares(&self, wo: Vec3) -> Option<Shares> {
        let (coat, metal, trapped) = self.albedos(wo);
        let (metal, trapped) = (metal.max_element(), trapped.max_element());
        let total = coat + metal + trapped;
        (total > 0.0).then(|| Shares { coat: coat / total, metal: metal / total, trapped: trapped / total })
    }

    /// All bounces in the mirror direction, if both layers are smooth.
    fn mirror_reflectance(&self, wo: Vec3) -> Vec3 {
        let (coat, metal) = (self.coat.reflectance(wo.z.abs()), self.metal_reflectance(wo));
        let leaves = metal.map(|r| r * bounces(&self.coat, wo, wo, r));
        leaves * (1.0 - coat).powi(2) + coat
    }

    /// Solid angle within the coat per solid angle outside.
    fn compression(&self, wi: Vec3, wi_inside: Vec3) -> f32 {
        wi.z / (wi_inside.z * self.coat.eta * self.coat.eta)
    }

    fn metal_eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let (wo_inside, wi_inside) = (inside(wo, self.coat.eta), inside(wi, self.coat.eta));
        let through = self.coat.transmittance(wo.z.abs()) * self.coat.transmittance(wi.z.abs());
        let (value, cos) = self.base.ggx.reflect_eval(wo_inside, wi_inside);
        let metal = fresnel::conductor(cos, self.base.eta, self.base.k);
        let colour = metal.map(|r| r * bounces(&self.coat, wo, wi, r));
        colour * (value * through * self.compression(wi, wi_inside))
    }

    fn trapped_eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let mean = TRAPPED.mean(self.base.ggx.mean_alpha(), self.coat.eta);
        let product = self.trapped(wo.z.abs()) * self.trapped(wi.z.abs());
        if product > 0.0 {
            self.trapped_colour * (product / mean * FRAC_1_PI * wi.z.abs())
        } else {
            Vec3::ZERO
        }
    }
}

impl Scatter for CoatedConductor {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if self.is_specular() || !same_side(wo, wi) {
            return Vec3::ZERO;
        }
        self.metal_eval(wo, wi) + self.trapped_eval(wo, wi) + self.coat.eval(wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.is_specular() || !same_side(wo, wi) {
            return 0.0;
        }
        let Some(shares) = self.shares(wo) else { return 0.0 };
        let (wo_inside, wi_inside) = (inside(wo, self.coat.eta), inside(wi, self.coat.eta));
        let metal = self.base.ggx.reflect_pdf(wo_inside, wi_inside) * self.compression(wi, wi_inside);
        shares.coat * self.coat.pdf(wo, wi) + shares.metal * metal + shares.trapped * cosine_pdf(wi)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if self.is_specular() {
            return Some(BsdfSample::specular(mirror(wo), self.mirror_reflectance(wo)));
        }
        let shares = self.shares(wo)?;
        let wi = if u_lobe < shares.coat {
            if self.coat.ggx.is_smooth() {
                return Some(self.coat.mirror_sample(wo, shares.coat));
            }
            self.coat.ggx.reflect_sample(wo, u)?.wi
        } else if u_lobe < shares.coat + shares.trapped {
            on_side_of(cosine_sample(u), wo)
        } else {
            let reflection = self.base.ggx.reflect_sample(inside(wo, self.coat.eta), u)?;
            outside(reflection.wi, self.coat.eta)?
        };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf))
    }

    fn is_specular(&self) -> bool {
        self.base.ggx.is_smooth()
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        let (coat, metal, trapped) = self.albedos(wo);
        metal + trapped + coat
    }
}
