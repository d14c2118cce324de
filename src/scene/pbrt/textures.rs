//! Textures and images, and parameters that may be textures.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};

use super::dialect::Dialect;
use super::directives::Statement;
use super::params::{Param, ParamType, Params};
use super::spectrum::{Spectrum, rgb_from_xyz};
use super::state::Reader;
use super::transforms::inverse;
use super::{Fault, Place, Result, files};
use crate::scene::texture::{
    Channels, Encoding, FloatTextureId, ImageTexture, Mapping, Procedural, RgbTextureId, Texture,
    TextureValue, Wrap,
};

/// Deepest texture of textures: a lookup follows both branches of each.
const MAX_TEXTURE_DEPTH: usize = 12;
/// Most octaves of noise: beyond, they are finer than any number can tell.
const MAX_OCTAVES: u32 = 64;

/// Named textures of one kind, with their depths.
type Names<Id> = HashMap<String, (Id, usize)>;

/// What the scene has named.
#[derive(Default)]
pub struct TextureNames {
    floats: Names<FloatTextureId>,
    rgbs: Names<RgbTextureId>,
    /// Depth of the texture that is being made.
    depth: usize,
}

/// How a parameter becomes a value of a texture.
pub trait Parameter: TextureValue {
    /// What is accepted, for messages.
    const KIND: &'static str;
    /// What is made use of in an image.
    fn channels(dialect: Dialect) -> Channels;
    fn names(names: &mut TextureNames) -> &mut Names<Self::Id>;
    /// The value of a parameter that is not a texture.
    fn value(reader: &mut Reader, params: &Params, name: &str, default: Self) -> Result<Self>;
}

impl Parameter for f32 {
    const KIND: &'static str = "float";
    fn channels(dialect: Dialect) -> Channels {
        dialect.scalar_channels()
    }
    fn names(names: &mut TextureNames) -> &mut Names<FloatTextureId> {
        &mut names.floats
    }
    fn value(_: &mut Reader, params: &Params, name: &str, default: f32) -> Result<f32> {
        Ok(params.float(name)?.map_or(default, |value| value as f32))
    }
}

impl Parameter for Vec3 {
    const KIND: &'static str = "spectrum";
    fn channels(_: Dialect) -> Channels {
        Channels::All
    }
    fn names(names: &mut TextureNames) -> &mut Names<RgbTextureId> {
        &mut names.rgbs
    }
    fn value(reader: &mut Reader, params: &Params, name: &str, default: Vec3) -> Result<Vec3> {
        let spectrum = reader.spectrum(params, name)?;
        Ok(spectrum.map_or(default, |spectrum| reader.dialect.reflectance_of(&spectrum)))
    }
}

impl Reader {
    /// A parameter that is a float or a float texture.
    pub fn float_texture_or(&mut self, params: &Params, name: &str, default: f64) -> Result<FloatTextureId> {
        self.texture_or::<f32>(params, name, default as f32)
    }

    /// A parameter that is a spectrum or a spectrum texture.
    pub fn rgb_texture_or(&mut self, params: &Params, name: &str, default: Vec3) -> Result<RgbTextureId> {
        self.texture_or::<Vec3>(params, name, default)
    }

    fn texture_or<V: Parameter>(&mut self, params: &Params, name: &str, default: V) -> Result<V::Id> {
        match params.get(name) {
            Some(param) if param.kind == ParamType::Texture => {
                let [wanted] = param.strings() else {
                    return Err(param.fault(format_args!("{} names", param.strings().len()), "one name"));
                };
                let Some(&(id, depth)) = V::names(&mut self.texture_names).get(wanted) else {
                    let accepted = format!("a {} texture made before", V::KIND);
                    return Err(param.fault(format_args!("texture \"{wanted}\""), &accepted));
                };
                self.texture_names.depth = self.texture_names.depth.max(depth + 1);
                Ok(id)
            }
            _ => {
                let value = V::value(self, params, name, default)?;
                Ok(self.textures.add(Texture::Constant(value)))
            }
        }
    }

    /// A parameter that is a colour or a spectrum.
    pub fn spectrum(&mut self, params: &Params, name: &str) -> Result<Option<Spectrum>> {
        let Some(param) = params.get(name) else { return Ok(None) };
        Ok(Some(match (param.kind, param.numbers()) {
            (ParamType::Rgb, &[r, g, b]) => {
                Spectrum::Rgb(self.state.color_space.to_srgb(DVec3::new(r, g, b)).as_vec3())
            }
            (ParamType::Xyz, &[x, y, z]) => Spectrum::Rgb(rgb_from_xyz(DVec3::new(x, y, z)).as_vec3()),
            (ParamType::Rgb | ParamType::Xyz, numbers) => {
                return Err(param.fault(format_args!("{} numbers", numbers.len()), "three numbers"));
            }
            (ParamType::Float, &[value]) => Spectrum::Rgb(Vec3::splat(value as f32)),
            (ParamType::Blackbody, &[kelvin]) if kelvin > 0.0 => Spectrum::Blackbody { kelvin, scale: 1.0 },
            (ParamType::Blackbody, &[kelvin, scale]) if kelvin > 0.0 => Spectrum::Blackbody { kelvin, scale },
            (ParamType::Blackbody, _) => return Err(param.fault("no temperature", "kelvins above 0")),
            (ParamType::Spectrum, numbers) => match param.strings() {
                [] => self.spectrum_of_numbers(param, numbers)?,
                [name] => self.named_spectrum(param, name)?,
                names => return Err(param.fault(format_args!("{} names", names.len()), "one name")),
            },
            _ => return Err(param.fault("of another type", "rgb, spectrum, blackbody or a texture")),
        }))
    }

    /// A spectrum that pbrt knows, or a file of wavelengths and values.
    fn named_spectrum(&mut self, param: &Param, name: &str) -> Result<Spectrum> {
        if let Some(spectrum) = Spectrum::named(name) {
            return Ok(spectrum);
        }
        let path = self.resolve_content(name);
        let shown = path.display();
        let numbers = files::numbers(&path).map_err(|error| {
            param.fault(format_args!("\"{shown}\" ({error})"), "a spectrum's name or file")
        })?;
        self.spectrum_of_numbers(param, &numbers)
    }

    fn spectrum_of_numbers(&self, param: &Param, numbers: &[f64]) -> Result<Spectrum> {
        let spectrum = match self.dialect.sorts_spectra() {
            true => Spectrum::from_unsorted_numbers(numbers),
            false => Spectrum::from_numbers(numbers),
        };
        match spectrum {
            Some(spectrum) if self.dialect.spectra_end() => Ok(spectrum.ending()),
            Some(spectrum) => Ok(spectrum),
            None => {
                let accepted = "pairs of rising wavelength (nm) and value";
                Err(param.fault(format_args!("{} numbers", numbers.len()), accepted))
            }
        }
    }

    pub fn texture(&mut self, statement: &Statement) -> Result<()> {
        let params = self.params_for("texture", statement);
        match statement.strings[1].as_str() {
            "float" => self.make_texture::<f32>(statement, &params)?,
            "spectrum" | "color" => self.make_texture::<Vec3>(statement, &params)?,
            other => {
                let message = format!("a texture of \"{other}\"; float and spectrum are accepted");
                return Err(Fault::new(statement.place, message));
            }
        }
        statement.params.mark_used_in(&params);
        Ok(())
    }

    fn make_texture<V: Parameter>(&mut self, statement: &Statement, params: &Params) -> Result<()> {
        let [name, _, kind] = &statement.strings[..] else { unreachable!("the table says three strings") };
        self.texture_names.depth = 0;
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let texture = match kind.as_str() {
            "constant" => Texture::Constant(V::value(self, params, "value", one)?),
            "imagemap" => Texture::Image(self.image_texture(params, V::channels(self.dialect))?),
            "scale" => {
                let first_name = if params.get("tex1").is_some() { "tex1" } else { "tex" };
                let first = self.texture_or(params, first_name, one)?;
                // Both factors may be colours in the older dialects; in v4 the second is a float.
                let second = if params.get("tex2").is_some() {
                    self.texture_or(params, "tex2", one)?
                } else {
                    let scale = self.float_texture_or(params, "scale", 1.0)?;
                    self.textures.add(Texture::<V>::Gray(scale))
                };
                Texture::Product { first, second }
            }
            "mix" => Texture::Mix {
                first: self.texture_or(params, "tex1", zero)?,
                second: self.texture_or(params, "tex2", one)?,
                amount: self.float_texture_or(params, "amount", 0.5)?,
            },
            "checkerboard" => Texture::Checkerboard {
                mapping: match params.integer_in("dimension", 2, 2..=3)? {
                    2 => self.mapping(params, false)?,
                    _ => Mapping::Space(self.solid_space(params.place)?.as_affine3a()),
                },
                even: self.texture_or(params, "tex1", one)?,
                odd: self.texture_or(params, "tex2", zero)?,
            },
            "dots" => Texture::Dots {
                mapping: self.mapping(params, false)?,
                inside: self.texture_or(params, "inside", one)?,
                outside: self.texture_or(params, "outside", zero)?,
            },
            "bilerp" => {
                let corners = [("v00", zero), ("v01", one), ("v10", zero), ("v11", one)]
                    .map(|(name, default)| V::value(self, params, name, default));
                let [v00, v01, v10, v11] = corners;
                Texture::Bilinear { mapping: self.mapping(params, false)?, corners: [v00?, v01?, v10?, v11?] }
            }
            "fbm" | "wrinkled" | "windy" | "marble" => Texture::Procedural {
                to_texture: self.solid_space(params.place)?.as_affine3a(),
                kind: procedural(kind, params)?,
            },
            other => {
                // A mean value keeps the scene readable.
                self.warnings.add(statement.place, format!("texture \"{other}\" is read as a constant 0.5"));
                params.mark_all_used();
                Texture::Constant(V::splat(0.5))
            }
        };
        let depth = self.texture_names.depth;
        if depth > MAX_TEXTURE_DEPTH {
            let message = format!("textures more than {MAX_TEXTURE_DEPTH} deep; fewer would be accepted");
            return Err(Fault::new(statement.place, message));
        }
        let id = self.textures.add(texture);
        V::names(&mut self.texture_names).insert(name.clone(), (id, depth));
        Ok(())
    }

    fn image_texture(&mut self, params: &Params, channels: Channels) -> Result<ImageTexture> {
        let Some(file) = params.string("filename")? else {
            return Err(Fault::new(
                params.place,
                "an imagemap without a file; \"string filename\" would be accepted",
            ));
        };
        let wrap = match params.string("wrap")? {
            None | Some("repeat") => Wrap::Repeat,
            Some("black") => Wrap::Black,
            // A map of the sphere is no map of a surface: its borders are as good as clamped.
            Some("clamp" | "octahedralsphere") => Wrap::Clamp,
            Some(other) => {
                let accepted = "repeat, black or clamp";
                return Err(Fault::new(
                    params.place,
                    format!("wrap \"{other}\"; {accepted} would be accepted"),
                ));
            }
        };
        // Filtering is bilinear; samples do the rest.
        for name in ["filter", "maxanisotropy", "trilinear"] {
            params.get(name);
        }
        let encoding = encoding(params, self.dialect)?;
        let scale = self.dialect.image_scale(params.float_or("scale", 1.0)?, encoding) as f32;
        if !scale.is_finite() {
            let message = format!("an imagemap that is scaled by {scale}; a finite number would be accepted");
            return Err(Fault::new(params.place, message));
        }
        Ok(ImageTexture {
            image: self.image(file, encoding, channels, params.place),
            mapping: self.mapping(params, self.dialect.images_start_at_the_bottom())?,
            wrap,
            scale,
            invert: params.bool_or("invert", false)?,
        })
    }

    /// The 2D mapping of a texture; `flip` turns v = 0 to the last row of an image.
    fn mapping(&mut self, params: &Params, flip: bool) -> Result<Mapping> {
        let number = |name, default| -> Result<f32> { Ok(params.float_or(name, default)? as f32) };
        let mut offset = Vec2::new(number("udelta", 0.0)?, number("vdelta", 0.0)?);
        if params.string("mapping")? == Some("planar") {
            let v1 = params.triple_or("v1", DVec3::X)?;
            let v2 = params.triple_or("v2", DVec3::Y)?;
            let mut planes = DAffine3 {
                matrix3: DMat3::from_cols(v1, v2, DVec3::ZERO).transpose(),
                translation: offset.as_dvec2().extend(0.0),
            };
            if flip {
                planes = DAffine3::from_translation(DVec3::Y)
                    * DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0))
                    * planes;
            }
            let space = match self.dialect.textures_turn_the_world() {
                true => self.to_world(),
                false => self.to_texture(params.place)?,
            };
            return Ok(Mapping::Space((planes * space).as_affine3a()));
        }
        match params.string("mapping")? {
            None | Some("uv") => {}
            Some("spherical") => {
                let to_texture = self.to_texture(params.place)?.as_affine3a();
                return Ok(Mapping::Spherical { to_texture, flip });
            }
            Some("cylindrical") => {
                let to_texture = self.to_texture(params.place)?.as_affine3a();
                return Ok(Mapping::Cylindrical { to_texture, flip });
            }
            Some(other) => {
                self.warnings.add(params.place, format!("texture mapping \"{other}\" is read as \"uv\""));
            }
        }
        let mut scale = Vec2::new(number("uscale", 1.0)?, number("vscale", 1.0)?);
        if flip {
            scale.y = -scale.y;
            offset.y = 1.0 - offset.y;
        }
        Ok(Mapping::Uv { scale, offset })
    }

    fn to_world(&self) -> DAffine3 {
        DAffine3::from_translation(self.origin())
    }

    /// Render space to where solid textures are looked up.
    fn solid_space(&self, place: Place) -> Result<DAffine3> {
        match self.dialect.textures_turn_the_world() {
            true => Ok(self.state.ctm[0] * self.to_world()),
            false => self.to_texture(place),
        }
    }

    /// Render space to the current, the texture's, space.
    fn to_texture(&self, place: Place) -> Result<DAffine3> {
        let message = "a singular transform; one that can be inverted would be accepted";
        inverse(&self.to_render()).ok_or_else(|| Fault::new(place, message))
    }
}

fn procedural(kind: &str, params: &Params) -> Result<Procedural> {
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

/// How images are encoded, if that is said: `encoding`, or the older dialects' `gamma`, which v3 takes for no number.
pub fn encoding(params: &Params, dialect: Dialect) -> Result<Option<Encoding>> {
    if let Some(param) = params.get("gamma").filter(|_| dialect != Dialect::V4) {
        return match param.kind {
            ParamType::Bool if !params.bool_or("gamma", true)? => Ok(Some(Encoding::Linear)),
            ParamType::Bool => Ok(Some(Encoding::Srgb)),
            _ if dialect == Dialect::V3 => Ok(None),
            _ => Ok(Some(Encoding::Gamma(params.positive_or("gamma", 1.0)? as f32))),
        };
    }
    match params.string("encoding")? {
        None => Ok(None),
        Some("sRGB") => Ok(Some(Encoding::Srgb)),
        Some("linear") => Ok(Some(Encoding::Linear)),
        Some(other) => {
            match other.strip_prefix("gamma ").and_then(|gamma| gamma.trim().parse::<f32>().ok()) {
                Some(gamma) if gamma > 0.0 => Ok(Some(Encoding::Gamma(gamma))),
                _ => {
                    let message =
                        format!("encoding \"{other}\"; sRGB, linear and \"gamma <number>\" are accepted");
                    Err(Fault::new(params.place, message))
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::{Vec2, Vec3};

    use crate::scene::MaterialKind;
    use crate::scene::pbrt::read_str;
    use crate::scene::texture::TexturePoint;

    const ONE_OCTAVE: &str = "\"spectrum\" \"fbm\" \"integer octaves\" 1";

    /// The colour of a texture at a place.
    fn colour(texture: &str, position: Vec3, uv: Vec2) -> Vec3 {
        let text =
            format!("WorldBegin Texture \"t\" {texture} Material \"diffuse\" \"texture reflectance\" \"t\"");
        let scene = read_str(&text, Path::new("")).unwrap_or_else(|error| panic!("{error}"));
        assert!(scene.warnings.is_empty(), "{texture}: {:?}", scene.warnings);
        let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!() };
        scene.textures.rgb(reflectance, TexturePoint { uv, position })
    }

    #[test]
    fn procedural_textures_are_read_with_their_parameters() {
        let place = Vec3::new(0.5, 0.25, 0.75);
        let at = |texture: &str| colour(texture, place, Vec2::ZERO);
        // The noise there, which is tested with the noise itself.
        let noise = -0.375_078_7;
        let near =
            |found: Vec3, expected: f32| assert!((found - expected).abs().max_element() < 1e-5, "{found}");
        near(at(ONE_OCTAVE), noise);
        near(at("\"spectrum\" \"wrinkled\" \"integer octaves\" 1 \"float roughness\" 0"), noise.abs());
        // The texture's space is that of its directive.
        let moved =
            format!("{ONE_OCTAVE} TransformBegin Translate 1 2 3 Texture \"t\" {ONE_OCTAVE} TransformEnd");
        near(colour(&moved, place + Vec3::new(1.0, 2.0, 3.0), Vec2::ZERO), noise);
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
        let board = "\"spectrum\" \"checkerboard\" \"string mapping\" \"cylindrical\"";
        let at = |z: f32| colour(board, Vec3::new(1.0, 0.0, z), Vec2::ZERO);
        assert_eq!([at(0.5), at(1.5)], [Vec3::ONE, Vec3::ZERO]);
    }
}
