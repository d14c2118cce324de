//! Checks of materials.

use super::textures::{float_id, rgb_id};
use super::validation_error::Result;
use super::values::{index, positive};
use crate::scene::material::{Additive, Lobe, Metal, Roughness};
use crate::scene::{FloatTextureId, MaterialKind, RgbTextureId, Scene};

/// Checks the texture ids, indices of refraction and mixed materials of all materials.
pub fn check_materials(scene: &Scene) -> Result {
    for (i, material) in scene.materials.iter().enumerate() {
        let check = Check { scene, field: format!("materials[{i}]") };
        check.kind(&material.kind)?;
        if let Some(id) = material.displacement {
            check.float("displacement", id)?;
        }
        if let Some(id) = material.normal_map {
            check.rgb("normal_map", id)?;
        }
    }
    Ok(())
}

/// The checks of one material.
struct Check<'s> {
    scene: &'s Scene,
    /// Path of the material in the scene.
    field: String,
}

impl Check<'_> {
    fn kind(&self, kind: &MaterialKind) -> Result {
        match kind {
            // Diffuse and specular surfaces
            MaterialKind::Diffuse { reflectance } | MaterialKind::Mirror { reflectance } => {
                self.rgb("kind.reflectance", *reflectance)
            }
            MaterialKind::OrenNayar { reflectance, sigma } => {
                self.rgb("kind.reflectance", *reflectance)?;
                self.float("kind.sigma", *sigma)
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                self.rgb("kind.reflectance", *reflectance)?;
                self.rgb("kind.transmittance", *transmittance)
            }

            // Conductors and dielectrics
            MaterialKind::Conductor { metal, roughness } => {
                self.metal(metal)?;
                self.roughness("kind.roughness", roughness)
            }
            MaterialKind::Dielectric { eta, roughness } => {
                self.eta("kind.eta", *eta)?;
                self.roughness("kind.roughness", roughness)
            }
            MaterialKind::ThinDielectric { eta } => self.eta("kind.eta", *eta),

            // Layered surfaces
            MaterialKind::FresnelBlend { diffuse, specular, roughness } => {
                self.rgb("kind.diffuse", *diffuse)?;
                self.rgb("kind.specular", *specular)?;
                self.roughness("kind.roughness", roughness)
            }
            MaterialKind::CoatedDiffuse { reflectance, eta, roughness, thickness } => {
                self.rgb("kind.reflectance", *reflectance)?;
                self.float("kind.thickness", *thickness)?;
                self.eta("kind.eta", *eta)?;
                self.roughness("kind.roughness", roughness)
            }
            MaterialKind::CoatedConductor {
                metal,
                conductor_roughness,
                eta,
                interface_roughness,
                thickness,
            } => {
                self.metal(metal)?;
                self.float("kind.thickness", *thickness)?;
                self.roughness("kind.conductor_roughness", conductor_roughness)?;
                self.eta("kind.eta", *eta)?;
                self.roughness("kind.interface_roughness", interface_roughness)
            }

            // Sums, mixes and interfaces
            MaterialKind::Additive(additive) => self.additive(additive),
            MaterialKind::Mix { first, second, amount } => {
                let count = self.scene.materials.len();
                index(first.0 as usize, count, || format!("{}.kind.first", self.field))?;
                index(second.0 as usize, count, || format!("{}.kind.second", self.field))?;
                self.float("kind.amount", *amount)
            }
            MaterialKind::Measured(_) | MaterialKind::Interface => Ok(()),
        }
    }

    fn additive(&self, additive: &Additive) -> Result {
        for id in additive.diffuse.into_iter().flatten() {
            self.rgb("kind.diffuse", id)?;
        }
        for (name, layer) in [("kind.gloss", additive.gloss), ("kind.dielectric", additive.dielectric)] {
            let Some(Lobe { colours, eta, roughness }) = layer else { continue };
            for id in colours.into_iter().flatten() {
                self.rgb(name, id)?;
            }
            self.eta(name, eta)?;
            self.roughness(name, &roughness)?;
        }
        additive.opacity.map_or(Ok(()), |id| self.rgb("kind.opacity", id))
    }

    fn metal(&self, metal: &Metal) -> Result {
        match *metal {
            Metal::Fresnel { eta, k } => {
                self.rgb("kind.metal.eta", eta)?;
                self.rgb("kind.metal.k", k)
            }
            Metal::Reflectance(reflectance) => self.rgb("kind.metal.reflectance", reflectance),
        }
    }

    fn roughness(&self, name: &str, roughness: &Roughness) -> Result {
        self.float(name, roughness.u)?;
        self.float(name, roughness.v)
    }

    fn eta(&self, name: &str, eta: f32) -> Result {
        positive(eta, || format!("{}.{name}", self.field))
    }

    fn float(&self, name: &str, id: FloatTextureId) -> Result {
        float_id(&self.scene.textures, id, || format!("{}.{name}", self.field))
    }

    fn rgb(&self, name: &str, id: RgbTextureId) -> Result {
        rgb_id(&self.scene.textures, id, || format!("{}.{name}", self.field))
    }
}
