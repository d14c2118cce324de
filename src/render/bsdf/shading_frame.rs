//! The shading frame: interpolated normal, bent by a bump map or a normal map.
//!
//! As in pbrt-v4, sections 10.5.1 and 10.5.3: a normal map wins over displacement; the height's
//! gradient is a finite difference; a normal that comes out on the wrong side of the surface is
//! turned round. Unlike there, a bump is laid over the surface as if it were locally flat: the
//! terms with ∂n/∂u and ∂n/∂v, of the size of height times curvature, are left out.

use glam::{Vec2, Vec3};

use super::frame::Frame;
use crate::geometry::SurfacePoint;
use crate::scene::texture::TexturePoint;
use crate::scene::{Material, Textures};

/// Step in u and v of the finite differences (pbrt-v4's where there is no ray footprint).
const STEP: f32 = 0.0005;
/// Derivatives with a smaller sine between them span no surface that a height could bend.
const LEAST_SINE: f32 = 1e-5;

/// The frame in which a material scatters at a point.
pub(super) fn of(textures: &Textures, material: &Material, point: &SurfacePoint) -> Frame {
    if let Some(id) = material.normal_map {
        let at = TexturePoint { uv: point.uv, position: point.position };
        normal_mapped(point, textures.rgb(id, at))
    } else if let Some(id) = material.displacement {
        bumped(point, |at| textures.float(id, at))
    } else {
        Frame::new(point.shading_normal, point.dpdu)
    }
}

/// The frame whose normal the colour `encoded` holds in tangent space: [0, 1] for [-1, 1].
fn normal_mapped(point: &SurfacePoint, encoded: Vec3) -> Frame {
    let tangent_space = Frame::new(point.shading_normal, point.dpdu);
    let normal = tangent_space.to_render(2.0 * encoded - 1.0);
    bent(point, normal, point.dpdu)
}

/// The frame of the surface moved by `height` along its normal.
fn bumped(point: &SurfacePoint, height: impl Fn(TexturePoint) -> f32) -> Frame {
    let n = point.shading_normal;
    let tangential = |d: Vec3| d - n * n.dot(d);
    let (dpdu, dpdv) = (tangential(point.dpdu), tangential(point.dpdv));
    let area = dpdu.cross(dpdv).length();
    if area <= LEAST_SINE * dpdu.length() * dpdv.length() {
        return Frame::new(n, point.dpdu);
    }
    let here = height(TexturePoint { uv: point.uv, position: point.position });
    let slope = |d_uv: Vec2, d_position: Vec3| {
        let there = TexturePoint { uv: point.uv + d_uv * STEP, position: point.position + d_position * STEP };
        (height(there) - here) / STEP
    };
    let bumped_u = dpdu + n * slope(Vec2::X, dpdu);
    let bumped_v = dpdv + n * slope(Vec2::Y, dpdv);
    bent(point, bumped_u.cross(bumped_v), bumped_u)
}

/// The frame of a new normal of any length, turned to the geometric normal's side; the old normal
/// stays where the new one is degenerate.
fn bent(point: &SurfacePoint, normal: Vec3, tangent: Vec3) -> Frame {
    match normal.try_normalize() {
        Some(n) if n.dot(point.geometric_normal) < 0.0 => Frame::new(-n, tangent),
        Some(n) => Frame::new(n, tangent),
        None => Frame::new(point.shading_normal, point.dpdu),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat_point() -> SurfacePoint {
        SurfacePoint {
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
    fn a_constant_height_bends_nothing() {
        assert_eq!(bumped(&flat_point(), |_| 7.0), Frame::new(Vec3::Z, Vec3::X));
    }

    #[test]
    fn a_ramp_tilts_the_normal_by_its_slope() {
        // u = x / 2, so a height of u rises by 1 in 2.
        let frame = bumped(&flat_point(), |at| at.uv.x);
        assert!((frame.z - Vec3::new(-0.5, 0.0, 1.0).normalize()).length() < 1e-3, "{}", frame.z);
        let frame = bumped(&flat_point(), |at| -at.position.y);
        assert!((frame.z - Vec3::new(0.0, 1.0, 1.0).normalize()).length() < 1e-3, "{}", frame.z);
    }

    #[test]
    fn a_mirrored_parametrisation_keeps_the_normals_side() {
        let mirrored = SurfacePoint { dpdv: Vec3::NEG_Y, ..flat_point() };
        let frame = bumped(&mirrored, |at| at.uv.x);
        assert!((frame.z - Vec3::new(-0.5, 0.0, 1.0).normalize()).length() < 1e-3, "{}", frame.z);
    }

    #[test]
    fn parallel_derivatives_and_infinite_heights_leave_the_normal_alone() {
        let degenerate = SurfacePoint { dpdv: Vec3::X, ..flat_point() };
        assert_eq!(bumped(&degenerate, |at| at.uv.x).z, Vec3::Z);
        assert_eq!(bumped(&flat_point(), |_| f32::INFINITY).z, Vec3::Z);
    }

    #[test]
    fn a_normal_map_is_read_in_tangent_space() {
        let frame = normal_mapped(&flat_point(), Vec3::new(0.5, 0.5, 1.0));
        assert!((frame.z - Vec3::Z).length() < 1e-6);
        let frame = normal_mapped(&flat_point(), Vec3::new(0.8, 0.5, 0.9));
        assert!((frame.z - Vec3::new(0.6, 0.0, 0.8)).length() < 1e-6);
    }
}
