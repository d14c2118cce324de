//! The camera: a projection, a thin lens and a shutter.

use super::AnimatedTransform;

/// A camera in render space. The renderer generates its rays.
///
/// Camera space is pbrt's: x right, y up, z forward (left-handed).
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Camera space to render space.
    pub to_render: AnimatedTransform,
    pub projection: Projection,
    /// Extent of the image plane (x min, x max, y min, y max), see [`Projection`] for its units.
    pub screen_window: [f32; 4],
    /// Radius of the lens, in scene units; 0 is a pinhole.
    pub lens_radius: f32,
    /// Distance of the plane in focus, along the view axis, in scene units.
    pub focal_distance: f32,
    /// Time at which the shutter opens.
    pub shutter_open: f32,
    /// Time at which the shutter closes, not before it opens.
    pub shutter_close: f32,
}

/// Projection from camera space to the image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// A point (sx, sy) of the screen window is seen in direction (sx·t, sy·t, 1), where
    /// t = `tan_half_fov` is the tangent of half the field of view across the shorter image side.
    Perspective { tan_half_fov: f32 },
    /// Parallel rays; the screen window is in scene units.
    Orthographic,
    /// All directions, with y up; lens and screen window are not used.
    Spherical(SphericalMapping),
}

/// Mapping of the sphere of directions to the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SphericalMapping {
    /// Columns are azimuth, rows the polar angle from y.
    LatLong,
    /// Octahedral; every pixel has the same solid angle (Clarberg 2008).
    EqualArea,
}

/// The screen window of a film with this aspect ratio (width over height). The shorter side spans
/// [-1, 1].
pub fn fitted_screen_window(aspect: f32) -> [f32; 4] {
    if aspect > 1.0 { [-aspect, aspect, -1.0, 1.0] } else { [-1.0, 1.0, -1.0 / aspect, 1.0 / aspect] }
}

/// Returns whether four numbers x0, x1, y0, y1 are a screen window: finite, with a width and a height, each of any sign.
pub fn is_window([x0, x1, y0, y1]: [f32; 4]) -> bool {
    [x1 - x0, y1 - y0].iter().all(|side| side.is_finite() && *side != 0.0)
}
