//! BSDFs: the scattering of light by a surface at a point, after its textures have been evaluated.
//!
//! Takes a material, a point and directions in render space; gives values, densities per solid angle and sampled
//! directions. The models and their conventions are pbrt-v4's (Pharr, Jakob, Humphreys, *Physically Based
//! Rendering*, 4th edition, chapters 9, 10 and 14), except for layered materials, which have a deterministic
//! closed form instead of a random walk (`coat`). As in pbrt, the shading normal distinguishes reflection from
//! transmission, and rough lobes do not compensate for multiple scattering between microfacets.
//!
//! A scattering model (`Bxdf`) holds evaluated parameters and works in its local frame. [`Bsdf`] adds the frame;
//! [`SimdBsdfs`] evaluates and samples the most frequent models in SIMD.

mod any_bxdf;
mod blinn;
mod bsdf_sample;
mod bsdf_values;
mod bump_mapping;
mod bxdf;
mod bxdf_sum;
mod clamp;
mod coat;
mod coated_conductor;
mod coated_diffuse;
mod conductor;
mod dielectric;
mod diffuse;
mod directions;
mod fresnel;
mod fresnel_blend;
mod ggx;
mod interface_table;
mod material_evaluator;
mod measured;
mod microfacet_distribution;
mod microfacet_lobe;
mod mirror;
mod mix_material;
mod null_transmission;
mod oren_nayar;
mod shading_frame;
mod simd_bsdfs;
mod simd_kernels;
mod simd_material;
#[cfg(test)]
mod statistical_tests;
mod thin_dielectric;
mod tinted_dielectric;

use glam::{Vec2, Vec3};

use self::any_bxdf::{AnyBxdf, with_bxdf};
pub use self::bsdf_sample::{BsdfSample, BsdfSamples};
pub use self::bsdf_values::BsdfValues;
use self::bump_mapping::bumped_shading_frame;
use self::bxdf::Bxdf;
use self::directions::on_horizon;
use self::material_evaluator::MaterialEvaluator;
use self::mix_material::choose_material;
use self::shading_frame::ShadingFrame;
pub use self::simd_bsdfs::SimdBsdfs;
pub use self::simd_material::SimdMaterial;
use crate::geometry::SurfaceInteraction;
use crate::scene::texture::TexturePoint;
use crate::scene::{MaterialId, Scene};

/// The scattering of light by a surface at a point. Directions are unit, in render space, and point away from the
/// surface.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<'s> {
    frame: ShadingFrame,
    bxdf: AnyBxdf<'s>,
    /// As given to [`Bsdf::new`], in the shading frame.
    wo: Vec3,
}

impl<'s> Bsdf<'s> {
    /// Evaluates a material's textures at a point. `u_mix` in [0, 1) resolves mixes; `wo` is the outgoing direction
    /// of [`Self::albedo`].
    ///
    /// `None` for materials that transmit light unchanged ([`crate::scene::MaterialKind::Interface`]).
    #[inline]
    pub fn new(
        scene: &'s Scene,
        material: MaterialId,
        point: &SurfaceInteraction,
        wo: Vec3,
        u_mix: f32,
    ) -> Option<Bsdf<'s>> {
        let textures = &scene.textures;
        let at = TexturePoint { uv: point.uv, position: point.position };
        let amount = |id| textures.float(id, at);
        let material = choose_material(&scene.materials, material, u_mix, amount)?;
        let bxdf = MaterialEvaluator { textures, at }.bxdf(&material.kind)?;
        let frame = bumped_shading_frame(textures, material, point);
        Some(Bsdf { frame, bxdf, wo: frame.to_local(wo) })
    }

    /// f |cos wi|, without specular lobes. Radiance travels from `wi` to `wo`.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.eval_and_pdf(wo, wi).0
    }

    /// Density per solid angle of [`Self::sample`], without specular lobes.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_and_pdf(wo, wi).1
    }

    /// [`Self::eval`] and [`Self::pdf`].
    #[inline]
    pub fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let (wo, wi) = (self.frame.to_local(wo), self.frame.to_local(wi));
        if on_horizon(wo) || on_horizon(wi) {
            (Vec3::ZERO, 0.0)
        } else {
            with_bxdf!(&self.bxdf, bxdf => bxdf.eval_and_pdf(wo, wi))
        }
    }

    /// Samples a direction: `u_lobe` chooses the lobe and `u` the direction, all in [0, 1). `None` if nothing is
    /// scattered, which is an estimate of zero.
    #[inline]
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wo = self.frame.to_local(wo);
        if on_horizon(wo) {
            return None;
        }
        let sample = with_bxdf!(&self.bxdf, bxdf => bxdf.sample(wo, u_lobe, u))?;
        let is_valid = !on_horizon(sample.wi) && (sample.specular || sample.pdf > 0.0);
        is_valid.then(|| BsdfSample { wi: self.frame.to_render(sample.wi).normalize(), ..sample })
    }

    /// Whether all lobes are specular, so that [`Self::eval`] is always zero.
    #[inline]
    pub fn is_specular(&self) -> bool {
        with_bxdf!(&self.bxdf, bxdf => bxdf.is_specular())
    }

    /// Whether some lobe that is not specular scatters light to the other side of the surface, if not all are specular.
    #[inline]
    pub fn transmits(&self) -> bool {
        with_bxdf!(&self.bxdf, bxdf => bxdf.transmits())
    }

    /// Estimate of the fraction of light from `wo` that is reflected or transmitted, in [0, 1]: a feature for the
    /// denoiser. It is 1 for specular surfaces.
    pub fn albedo(&self) -> Vec3 {
        if self.is_specular() {
            return Vec3::ONE;
        }
        with_bxdf!(&self.bxdf, bxdf => bxdf.albedo(self.wo)).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Unit normal after bump or normal mapping, in the geometric normal's hemisphere.
    #[inline]
    pub fn shading_normal(&self) -> Vec3 {
        self.frame.z
    }
}

#[cfg(test)]
mod tests {
    use super::diffuse::Diffuse;
    use super::thin_dielectric::ThinDielectric;
    use super::*;

    #[test]
    fn a_tilted_surface_scatters_in_its_own_frame() {
        let normal = Vec3::new(1.0, -2.0, 0.5).normalize();
        let bxdf = AnyBxdf::ThinDielectric(ThinDielectric { eta: 1.5 });
        let wo = Vec3::new(0.8, 0.0, 0.6);
        let bsdf = Bsdf { frame: ShadingFrame::new(normal, Vec3::X), bxdf, wo };
        let reflected = bsdf.sample(wo, 0.0, Vec2::ZERO).expect("a pane always scatters");
        let expected = normal * (2.0 * normal.dot(wo)) - wo;
        assert!((reflected.wi - expected).length() < 1e-6);
        assert!(bsdf.shading_normal() == normal && bsdf.albedo() == Vec3::ONE && bsdf.is_specular());
    }

    #[test]
    fn directions_on_the_horizon_scatter_nothing() {
        let white = Diffuse { reflectance: Vec3::ONE, transmittance: Vec3::ZERO };
        let frame = ShadingFrame::new(Vec3::Z, Vec3::X);
        let bsdf = Bsdf { frame, bxdf: AnyBxdf::Diffuse(white), wo: Vec3::Z };
        assert_eq!(bsdf.eval(Vec3::X, Vec3::Z), Vec3::ZERO);
        assert_eq!(bsdf.pdf(Vec3::Z, Vec3::X), 0.0);
        assert!(bsdf.sample(Vec3::X, 0.5, Vec2::splat(0.5)).is_none());
        assert!((bsdf.eval(Vec3::Z, Vec3::Z).x - std::f32::consts::FRAC_1_PI).abs() < 1e-7);
    }
}
