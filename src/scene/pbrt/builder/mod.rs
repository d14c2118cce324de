//! The scene under construction and the graphics state.
//!
//! [`SceneBuilder`] holds the data; the directives are methods of it in the folders beside this one.

mod camera_file;
mod graphics_state;
mod image_files;
mod material_ref;
mod named_textures;
mod object_definition;
mod parser_scope;
mod primitive_group;
mod render_options;
mod scene_builder;

pub use self::camera_file::CameraFile;
pub use self::graphics_state::{AreaLightSource, GraphicsState, TransformSet};
pub use self::image_files::ImageFiles;
pub use self::material_ref::{MaterialEntity, MaterialRef};
pub use self::named_textures::{NamedTextures, TextureSize, TexturesByName};
pub use self::object_definition::{InstanceEntity, ObjectDefinition, ObjectPart};
pub use self::parser_scope::{ParserScope, ScopeKind};
pub use self::primitive_group::PrimitiveGroup;
pub use self::render_options::{OptionStatement, RenderOptions};
pub use self::scene_builder::SceneBuilder;
