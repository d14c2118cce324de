//! BSDFs: how a surface scatters light at a point, after its textures have been evaluated.
//!
//! The models and their conventions are pbrt-v4's (Pharr, Jakob, Humphreys, *Physically Based
//! Rendering*, 4th edition, chapters 9, 10 and 14), but for layered materials, which have a
//! deterministic closed form here instead of a random walk (`coat`). As there, the frame of
//! the shading normal decides what is reflection and what transmission, and rough lobes have no
//! compensation for multiple scattering between microfacets.
//!
//! A lobe (`Scatter`) is made of plain values and knows its local frame only; [`Bsdf`] adds the
//! frame, and [`Bsdf::new`] the textures.

mod blinn;
mod coat;
mod coated_conductor;
mod coated_diffuse;
mod conductor;
mod dielectric;
mod diffuse;
mod frame;
mod fresnel;
mod fresnel_blend;
mod gloss;
mod measured;
mod microfacet;
mod mirror;
mod oren_nayar;
mod plain;
mod shading_frame;
#[cfg(test)]
mod statistical_tests;
mod sum;
mod table;

use glam::{Vec2, Vec3};

use crate::geometry::SurfacePoint;
use crate::scene::material::{Additive, Metal, Roughness, RoughnessScale};
use crate::scene::texture::TexturePoint;
use crate::scene::{FloatTextureId, Material, MaterialId, MaterialKind, RgbTextureId, Scene, Textures};
use blinn::Blinn;
use coat::Coat;
use coated_conductor::CoatedConductor;
use coated_diffuse::CoatedDiffuse;
use conductor::Conductor;
use dielectric::{Dielectric, ThinDielectric, TintedDielectric};
use diffuse::Diffuse;
use frame::Frame;
use fresnel_blend::FresnelBlend;
use gloss::{FacetFresnel, Facets, Gloss};
use measured::Measured;
use microfacet::Ggx;
use mirror::Mirror;
use oren_nayar::OrenNayar;
pub use plain::{Evaluated, Plain, PlainSurfaces, Scattered};
use sum::{Straight, Sum};

/// Cosines below this are lost in the rounding of the change of frame, and so is the side of the
/// surface; such directions scatter nothing.
const HORIZON: f32 = 1e-6;

/// Mixes nested deeper than this are taken for a circle.
const MAX_MIX_DEPTH: usize = 64;

/// A direction drawn from a BSDF.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Unit, away from the surface; in render space.
    pub wi: Vec3,
    /// f |cos| / pdf, of the part that was drawn if it is specular.
    pub weight: Vec3,
    /// Per steradian; 0 for specular samples.
    pub pdf: f32,
    pub specular: bool,
    /// Whether light changes sides of the surface.
    pub transmission: bool,
    /// Index of refraction of `wi`'s side over `wo`'s if it was refracted; else 1.
    pub eta: f32,
}

impl BsdfSample {
    fn glossy(wi: Vec3, weight: Vec3, pdf: f32) -> Self {
        Self { wi, weight, pdf, specular: false, transmission: false, eta: 1.0 }
    }

    fn specular(wi: Vec3, weight: Vec3) -> Self {
        Self { wi, weight, pdf: 0.0, specular: true, transmission: false, eta: 1.0 }
    }
}

/// A scattering model in its local frame, z along the shading normal. Directions are unit, not on
/// the horizon, and on either side.
///
/// `sample` draws what `pdf` says, and its `weight` is `eval / pdf`, wherever it is not specular.
trait Scatter {
    /// f |cos wi|, specular parts excluded.
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3;
    /// Density per steradian of non-specular samples.
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32;
    /// `None` where the numbers lead nowhere (below the surface, or nothing scatters).
    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample>;
    /// Whether there are only specular parts.
    fn is_specular(&self) -> bool;
    /// Estimate of the share of light from `wo` that is scattered.
    fn albedo(&self, wo: Vec3) -> Vec3;
}

#[derive(Clone, Copy, Debug)]
enum Lobe<'s> {
    Diffuse(Diffuse),
    OrenNayar(OrenNayar),
    Mirror(Mirror),
    Conductor(Conductor),
    Dielectric(Dielectric),
    ThinDielectric(ThinDielectric),
    CoatedDiffuse(CoatedDiffuse),
    CoatedConductor(CoatedConductor),
    FresnelBlend(FresnelBlend),
    Gloss(Gloss),
    Sum(Sum),
    Measured(Measured<'s>),
}

/// What a lobe of any kind gives; without a virtual call, so that it can be inlined.
macro_rules! of_lobe {
    ($lobe:expr, $name:ident => $value:expr) => {
        match $lobe {
            Lobe::Diffuse($name) => $value,
            Lobe::OrenNayar($name) => $value,
            Lobe::Mirror($name) => $value,
            Lobe::Conductor($name) => $value,
            Lobe::Dielectric($name) => $value,
            Lobe::ThinDielectric($name) => $value,
            Lobe::CoatedDiffuse($name) => $value,
            Lobe::CoatedConductor($name) => $value,
            Lobe::FresnelBlend($name) => $value,
            Lobe::Gloss($name) => $value,
            Lobe::Sum($name) => $value,
            Lobe::Measured($name) => $value,
        }
    };
}

impl<'s> Lobe<'s> {
    /// The lobe of a material that is no mix; `None` for one that light passes unchanged.
    fn of(kind: &'s MaterialKind, values: &Values) -> Option<Self> {
        Some(match *kind {
            MaterialKind::Diffuse { reflectance } => {
                Lobe::Diffuse(Diffuse { reflectance: values.colour(reflectance), transmittance: Vec3::ZERO })
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => Lobe::Diffuse(Diffuse {
                reflectance: values.colour(reflectance),
                transmittance: values.colour(transmittance),
            }),
            MaterialKind::OrenNayar { reflectance, sigma } => {
                Lobe::OrenNayar(OrenNayar::new(values.colour(reflectance), values.float(sigma)))
            }
            MaterialKind::Mirror { reflectance } => {
                Lobe::Mirror(Mirror { reflectance: values.colour(reflectance) })
            }
            MaterialKind::Conductor { metal, roughness } => values.metal(metal, roughness),
            MaterialKind::Dielectric { eta, roughness } => {
                Lobe::Dielectric(Dielectric { eta: usable_eta(eta), ggx: values.ggx(roughness) })
            }
            MaterialKind::ThinDielectric { eta } => {
                Lobe::ThinDielectric(ThinDielectric { eta: usable_eta(eta) })
            }
            MaterialKind::CoatedDiffuse { reflectance, eta, roughness } => {
                let coat = Coat::new(usable_eta(eta), values.ggx(roughness));
                Lobe::CoatedDiffuse(CoatedDiffuse::new(coat, values.colour(reflectance)))
            }
            MaterialKind::CoatedConductor { metal, conductor_roughness, eta, interface_roughness } => {
                let coat = Coat::new(usable_eta(eta), values.ggx(interface_roughness));
                let base = values.conductor(metal, conductor_roughness);
                Lobe::CoatedConductor(CoatedConductor::new(coat, base))
            }
            MaterialKind::FresnelBlend { diffuse, specular, roughness } => Lobe::FresnelBlend(FresnelBlend {
                diffuse: values.colour(diffuse),
                specular: values.colour(specular),
                facets: values.facets(roughness),
            }),
            MaterialKind::Additive(ref parts) => Lobe::Sum(values.sum(parts)),
            MaterialKind::Measured(ref table) => Lobe::Measured(Measured { table }),
            MaterialKind::Interface | MaterialKind::Mix { .. } => return None,
        })
    }
}

/// A material's textures at one point.
struct Values<'t> {
    textures: &'t Textures,
    at: TexturePoint,
}

impl Values<'_> {
    /// A reflectance: within [0, 1], and 0 for what is not a number.
    fn colour(&self, id: RgbTextureId) -> Vec3 {
        self.textures.rgb(id, self.at).map(|v| bounded(v, 1.0))
    }

    fn float(&self, id: FloatTextureId) -> f32 {
        self.textures.float(id, self.at)
    }

    fn ggx(&self, roughness: Roughness) -> Ggx {
        let alpha = |id| roughness.scale.alpha(self.float(id));
        Ggx::new(alpha(roughness.u), alpha(roughness.v))
    }

    /// Microfacets that are never smooth, by the dialect's distribution.
    fn facets(&self, roughness: Roughness) -> Facets {
        if roughness.scale == RoughnessScale::InverseExponent {
            Facets::Blinn(Blinn::new(self.float(roughness.u).recip(), self.float(roughness.v).recip()))
        } else {
            let alpha = |id| roughness.scale.alpha(self.float(id));
            Facets::Ggx(Ggx::rough(alpha(roughness.u), alpha(roughness.v)))
        }
    }

    /// A metal by the dialect's distribution.
    fn metal(&self, metal: Metal, roughness: Roughness) -> Lobe<'static> {
        if roughness.scale != RoughnessScale::InverseExponent {
            return Lobe::Conductor(self.conductor(metal, roughness));
        }
        let (eta, k) = self.indices(metal);
        Lobe::Gloss(Gloss {
            reflectance: Vec3::ONE,
            transmittance: Vec3::ZERO,
            facets: self.facets(roughness),
            fresnel: FacetFresnel::Conductor { eta, k },
        })
    }

    fn sum(&self, parts: &Additive) -> Sum {
        let colour = |id: Option<RgbTextureId>| id.map_or(Vec3::ZERO, |id| self.colour(id));
        let opacity = parts.opacity.map_or(Vec3::ONE, |id| self.colour(id));
        let straight = Vec3::ONE - opacity;
        let lit = |colours: [Vec3; 2]| colours.map(|colour| colour * opacity);
        let some = |colours: [Vec3; 2]| colours != [Vec3::ZERO; 2];
        let [reflectance, transmittance] = lit(parts.diffuse.map(colour));
        let diffuse = some([reflectance, transmittance]).then_some(Diffuse { reflectance, transmittance });
        let gloss = parts.gloss.and_then(|gloss| {
            let [reflectance, transmittance] = lit(gloss.colours.map(colour));
            some([reflectance, transmittance]).then(|| Gloss {
                reflectance,
                transmittance,
                facets: self.facets(gloss.roughness),
                fresnel: FacetFresnel::Dielectric(gloss.eta),
            })
        });
        let dielectric = parts.dielectric.and_then(|boundary| {
            let [reflected, transmitted] = lit(boundary.colours.map(colour));
            some([reflected, transmitted]).then(|| {
                let ggx = self.ggx(boundary.roughness);
                let boundary = Dielectric { eta: usable_eta(boundary.eta), ggx };
                TintedDielectric { boundary, reflected, transmitted }
            })
        });
        let straight = (straight != Vec3::ZERO).then_some(Straight(straight));
        Sum { diffuse, gloss, dielectric, straight }
    }

    fn conductor(&self, metal: Metal, roughness: Roughness) -> Conductor {
        let (eta, k) = self.indices(metal);
        Conductor { eta, k, ggx: self.ggx(roughness) }
    }

    /// Complex index of refraction.
    fn indices(&self, metal: Metal) -> (Vec3, Vec3) {
        // Far beyond any metal; keeps squares finite.
        const MAX_INDEX: f32 = 1e4;
        let index = |id| self.textures.rgb(id, self.at).map(|v| bounded(v, MAX_INDEX));
        match metal {
            Metal::Fresnel { eta, k } => (index(eta), index(k)),
            Metal::Reflectance(r) => (Vec3::ONE, fresnel::absorption_of_reflectance(self.colour(r))),
        }
    }
}

/// The value brought into [0, `max`]; 0 for what is not a number.
fn bounded(value: f32, max: f32) -> f32 {
    if value > 0.0 { value.min(max) } else { 0.0 }
}

/// The index of refraction, or 1 (no boundary) where it makes no sense, as pbrt-v4 does for 0.
fn usable_eta(eta: f32) -> f32 {
    if eta.is_normal() && eta > 0.0 { eta } else { 1.0 }
}

/// How a surface scatters light at a point. Directions are unit, in render space, and point away
/// from the surface.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<'s> {
    frame: Frame,
    lobe: Lobe<'s>,
    /// As given to [`Bsdf::new`], local.
    wo: Vec3,
}

impl<'s> Bsdf<'s> {
    /// Evaluates the material's textures at the point. `None` for materials that light passes
    /// unchanged ([`MaterialKind::Interface`]). `u_mix` in [0, 1) decides mixes; `wo` is the
    /// direction that [`Self::albedo`] is seen from.
    #[inline]
    pub fn new(
        scene: &'s Scene,
        material: MaterialId,
        point: &SurfacePoint,
        wo: Vec3,
        u_mix: f32,
    ) -> Option<Bsdf<'s>> {
        let textures = &scene.textures;
        let at = TexturePoint { uv: point.uv, position: point.position };
        let amount = |id| textures.float(id, at);
        let material = unmixed(&scene.materials, material, u_mix, amount)?;
        let lobe = Lobe::of(&material.kind, &Values { textures, at })?;
        let frame = shading_frame::of(textures, material, point);
        Some(Bsdf { frame, lobe, wo: frame.to_local(wo) })
    }

    /// f |cos wi|, specular parts excluded. Radiance travels from `wi` to `wo`.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.eval_and_pdf(wo, wi).0
    }

    /// Density, per steradian, of [`Self::sample`]'s non-specular directions.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_and_pdf(wo, wi).1
    }

    /// [`Self::eval`] and [`Self::pdf`], which have much in common.
    #[inline]
    pub fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let (wo, wi) = (self.frame.to_local(wo), self.frame.to_local(wi));
        if on_horizon(wo) || on_horizon(wi) {
            (Vec3::ZERO, 0.0)
        } else {
            of_lobe!(&self.lobe, lobe => (lobe.eval(wo, wi), lobe.pdf(wo, wi)))
        }
    }

    /// Draws a direction by `u_lobe` (which part) and `u` (where), all in [0, 1); `None` where
    /// they lead nowhere, which is an estimate of zero.
    #[inline]
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wo = self.frame.to_local(wo);
        if on_horizon(wo) {
            return None;
        }
        let sample = of_lobe!(&self.lobe, lobe => lobe.sample(wo, u_lobe, u))?;
        let reachable = !on_horizon(sample.wi) && (sample.specular || sample.pdf > 0.0);
        reachable.then(|| BsdfSample { wi: self.frame.to_render(sample.wi).normalize(), ..sample })
    }

    /// Whether nothing but specular parts scatters, so that [`Self::eval`] is always zero.
    #[inline]
    pub fn is_specular(&self) -> bool {
        of_lobe!(&self.lobe, lobe => lobe.is_specular())
    }

    /// Whether light from one side may be scattered to the other.
    #[inline]
    pub fn transmits(&self) -> bool {
        match self.lobe {
            Lobe::Diffuse(lobe) => lobe.transmittance != Vec3::ZERO,
            Lobe::Dielectric(_) | Lobe::ThinDielectric(_) => true,
            Lobe::Gloss(lobe) => lobe.transmittance != Vec3::ZERO,
            Lobe::Sum(lobe) => lobe.transmits(),
            Lobe::OrenNayar(_)
            | Lobe::Mirror(_)
            | Lobe::Conductor(_)
            | Lobe::CoatedDiffuse(_)
            | Lobe::CoatedConductor(_)
            | Lobe::FresnelBlend(_)
            | Lobe::Measured(_) => false,
        }
    }

    /// What the eye would call the surface's reflectance, in [0, 1]: a feature for the denoiser.
    /// Reflected and transmitted light count; 1 for mirrors and glass.
    pub fn albedo(&self) -> Vec3 {
        if self.is_specular() {
            return Vec3::ONE;
        }
        of_lobe!(&self.lobe, lobe => lobe.albedo(self.wo)).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Unit normal after bump or normal map, in the geometric normal's hemisphere.
    #[inline]
    pub fn shading_normal(&self) -> Vec3 {
        self.frame.z
    }
}

#[inline(always)]
fn on_horizon(w: Vec3) -> bool {
    w.z.is_nan() || w.z.abs() <= HORIZON
}

/// Follows mixes to a material that is none, as pbrt-v4's `MixMaterial` does, but with one number
/// for all of them: what a choice leaves of it is spread over [0, 1) again for the next. `None` if
/// mixes go in a circle.
fn unmixed(
    materials: &[Material],
    mut id: MaterialId,
    mut u: f32,
    amount_of: impl Fn(FloatTextureId) -> f32,
) -> Option<&Material> {
    for _ in 0..MAX_MIX_DEPTH {
        let material = &materials[id.0 as usize];
        let MaterialKind::Mix { first, second, amount } = material.kind else { return Some(material) };
        let amount = amount_of(amount);
        if u < amount {
            (id, u) = (second, u / amount.min(1.0));
        } else {
            let amount = amount.max(0.0);
            (id, u) = (first, (u - amount) / (1.0 - amount));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(kind: MaterialKind) -> Material {
        Material { name: String::new(), kind, displacement: None, normal_map: None }
    }

    fn mix(first: u32, second: u32, amount: u32) -> Material {
        let (first, second, amount) = (MaterialId(first), MaterialId(second), FloatTextureId(amount));
        material(MaterialKind::Mix { first, second, amount })
    }

    fn glass(eta: f32) -> Material {
        material(MaterialKind::ThinDielectric { eta })
    }

    fn eta_of(material: Option<&Material>) -> f32 {
        match material.map(|m| &m.kind) {
            Some(MaterialKind::ThinDielectric { eta }) => *eta,
            other => panic!("not one of the test's materials: {other:?}"),
        }
    }

    #[test]
    fn a_mix_of_mixes_takes_each_material_in_its_share() {
        // A quarter of 3; of the rest, half each of 1 and 2.
        let materials = [mix(1, 4, 0), mix(2, 3, 1), glass(1.0), glass(2.0), glass(3.0)];
        let amount = |id: FloatTextureId| [0.25, 0.5][id.0 as usize];
        let mut counts = [0; 4];
        for i in 0..1000 {
            let u = (i as f32 + 0.5) / 1000.0;
            counts[eta_of(unmixed(&materials, MaterialId(0), u, amount)) as usize] += 1;
        }
        assert!((counts[3] - 250i32).abs() <= 1 && (counts[1] - 375i32).abs() <= 1, "{counts:?}");
    }

    #[test]
    fn amounts_beyond_their_range_choose_one_material() {
        let materials = [mix(1, 2, 0), glass(1.0), glass(2.0)];
        for (amount, expected) in [(-1.0, 1.0), (0.0, 1.0), (f32::NAN, 1.0), (1.0, 2.0), (7.0, 2.0)] {
            for u in [0.0, 0.5, 1.0 - f32::EPSILON] {
                assert_eq!(eta_of(unmixed(&materials, MaterialId(0), u, |_| amount)), expected);
            }
        }
    }

    #[test]
    fn mixes_in_a_circle_end() {
        let materials = [mix(1, 1, 0), mix(0, 0, 0)];
        assert!(unmixed(&materials, MaterialId(0), 0.3, |_| 0.5).is_none());
    }

    #[test]
    fn a_tilted_surface_scatters_in_its_own_frame() {
        let normal = Vec3::new(1.0, -2.0, 0.5).normalize();
        let lobe = Lobe::ThinDielectric(ThinDielectric { eta: 1.5 });
        let wo = Vec3::new(0.8, 0.0, 0.6);
        let bsdf = Bsdf { frame: Frame::new(normal, Vec3::X), lobe, wo };
        let reflected = bsdf.sample(wo, 0.0, Vec2::ZERO).expect("a pane always scatters");
        let expected = normal * (2.0 * normal.dot(wo)) - wo;
        assert!((reflected.wi - expected).length() < 1e-6);
        assert!(bsdf.shading_normal() == normal && bsdf.albedo() == Vec3::ONE && bsdf.is_specular());
    }

    #[test]
    fn directions_along_the_surface_scatter_nothing() {
        let white = Diffuse { reflectance: Vec3::ONE, transmittance: Vec3::ZERO };
        let bsdf = Bsdf { frame: Frame::new(Vec3::Z, Vec3::X), lobe: Lobe::Diffuse(white), wo: Vec3::Z };
        assert_eq!(bsdf.eval(Vec3::X, Vec3::Z), Vec3::ZERO);
        assert_eq!(bsdf.pdf(Vec3::Z, Vec3::X), 0.0);
        assert!(bsdf.sample(Vec3::X, 0.5, Vec2::splat(0.5)).is_none());
        assert!((bsdf.eval(Vec3::Z, Vec3::Z).x - std::f32::consts::FRAC_1_PI).abs() < 1e-7);
    }
}
