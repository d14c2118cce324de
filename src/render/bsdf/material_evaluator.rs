//! Evaluates a material's textures at a point and makes its scattering model from them (pbrt-v4's
//! `Material::GetBxDF`, section 10.5).

use glam::Vec3;

use super::any_bxdf::AnyBxdf;
use super::blinn::Blinn;
use super::bxdf_sum::BxdfSum;
use super::clamp::clamp_or_zero;
use super::coat::Coat;
use super::coated_conductor::CoatedConductor;
use super::coated_diffuse::CoatedDiffuse;
use super::conductor::Conductor;
use super::dielectric::Dielectric;
use super::diffuse::Diffuse;
use super::fresnel;
use super::fresnel_blend::FresnelBlend;
use super::ggx::Ggx;
use super::measured::Measured;
use super::microfacet_distribution::MicrofacetDistribution;
use super::microfacet_lobe::{MicrofacetFresnel, MicrofacetLobe};
use super::mirror::Mirror;
use super::null_transmission::NullTransmission;
use super::oren_nayar::OrenNayar;
use super::thin_dielectric::ThinDielectric;
use super::tinted_dielectric::TintedDielectric;
use crate::scene::material::{Additive, Metal, Roughness, RoughnessScale};
use crate::scene::texture::TexturePoint;
use crate::scene::{FloatTextureId, MaterialKind, RgbTextureId, Textures};

/// The textures of a scene at one point.
pub(super) struct MaterialEvaluator<'t> {
    pub textures: &'t Textures,
    pub at: TexturePoint,
}

impl MaterialEvaluator<'_> {
    /// The scattering model of a material; `None` for an interface, which transmits light unchanged, and for a
    /// mix, which has to be resolved before.
    pub fn bxdf<'s>(&self, kind: &'s MaterialKind) -> Option<AnyBxdf<'s>> {
        Some(match *kind {
            // Diffuse materials
            MaterialKind::Diffuse { reflectance } => {
                AnyBxdf::Diffuse(Diffuse { reflectance: self.colour(reflectance), transmittance: Vec3::ZERO })
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => AnyBxdf::Diffuse(Diffuse {
                reflectance: self.colour(reflectance),
                transmittance: self.colour(transmittance),
            }),
            MaterialKind::OrenNayar { reflectance, sigma } => {
                AnyBxdf::OrenNayar(OrenNayar::new(self.colour(reflectance), self.float(sigma)))
            }

            // Conductors and dielectrics
            MaterialKind::Mirror { reflectance } => {
                AnyBxdf::Mirror(Mirror { reflectance: self.colour(reflectance) })
            }
            MaterialKind::Conductor { metal, roughness } => self.metal(metal, roughness),
            MaterialKind::Dielectric { eta, roughness } => {
                AnyBxdf::Dielectric(Dielectric { eta: valid_eta(eta), ggx: self.ggx(roughness) })
            }
            MaterialKind::ThinDielectric { eta } => {
                AnyBxdf::ThinDielectric(ThinDielectric { eta: valid_eta(eta) })
            }

            // Layered and composite materials
            MaterialKind::CoatedDiffuse { reflectance, eta, roughness, thickness } => {
                let coat = Coat::new(valid_eta(eta), self.ggx(roughness), self.float(thickness));
                AnyBxdf::CoatedDiffuse(CoatedDiffuse::new(coat, self.colour(reflectance)))
            }
            MaterialKind::CoatedConductor {
                metal,
                conductor_roughness,
                eta,
                interface_roughness,
                thickness,
            } => {
                let coat = Coat::new(valid_eta(eta), self.ggx(interface_roughness), self.float(thickness));
                let base = self.conductor(metal, conductor_roughness);
                AnyBxdf::CoatedConductor(CoatedConductor::new(coat, base))
            }
            MaterialKind::FresnelBlend { diffuse, specular, roughness } => {
                AnyBxdf::FresnelBlend(FresnelBlend {
                    diffuse: self.colour(diffuse),
                    specular: self.colour(specular),
                    distribution: self.distribution(roughness),
                })
            }
            MaterialKind::Additive(ref lobes) => AnyBxdf::Sum(self.sum(lobes)),
            MaterialKind::Measured(ref table) => AnyBxdf::Measured(Measured { table }),

            MaterialKind::Interface | MaterialKind::Mix { .. } => return None,
        })
    }

    /// A reflectance, clamped to [0, 1]; NaN becomes 0.
    pub fn colour(&self, id: RgbTextureId) -> Vec3 {
        self.textures.rgb(id, self.at).map(|v| clamp_or_zero(v, 1.0))
    }

    fn float(&self, id: FloatTextureId) -> f32 {
        self.textures.float(id, self.at)
    }

    fn ggx(&self, roughness: Roughness) -> Ggx {
        let alpha = |id| roughness.scale.alpha(self.float(id));
        Ggx::new(alpha(roughness.u), alpha(roughness.v))
    }

    /// The microfacet distribution of the roughness's dialect, never smooth.
    fn distribution(&self, roughness: Roughness) -> MicrofacetDistribution {
        if roughness.scale == RoughnessScale::InverseExponent {
            let exponents = [roughness.u, roughness.v].map(|id| self.float(id).recip());
            MicrofacetDistribution::Blinn(Blinn::new(exponents[0], exponents[1]))
        } else {
            let alpha = |id| roughness.scale.alpha(self.float(id));
            MicrofacetDistribution::Ggx(Ggx::rough(alpha(roughness.u), alpha(roughness.v)))
        }
    }

    /// A conductor with the microfacet distribution of the roughness's dialect.
    fn metal(&self, metal: Metal, roughness: Roughness) -> AnyBxdf<'static> {
        if roughness.scale != RoughnessScale::InverseExponent {
            return AnyBxdf::Conductor(self.conductor(metal, roughness));
        }
        let (eta, k) = self.complex_index(metal);
        AnyBxdf::MicrofacetLobe(MicrofacetLobe {
            reflectance: Vec3::ONE,
            transmittance: Vec3::ZERO,
            distribution: self.distribution(roughness),
            fresnel: MicrofacetFresnel::Conductor { eta, k },
        })
    }

    /// A conductor of GGX microfacets, or a smooth one.
    pub fn conductor(&self, metal: Metal, roughness: Roughness) -> Conductor {
        let (eta, k) = self.complex_index(metal);
        Conductor { eta, k, ggx: self.ggx(roughness) }
    }

    /// Complex index of refraction: η and k.
    fn complex_index(&self, metal: Metal) -> (Vec3, Vec3) {
        // Far beyond any metal, and small enough for finite squares.
        const MAX_INDEX: f32 = 1e4;
        let index = |id| self.textures.rgb(id, self.at).map(|v| clamp_or_zero(v, MAX_INDEX));
        match metal {
            Metal::Fresnel { eta, k } => (index(eta), index(k)),
            Metal::Reflectance(r) => (Vec3::ONE, fresnel::absorption_from_reflectance(self.colour(r))),
        }
    }

    fn sum(&self, lobes: &Additive) -> BxdfSum {
        let colour = |id: Option<RgbTextureId>| id.map_or(Vec3::ZERO, |id| self.colour(id));
        let opacity = lobes.opacity.map_or(Vec3::ONE, |id| self.colour(id));
        let transparency = Vec3::ONE - opacity;
        let scaled = |colours: [Vec3; 2]| colours.map(|colour| colour * opacity);
        let is_visible = |colours: [Vec3; 2]| colours != [Vec3::ZERO; 2];

        // Make the lobes that scatter
        let [reflectance, transmittance] = scaled(lobes.diffuse.map(colour));
        let diffuse =
            is_visible([reflectance, transmittance]).then_some(Diffuse { reflectance, transmittance });
        let microfacet = lobes.gloss.and_then(|layer| {
            let [reflectance, transmittance] = scaled(layer.colours.map(colour));
            is_visible([reflectance, transmittance]).then(|| MicrofacetLobe {
                reflectance,
                transmittance,
                distribution: self.distribution(layer.roughness),
                fresnel: MicrofacetFresnel::Dielectric {
                    front: layer.eta,
                    back: if lobes.inverts_gloss_behind { layer.eta.recip() } else { layer.eta },
                },
            })
        });
        let dielectric = lobes.dielectric.and_then(|layer| {
            let [reflected, transmitted] = scaled(layer.colours.map(colour));
            is_visible([reflected, transmitted]).then(|| {
                let ggx = self.ggx(layer.roughness);
                let dielectric = Dielectric { eta: valid_eta(layer.eta), ggx };
                TintedDielectric { dielectric, reflected, transmitted }
            })
        });

        // Transmit the rest unchanged
        let null = (transparency != Vec3::ZERO).then_some(NullTransmission(transparency));
        BxdfSum { diffuse, microfacet, dielectric, null }
    }
}

/// The index of refraction, or 1 (no boundary) if it is not a positive normal number, as in pbrt-v4 for 0.
fn valid_eta(eta: f32) -> f32 {
    if eta.is_normal() && eta > 0.0 { eta } else { 1.0 }
}
