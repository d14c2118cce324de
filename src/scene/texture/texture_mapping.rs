//! Mappings from surface points to texture coordinates.

use std::f32::consts::{PI, TAU};

use glam::{Affine3A, Vec2, Vec3};

/// A surface point at which a texture is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct TexturePoint {
    pub uv: Vec2,
    /// Position in render space, for mappings of positions.
    pub position: Vec3,
}

/// A mapping from a surface point to texture coordinates (s, t).
#[derive(Clone, Copy, Debug)]
pub enum TextureMapping {
    /// (s, t) = scale · (u, v) + offset.
    Uv { scale: Vec2, offset: Vec2 },
    /// (s, t) = the first two coordinates of the position in texture space. Solid textures use all
    /// three.
    Space(Affine3A),
    /// (s, t) = polar angle from z and azimuth in texture space, as fractions of their ranges. `flip`
    /// replaces t by 1 − t.
    Spherical { to_texture: Affine3A, flip: bool },
    /// (s, t) = azimuth as a fraction of its range and height along z, in texture space; if `normalised`,
    /// the height of the unit vector in the point's direction. `flip` replaces t by 1 − t.
    Cylindrical { to_texture: Affine3A, normalised: bool, flip: bool },
}

impl TextureMapping {
    /// Texture coordinates (s, t) of a point, and the third coordinate of a solid texture.
    pub fn coordinates(&self, at: TexturePoint) -> Vec3 {
        match self {
            TextureMapping::Uv { scale, offset } => (*scale * at.uv + *offset).extend(0.0),
            TextureMapping::Space(to_texture) => to_texture.transform_point3(at.position),
            TextureMapping::Spherical { to_texture, flip } => {
                let p = to_texture.transform_point3(at.position);
                let azimuth = p.y.atan2(p.x) / TAU;
                let polar = p.truncate().length().atan2(p.z) / PI;
                st(polar, if azimuth < 0.0 { azimuth + 1.0 } else { azimuth }, *flip)
            }
            TextureMapping::Cylindrical { to_texture, normalised, flip } => {
                let p = to_texture.transform_point3(at.position);
                let height = if *normalised { p.normalize_or_zero().z } else { p.z };
                st(0.5 + p.y.atan2(p.x) / TAU, height, *flip)
            }
        }
    }
}

/// Texture coordinates, with t flipped if `flip` is set.
fn st(s: f32, t: f32, flip: bool) -> Vec3 {
    Vec3::new(s, if flip { 1.0 - t } else { t }, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spherical_and_cylindrical_coordinates_are_in_the_unit_interval() {
        let to_texture = Affine3A::from_translation(Vec3::new(0.0, 0.0, -1.0));
        let at = |mapping: TextureMapping, x: f32, y: f32, z: f32| {
            let position = Vec3::new(x, y, z);
            mapping.coordinates(TexturePoint { uv: Vec2::ZERO, position }).truncate()
        };
        let sphere = |flip| TextureMapping::Spherical { to_texture, flip };
        let cylinder = |flip| TextureMapping::Cylindrical { to_texture, normalised: false, flip };
        assert_eq!(at(sphere(false), 2.0, 0.0, 1.0), Vec2::new(0.5, 0.0));
        assert_eq!(at(sphere(false), 0.0, -2.0, 1.0), Vec2::new(0.5, 0.75));
        assert_eq!(at(sphere(true), 0.0, 0.1, 1.0), Vec2::new(0.5, 0.75));
        assert_eq!(at(sphere(false), 0.0, 0.0, 4.0).x, 0.0);
        assert_eq!(at(cylinder(false), 3.0, 0.0, 1.25), Vec2::new(0.5, 0.25));
        assert_eq!(at(cylinder(true), 0.0, 3.0, 1.25), Vec2::new(0.75, 0.75));
    }
}
