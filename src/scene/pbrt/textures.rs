//! Textures and images, and parameters that may be textures.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};

use super::directives::Statement;
use super::params::{Param, ParamType, Params};
use super::spectrum::{Spectrum, rgb_from_xyz};
use super::state::Reader;
use super::{Fault, Place, Result, files};
use crate::scene::texture::{
    Encoding, FloatTextureId, ImageTexture, Mapping, RgbTextureId, Texture, TextureValue, Wrap,
};

/// Deepest texture of textures: a lookup follows both branches of each.
const MAX_TEXTURE_DEPTH: usize = 12;

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
    fn names(names: &mut TextureNames) -> &mut Names<Self::Id>;
    /// The value of a parameter that is not a texture.
    fn value(reader: &mut Reader, params: &Params, name: &str, default: Self) -> Result<Self>;
}

impl Parameter for f32 {
    const KIND: &'static str = "float";
    fn names(names: &mut TextureNames) -> &mut Names<FloatTextureId> {
        &mut names.floats
    }
    fn value(_: &mut Reader, params: &Params, name: &str, default: f32) -> Result<f32> {
        Ok(params.float(name)?.map_or(default, |value| value as f32))
    }
}

impl Parameter for Vec3 {
    const KIND: &'static str = "spectrum";
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
                [] => spectrum_of_numbers(param, numbers)?,
                [name] => self.named_spectrum(param, name)?,
                names => return Err(param.fault(format_args!("{} names", names.len()), "one name")),
            },
            _ => return Err(param.fault("of another type", "rgb, spectrum, blackbody or a texture")),
        }))
    }

    /// A spectrum that pbrt knows, or a file of wavelengths and values.
    fn named_spectrum(&self, param: &Param, name: &str) -> Result<Spectrum> {
        if let Some(spectrum) = Spectrum::named(name) {
            return Ok(spectrum);
        }
        let path = self.resolve(name);
        let shown = path.display();
        let numbers = files::numbers(&path).map_err(|error| {
            param.fault(format_args!("\"{shown}\" ({error})"), "a spectrum's name or file")
        })?;
        spectrum_of_numbers(param, &numbers)
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
            "imagemap" => Texture::Image(self.image_texture(params)?),
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
                    _ => Mapping::Space(self.to_texture(params.place)?.as_affine3a()),
                },
                even: self.texture_or(params, "tex1", one)?,
                odd: self.texture_or(params, "tex2", zero)?,
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

    fn image_texture(&mut self, params: &Params) -> Result<ImageTexture> {
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
        Ok(ImageTexture {
            image: self.image(file, encoding(params, self.dialect.default_encoding())?, params.place),
            mapping: self.mapping(params, self.dialect.images_start_at_the_bottom())?,
            wrap,
            scale: params.float_or("scale", 1.0)? as f32,
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
            return Ok(Mapping::Space((planes * self.to_texture(params.place)?).as_affine3a()));
        }
        match params.string("mapping")? {
            None | Some("uv") => {}
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

    /// Render space to the current, the texture's, space.
    fn to_texture(&self, place: Place) -> Result<DAffine3> {
        let inverse = self.to_render().inverse();
        if inverse.is_finite() {
            return Ok(inverse);
        }
        Err(Fault::new(place, "a singular transform; one that can be inverted would be accepted"))
    }
}

fn spectrum_of_numbers(param: &Param, numbers: &[f64]) -> Result<Spectrum> {
    Spectrum::from_numbers(numbers).ok_or_else(|| {
        param.fault(format_args!("{} numbers", numbers.len()), "pairs of rising wavelength (nm) and value")
    })
}

/// How 8- and 16-bit images are encoded: `encoding`, or v3's `gamma`.
pub fn encoding(params: &Params, default: Encoding) -> Result<Encoding> {
    if let Some(param) = params.get("gamma") {
        return Ok(match param.kind {
            ParamType::Bool if !params.bool_or("gamma", true)? => Encoding::Linear,
            ParamType::Bool => Encoding::Srgb,
            _ => Encoding::Gamma(params.positive_or("gamma", 1.0)? as f32),
        });
    }
    match params.string("encoding")? {
        None => Ok(default),
        Some("sRGB") => Ok(Encoding::Srgb),
        Some("linear") => Ok(Encoding::Linear),
        Some(other) => {
            match other.strip_prefix("gamma ").and_then(|gamma| gamma.trim().parse::<f32>().ok()) {
                Some(gamma) if gamma > 0.0 => Ok(Encoding::Gamma(gamma)),
                _ => {
                    let message =
                        format!("encoding \"{other}\"; sRGB, linear and \"gamma <number>\" are accepted");
                    Err(Fault::new(params.place, message))
                }
            }
        }
    }
}
