//! The material directives: current, named and overridden materials.

use std::rc::Rc;

use glam::Vec3;

use crate::scene::material::MaterialKind;
use crate::scene::pbrt::builder::{MaterialEntity, MaterialRef, SceneBuilder};
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParseError, Result, Statement};
use crate::scene::texture::{
    Content, Encoding, ImageFilter, ImageTexture, Texture, TextureMapping, WrapMode,
};
use crate::scene::{Material, MaterialId};

/// The error for a reference to a material that is not defined.
fn unknown_material(name: &str, loc: FileLoc) -> ParseError {
    ParseError::new(
        loc,
        format!("unknown material \"{name}\"; expected a material that MakeNamedMaterial defines"),
    )
}

impl SceneBuilder {
    /// Adds the material of shapes before the first material directive.
    pub fn add_default_material(&mut self) {
        let reflectance = self.textures.add(Texture::Constant(Vec3::splat(0.5)));
        self.state.material.id = self.add_material(Material {
            name: String::new(),
            kind: MaterialKind::Diffuse { reflectance },
            displacement: None,
            normal_map: None,
        });
        if self.dialect.shapes_override_materials() {
            let (name, params) = (String::new(), ParameterDictionary::empty(FileLoc::default()));
            let entity = MaterialEntity { name, kind: "matte".into(), params, loc: FileLoc::default() };
            self.state.material.entity = Some(Rc::new(entity));
        }
    }

    /// Adds a material and tracks the depth of mixes.
    fn add_material(&mut self, material: Material) -> MaterialId {
        let depth = match &material.kind {
            MaterialKind::Mix { first, second, .. } => {
                1 + [first, second].map(|id| self.mix_depths[id.0 as usize]).into_iter().max().unwrap_or(0)
            }
            _ => 0,
        };
        self.materials.push(material);
        self.mix_depths.push(depth);
        MaterialId((self.materials.len() - 1) as u32)
    }

    /// `Material`.
    pub fn material(&mut self, statement: &Statement) -> Result<()> {
        let params = self.params_for("material", statement);
        let (kind, loc) = (&statement.strings[0], statement.loc);
        let id = self.make_material("", kind, &params, loc)?;
        statement.params.mark_used_from(&params);
        let entity = self.dialect.shapes_override_materials().then(|| {
            Rc::new(MaterialEntity {
                name: String::new(),
                kind: kind.clone(),
                params: params.into_owned().retain_used(),
                loc,
            })
        });
        self.state.material = MaterialRef { id, entity };
        Ok(())
    }

    /// `MakeNamedMaterial`.
    pub fn make_named_material(&mut self, statement: &Statement) -> Result<()> {
        let params = self.params_for("material", statement);
        let name = &statement.strings[0];
        let Some(kind) = params.string("type")?.map(String::from) else {
            let message = format!("material \"{name}\" without a type; expected \"string type\"");
            return Err(ParseError::new(statement.loc, message));
        };
        let loc = statement.loc;
        let id = self.make_material(name, &kind, &params, loc)?;
        statement.params.mark_used_from(&params);
        let entity = self.dialect.shapes_override_named_materials().then(|| {
            Rc::new(MaterialEntity {
                name: name.clone(),
                kind,
                params: params.into_owned().retain_used(),
                loc,
            })
        });
        let id = self.replace_forward_material(name, id);
        let material = MaterialRef { id, entity };
        self.define(|builder| &mut builder.named_materials, name.clone(), material);
        Ok(())
    }

    /// Moves the newest material into the slot of a forward reference to `name`, if there is one.
    /// Returns the id of the material after that.
    fn replace_forward_material(&mut self, name: &str, newest: MaterialId) -> MaterialId {
        let Some((slot, _)) = self.forward_materials.remove(name) else { return newest };
        self.materials.swap_remove(slot.0 as usize);
        self.mix_depths.swap_remove(slot.0 as usize);
        slot
    }

    /// A slot for a material that is referenced before its definition.
    pub fn declare_material(&mut self, name: &str, loc: FileLoc) -> MaterialRef {
        let id = match self.forward_materials.get(name) {
            Some(&(id, _)) => id,
            None => {
                let id = self.add_material(self.materials[0].clone());
                self.forward_materials.insert(name.into(), (id, loc));
                id
            }
        };
        MaterialRef { id, entity: None }
    }

    /// Checks that every forward reference of a shape or a mix was resolved. As in pbrt-v4, other references do not
    /// count.
    ///
    /// # Errors
    /// Located at the first reference to a material that is never defined.
    pub fn check_forward_materials(&self) -> Result<()> {
        if self.forward_materials.is_empty() {
            return Ok(());
        }
        let mut is_used = vec![false; self.materials.len()];
        for primitive in self.groups.iter().flat_map(|group| &group.primitives) {
            is_used[primitive.material.0 as usize] = true;
        }
        for material in &self.materials {
            if let MaterialKind::Mix { first, second, .. } = material.kind {
                is_used[first.0 as usize] = true;
                is_used[second.0 as usize] = true;
            }
        }
        let used = self.forward_materials.iter().filter(|(_, (id, _))| is_used[id.0 as usize]);
        match used.min_by_key(|(_, (id, _))| id.0) {
            Some((name, (_, loc))) => Err(unknown_material(name, *loc)),
            None => Ok(()),
        }
    }

    /// `NamedMaterial`.
    pub fn named_material(&mut self, statement: &Statement) -> Result<()> {
        let (name, loc) = (&statement.strings[0], statement.loc);
        match self.find_material(name, loc) {
            Ok(material) => self.state.material = material,
            Err(error) if self.dialect.ignores_unknown_materials() => {
                self.warnings.add(error.loc, error.message);
            }
            Err(_) if self.dialect.allows_forward_references() => {
                self.state.material = self.declare_material(name, loc);
            }
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// The material that `MakeNamedMaterial` defined as `name`.
    pub fn find_material(&self, name: &str, loc: FileLoc) -> Result<MaterialRef> {
        self.named_materials.get(name).cloned().ok_or_else(|| unknown_material(name, loc))
    }

    /// The material of a shape: the current one, or a new one if unused parameters of the shape
    /// override the material's. Call it after the shape has looked up its own parameters.
    pub fn shape_material(&mut self, params: &ParameterDictionary) -> Result<MaterialId> {
        let MaterialRef { id, entity } = self.state.material.clone();
        let Some(entity) = entity.filter(|_| params.unused().next().is_some()) else { return Ok(id) };
        let all = entity.params.extended_with_unused(params);
        let changed = self.make_material(&entity.name, &entity.kind, &all, entity.loc)?;
        if params.mark_used_from_extension(&all) {
            return Ok(changed);
        }
        // The unused parameters do not belong to the material either
        self.materials.pop();
        self.mix_depths.pop();
        Ok(id)
    }

    /// Makes a material of type `kind` with its displacement and normal map.
    fn make_material(
        &mut self,
        name: &str,
        kind: &str,
        params: &ParameterDictionary,
        loc: FileLoc,
    ) -> Result<MaterialId> {
        let kind = self.material_kind(kind, params, loc)?;
        self.warn_reflectance_above_one(name, &kind, loc);
        let displacement = match (params.get("displacement"), params.get("bumpmap")) {
            (None, None) => None,
            (Some(_), _) => Some(self.float_texture_or(params, "displacement", 0.0)?),
            (None, Some(_)) => Some(self.float_texture_or(params, "bumpmap", 0.0)?),
        };
        let displacement = displacement.filter(|id| self.textures.constant_float(*id).is_none());
        let file = params.string("normalmap")?.filter(|file| !file.is_empty()).map(String::from);
        let normal_map = match file {
            None => None,
            Some(file) => {
                // pbrt-v4 decodes those of JPEG and TGA files as sRGB, which tilts all normals
                let path = self.resolve_content(&file);
                let flip_rows = self.dialect.flips_rows(&path);
                let (encoding, content) = (Encoding::Linear, Content::Colour);
                let image = self.images.add(path, encoding, content, flip_rows, None, params.loc);
                let mapping = TextureMapping::Uv { scale: glam::Vec2::new(1.0, -1.0), offset: glam::Vec2::Y };
                let (wrap, filter) = (WrapMode::Repeat, ImageFilter::Bilinear);
                let texture = ImageTexture { image, mapping, wrap, filter, scale: 1.0, invert: false };
                Some(self.textures.add(Texture::<Vec3>::Image(texture)))
            }
        };
        Ok(self.add_material(Material { name: name.into(), kind, displacement, normal_map }))
    }
}
