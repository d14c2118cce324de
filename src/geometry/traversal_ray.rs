//! A ray with the reciprocals and the shear that box and triangle tests need.

use glam::{DAffine3, Vec3};

/// By major axis, and by whether the direction runs along (0) or against (1) it: the other two axes
/// in the order that keeps the handedness, then the major axis.
const AXES: [[[usize; 3]; 2]; 3] = [[[1, 2, 0], [2, 1, 0]], [[2, 0, 1], [0, 2, 1]], [[0, 1, 2], [1, 0, 2]]];

/// A ray, prepared for tests against boxes and triangles.
#[derive(Clone, Copy, Debug)]
pub struct TraversalRay {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Reciprocals of the direction's components.
    pub inverse_direction: Vec3,
    /// Distance of the nearest hit so far.
    pub t_max: f32,
    /// 1 for each axis along which the direction is negative, so that the ray enters a box through
    /// its maximum; otherwise 0.
    pub direction_is_negative: [usize; 3],
    /// Permutation of the axes that makes the one of the largest direction component the last and
    /// keeps the handedness (Woop, Benthin and Wald 2013, section 3.1).
    pub axes: [usize; 3],
    /// The origin's coordinates in the order of `axes`.
    pub permuted_origin: [f32; 3],
    /// Shear that aligns the direction with the last axis.
    pub shear: [f32; 2],
    /// Distance along the ray per unit of the last axis.
    pub scale: f32,
}

impl TraversalRay {
    /// `None` for rays that can hit nothing: origin or direction not finite, direction zero, or
    /// `t_max` not positive.
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3, t_max: f32) -> Option<Self> {
        let size = direction.abs();
        let major = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        // Zero times infinity or NaN is NaN.
        let finite = (0.0 * origin + 0.0 * direction).element_sum() == 0.0;
        if !(finite && t_max > 0.0 && size[major] > 0.0) {
            return None;
        }
        let inverse_direction = direction.recip();
        let scale = inverse_direction[major];
        let axes @ [a, b, _] = AXES[major][(scale < 0.0) as usize];
        Some(Self {
            origin,
            direction,
            inverse_direction,
            t_max,
            direction_is_negative: inverse_direction.to_array().map(|x| (x.to_bits() >> 31) as usize),
            axes,
            permuted_origin: axes.map(|axis| origin[axis]),
            shear: [direction[a] * scale, direction[b] * scale],
            scale,
        })
    }

    /// The ray in another space. The direction is not normalised, so distances stay the same.
    #[inline]
    pub fn transformed(&self, to_local: &DAffine3) -> Option<Self> {
        Self::new(
            to_local.transform_point3(self.origin.as_dvec3()).as_vec3(),
            to_local.transform_vector3(self.direction.as_dvec3()).as_vec3(),
            self.t_max,
        )
    }
}
