//! The directive `Shape`.

use super::mesh_description::MeshDescription;
use super::{curve, height_field, ply, revolution};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result, Statement};

impl SceneBuilder {
    /// `Shape`. In the older dialects a shape with an error is left out.
    pub fn shape(&mut self, statement: &Statement) -> Result<()> {
        let params = &*self.params_for("shape", statement);
        if let Err(error) = self.add_shape_of_kind(&statement.strings[0], params) {
            self.warn_or_fail(error, "the shape is ignored")?;
            statement.params.mark_all_used();
        }
        statement.params.mark_used_from(params);
        Ok(())
    }

    /// Adds a shape of the type `kind`.
    fn add_shape_of_kind(&mut self, kind: &str, params: &ParameterDictionary) -> Result<()> {
        let error = |message: String| ParseError::new(params.loc, message);
        match kind {
            // Analytic shapes
            "sphere" => self.sphere(params)?,
            "disk" => self.disk(params)?,
            // Meshes
            "trianglemesh" => {
                let mesh = self.triangle_mesh(params)?;
                self.add_mesh(params, &mesh, error)?;
            }
            "loopsubdiv" => {
                let mesh = self.loop_subdivided(params)?;
                self.add_mesh(params, &mesh, error)?;
            }
            "plymesh" => {
                let Some(name) = params.string("filename")? else {
                    return Err(error("plymesh without a file; expected \"string filename\"".into()));
                };
                let path = self.resolve_content(name);
                let named = |message: String| error(format!("mesh \"{}\": {message}", path.display()));
                let mesh = ply::read(&path).map_err(|message| {
                    named(format!("{message}; expected a valid PLY file that fits in memory"))
                })?;
                let mesh = MeshDescription { tangents: self.dialect.mesh_tangents(), ..mesh };
                self.add_mesh(params, &mesh, named)?;
            }
            "bilinearmesh" => {
                let mesh = self.bilinear_mesh(params)?;
                self.add_mesh(params, &mesh, error)?;
            }
            // Tessellated shapes
            "curve" => {
                if curve::is_flat(params)? {
                    self.warnings.add(params.loc, "curves of type \"flat\" are shaded as round curves");
                }
                self.add_mesh(params, &curve::mesh(params)?, error)?
            }
            "cylinder" | "cone" | "paraboloid" | "hyperboloid" => {
                self.add_tessellated_quadric(params, &revolution::mesh(kind, params)?, error)?;
            }
            "heightfield" => self.add_mesh(params, &height_field::mesh(params)?, error)?,
            // Unsupported shapes
            "nurbs" => {
                self.warnings.add(params.loc, format!("shape \"{kind}\" is not supported and is ignored"));
                params.mark_all_used();
            }
            other => {
                return Err(error(format!(
                    "unknown shape \"{other}\"; expected sphere, disk, cylinder, trianglemesh, plymesh, bilinearmesh, curve or \
                     loopsubdiv"
                )));
            }
        }
        Ok(())
    }
}
