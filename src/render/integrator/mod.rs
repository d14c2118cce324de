//! Light transport by paths from the camera, with light sampling at every scattering event.
//!
//! One tracer serves both of a scene's integrators: `Path` follows a path until it has scattered
//! `max_depth` times; `Direct` ends it where it arrives from the first scattering event that is
//! not perfectly specular.

mod direct;
mod events;
mod flights;
mod path;
mod shade;

use std::sync::Arc;

use crate::geometry::{Accel, SurfacePoint};
use crate::scene::material::{Metal, Roughness};
use crate::scene::{Effects, Integrator, Material, MaterialKind, Primitive, Scene, Shape};
use crate::stats::{Block, Layout};

use self::events::Rules;
use super::bsdf::Plain;
use super::lights::Lights;
use super::sampler::{Dimensions, Needs};

pub use path::Wavefront;

/// Traces paths through one scene. See the module.
pub struct PathTracer<'s> {
    pub(super) scene: &'s Scene,
    pub(super) accel: &'s Accel<'s>,
    pub(super) lights: Arc<Lights<'s>>,
    dimensions: Dimensions,
    rules: Rules,
    /// Paths go on from where they scatter.
    follows: bool,
    /// For each material, whether it looks at texture coordinates or tangents.
    parametrised: Vec<bool>,
    /// For each material, what it is if it is plain.
    plain_materials: Vec<Option<Plain>>,
    /// For each primitive, whether it is shaded as plain.
    is_plain: Vec<bool>,
    /// Some material lets light pass unchanged.
    has_interfaces: bool,
    records_albedo: bool,
    inverse_diameter: f32,
}

impl<'s> PathTracer<'s> {
    /// `effects`: what `layout` was made for.
    pub fn new(
        scene: &'s Scene,
        accel: &'s Accel<'s>,
        lights: Arc<Lights<'s>>,
        effects: &Effects,
        layout: &Layout,
    ) -> Self {
        let diameter = diameter(accel);
        let (max_depth, direct_only) = match scene.integrator {
            Integrator::Path { max_depth } => (max_depth, false),
            Integrator::Direct { max_depth } => (max_depth, true),
        };
        let some_material = |is: fn(&MaterialKind) -> bool| scene.materials.iter().any(|m| is(&m.kind));
        let chains = max_depth > 1 && (!direct_only || effects.specular);
        let follows = chains || effects.second_hit || lights.found_by_rays();
        let needs = Needs {
            lens: effects.lens,
            time: effects.motion,
            light_choice: lights.need_choice(),
            light_uv: effects.extended_lights,
            lobe: some_material(has_lobes),
            bsdf_uv: follows,
            mix: some_material(|kind| matches!(kind, MaterialKind::Mix { .. })),
            roulette: !direct_only && max_depth >= events::ROULETTE_DEPTH,
        };
        let alive = |block| layout.block(block).is_some();
        let plain_materials: Vec<_> =
            scene.materials.iter().map(|material| Plain::of(&scene.textures, material)).collect();
        // Of other shapes, texture coordinates are not computed in lanes, and for light from an image of none.
        let is_plain = |primitive: &Primitive| {
            if primitive.area_light.is_some_and(|light| light.image.is_some()) {
                return false;
            }
            let plain = plain_materials[primitive.material.0 as usize];
            plain.is_some_and(|plain| plain.is_constant() || matches!(primitive.shape, Shape::Mesh(_)))
        };
        Self {
            scene,
            accel,
            dimensions: Dimensions::new(&needs),
            rules: Rules {
                max_depth,
                direct_only,
                lights_are_found: lights.found_by_rays(),
                records_second_hit: alive(Block::Position2),
            },
            follows,
            parametrised: scene.materials.iter().map(|m| is_parametrised(scene, m)).collect(),
            is_plain: scene.primitives.iter().map(is_plain).collect(),
            plain_materials,
            has_interfaces: some_material(|kind| matches!(kind, MaterialKind::Interface)),
            records_albedo: alive(Block::Albedo),
            inverse_diameter: 1.0 / diameter,
            lights,
        }
    }

    /// Where the numbers of a sample stand.
    pub fn dimensions(&self) -> &Dimensions {
        &self.dimensions
    }

    /// What recorded positions are divided by, in scene units.
    pub fn diameter(&self) -> f32 {
        1.0 / self.inverse_diameter
    }

    /// Index of a primitive's material.
    #[inline]
    fn material(&self, primitive: u32) -> u32 {
        self.scene.primitives[primitive as usize].material.0
    }

    fn is_interface(&self, point: &SurfacePoint) -> bool {
        let material = self.scene.primitives[point.primitive as usize].material;
        matches!(self.scene.materials[material.0 as usize].kind, MaterialKind::Interface)
    }
}

/// Whether the parametrisation of a surface makes a difference to how a material looks. It may say
/// so where it makes none.
fn is_parametrised(scene: &Scene, material: &Material) -> bool {
    let same_everywhere = |id| scene.textures.constant_rgb(id).is_some();
    let isotropic = |roughness: &Roughness| {
        let [u, v] = [roughness.u, roughness.v].map(|id| scene.textures.constant_float(id));
        u.is_some() && u == v
    };
    let plain = match &material.kind {
        MaterialKind::Diffuse { reflectance } => same_everywhere(*reflectance),
        MaterialKind::Conductor { metal, roughness } => {
            isotropic(roughness)
                && match metal {
                    Metal::Fresnel { eta, k } => same_everywhere(*eta) && same_everywhere(*k),
                    Metal::Reflectance(reflectance) => same_everywhere(*reflectance),
                }
        }
        MaterialKind::Dielectric { roughness, .. } => isotropic(roughness),
        MaterialKind::CoatedDiffuse { reflectance, roughness, .. } => {
            same_everywhere(*reflectance) && isotropic(roughness)
        }
        MaterialKind::ThinDielectric { .. } | MaterialKind::Interface => true,
        _ => false,
    };
    !plain || material.displacement.is_some() || material.normal_map.is_some()
}

/// Whether a number is needed to choose between parts of a BSDF.
fn has_lobes(kind: &MaterialKind) -> bool {
    match kind {
        MaterialKind::Diffuse { .. }
        | MaterialKind::OrenNayar { .. }
        | MaterialKind::Mirror { .. }
        | MaterialKind::Conductor { .. }
        | MaterialKind::Mix { .. }
        | MaterialKind::Interface => false,
        MaterialKind::DiffuseTransmission { .. }
        | MaterialKind::Dielectric { .. }
        | MaterialKind::ThinDielectric { .. }
        | MaterialKind::CoatedDiffuse { .. }
        | MaterialKind::CoatedConductor { .. }
        | MaterialKind::FresnelBlend { .. }
        | MaterialKind::Additive(_)
        | MaterialKind::Measured(_) => true,
    }
}

/// Diagonal of the scene's bounds; 1 for a scene without extent.
fn diameter(accel: &Accel) -> f32 {
    let diagonal = accel.bounds().map_or(0.0, |(min, max)| (max - min).length());
    if diagonal > 0.0 && diagonal.is_finite() { diagonal } else { 1.0 }
}
