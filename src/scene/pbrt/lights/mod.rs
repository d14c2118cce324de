//! `LightSource` and `AreaLightSource`.

mod infinite_light;
mod light_directives;
mod light_power;
mod projectors;

pub use self::light_power::scale_light;
