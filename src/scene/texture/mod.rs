//! Textures and the images they use.

mod floor;
mod load;
mod pfm;
mod procedural;
mod texture_id;
mod texture_image;
mod texture_mapping;
mod texture_value;
mod textures;

pub(crate) use self::floor::floor;
pub use self::load::{Content, Encoding, load, one_texel};
pub use self::procedural::Procedural;
pub use self::texture_id::{FloatTextureId, ImageId, RgbTextureId};
pub use self::texture_image::{Texel, TextureImage, WrapMode};
pub use self::texture_mapping::{TextureMapping, TexturePoint};
pub use self::texture_value::TextureValue;
pub use self::textures::{ImageFilter, ImageTexture, PooledValue, Texture, Textures};
