//! One scattering model of any kind, dispatched by a `match` instead of a virtual call, so that it can be
//! inlined.

use super::bxdf_sum::BxdfSum;
use super::coated_conductor::CoatedConductor;
use super::coated_diffuse::CoatedDiffuse;
use super::conductor::Conductor;
use super::dielectric::Dielectric;
use super::diffuse::Diffuse;
use super::fresnel_blend::FresnelBlend;
use super::measured::Measured;
use super::microfacet_lobe::MicrofacetLobe;
use super::mirror::Mirror;
use super::oren_nayar::OrenNayar;
use super::thin_dielectric::ThinDielectric;

/// A scattering model; [`with_bxdf`] calls the methods of [`super::bxdf::Bxdf`] on it.
#[derive(Clone, Copy, Debug)]
pub(super) enum AnyBxdf<'s> {
    Diffuse(Diffuse),
    OrenNayar(OrenNayar),
    Mirror(Mirror),
    Conductor(Conductor),
    Dielectric(Dielectric),
    ThinDielectric(ThinDielectric),
    CoatedDiffuse(CoatedDiffuse),
    CoatedConductor(CoatedConductor),
    FresnelBlend(FresnelBlend),
    MicrofacetLobe(MicrofacetLobe),
    Sum(BxdfSum),
    Measured(Measured<'s>),
}

/// Evaluates an expression with a name bound to the model inside an [`AnyBxdf`].
macro_rules! with_bxdf {
    ($bxdf:expr, $name:ident => $value:expr) => {
        match $bxdf {
            AnyBxdf::Diffuse($name) => $value,
            AnyBxdf::OrenNayar($name) => $value,
            AnyBxdf::Mirror($name) => $value,
            AnyBxdf::Conductor($name) => $value,
            AnyBxdf::Dielectric($name) => $value,
            AnyBxdf::ThinDielectric($name) => $value,
            AnyBxdf::CoatedDiffuse($name) => $value,
            AnyBxdf::CoatedConductor($name) => $value,
            AnyBxdf::FresnelBlend($name) => $value,
            AnyBxdf::MicrofacetLobe($name) => $value,
            AnyBxdf::Sum($name) => $value,
            AnyBxdf::Measured($name) => $value,
        }
    };
}
pub(super) use with_bxdf;
