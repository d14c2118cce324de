//! `Texture`, and parameters that may be textures.

mod image_textures;
mod spectrum_parameters;
mod texture_directive;
mod texture_mapping;
mod texture_parameter;

pub use self::image_textures::image_encoding;
