//! Adds shapes to the scene: placement, material, alpha and area light.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::mesh_description::MeshDescription;
use crate::scene::material::MaterialKind;
use crate::scene::pbrt::builder::{AreaLightSource, SceneBuilder};
use crate::scene::pbrt::dialect::Dialect;
use crate::scene::pbrt::directives::objects::ShapePlacement;
use crate::scene::pbrt::lights::scale_light;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParameterType, ParseError, Result};
use crate::scene::shape::LARGEST_COORDINATE;
use crate::scene::texture::{FloatTextureId, Texture};
use crate::scene::{Disk, Primitive, Shape, Sphere};

impl SceneBuilder {
    /// `sphere`.
    pub fn sphere(&mut self, params: &ParameterDictionary) -> Result<()> {
        let radius = params.positive_or("radius", 1.0)?;
        let z_min = params.float_or("zmin", -radius)?.clamp(-radius, radius);
        let z_max = params.float_or("zmax", radius)?.clamp(-radius, radius);
        let phi_max = phi_max(params)?;
        self.add_shape(params, DVec3::ZERO, |to_object| {
            Shape::Sphere(Sphere {
                to_object,
                radius: radius as f32,
                z_min: z_min.min(z_max) as f32,
                z_max: z_min.max(z_max) as f32,
                phi_max,
            })
        })
    }

    /// `disk`.
    pub fn disk(&mut self, params: &ParameterDictionary) -> Result<()> {
        let radius = params.positive_or("radius", 1.0)?;
        let inner_radius = params.float_or("innerradius", 0.0)?.clamp(0.0, radius);
        let height = params.float_or("height", 0.0)?;
        let phi_max = phi_max(params)?;
        self.add_shape(params, DVec3::new(0.0, 0.0, height), |to_object| {
            Shape::Disk(Disk {
                to_object,
                height: height as f32,
                radius: radius as f32,
                inner_radius: inner_radius as f32,
                phi_max,
            })
        })
    }

    /// Adds an analytic shape; `reference` is a point on it, in its space.
    fn add_shape(
        &mut self,
        params: &ParameterDictionary,
        reference: DVec3,
        make: impl FnOnce(DAffine3) -> Shape,
    ) -> Result<()> {
        let ShapePlacement { group, to_group } = self.place_shape(reference, params.loc)?;
        let flip_normal = self.reverses_quadric(to_group);
        let shape = make(to_group);
        if !shape.max_coordinate().is_some_and(|coordinate| coordinate < LARGEST_COORDINATE) {
            let message = format!("a shape with coordinates beyond {LARGEST_COORDINATE:e} is ignored");
            self.warnings.add(params.loc, message);
            return Ok(());
        }
        self.add_primitive(params, group, shape, flip_normal)
    }

    /// Whether the front of a sphere or another quadric is opposite to its normal ∂p/∂u × ∂p/∂v in its own space.
    fn reverses_quadric(&self, to_group: DAffine3) -> bool {
        // A mirrored sphere of v2 keeps its front outside. In v3 and v4 it has it inside where rays hit it, and outside where light is
        // sampled from it, which is most of the light that it gives
        let reverse = self.state.reverse_orientation;
        let keeps_front = self.dialect == Dialect::V2 || self.state.area_light.is_some();
        if keeps_front { reverse } else { reverse != mirrors(to_group) }
    }

    /// Adds a mesh; `error` locates an error in it.
    pub fn add_mesh(
        &mut self,
        params: &ParameterDictionary,
        mesh: &MeshDescription,
        error: impl Fn(String) -> ParseError,
    ) -> Result<()> {
        let placement = self.place_mesh(mesh, params.loc)?;
        self.add_placed_mesh(params, mesh, placement, self.state.reverse_orientation, error)
    }

    /// Adds the mesh of a tessellated quadric, with the quadric's front.
    pub fn add_tessellated_quadric(
        &mut self,
        params: &ParameterDictionary,
        mesh: &MeshDescription,
        error: impl Fn(String) -> ParseError,
    ) -> Result<()> {
        let placement = self.place_mesh(mesh, params.loc)?;
        let reverse = self.reverses_quadric(placement.to_group);
        self.add_placed_mesh(params, mesh, placement, reverse, error)
    }

    fn place_mesh(&mut self, mesh: &MeshDescription, loc: FileLoc) -> Result<ShapePlacement> {
        let reference = mesh.positions.first().copied().filter(|p| p.is_finite()).unwrap_or_default();
        self.place_shape(reference, loc)
    }

    /// Adds a mesh to a group. `reverse` says whether its front is opposite to its normals.
    fn add_placed_mesh(
        &mut self,
        params: &ParameterDictionary,
        mesh: &MeshDescription,
        ShapePlacement { group, to_group }: ShapePlacement,
        reverse: bool,
        error: impl Fn(String) -> ParseError,
    ) -> Result<()> {
        let flip_normal = reverse != mirrors(to_group);
        let mut baked = mesh.bake(to_group, flip_normal, reverse).map_err(error)?;
        if baked.remove_triangles_beyond(LARGEST_COORDINATE) {
            let message = format!("triangles with coordinates beyond {LARGEST_COORDINATE:e} are ignored");
            self.warnings.add(params.loc, message);
        }
        if baked.indices.is_empty() {
            self.warnings.add(params.loc, "a mesh whose triangles have no area is ignored");
            return Ok(());
        }
        self.add_primitive(params, group, Shape::Mesh(Arc::new(baked)), flip_normal)
    }

    /// Adds a primitive to a group, with the current material and area light.
    fn add_primitive(
        &mut self,
        params: &ParameterDictionary,
        group: usize,
        shape: Shape,
        flip_normal: bool,
    ) -> Result<()> {
        // Evaluate alpha and material
        let alpha = self.alpha(params)?;
        let material = self.shape_material(params)?;

        // Drop area lights that are not simulated
        let mut area_light = self.state.area_light;
        if area_light.is_some() && group != 0 {
            self.warnings.add(params.loc, "area lights on moving or instanced shapes are not simulated");
            area_light = None;
        }

        // Scale the radiance to a given power
        let area_light = match area_light {
            Some(AreaLightSource { mut light, power: Some(power) }) => {
                let sides = if light.two_sided { 2.0 } else { 1.0 };
                light.radiance =
                    scale_light(light.radiance, power / (PI * sides * shape.area()), params.loc)?;
                if light.image.is_some() {
                    self.area_lights_with_power.push((self.groups[group].primitives.len(), params.loc));
                }
                Some(light)
            }
            emission => emission.map(|emission| emission.light),
        };

        // Report progress and add the primitive
        if area_light.is_some() {
            self.area_light_locs.push((self.groups[group].primitives.len(), params.loc));
        }
        self.progress.shapes += 1;
        if let Shape::Mesh(mesh) = &shape {
            self.progress.triangles += mesh.indices.len();
        }
        (self.report_progress)(self.progress);
        self.groups[group].primitives.push(Primitive { shape, material, alpha, area_light, flip_normal });
        Ok(())
    }

    /// Removes the primitives of interfaces between media that do not emit, and the instances that this leaves
    /// without any: media are not simulated, so light passes interfaces unchanged. Call it when all materials are
    /// defined.
    pub fn remove_interfaces(&mut self) {
        let (materials, interfaces_emit) = (&self.materials, self.dialect.interfaces_emit());
        let is_removed = |primitive: &Primitive| {
            let material = &materials[primitive.material.0 as usize];
            matches!(material.kind, MaterialKind::Interface)
                && !(interfaces_emit && primitive.area_light.is_some())
        };
        for &(index, loc) in &self.area_light_locs {
            if is_removed(&self.groups[0].primitives[index]) {
                self.warnings.add(loc, "an area light on the material \"interface\" is ignored");
            }
        }
        for group in &mut self.groups {
            group.primitives.retain(|primitive| !is_removed(primitive));
        }
        let groups = &self.groups;
        self.instances.retain(|instance| !groups[instance.object].primitives.is_empty());
    }

    /// The alpha texture of a shape, unless it is opaque.
    fn alpha(&mut self, params: &ParameterDictionary) -> Result<Option<FloatTextureId>> {
        let Some(param) = params.get("alpha") else { return Ok(None) };
        let id = match param.kind {
            ParameterType::Texture => self.float_texture_or(params, "alpha", 1.0)?,
            _ => {
                let alpha = params.float_or("alpha", 1.0)? as f32;
                self.textures.add(Texture::Constant(alpha))
            }
        };
        let id =
            if self.dialect.alpha_is_binary() { self.textures.add(Texture::<f32>::NotZero(id)) } else { id };
        Ok((self.textures.constant_float(id) != Some(1.0)).then_some(id))
    }
}

/// Whether a transform changes handedness.
fn mirrors(transform: DAffine3) -> bool {
    transform.matrix3.determinant() < 0.0
}

/// The parameter `phimax` in radians.
fn phi_max(params: &ParameterDictionary) -> Result<f32> {
    let degrees = params.positive_or("phimax", 360.0)?.min(360.0);
    Ok(degrees.to_radians() as f32)
}
