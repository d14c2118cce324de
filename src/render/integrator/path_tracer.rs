//! The path tracer's view of a scene: accelerated geometry, lights, and properties of its materials.

use std::sync::Arc;

use super::termination::{ROULETTE_DEPTH, Termination};
use crate::geometry::{Accel, SurfaceInteraction};
use crate::render::bsdf::SimdMaterial;
use crate::render::lights::Lights;
use crate::render::sampler::{Dimensions, RequiredDimensions};
use crate::scene::{Effects, Integrator, MaterialTraits, Primitive, Scene, Shape};
use crate::stats::{Block, Layout};

/// Interfaces that a ray passes at most. No scene nests as many; the limit ends rays that meet overlapping
/// surfaces again and again because of rounding.
pub(super) const MAX_INTERFACES: u32 = 256;

/// Traces paths through one scene.
pub struct PathTracer<'s> {
    pub(in crate::render) scene: &'s Scene,
    pub(in crate::render) accel: &'s Accel<'s>,
    pub(in crate::render) lights: Arc<Lights<'s>>,
    pub(super) dimensions: Dimensions,
    pub(super) termination: Termination,
    /// BSDFs are sampled: some paths have a second ray.
    pub(super) samples_bsdfs: bool,
    /// For each material, its traits.
    pub(super) material_traits: Vec<MaterialTraits>,
    /// For each material, its SIMD version, if it has one.
    pub(super) simd_materials: Vec<Option<SimdMaterial>>,
    /// For each primitive, whether it is shaded by its SIMD material.
    pub(super) has_simd_material: Vec<bool>,
    /// Some surface is an interface, which transmits light unchanged.
    pub(super) has_interfaces: bool,
    /// Some surface is an interface, or a mix that may choose one: paths may pass their last hit.
    pub(super) may_pass_surfaces: bool,
    pub(super) records_albedo: bool,
    pub(super) inverse_diameter: f32,
}

impl<'s> PathTracer<'s> {
    /// Prepares to trace paths whose samples have the given layout, which is that of `effects`.
    pub fn new(
        scene: &'s Scene,
        accel: &'s Accel<'s>,
        lights: Arc<Lights<'s>>,
        effects: &Effects,
        layout: &Layout,
    ) -> Self {
        // Find out which paths are traced
        let (max_depth, direct_only) = match scene.integrator {
            Integrator::Path { max_depth } => (max_depth, false),
            Integrator::Direct { max_depth } => (max_depth, true),
        };
        let scatters_again = max_depth > 1 && (!direct_only || effects.specular);
        let samples_bsdfs = scatters_again || effects.second_hit || lights.can_be_hit();
        let is_recorded = |block| layout.block(block).is_some();
        let termination = Termination {
            max_depth,
            direct_only,
            lights_are_hit: lights.can_be_hit(),
            records_second_hit: is_recorded(Block::Position2) || is_recorded(Block::Normal2),
        };

        // Allot the dimensions of the sampler
        let material_traits: Vec<_> =
            scene.materials.iter().map(|material| MaterialTraits::new(&scene.textures, material)).collect();
        let some_material = |has: fn(&MaterialTraits) -> bool| material_traits.iter().any(has);
        let dimensions = Dimensions::new(&RequiredDimensions {
            lens: effects.lens,
            time: effects.motion,
            light_choice: lights.needs_choice(),
            light_uv: effects.extended_lights,
            lobe: some_material(|traits| traits.chooses_lobe),
            bsdf_uv: samples_bsdfs,
            mix: some_material(|traits| traits.is_mix),
            roulette: !direct_only && max_depth >= ROULETTE_DEPTH,
        });

        // Find out whether paths may pass surfaces
        let some_surface = |has: fn(&MaterialTraits) -> bool| {
            scene.primitives.iter().any(|primitive| has(&material_traits[primitive.material.0 as usize]))
        };
        let has_interfaces = some_surface(|traits| traits.is_interface);
        let may_pass_surfaces = has_interfaces
            || some_surface(|traits| traits.is_mix) && some_material(|traits| traits.is_interface);

        // Find the SIMD versions of materials
        let simd_materials: Vec<_> =
            scene.materials.iter().map(|material| SimdMaterial::new(&scene.textures, material)).collect();
        // Texture coordinates are computed in lanes for meshes only, and emission from an image for no shape.
        let has_simd_material = |primitive: &Primitive| {
            if primitive.area_light.is_some_and(|light| light.image.is_some()) {
                return false;
            }
            let material = simd_materials[primitive.material.0 as usize];
            material
                .is_some_and(|material| material.is_constant() || matches!(primitive.shape, Shape::Mesh(_)))
        };

        Self {
            scene,
            accel,
            lights,
            dimensions,
            termination,
            samples_bsdfs,
            has_simd_material: scene.primitives.iter().map(has_simd_material).collect(),
            simd_materials,
            has_interfaces,
            may_pass_surfaces,
            material_traits,
            records_albedo: is_recorded(Block::Albedo),
            inverse_diameter: 1.0 / diameter(accel),
        }
    }

    /// Returns the purposes of the sampler's dimensions.
    pub fn dimensions(&self) -> &Dimensions {
        &self.dimensions
    }

    /// Returns the length that recorded positions are divided by, in scene units.
    pub fn diameter(&self) -> f32 {
        1.0 / self.inverse_diameter
    }

    /// Returns the index of a primitive's material.
    #[inline]
    pub(super) fn material(&self, primitive: u32) -> u32 {
        self.scene.primitives[primitive as usize].material.0
    }

    /// Returns whether a surface transmits light unchanged. A mix with an interface is none.
    #[inline]
    pub(super) fn is_interface(&self, point: &SurfaceInteraction) -> bool {
        let material = self.material(point.primitive);
        self.material_traits[material as usize].is_interface
    }
}

/// Returns the diagonal of the scene's bounds; 1 for a scene without extent.
fn diameter(accel: &Accel) -> f32 {
    let diagonal = accel.bounds().map_or(0.0, |(min, max)| (max - min).length());
    if diagonal > 0.0 && diagonal.is_finite() { diagonal } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::render::sample_layout::sample_layout;
    use crate::scene::MaterialId;
    use crate::scene::pbrt::read_str;

    #[test]
    fn only_materials_of_surfaces_let_paths_pass() {
        let text = "WorldBegin MakeNamedMaterial \"nothing\" \"string type\" \"interface\"
            Material \"mix\" \"string materials\" [\"nothing\" \"nothing\"] Material \"diffuse\" Shape \"sphere\"";
        let mut scene = read_str(text, Path::new("")).unwrap();
        let [interface, mix, diffuse] = [1, 2, 3].map(MaterialId);
        for (material, expected) in
            [(diffuse, (false, false)), (mix, (false, true)), (interface, (true, true))]
        {
            scene.primitives[0].material = material;
            let accel = Accel::build(&scene);
            let effects = scene.effects();
            let layout = sample_layout(&effects);
            let tracer = PathTracer::new(&scene, &accel, Arc::new(Lights::new(&scene)), &effects, &layout);
            assert_eq!((tracer.has_interfaces, tracer.may_pass_surfaces), expected, "{material:?}");
        }
    }
}
