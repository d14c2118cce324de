//! Checks of a whole scene.

use super::ValidationError;
use super::camera::{check_camera, check_film};
use super::lights::check_lights;
use super::materials::check_materials;
use super::shapes::{check_objects, check_primitives};
use super::textures::check_textures;
use super::values::{finite_point, require};
use crate::scene::Scene;
use crate::scene::integrator::MAX_DEPTH;

impl Scene {
    /// Checks a scene that was built in memory. The reader of [`crate::scene::pbrt`] reports such
    /// problems itself, at their location in the file.
    ///
    /// The check takes time proportional to the size of the meshes and images.
    ///
    /// # Errors
    /// Names the first field with which rendering would panic or compute non-finite colours: an index
    /// out of range, a number that is not finite or has the wrong sign, an empty film or image, or a
    /// cycle of textures.
    pub fn validate(&self) -> Result<(), ValidationError> {
        finite_point(self.origin, || "origin".into())?;
        check_camera(&self.camera)?;
        check_film(&self.film)?;
        let depth = self.integrator.max_depth();
        require(depth <= MAX_DEPTH, || "integrator.max_depth".into(), depth, "at most 2^20")?;
        require(self.spp > 0, || "spp".into(), self.spp, "at least 1")?;
        check_textures(&self.textures)?;
        check_materials(self)?;
        check_objects(self)?;
        check_primitives(self)?;
        check_lights(&self.lights, &self.textures)
    }
}
