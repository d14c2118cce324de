//! Types that parameters are declared with.

/// The declared type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterType {
    Float,
    Integer,
    Bool,
    String,
    Texture,
    Rgb,
    Xyz,
    Spectrum,
    Blackbody,
    Point2,
    Point3,
    Vector2,
    Vector3,
    Normal3,
}

impl ParameterType {
    /// Parses a type name in the spelling of any dialect.
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "float" => Self::Float,
            "integer" => Self::Integer,
            "bool" => Self::Bool,
            "string" => Self::String,
            "texture" => Self::Texture,
            "rgb" | "color" => Self::Rgb,
            "xyz" => Self::Xyz,
            "spectrum" => Self::Spectrum,
            "blackbody" => Self::Blackbody,
            "point2" => Self::Point2,
            "point3" | "point" => Self::Point3,
            "vector2" => Self::Vector2,
            "vector3" | "vector" => Self::Vector3,
            "normal3" | "normal" => Self::Normal3,
            _ => return None,
        })
    }
}
