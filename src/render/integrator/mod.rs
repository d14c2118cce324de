//! Light transport by paths from the camera, with light sampling at every scattering event.
//!
//! One tracer serves both of a scene's integrators: `Path` follows a path until it has scattered
//! `max_depth` times; `Direct` ends it where it arrives from the first scattering event that is
//! not perfectly specular.

mod direct;
mod path;

use crate::geometry::{Accel, SurfacePoint};
use crate::scene::{Effects, Integrator, MaterialKind, Scene};
use crate::stats::{Block, Layout};

use super::lights::Lights;
use super::sampler::{Dimensions, Needs};

/// Traces paths through one scene. See the module.
pub struct PathTracer<'s> {
    scene: &'s Scene,
    accel: &'s Accel<'s>,
    lights: Lights<'s>,
    dimensions: Dimensions,
    max_depth: u32,
    /// Light arrives by one scattering event that is not perfectly specular.
    direct_only: bool,
    /// Paths go on from where they scatter.
    follows: bool,
    /// Some material lets light pass unchanged.
    has_interfaces: bool,
    records_albedo: bool,
    records_second_hit: bool,
    /// Numbers of the first hit are recorded, and so have to be made even if there is none.
    records_numbers: bool,
    inverse_diameter: f32,
}

impl<'s> PathTracer<'s> {
    /// `effects`: what `layout` was made for.
    pub fn new(scene: &'s Scene, accel: &'s Accel<'s>, effects: &Effects, layout: &Layout) -> Self {
        let diameter = diameter(accel);
        let lights = Lights::new(scene);
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
            roulette: !direct_only && max_depth >= path::ROULETTE_DEPTH,
        };
        let alive = |block| layout.block(block).is_some();
        Self {
            scene,
            accel,
            dimensions: Dimensions::new(&needs),
            max_depth,
            direct_only,
            follows,
            has_interfaces: some_material(|kind| matches!(kind, MaterialKind::Interface)),
            records_albedo: alive(Block::Albedo),
            records_second_hit: alive(Block::Position2),
            records_numbers: alive(Block::Light1) || alive(Block::Bsdf1),
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

    fn is_interface(&self, point: &SurfacePoint) -> bool {
        let material = self.scene.primitives[point.primitive as usize].material;
        matches!(self.scene.materials[material.0 as usize].kind, MaterialKind::Interface)
    }
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
