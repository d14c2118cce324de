//! What differs between the dialects of pbrt's versions 2, 3 and 4.
//!
//! v4 is the reference. The older ones are read as far as they mean the same, and approximated,
//! with a warning, where an old material has no exact counterpart.

use glam::Vec3;

use super::lexer::{Lexer, TokenKind};
use super::params::{ParamType, Params};
use super::state::Reader;
use super::{Place, Result};
use crate::scene::film::PixelFilter;
use crate::scene::material::{MaterialKind, Metal, Roughness};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    V2,
    V3,
    V4,
}

impl Dialect {
    /// Recognises the dialect of a main file. Only the older ones close the world with `WorldEnd`,
    /// and only v3 of these says `Integrator`.
    pub fn detect(text: &[u8]) -> Self {
        let mut lexer = Lexer::new(text, 0);
        let (mut world_end, mut integrator) = (false, false);
        // What is no token is reported when it is read in earnest.
        while let Ok(Some(token)) = lexer.next() {
            if let TokenKind::Word(word) = token.kind {
                world_end |= word == "WorldEnd";
                integrator |= word == "Integrator";
            }
        }
        match (world_end, integrator) {
            (false, _) => Dialect::V4,
            (true, true) => Dialect::V3,
            (true, false) => Dialect::V2,
        }
    }

    /// Whether `AttributeEnd` may close `ObjectBegin` and the other way round: in the older
    /// dialects both work on one stack.
    pub fn blocks_may_cross(self) -> bool {
        self != Dialect::V4
    }

    /// Whether `TransformEnd` restores the transform only, rather than all attributes.
    pub fn transform_blocks_hold_transforms_only(self) -> bool {
        self != Dialect::V4
    }

    /// Whether v = 0 is the bottom row of an image.
    pub fn images_start_at_the_bottom(self) -> bool {
        self != Dialect::V2
    }

    /// Whether environment images are latitude-longitude maps.
    pub fn environments_are_lat_long(self) -> bool {
        self != Dialect::V4
    }

    /// The filter of a scene that names none.
    pub fn default_filter(self) -> PixelFilter {
        match self {
            Dialect::V4 => PixelFilter::Gaussian { radius: [1.5; 2], sigma: 0.5 },
            Dialect::V2 | Dialect::V3 => PixelFilter::Box { radius: [0.5; 2] },
        }
    }

    /// The integrator of a scene that names none.
    pub fn default_integrator(self) -> &'static str {
        match self {
            Dialect::V2 => "directlighting",
            Dialect::V3 => "path",
            Dialect::V4 => "volpath",
        }
    }

    /// The size of the film, where it is not given.
    pub fn default_resolution(self) -> [u32; 2] {
        match self {
            Dialect::V2 | Dialect::V3 => [640, 480],
            Dialect::V4 => [1280, 720],
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

impl Reader {
    /// A material of an older dialect; `None` if the name is none of theirs.
    pub fn old_material(&mut self, kind: &str, params: &Params, place: Place) -> Result<Option<MaterialKind>> {
        let half = Vec3::splat(0.5);
        let quarter = Vec3::splat(0.25);
        Ok(Some(match kind {
            "matte" => MaterialKind::Diffuse { reflectance: self.rgb_texture_or(params, "Kd", half)? },
            "mirror" => MaterialKind::Conductor {
                metal: Metal::Reflectance(self.rgb_texture_or(params, "Kr", Vec3::splat(0.9))?),
                roughness: self.smooth(),
            },
            "glass" => {
                let eta = match params.get("index") {
                    Some(_) => self.refractive_index(params, "index", 1.5)?,
                    None => self.refractive_index(params, "eta", 1.5)?,
                };
                MaterialKind::Dielectric { eta, roughness: self.smooth() }
            }
            "metal" => MaterialKind::Conductor {
                metal: self.metal(params, "")?,
                roughness: self.old_roughness(params, 0.01)?,
            },
            "plastic" | "substrate" => {
                self.warnings.add(place, format!("material \"{kind}\" is approximated by \"coateddiffuse\""));
                MaterialKind::CoatedDiffuse {
                    reflectance: self.rgb_texture_or(params, "Kd", if kind == "plastic" { quarter } else { half })?,
                    eta: 1.5,
                    roughness: self.old_roughness(params, 0.1)?,
                }
            }
            _ => return Ok(None),
        }))
    }

    /// Roughness as the older dialects mean it.
    fn old_roughness(&mut self, params: &Params, default: f64) -> Result<Roughness> {
        self.roughness(params, "", default)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dialects_are_recognised_by_their_words() {
        assert_eq!(Dialect::detect(b"Integrator \"path\" WorldBegin # WorldEnd"), Dialect::V4);
        assert_eq!(Dialect::detect(b"Integrator \"path\" WorldBegin WorldEnd"), Dialect::V3);
        assert_eq!(Dialect::detect(b"SurfaceIntegrator \"path\" WorldBegin WorldEnd"), Dialect::V2);
    }
}
