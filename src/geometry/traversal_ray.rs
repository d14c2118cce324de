//! A ray with the reciprocals and the shear that box and triangle tests need.

use glam::{DAffine3, DVec3, Vec3};

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
    #[inline(always)]
    pub fn transformed(&self, to_local: &ToLocal) -> Option<Self> {
        Self::new(to_local.point(self.origin), to_local.vector(self.direction), self.t_max)
    }
}

/// An affine map, in the form in which vector instructions apply it: its columns, the translation last, each padded
/// with a zero.
#[derive(Clone, Copy, Debug)]
pub struct ToLocal([[f64; 4]; 4]);

impl ToLocal {
    #[inline(always)]
    fn vector_padded(&self, vector: Vec3) -> [f64; 4] {
        let Self([x_axis, y_axis, z_axis, _]) = self;
        let [x, y, z] = vector.to_array().map(f64::from);
        std::array::from_fn(|row| x_axis[row] * x + y_axis[row] * y + z_axis[row] * z)
    }

    #[inline(always)]
    fn vector(&self, vector: Vec3) -> Vec3 {
        rounded(self.vector_padded(vector))
    }

    #[inline(always)]
    fn point(&self, point: Vec3) -> Vec3 {
        let (linear, translation) = (self.vector_padded(point), &self.0[3]);
        rounded(std::array::from_fn(|row| linear[row] + translation[row]))
    }
}

impl From<DAffine3> for ToLocal {
    fn from(map: DAffine3) -> Self {
        let column = |column: DVec3| [column.x, column.y, column.z, 0.0];
        Self([
            column(map.matrix3.x_axis),
            column(map.matrix3.y_axis),
            column(map.matrix3.z_axis),
            column(map.translation),
        ])
    }
}

#[inline(always)]
fn rounded(padded: [f64; 4]) -> Vec3 {
    let [x, y, z, _] = padded.map(|value| value as f32);
    Vec3::new(x, y, z)
}
