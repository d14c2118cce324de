//! What differs between the dialects of pbrt's versions 2, 3 and 4.
//!
//! v4 is the reference. The older ones' materials are sums of lobes, and keep their formulas:
//! Blinn's microfacets in v2 (exponent 1 / roughness), GGX in v3. Their plastics, and v2's `uber`
//! and `translucent`, take the index of refraction the wrong way round, so that everything beyond
//! the critical angle is reflected; images made with them show that, and it is kept.

use std::path::Path;

use glam::Vec3;

use super::params::{ParamType, Params};
use super::spectrum::Spectrum;
use super::state::Reader;
use super::{Fault, Place, Result};
use crate::scene::RgbTextureId;
use crate::scene::film::PixelFilter;
use crate::scene::light::SpotFalloff;
use crate::scene::material::{Additive, Layer, MaterialKind, Metal, RoughnessScale};
use crate::scene::texture::{Channels, Encoding, Texture};

/// A version of pbrt, by what its scene files mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    V2,
    V3,
    V4,
}

impl std::fmt::Display for Dialect {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Dialect::V2 => "pbrt-v2",
            Dialect::V3 => "pbrt-v3",
            Dialect::V4 => "pbrt-v4",
        })
    }
}

impl Dialect {
    /// Whether `AttributeEnd` may close `ObjectBegin` and the other way round: in the older
    /// dialects both work on one stack.
    pub(super) fn blocks_may_cross(self) -> bool {
        self != Dialect::V4
    }

    /// Whether the end of the world ends the blocks that are still open.
    pub(super) fn worlds_end_blocks(self) -> bool {
        self != Dialect::V4
    }

    /// Whether texture coordinates of a mesh beyond one for each vertex are passed over, rather than all of them.
    pub(super) fn surplus_uvs_are_cut(self) -> bool {
        self != Dialect::V4
    }

    /// Whether `TransformEnd` restores the transform only, rather than all attributes.
    pub(super) fn transform_blocks_hold_transforms_only(self) -> bool {
        self != Dialect::V4
    }

    /// Whether the name of a material or an object may stand before what makes it.
    pub(super) fn names_may_come_first(self) -> bool {
        self == Dialect::V4
    }

    /// Whether `NamedMaterial` of an unknown name leaves things as they are.
    pub(super) fn unknown_materials_are_forgiven(self) -> bool {
        self != Dialect::V4
    }

    /// Whether a shape may have parameters of its material, which count more than the material's own.
    pub(super) fn shapes_change_materials(self) -> bool {
        self != Dialect::V4
    }

    /// Whether that goes for materials that have a name, too, which v2 makes once and for all.
    pub(super) fn shapes_change_named_materials(self) -> bool {
        self == Dialect::V3
    }

    /// Whether a surface is there wherever its alpha is not 0, rather than with that probability.
    pub(super) fn alpha_is_a_mask(self) -> bool {
        self != Dialect::V4
    }

    /// Whether solid textures are looked up where the current transform takes a point of the world, and planar ones
    /// at that point, rather than both in the space that the transform leads from.
    pub(super) fn textures_turn_the_world(self) -> bool {
        self != Dialect::V4
    }

    /// Whether the amount of a mix of materials is a colour.
    pub(super) fn mixes_by_colour(self) -> bool {
        self != Dialect::V4
    }

    /// Whether an image is as bright as its shutter is long open.
    pub(super) fn shutter_exposes(self) -> bool {
        self == Dialect::V4
    }

    /// Whether v = 0 is the bottom row of an image.
    pub(super) fn images_start_at_the_bottom(self) -> bool {
        self != Dialect::V2
    }

    /// Whether environment images are latitude-longitude maps.
    pub(super) fn environments_are_lat_long(self) -> bool {
        self != Dialect::V4
    }

    /// What a roughness means; `remap` is the parameter `remaproughness`, which v2 does not have.
    pub(super) fn roughness_scale(self, remap: bool) -> RoughnessScale {
        match (self, remap) {
            (Dialect::V2, _) => RoughnessScale::InverseExponent,
            (_, false) => RoughnessScale::Alpha,
            (Dialect::V3, true) => RoughnessScale::Logarithm,
            (Dialect::V4, true) => RoughnessScale::SquareRoot,
        }
    }

    /// What an image holds whose parameters ask for `wanted`, if they do. v4 asks only of PNG files, and takes
    /// all others of integers for sRGB; the older dialects take a parameter at its word, of every file.
    pub(super) fn encoding_of(self, path: &Path, wanted: Option<Encoding>) -> Encoding {
        let floats = is_one_of(path, &["exr", "pfm"]);
        let usual = if floats || self == Dialect::V2 { Encoding::Linear } else { Encoding::Srgb };
        let asks = self != Dialect::V4 || is_one_of(path, &["png"]);
        wanted.filter(|_| asks).unwrap_or(usual)
    }

    /// Field of view of lights that project an image, in degrees.
    pub(super) fn default_projection_fov(self) -> f64 {
        if self == Dialect::V4 { 90.0 } else { 45.0 }
    }

    /// Whether a projected image's first row is above.
    pub(super) fn projections_are_upright(self) -> bool {
        self == Dialect::V4
    }

    /// Whether the first row of an image is its bottom: v2 reads these formats so.
    pub(super) fn reads_upwards(self, path: &Path) -> bool {
        self == Dialect::V2 && is_one_of(path, &["tga", "pfm"])
    }

    /// What images of lights hold, where that is not said as for other images.
    pub(super) fn light_encoding(self) -> Option<Encoding> {
        (self != Dialect::V4).then_some(Encoding::Linear)
    }

    /// What a scalar texture takes from an image.
    pub(super) fn scalar_channels(self) -> Channels {
        if self == Dialect::V4 { Channels::All } else { Channels::Luminance }
    }

    /// The factor of an image's linear values, of one that says `scale`: v2 multiplies before it decodes.
    pub(super) fn image_scale(self, scale: f64, encoding: Option<Encoding>) -> f64 {
        match (self, encoding) {
            (Dialect::V2, Some(Encoding::Gamma(gamma))) => scale.max(0.0).powf(gamma.into()),
            _ => scale,
        }
    }

    /// Reflectance, or index of refraction, by channel.
    pub(super) fn reflectance_of(self, spectrum: &Spectrum) -> Vec3 {
        match self {
            Dialect::V2 | Dialect::V3 => spectrum.unadapted(),
            Dialect::V4 => spectrum.reflectance(),
        }
    }

    /// Colour of a light; in v4 its brightness is said elsewhere.
    pub(super) fn light_of(self, spectrum: &Spectrum) -> Vec3 {
        match self {
            Dialect::V2 | Dialect::V3 => spectrum.unadapted().max(Vec3::ZERO),
            Dialect::V4 => spectrum.illuminant(),
        }
    }

    /// Whether the samples of a spectrum may stand in any order, rather than by rising wavelength.
    pub(super) fn sorts_spectra(self) -> bool {
        self != Dialect::V4
    }

    /// Whether a spectrum is 0 beyond its samples, rather than constant.
    pub(super) fn spectra_end(self) -> bool {
        self == Dialect::V4
    }

    /// The filter of a scene that names none.
    pub(super) fn default_filter(self) -> PixelFilter {
        match self {
            Dialect::V4 => PixelFilter::Gaussian { radius: [1.5; 2], sigma: 0.5 },
            Dialect::V2 | Dialect::V3 => PixelFilter::Box { radius: [0.5; 2] },
        }
    }

    /// What the radius of a pixel filter is called.
    pub(super) fn filter_radius_names(self) -> [&'static str; 2] {
        match self {
            Dialect::V4 => ["xradius", "yradius"],
            Dialect::V2 | Dialect::V3 => ["xwidth", "ywidth"],
        }
    }

    /// The radius of a Gaussian filter, where it is not given.
    pub(super) fn default_gaussian_radius(self) -> f64 {
        if self == Dialect::V4 { 1.5 } else { 2.0 }
    }

    /// How a spot light falls off between its two angles.
    pub(super) fn spot_falloff(self) -> SpotFalloff {
        if self == Dialect::V4 { SpotFalloff::Smoothstep } else { SpotFalloff::FourthPower }
    }

    /// The integrator of a scene that names none.
    pub(super) fn default_integrator(self) -> &'static str {
        match self {
            Dialect::V2 => "directlighting",
            Dialect::V3 => "path",
            Dialect::V4 => "volpath",
        }
    }

    /// The largest number of scattering events of a path. v2 looks at its limit only after the
    /// light of the last event was gathered, so that there is one more.
    pub(super) fn scattering_events(self, max_depth: u32) -> u32 {
        if self == Dialect::V2 { max_depth + 1 } else { max_depth }
    }

    /// The size of the film, where it is not given.
    pub(super) fn default_resolution(self) -> [u32; 2] {
        match self {
            Dialect::V2 => [640, 480],
            Dialect::V3 | Dialect::V4 => [1280, 720],
        }
    }
}

/// The type that a parameter is declared with.
pub fn parameter_type(name: &str) -> Option<ParamType> {
    Some(match name {
        "float" => ParamType::Float,
        "integer" => ParamType::Integer,
        "bool" => ParamType::Bool,
        "string" => ParamType::String,
        "texture" => ParamType::Texture,
        "rgb" | "color" => ParamType::Rgb,
        "xyz" => ParamType::Xyz,
        "spectrum" => ParamType::Spectrum,
        "blackbody" => ParamType::Blackbody,
        "point2" => ParamType::Point2,
        "point3" | "point" => ParamType::Point3,
        "vector2" => ParamType::Vector2,
        "vector3" | "vector" => ParamType::Vector3,
        "normal3" | "normal" => ParamType::Normal3,
        _ => return None,
    })
}

/// Whether a file's name ends in one of these.
fn is_one_of(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|found| extensions.iter().any(|name| found.eq_ignore_ascii_case(name)))
}

/// Index of refraction of the gloss of plastics.
const PLASTIC_ETA: f32 = 1.5;

impl Reader {
    /// The names of the two materials of a mix, the one that `amount` 0 gives first.
    pub fn mixed_names<'p>(&self, params: &'p Params, place: Place) -> Result<[&'p str; 2]> {
        if let Some([first, second]) = params.strings("materials")? {
            return Ok([first, second]);
        }
        // In the older dialects `amount` is that of the first.
        match (params.string("namedmaterial1")?, params.string("namedmaterial2")?) {
            (Some(first), Some(second)) => Ok([second, first]),
            _ => {
                let message = "a mix without \"string materials\"; the names of two would be accepted";
                Err(Fault::new(place, message))
            }
        }
    }

    /// A material of an older dialect; `None` if the name is none of theirs.
    pub fn old_material(
        &mut self,
        kind: &str,
        params: &Params,
        place: Place,
    ) -> Result<Option<MaterialKind>> {
        let gray = Vec3::splat;
        Ok(Some(match kind {
            "matte" => {
                let reflectance = self.rgb_texture_or(params, "Kd", gray(0.5))?;
                let sigma = self.float_texture_or(params, "sigma", 0.0)?;
                if self.textures.constant_float(sigma) == Some(0.0) {
                    MaterialKind::Diffuse { reflectance }
                } else {
                    MaterialKind::OrenNayar { reflectance, sigma }
                }
            }
            "mirror" => MaterialKind::Mirror { reflectance: self.rgb_texture_or(params, "Kr", gray(0.9))? },
            "glass" => self.glass(params)?,
            "metal" => MaterialKind::Conductor {
                metal: self.metal(params, "")?,
                roughness: self.roughness(params, "", 0.01)?,
            },
            "shinymetal" => {
                let message = "material \"shinymetal\" is read as \"metal\" of the reflectance \"Ks\"";
                self.warnings.add(place, message);
                params.get("Kr");
                MaterialKind::Conductor {
                    metal: Metal::Reflectance(self.rgb_texture_or(params, "Ks", gray(1.0))?),
                    roughness: self.roughness(params, "", 0.1)?,
                }
            }
            "substrate" => MaterialKind::FresnelBlend {
                diffuse: self.rgb_texture_or(params, "Kd", gray(0.5))?,
                specular: self.rgb_texture_or(params, "Ks", gray(0.5))?,
                roughness: self.roughness(params, "", 0.1)?,
            },
            "plastic" => {
                let diffuse = [Some(self.rgb_texture_or(params, "Kd", gray(0.25))?), None];
                let colours = [Some(self.rgb_texture_or(params, "Ks", gray(0.25))?), None];
                let roughness = self.roughness(params, "", 0.1)?;
                let gloss = Some(Layer { colours, eta: 1.0 / PLASTIC_ETA, roughness });
                MaterialKind::Additive(Box::new(Additive { diffuse, gloss, ..Additive::default() }))
            }
            "uber" => self.uber(params)?,
            "translucent" => self.translucent(params)?,
            _ => return Ok(None),
        }))
    }

    /// Glass whose two sides of light may be coloured.
    fn glass(&mut self, params: &Params) -> Result<MaterialKind> {
        let eta = self.old_index(params)?;
        let colours = ["Kr", "Kt"].map(|name| self.rgb_texture_or(params, name, Vec3::ONE));
        let [reflected, transmitted] = colours;
        let colours = [Some(reflected?), Some(transmitted?)];
        let roughness = self.roughness(params, "", 0.0)?;
        let white =
            |id: &Option<RgbTextureId>| id.is_none_or(|id| self.textures.constant_rgb(id) == Some(Vec3::ONE));
        if colours.iter().all(white) {
            return Ok(MaterialKind::Dielectric { eta, roughness });
        }
        let dielectric = Some(Layer { colours, eta, roughness });
        Ok(MaterialKind::Additive(Box::new(Additive { dielectric, ..Additive::default() })))
    }

    fn uber(&mut self, params: &Params) -> Result<MaterialKind> {
        let eta = match self.dialect {
            Dialect::V2 => self.old_index(params)?.recip(),
            Dialect::V3 | Dialect::V4 => self.old_index(params)?,
        };
        let mut colour = |name, default| self.rgb_texture_or(params, name, Vec3::splat(default)).map(Some);
        let diffuse = [colour("Kd", 0.25)?, None];
        let gloss = [colour("Ks", 0.25)?, None];
        let boundary = [colour("Kr", 0.0)?, colour("Kt", 0.0)?];
        let opacity = colour("opacity", 1.0)?;
        let gloss = Some(Layer { colours: gloss, eta, roughness: self.roughness(params, "", 0.1)? });
        let dielectric = Some(Layer { colours: boundary, eta, roughness: self.smooth() });
        Ok(MaterialKind::Additive(Box::new(Additive { diffuse, gloss, dielectric, opacity })))
    }

    fn translucent(&mut self, params: &Params) -> Result<MaterialKind> {
        let half = Vec3::splat(0.5);
        let sides = ["reflect", "transmit"].map(|name| self.rgb_texture_or(params, name, half));
        let [reflect, transmit] = sides;
        let sides = [reflect?, transmit?];
        let mut colours = |name| -> Result<[Option<RgbTextureId>; 2]> {
            let first = self.rgb_texture_or(params, name, Vec3::splat(0.25))?;
            Ok(sides.map(|second| Some(self.textures.add(Texture::<Vec3>::Product { first, second }))))
        };
        let (diffuse, colours) = (colours("Kd")?, colours("Ks")?);
        let roughness = self.roughness(params, "", 0.1)?;
        let layer = |eta| Some(Layer { colours, eta, roughness });
        // v2's gloss is transmitted as it is reflected; v3's goes through as through rough glass.
        let (gloss, dielectric) = match self.dialect {
            Dialect::V2 => (layer(1.0 / PLASTIC_ETA), None),
            Dialect::V3 | Dialect::V4 => (None, layer(PLASTIC_ETA)),
        };
        Ok(MaterialKind::Additive(Box::new(Additive { diffuse, gloss, dielectric, opacity: None })))
    }

    fn old_index(&mut self, params: &Params) -> Result<f32> {
        let name = if params.get("eta").is_some() { "eta" } else { "index" };
        self.refractive_index(params, name, f64::from(PLASTIC_ETA))
    }
}

#[cfg(test)]
mod tests;
