//! Computes the shading frame from the interpolated normal and a material's bump map or normal map.
//!
//! As in pbrt-v4, section 10.5.3, a normal map takes precedence over displacement, the gradient of the height is
//! a finite difference, and a normal on the wrong side of the surface is flipped. Unlike in pbrt, the surface
//! under a bump map counts as locally flat: the terms with ∂n/∂u and ∂n/∂v, in the order of height times
//! curvature, are omitted.

use glam::{Vec2, Vec3};

use super::shading_frame::ShadingFrame;
use crate::geometry::SurfaceInteraction;
use crate::scene::texture::TexturePoint;
use crate::scene::{Material, Textures};

/// Largest step in u and v of the finite differences (pbrt-v4's without ray differentials). It is at most a texel of the finest image:
/// over several of them bumps would cancel out.
const STEP: f32 = 0.0005;
/// Least step: below it rounding errors of u and v would show.
const LEAST_STEP: f32 = 4e-6;
/// Below this sine of the angle between ∂p/∂u and ∂p/∂v the parametrisation is degenerate, and bump mapping is
/// skipped.
const MIN_SINE: f32 = 1e-5;

/// The shading frame of a material at a point, after its bump map or normal map.
pub(super) fn bumped_shading_frame(
    textures: &Textures,
    material: &Material,
    point: &SurfaceInteraction,
) -> ShadingFrame {
    if let Some(id) = material.normal_map {
        let at = TexturePoint { uv: point.uv, position: point.position };
        normal_mapped(point, textures.rgb(id, at))
    } else if let Some(id) = material.displacement {
        let step = textures.texel_step(id).clamp(LEAST_STEP, STEP);
        bumped(point, step, |at| textures.float(id, at))
    } else {
        ShadingFrame::new(point.shading_normal, point.dpdu)
    }
}

/// The frame of the tangent-space normal that the colour `encoded` encodes: [0, 1] for [-1, 1].
fn normal_mapped(point: &SurfaceInteraction, encoded: Vec3) -> ShadingFrame {
    let tangent_space = ShadingFrame::new(point.shading_normal, point.dpdu);
    let normal = tangent_space.to_render(2.0 * encoded - 1.0);
    oriented_frame(point, normal, point.dpdu)
}

/// The frame of the surface displaced by `height` along its normal.
fn bumped(point: &SurfaceInteraction, step: f32, height: impl Fn(TexturePoint) -> f32) -> ShadingFrame {
    let n = point.shading_normal;
    let tangential = |d: Vec3| d - n * n.dot(d);
    let (dpdu, dpdv) = (tangential(point.dpdu), tangential(point.dpdv));
    let area = dpdu.cross(dpdv).length();
    if area <= MIN_SINE * dpdu.length() * dpdv.length() {
        return ShadingFrame::new(n, point.dpdu);
    }
    let centre = height(TexturePoint { uv: point.uv, position: point.position });
    let derivative = |d_uv: Vec2, d_position: Vec3| {
        let shifted =
            TexturePoint { uv: point.uv + d_uv * step, position: point.position + d_position * step };
        (height(shifted) - centre) / step
    };
    let bumped_dpdu = dpdu + n * derivative(Vec2::X, dpdu);
    let bumped_dpdv = dpdv + n * derivative(Vec2::Y, dpdv);
    oriented_frame(point, bumped_dpdu.cross(bumped_dpdv), bumped_dpdu)
}

/// The frame of a mapped normal of any length, flipped to the geometric normal's side; the frame of the
/// interpolated normal if the mapped one is degenerate.
fn oriented_frame(point: &SurfaceInteraction, normal: Vec3, tangent: Vec3) -> ShadingFrame {
    match normal.try_normalize() {
        Some(n) if n.dot(point.geometric_normal) < 0.0 => ShadingFrame::new(-n, tangent),
        Some(n) => ShadingFrame::new(n, tangent),
        None => ShadingFrame::new(point.shading_normal, point.dpdu),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat_point() -> SurfaceInteraction {
        SurfaceInteraction {
            position: Vec3::ZERO,
            position_error: Vec3::ZERO,
            geometric_normal: Vec3::Z,
            shading_normal: Vec3::Z,
            dpdu: Vec3::X * 2.0,
            dpdv: Vec3::Y * 4.0,
            uv: Vec2::splat(0.5),
            primitive: 0,
            element: 0,
        }
    }

    #[test]
    fn a_constant_height_keeps_the_normal() {
        assert_eq!(bumped(&flat_point(), STEP, |_| 7.0), ShadingFrame::new(Vec3::Z, Vec3::X));
    }

    #[test]
    fn a_linear_height_tilts_the_normal_by_its_slope() {
        // u = x / 2, so a height of u rises by 1 in 2.
        let frame = bumped(&flat_point(), STEP, |at| at.uv.x);
        assert!((frame.z - Vec3::new(-0.5, 0.0, 1.0).normalize()).length() < 1e-3, "{}", frame.z);
        let frame = bumped(&flat_point(), STEP, |at| -at.position.y);
        assert!((frame.z - Vec3::new(0.0, 1.0, 1.0).normalize()).length() < 1e-3, "{}", frame.z);
    }

    #[test]
    fn heights_along_opposite_tangents_are_depths() {
        let opposite = SurfaceInteraction { dpdu: Vec3::NEG_X, dpdv: Vec3::NEG_Y, ..flat_point() };
        let frame = bumped(&opposite, STEP, |at| at.uv.x + 2.0 * at.uv.y);
        assert!((frame.z - Vec3::new(1.0, 2.0, 1.0).normalize()).length() < 1e-3, "{}", frame.z);
    }

    #[test]
    fn a_left_handed_parametrisation_keeps_the_side_of_the_normal() {
        let mirrored = SurfaceInteraction { dpdv: Vec3::NEG_Y, ..flat_point() };
        let frame = bumped(&mirrored, STEP, |at| at.uv.x);
        assert!((frame.z - Vec3::new(-0.5, 0.0, 1.0).normalize()).length() < 1e-3, "{}", frame.z);
    }

    #[test]
    fn parallel_derivatives_and_infinite_heights_keep_the_normal() {
        let degenerate = SurfaceInteraction { dpdv: Vec3::X, ..flat_point() };
        assert_eq!(bumped(&degenerate, STEP, |at| at.uv.x).z, Vec3::Z);
        assert_eq!(bumped(&flat_point(), STEP, |_| f32::INFINITY).z, Vec3::Z);
    }

    #[test]
    fn a_normal_map_is_in_tangent_space() {
        let frame = normal_mapped(&flat_point(), Vec3::new(0.5, 0.5, 1.0));
        assert!((frame.z - Vec3::Z).length() < 1e-6);
        let frame = normal_mapped(&flat_point(), Vec3::new(0.8, 0.5, 0.9));
        assert!((frame.z - Vec3::new(0.6, 0.0, 0.8)).length() < 1e-6);
    }
}
