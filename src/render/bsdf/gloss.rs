//! Microfacet reflection as a layer of its own (Torrance and Sparrow 1967): what pbrt-v2's and
//! v3's `plastic`, `uber` and `metal` add to, or have instead of, a diffuse part.

use glam::{Vec2, Vec3};

use super::blinn::Blinn;
use super::frame::same_side;
use super::microfacet::Ggx;
use super::{BsdfSample, Scatter, fresnel};

/// A distribution of microfacets, none of them smooth.
#[derive(Clone, Copy, Debug)]
pub(super) enum Facets {
    Ggx(Ggx),
    Blinn(Blinn),
}

impl Facets {
    pub fn density(self, m: Vec3) -> f32 {
        match self {
            Facets::Ggx(ggx) => ggx.density(m),
            Facets::Blinn(blinn) => blinn.density(m),
        }
    }

    /// f |cos wi| but for Fresnel's factor, and the cosine to the microfacet that it depends on.
    pub fn reflect_eval(self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        match self {
            Facets::Ggx(ggx) => ggx.reflect_eval(wo, wi),
            Facets::Blinn(blinn) => blinn.reflect_eval(wo, wi),
        }
    }

    pub fn reflect_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        match self {
            Facets::Ggx(ggx) => ggx.reflect_pdf(wo, wi),
            Facets::Blinn(blinn) => blinn.reflect_pdf(wo, wi),
        }
    }

    pub fn reflect_sample(self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        match self {
            Facets::Ggx(ggx) => Some(ggx.reflect_sample(wo, u)?.wi),
            Facets::Blinn(blinn) => blinn.reflect_sample(wo, u),
        }
    }
}

/// What a microfacet reflects by angle.
#[derive(Clone, Copy, Debug)]
pub(super) enum FacetFresnel {
    /// Index of refraction of the far side over that of the near side. Below 1 everything beyond
    /// the critical angle is reflected: pbrt-v2's and v3's plastics are lit from inside.
    Dielectric(f32),
    Conductor {
        eta: Vec3,
        k: Vec3,
    },
}

impl FacetFresnel {
    fn at(self, cos: f32) -> Vec3 {
        match self {
            FacetFresnel::Dielectric(eta) => Vec3::splat(fresnel::dielectric(cos, eta)),
            FacetFresnel::Conductor { eta, k } => fresnel::conductor(cos, eta, k),
        }
    }
}

/// Microfacets that reflect, and, mirrored at the surface's plane, transmit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gloss {
    pub reflectance: Vec3,
    pub transmittance: Vec3,
    pub facets: Facets,
    pub fresnel: FacetFresnel,
}

impl Gloss {
    fn reflect_probability(&self) -> f32 {
        let (r, t) = (self.reflectance.max_element(), self.transmittance.max_element());
        if r + t > 0.0 { r / (r + t) } else { 0.0 }
    }

    /// The factor of the side of `wi`, and `wi` on the side of `wo`.
    fn on_reflecting_side(&self, wo: Vec3, wi: Vec3) -> (Vec3, Vec3) {
        if same_side(wo, wi) { (self.reflectance, wi) } else { (self.transmittance, through(wi)) }
    }
}

/// The mirror image of a direction on the other side.
fn through(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

impl Scatter for Gloss {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let (factor, wi) = self.on_reflecting_side(wo, wi);
        if factor == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let (value, cos) = self.facets.reflect_eval(wo, wi);
        factor * self.fresnel.at(cos) * value
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let p = self.reflect_probability();
        let share = if same_side(wo, wi) { p } else { 1.0 - p };
        if share == 0.0 {
            return 0.0;
        }
        share * self.facets.reflect_pdf(wo, self.on_reflecting_side(wo, wi).1)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let reflect = u_lobe < self.reflect_probability();
        let wi = self.facets.reflect_sample(wo, u)?;
        let wi = if reflect { wi } else { through(wi) };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample {
            transmission: !reflect,
            ..BsdfSample::glossy(wi, self.eval(wo, wi) / pdf, pdf)
        })
    }

    fn is_specular(&self) -> bool {
        false
    }

    fn albedo(&self, wo: Vec3) -> Vec3 {
        (self.reflectance + self.transmittance) * self.fresnel.at(wo.z.abs())
    }
}
