//! Image textures, and the images of a scene.

use crate::scene::ImageId;
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::dialect::Dialect;
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParameterType, ParseError, Result};
use crate::scene::texture::{Content, Encoding, ImageFilter, ImageTexture, WrapMode};

impl SceneBuilder {
    /// The texture `imagemap`.
    pub fn image_texture(&mut self, params: &ParameterDictionary, content: Content) -> Result<ImageTexture> {
        let Some(file) = params.string("filename")? else {
            return Err(ParseError::new(params.loc, "imagemap without a file; expected \"string filename\""));
        };
        let wrap = match params.string("wrap")? {
            None | Some("repeat") => WrapMode::Repeat,
            Some("black") => WrapMode::Black,
            // Octahedral wrapping is for environment maps, not for surfaces
            Some("clamp" | "octahedralsphere") => WrapMode::Clamp,
            Some(other) => {
                let expected = "repeat, black or clamp";
                return Err(ParseError::new(
                    params.loc,
                    format!("unknown wrap \"{other}\"; expected {expected}"),
                ));
            }
        };
        // Images are not prefiltered, so that the other filters are all bilinear
        let filter = match params.string("filter")? {
            Some("point") => ImageFilter::Nearest,
            _ => ImageFilter::Bilinear,
        };
        for name in ["maxanisotropy", "trilinear"] {
            params.get(name);
        }
        let encoding = image_encoding(params, self.dialect)?;
        let scale = self.dialect.image_scale(params.float_or("scale", 1.0)?, encoding) as f32;
        if !scale.is_finite() {
            let message = format!("the scale of the imagemap is {scale}; expected a finite number");
            return Err(ParseError::new(params.loc, message));
        }
        let replacement = self.dialect.missing_texture_value();
        Ok(ImageTexture {
            image: self.image(file, encoding, content, replacement, params.loc),
            mapping: self.texture_mapping(params, self.dialect.v_starts_at_bottom_row())?,
            wrap,
            filter,
            scale,
            invert: params.bool_or("invert", false)?,
        })
    }

    /// The id of an image file; `encoding` is what the parameters ask for, if anything, and `replacement` the encoded
    /// value of an image that cannot be read.
    pub fn image(
        &mut self,
        file: &str,
        encoding: Option<Encoding>,
        content: Content,
        replacement: Option<f32>,
        loc: FileLoc,
    ) -> ImageId {
        let path = self.resolve_content(file);
        let encoding = self.dialect.image_encoding(&path, encoding);
        let flip_rows = self.dialect.flips_rows(&path);
        self.images.add(path, encoding, content, flip_rows, replacement, loc)
    }

    /// Decodes the scene's images.
    pub fn load_images(&mut self) -> Result<()> {
        for image in std::mem::take(&mut self.images).load(&mut self.warnings)? {
            self.textures.add_image(image);
        }
        Ok(())
    }
}

/// The encoding that parameters ask for, if any: `encoding`, or the older dialects' `gamma`, which
/// v3 accepts as a truth value only.
pub fn image_encoding(params: &ParameterDictionary, dialect: Dialect) -> Result<Option<Encoding>> {
    let gamma = if dialect == Dialect::V4 { None } else { params.get("gamma") };
    if let Some(param) = gamma {
        return match param.kind {
            ParameterType::Bool if !params.bool_or("gamma", true)? => Ok(Some(Encoding::Linear)),
            ParameterType::Bool => Ok(Some(Encoding::Srgb)),
            _ if dialect == Dialect::V3 => Ok(None),
            _ => match params.positive_or("gamma", 1.0)? as f32 {
                gamma if gamma > 0.0 && gamma.is_finite() => Ok(Some(Encoding::Gamma(gamma))),
                gamma => Err(param.error(gamma, "a number above 0 in single precision")),
            },
        };
    }
    match params.string("encoding")? {
        None => Ok(None),
        Some("sRGB") => Ok(Some(Encoding::Srgb)),
        Some("linear") => Ok(Some(Encoding::Linear)),
        Some(other) => {
            match other.strip_prefix("gamma ").and_then(|gamma| gamma.trim().parse::<f32>().ok()) {
                Some(gamma) if gamma > 0.0 && gamma.is_finite() => Ok(Some(Encoding::Gamma(gamma))),
                _ => {
                    let message =
                        format!("unknown encoding \"{other}\"; expected sRGB, linear or \"gamma <number>\"");
                    Err(ParseError::new(params.loc, message))
                }
            }
        }
    }
}
