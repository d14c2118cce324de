//! The directive `Texture`.

use glam::Vec3;

use super::texture_parameter::TextureParameter;
use crate::scene::FloatTextureId;
use crate::scene::pbrt::builder::{SceneBuilder, TextureSize};
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result, Statement};
use crate::scene::texture::{ImageTexture, Procedural, Texture, TextureMapping};

/// Depth limit of texture expressions.
const MAX_TEXTURE_DEPTH: usize = 30;
/// Largest number of textures in an expression; evaluation follows every branch, at each point that is shaded.
const MAX_EVALUATIONS: usize = 8192;
/// Largest number of noise octaves. Higher octaves are finer than the precision of coordinates.
const MAX_OCTAVES: u32 = 64;

impl SceneBuilder {
    /// `Texture`: defines a named texture.
    pub fn texture(&mut self, statement: &Statement) -> Result<()> {
        let params = self.params_for("texture", statement);
        match statement.strings[1].as_str() {
            "float" => self.make_texture::<f32>(statement, &params)?,
            "spectrum" | "color" => self.make_texture::<Vec3>(statement, &params)?,
            other => {
                let message = format!("unknown texture type \"{other}\"; expected float or spectrum");
                statement.params.mark_all_used();
                return self.warn_or_fail(ParseError::new(statement.loc, message), "the texture is ignored");
            }
        }
        statement.params.mark_used_from(&params);
        Ok(())
    }

    /// Defines a texture with values of type `V`.
    fn make_texture<V: TextureParameter>(
        &mut self,
        statement: &Statement,
        params: &ParameterDictionary,
    ) -> Result<()> {
        let [name, _, kind] = &statement.strings[..] else { unreachable!("the table says three strings") };
        self.named_textures.size = TextureSize::default();
        let texture = self.texture_expression::<V>(kind, params)?;
        let size = self.named_textures.size;
        if size.depth > MAX_TEXTURE_DEPTH {
            let message =
                format!("textures are nested too deep; expected at most {MAX_TEXTURE_DEPTH} levels");
            return Err(ParseError::new(statement.loc, message));
        }
        if size.evaluations > MAX_EVALUATIONS {
            let message = format!(
                "a texture of {} others, repeated ones counted; expected at most {MAX_EVALUATIONS}",
                size.evaluations
            );
            return Err(ParseError::new(statement.loc, message));
        }
        let id = self.textures.add(texture);
        self.define(|builder| V::names(&mut builder.named_textures), name.clone(), (id, size));
        Ok(())
    }

    /// An inverted image times a constant: pbrt-v4 scales the image's values and inverts them then.
    fn scaled_before_inversion<V: TextureParameter>(
        &self,
        image: V::Id,
        scale: FloatTextureId,
    ) -> Option<ImageTexture> {
        let factor = self.textures.constant_float(scale)?;
        match V::texture(&self.textures, image) {
            Texture::Image(image) if image.invert => {
                Some(ImageTexture { scale: image.scale * factor, ..image.clone() })
            }
            _ => None,
        }
    }

    /// The texture of type `kind`. Textures in its parameters raise `named_textures.size`.
    fn texture_expression<V: TextureParameter>(
        &mut self,
        kind: &str,
        params: &ParameterDictionary,
    ) -> Result<Texture<V>> {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        Ok(match kind {
            // Values and images
            "constant" => Texture::Constant(V::value(self, params, "value", one)?),
            "imagemap" => Texture::Image(self.image_texture(params, V::content(self.dialect))?),
            // Combinations of textures
            "scale" => {
                let first_name = if params.get("tex1").is_some() { "tex1" } else { "tex" };
                let first = self.texture_or(params, first_name, one)?;
                // The second factor is a texture in the older dialects and a float in v4
                let second = if params.get("tex2").is_some() {
                    self.texture_or(params, "tex2", one)?
                } else {
                    let scale = self.float_texture_or(params, "scale", 1.0)?;
                    if let Some(image) = self.scaled_before_inversion::<V>(first, scale) {
                        return Ok(Texture::Image(image));
                    }
                    self.textures.add(Texture::<V>::Gray(scale))
                };
                Texture::Product { first, second }
            }
            "mix" => Texture::Mix {
                first: self.texture_or(params, "tex1", zero)?,
                second: self.texture_or(params, "tex2", one)?,
                amount: self.float_texture_or(params, "amount", 0.5)?,
            },
            // Patterns
            "checkerboard" => Texture::Checkerboard {
                mapping: match params.integer_in("dimension", 2, 2..=3)? {
                    2 => self.texture_mapping(params, false)?,
                    _ => TextureMapping::Space(self.solid_texture_transform(params.loc)?.as_affine3a()),
                },
                even: self.texture_or(params, "tex1", one)?,
                odd: self.texture_or(params, "tex2", zero)?,
            },
            "dots" => Texture::Dots {
                mapping: self.texture_mapping(params, false)?,
                // pbrt passes the two in the opposite order, in all versions
                outside: self.texture_or(params, "inside", one)?,
                inside: self.texture_or(params, "outside", zero)?,
            },
            "bilerp" => {
                let corners = [("v00", zero), ("v01", one), ("v10", zero), ("v11", one)]
                    .map(|(name, default)| V::value(self, params, name, default));
                let [v00, v01, v10, v11] = corners;
                Texture::Bilinear {
                    mapping: self.texture_mapping(params, false)?,
                    corners: [v00?, v01?, v10?, v11?],
                }
            }
            "fbm" | "wrinkled" | "windy" | "marble" => Texture::Procedural {
                to_texture: self.solid_texture_transform(params.loc)?.as_affine3a(),
                kind: procedural(kind, params)?,
            },
            // Unsupported textures become a medium gray
            other => {
                self.warnings
                    .add(params.loc, format!("texture \"{other}\" is not supported; using the constant 0.5"));
                params.mark_all_used();
                Texture::Constant(V::splat(0.5))
            }
        })
    }
}

/// The parameters of a procedural texture.
fn procedural(kind: &str, params: &ParameterDictionary) -> Result<Procedural> {
    if kind == "windy" {
        return Ok(Procedural::Windy);
    }
    let octaves = params.integer_in("octaves", 8, 0..=MAX_OCTAVES)?;
    let number = |name, default| -> Result<f32> { Ok(params.float_or(name, default)? as f32) };
    let roughness = number("roughness", 0.5)?;
    Ok(match kind {
        "fbm" => Procedural::Fbm { octaves, roughness },
        "wrinkled" => Procedural::Wrinkled { octaves, roughness },
        _ => Procedural::Marble {
            octaves,
            roughness,
            scale: number("scale", 1.0)?,
            variation: number("variation", 0.2)?,
        },
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::{Vec2, Vec3};

    use crate::scene::MaterialKind;
    use crate::scene::pbrt::read_str;
    use crate::scene::texture::TexturePoint;

    const ONE_OCTAVE: &str = "\"spectrum\" \"fbm\" \"integer octaves\" 1";

    /// The colour of a texture at a point.
    fn colour(texture: &str, position: Vec3, uv: Vec2) -> Vec3 {
        let text =
            format!("WorldBegin Texture \"t\" {texture} Material \"diffuse\" \"texture reflectance\" \"t\"");
        let scene = read_str(&text, Path::new("")).unwrap_or_else(|error| panic!("{error}"));
        assert!(scene.warnings.is_empty(), "{texture}: {:?}", scene.warnings);
        let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!() };
        scene.textures.rgb(reflectance, TexturePoint { uv, position })
    }

    #[test]
    fn textures_of_too_many_others_are_errors() {
        let read = |text: &str| read_str(text, Path::new(""));
        let first = "WorldBegin Texture \"t0\" \"float\" \"checkerboard\"".to_owned();
        let nested = |levels: usize, kind: &str, operands: &[&str]| {
            let next = |i: usize| {
                let of = |name: &&str| format!("\"texture {name}\" \"t{}\"", i - 1);
                let operands = operands.iter().map(of).collect::<Vec<_>>().join(" ");
                format!("\nTexture \"t{i}\" \"float\" \"{kind}\" {operands}")
            };
            first.clone() + &(1..=levels).map(next).collect::<String>()
        };
        // 3 + 9 + ... + 3⁷ = 3279
        let mixes = |levels| nested(levels, "mix", &["tex1", "tex2", "amount"]);
        assert!(read(&mixes(7)).is_ok());
        let too_many = read(&mixes(8)).unwrap_err();
        assert!(too_many.line == 9 && too_many.message.contains("of 9840 others"), "{too_many}");
        assert!(read(&nested(30, "scale", &["tex"])).is_ok());
        let too_deep = read(&nested(31, "scale", &["tex"])).unwrap_err();
        assert!(too_deep.line == 32 && too_deep.message.contains("nested too deep"), "{too_deep}");
    }

    #[test]
    fn procedural_textures_are_read_with_their_parameters() {
        let loc = Vec3::new(0.5, 0.25, 0.75);
        let at = |texture: &str| colour(texture, loc, Vec2::ZERO);
        // The value of the noise is tested in `Procedural`
        let noise = -0.375_078_7;
        let near =
            |found: Vec3, expected: f32| assert!((found - expected).abs().max_element() < 1e-5, "{found}");
        near(at(ONE_OCTAVE), noise);
        near(at("\"spectrum\" \"wrinkled\" \"integer octaves\" 1 \"float roughness\" 0"), noise.abs());
        // The texture is in the space of its directive
        let moved =
            format!("{ONE_OCTAVE} TransformBegin Translate 1 2 3 Texture \"t\" {ONE_OCTAVE} TransformEnd");
        near(colour(&moved, loc + Vec3::new(1.0, 2.0, 3.0), Vec2::ZERO), noise);
        let marble = at("\"spectrum\" \"marble\" \"float scale\" 4 \"float variation\" 0.1");
        assert!(marble.min_element() > 0.2 && marble.max_element() < 1.0 && marble.z > marble.x, "{marble}");
        assert_ne!(at("\"spectrum\" \"windy\""), Vec3::splat(0.5));
    }

    #[test]
    fn dots_corners_and_mappings_are_read() {
        let corners = "\"spectrum\" \"bilerp\" \"rgb v01\" [0 0 0] \"rgb v10\" [0 1 0]
            \"rgb v11\" [0 1 1] \"rgb v00\" [1 0 0]";
        let at = |uv: Vec2| colour(corners, Vec3::ZERO, uv);
        assert_eq!([at(Vec2::ZERO), at(Vec2::X), at(Vec2::Y)], [Vec3::X, Vec3::Y, Vec3::ZERO]);
        let dots = "\"spectrum\" \"dots\" \"rgb inside\" [1 0 0] \"rgb outside\" [0 0 1]
            \"string mapping\" \"spherical\"";
        let value = colour(dots, Vec3::X, Vec2::ZERO);
        assert!(value == Vec3::X || value == Vec3::Z, "{value}");
        // As in pbrt, the value called "inside" is that around the dots, which cover less than half
        let dots = "\"spectrum\" \"dots\" \"rgb inside\" [1 0 0] \"rgb outside\" [0 0 1]
            \"float uscale\" 20 \"float vscale\" 20";
        let place = |i: u32| Vec2::new((i % 16) as f32, (i / 16) as f32) / 16.0;
        let around = (0..256).filter(|&i| colour(dots, Vec3::ZERO, place(i)) == Vec3::X).count();
        assert!((128..256).contains(&around), "{around}");
        let board = "\"spectrum\" \"checkerboard\" \"string mapping\" \"cylindrical\"";
        let at = |z: f32| colour(board, Vec3::new(1.0, 0.0, z), Vec2::ZERO);
        assert_eq!([at(0.5), at(1.5)], [Vec3::ONE, Vec3::ZERO]);
    }
}
