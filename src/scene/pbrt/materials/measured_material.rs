//! Measured BRDFs, resampled from files.

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;

use super::irregular_brdf::IrregularBrdf;
use super::merl_brdf::MerlBrdf;
use crate::scene::material::MaterialKind;
use crate::scene::measured_brdf::MeasuredBrdf;
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::files;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParseError, Result};
use crate::scene::texture::Texture;

impl SceneBuilder {
    /// `measured`; each file is read once.
    pub fn measured(&mut self, params: &ParameterDictionary, loc: FileLoc) -> Result<MaterialKind> {
        let Some(name) = params.string("filename")? else {
            let message = "measured material without a file; expected \"string filename\"";
            return Err(ParseError::new(loc, message));
        };
        let path = self.resolve_content(name);
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("bsdf")) {
            self.warnings.add(loc, "measured BRDFs of pbrt-v4 (.bsdf) are not supported; using \"diffuse\"");
            return Ok(MaterialKind::Diffuse {
                reflectance: self.textures.add(Texture::Constant(Vec3::splat(0.5))),
            });
        }
        if let Some(table) = self.measured_brdfs.get(&path) {
            return Ok(MaterialKind::Measured(table.clone()));
        }
        let named = |message: String| {
            let expected = "a .brdf file or a MERL table";
            ParseError::new(loc, format!("BRDF \"{}\": {message}; expected {expected}", path.display()))
        };
        let table = Arc::new(read(&path).map_err(named)?);
        self.measured_brdfs.insert(path, table.clone());
        Ok(MaterialKind::Measured(table))
    }
}

/// Reads a measured BRDF; the extension determines the format.
///
/// # Errors
/// One sentence, without the file's name.
fn read(path: &Path) -> std::result::Result<MeasuredBrdf, String> {
    let is_text = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("brdf"));
    if is_text {
        let samples = IrregularBrdf::from_numbers(&files::numbers(path)?)?;
        Ok(MeasuredBrdf::new(|wo, wi| samples.value(wo, wi)))
    } else {
        let table = MerlBrdf::read(path)?;
        Ok(MeasuredBrdf::new(|wo, wi| table.value(wo, wi)))
    }
}
