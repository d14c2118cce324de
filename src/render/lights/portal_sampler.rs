//! Samples directions through a portal, a rectangle that masks an environment, in proportion to the
//! environment's radiance (Bitterli, Novák and Jarosz, *Portal-Masked Environment Map Sampling*, 2015;
//! pbrt-v4, section 12.5.3).
//!
//! Directions of the half space beyond the portal are mapped to the unit square by their angles to the normal
//! along the two edges. This rectification maps the portal to an axis-aligned window from every reference
//! point, so that one table of radiance serves all points.

use std::f64::consts::PI;

use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::light_bounds::LightBounds;
use super::windowed_piecewise_constant_2d::{Window, WindowedPiecewiseConstant2d};
use crate::scene::light::Portal;

/// Maximum number of rows of the table of radiance: 8 MB.
const MAX_ROWS: usize = 1024;
/// Maximum number of lookups per cell of the table, along each side.
const MAX_LOOKUPS: usize = 8;
/// Fraction of the mean radiance that is added to every cell, so that none with emission between the looked-up
/// directions has probability 0.
const FLOOR: f32 = 0.01;

/// A portal, prepared for sampling.
#[derive(Clone, Debug)]
pub struct PortalSampler {
    /// Rotates render space to portal space: x and y along the edges, z outwards.
    to_local: DMat3,
    /// Opposite corners, in render space.
    corners: [DVec3; 2],
    distribution: WindowedPiecewiseConstant2d,
    bounds: LightBounds,
}

impl PortalSampler {
    /// `rows`: number of rows of the environment's image. `radiance`: from a unit direction of render space,
    /// averaged over the channels.
    pub fn new(portal: &Portal, rows: usize, radiance: impl Fn(Vec3) -> f32 + Sync) -> Self {
        // Orthogonalise the portal's edges, which are orthogonal only up to rounding
        let corner = portal.corner.as_dvec3();
        let [along, up] = portal.edges.map(Vec3::as_dvec3);
        let x = along.normalize();
        let z = x.cross(up).normalize();
        let y = z.cross(x);
        let up = y * up.dot(y);
        let to_local = DMat3::from_cols(x, y, z).transpose();

        // Tabulate the radiance over rectified directions
        let size = rows.clamp(1, MAX_ROWS);
        // Two lookups per texel miss none, up to the cost that a tall image may have.
        let lookups = (2 * rows.div_ceil(size)).min(MAX_LOOKUPS);
        let to_render = to_local.transpose();
        let means: Vec<f32> = (0..size * size)
            .into_par_iter()
            .map(|cell| {
                let corner = DVec2::new((cell % size) as f64, (cell / size) as f64);
                let lookup = |i: usize| {
                    let offset = DVec2::new((i % lookups) as f64 + 0.5, (i / lookups) as f64 + 0.5);
                    let uv = (corner + offset / lookups as f64) / size as f64;
                    radiance((to_render * direction(uv)).as_vec3())
                };
                (0..lookups * lookups).map(lookup).sum::<f32>() / (lookups * lookups) as f32
            })
            .collect();

        // Weight the radiance by solid angle
        let solid_angles: Vec<f32> = (0..size * size)
            .map(|cell| {
                let centre = DVec2::new((cell % size) as f64 + 0.5, (cell / size) as f64 + 0.5);
                solid_angle(direction(centre / size as f64)) as f32
            })
            .collect();
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        let mean =
            (dot(&means, &solid_angles) / solid_angles.iter().map(|&s| f64::from(s)).sum::<f64>()) as f32;
        let weights: Vec<f32> = means
            .iter()
            .zip(&solid_angles)
            .map(|(m, solid_angle)| (m + FLOOR * mean) * solid_angle)
            .collect();

        Self {
            to_local,
            corners: [corner, corner + along + up],
            distribution: WindowedPiecewiseConstant2d::new(size, &weights),
            bounds: LightBounds {
                centre: (corner + (along + up) / 2.0).as_vec3(),
                radius: (((along + up).length() / 2.0) as f32).next_up(),
                axis: (-z).as_vec3(),
                cos_axes: 1.0,
                cos_emission: 0.0,
                two_sided: false,
                intensity: (along.cross(up).length()) as f32 * mean,
            },
        }
    }

    /// Bounds of a one-sided area light in the portal's place.
    pub fn bounds(&self) -> LightBounds {
        self.bounds
    }

    /// Whether a ray from a reference point in a unit direction leaves through the portal.
    #[inline]
    pub fn contains(&self, reference: Vec3, direction: Vec3) -> bool {
        let window_and_uv = self.window(reference).zip(rectify(self.to_local * direction.as_dvec3()));
        window_and_uv.is_some_and(|(window, uv)| window.contains(uv))
    }

    /// Samples a unit direction from a reference point and returns it with its density per solid angle;
    /// `None` if the portal is not visible from there.
    #[inline]
    pub fn sample(&self, reference: Vec3, u: Vec2) -> Option<(Vec3, f32)> {
        let (uv, density) = self.distribution.sample(&self.window(reference)?, u.as_dvec2())?;
        let local = direction(uv);
        let pdf = (density / solid_angle(local)) as f32;
        let direction = (self.to_local.transpose() * local).as_vec3();
        (pdf > 0.0 && pdf.is_finite()).then_some((direction, pdf))
    }

    /// Density per solid angle with which [`Self::sample`] samples a unit direction.
    #[inline]
    pub fn pdf(&self, reference: Vec3, direction: Vec3) -> f32 {
        let local = self.to_local * direction.as_dvec3();
        let Some((window, uv)) = self.window(reference).zip(rectify(local)) else { return 0.0 };
        let pdf = (self.distribution.pdf(&window, uv) / solid_angle(local)) as f32;
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// The portal in rectified coordinates around a reference point; `None` if the point is beyond the portal.
    #[inline]
    fn window(&self, reference: Vec3) -> Option<Window> {
        let [min, max] = self.corners.map(|corner| rectify(self.to_local * (corner - reference.as_dvec3())));
        let (min, max) = (min?, max?);
        // Near the portal's plane, rounding may swap the corners.
        min.cmple(max).all().then_some(Window { min, max })
    }
}

/// Maps a direction of portal space, of any length, to the unit square; `None` if it does not point outwards.
#[inline]
fn rectify(direction: DVec3) -> Option<DVec2> {
    let angle = |along: f64| (along.atan2(direction.z) / PI + 0.5).clamp(0.0, 1.0);
    (direction.z > 0.0).then(|| DVec2::new(angle(direction.x), angle(direction.y)))
}

/// The inverse of [`rectify`]: a unit direction.
#[inline]
fn direction(uv: DVec2) -> DVec3 {
    let angle = (uv - 0.5) * PI;
    DVec3::new(angle.x.tan(), angle.y.tan(), 1.0).normalize()
}

/// Solid angle per area of the unit square, at a unit direction.
#[inline]
fn solid_angle(direction: DVec3) -> f64 {
    PI * PI * (1.0 - direction.x * direction.x) * (1.0 - direction.y * direction.y) / direction.z
}

#[cfg(test)]
mod tests;
