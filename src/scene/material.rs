//! What surfaces are made of, as data. BSDFs are made from it by the renderer.

use super::{FloatTextureId, RgbTextureId};

/// Index into [`super::Scene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u32);

/// A material: what scatters, and what bends the shading normal.
#[derive(Clone, Debug)]
pub struct Material {
    /// The scene's name for it; empty when it has none.
    pub name: String,
    pub kind: MaterialKind,
    /// Height in scene units, whose gradient bends the normal.
    pub displacement: Option<FloatTextureId>,
    /// Tangent-space normals, encoded in [0, 1].
    pub normal_map: Option<RgbTextureId>,
}

/// Roughness along the two tangent directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roughness {
    pub u: FloatTextureId,
    pub v: FloatTextureId,
    /// The value is pbrt's perceptual roughness: alpha = √roughness (v4). Otherwise it is alpha.
    pub remap: bool,
}

/// Complex index of refraction by RGB, or the reflectance at normal incidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Metal {
    Fresnel { eta: RgbTextureId, k: RgbTextureId },
    Reflectance(RgbTextureId),
}

/// The scattering models of pbrt-v4, and `None` for invisible boundaries.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// Lambertian reflection.
    Diffuse { reflectance: RgbTextureId },
    /// Lambertian reflection and transmission.
    DiffuseTransmission { reflectance: RgbTextureId, transmittance: RgbTextureId },
    /// GGX microfacet conductor.
    Conductor { metal: Metal, roughness: Roughness },
    /// GGX microfacet dielectric that reflects and refracts.
    Dielectric { eta: f32, roughness: Roughness },
    /// A pane without thickness: reflects and lets straight through.
    ThinDielectric { eta: f32 },
    /// Diffuse base under a dielectric coat.
    CoatedDiffuse { reflectance: RgbTextureId, eta: f32, roughness: Roughness },
    /// Conductor under a dielectric coat.
    CoatedConductor { metal: Metal, conductor_roughness: Roughness, eta: f32, interface_roughness: Roughness },
    /// `amount` of the second, the rest of the first.
    Mix { first: super::MaterialId, second: super::MaterialId, amount: FloatTextureId },
    /// A boundary that light passes unchanged.
    Interface,
}
