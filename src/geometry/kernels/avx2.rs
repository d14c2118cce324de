//! The tests of the parent module with AVX2: one instruction for each operation of the portable code.

use std::arch::x86_64::*;

use super::{BoxHits, SLAB_WIDENING, TriangleCandidates};
use crate::geometry::bvh::{Node, WIDTH};
use crate::geometry::traversal_ray::TraversalRay;
use crate::geometry::triangle::TrianglePacket;

/// Compiles to one load.
#[inline(always)]
fn load(lanes: &[f32; WIDTH]) -> __m256 {
    bytemuck::cast(*lanes)
}

/// See [`super::intersect_boxes`].
#[inline]
#[target_feature(enable = "avx2")]
pub fn intersect_boxes(node: &Node, ray: &TraversalRay) -> BoxHits {
    let mut t_near = _mm256_setzero_ps();
    let mut t_far = _mm256_set1_ps(ray.t_max);
    for (axis, planes) in node.planes.iter().enumerate() {
        let (origin, inverse) =
            (_mm256_set1_ps(ray.origin[axis]), _mm256_set1_ps(ray.inverse_direction[axis]));
        let near_plane = load(&planes[ray.direction_is_negative[axis] & 1]);
        let far_plane = load(&planes[!ray.direction_is_negative[axis] & 1]);
        // Of NaN and a number, these instructions return their second operand, the number.
        t_near = _mm256_max_ps(_mm256_mul_ps(_mm256_sub_ps(near_plane, origin), inverse), t_near);
        t_far = _mm256_min_ps(_mm256_mul_ps(_mm256_sub_ps(far_plane, origin), inverse), t_far);
    }
    let widened = _mm256_mul_ps(t_far, _mm256_set1_ps(SLAB_WIDENING));
    let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(t_near, widened));
    BoxHits { mask: mask as u32, t_near: bytemuck::cast(t_near) }
}

/// See [`super::intersect_triangles`].
#[inline]
#[target_feature(enable = "avx2")]
pub fn intersect_triangles(packet: &TrianglePacket, ray: &TraversalRay) -> Option<TriangleCandidates> {
    // Shear the corners so that the ray runs along z
    let zero = _mm256_setzero_ps();
    let [a, b, major] = ray.axes;
    let [origin_a, origin_b, origin_major] = ray.permuted_origin.map(|x| _mm256_set1_ps(x));
    let [shear_a, shear_b] = ray.shear.map(|x| _mm256_set1_ps(x));
    let (mut x, mut y, mut z) = ([zero; 3], [zero; 3], [zero; 3]);
    for (corner, planes) in packet.corners.iter().enumerate() {
        z[corner] = _mm256_sub_ps(load(&planes[major]), origin_major);
        let (centred_a, centred_b) =
            (_mm256_sub_ps(load(&planes[a]), origin_a), _mm256_sub_ps(load(&planes[b]), origin_b));
        x[corner] = _mm256_sub_ps(centred_a, _mm256_mul_ps(shear_a, z[corner]));
        y[corner] = _mm256_sub_ps(centred_b, _mm256_mul_ps(shear_b, z[corner]));
    }

    // Compute the edge functions, and test their signs
    let edge = |b: usize, c: usize| _mm256_sub_ps(_mm256_mul_ps(x[b], y[c]), _mm256_mul_ps(y[b], x[c]));
    let (u, v, w) = (edge(2, 1), edge(0, 2), edge(1, 0));
    let least = _mm256_min_ps(_mm256_min_ps(u, v), w);
    let greatest = _mm256_max_ps(_mm256_max_ps(u, v), w);
    let inside =
        _mm256_or_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(least, zero), _mm256_cmp_ps::<_CMP_LE_OQ>(greatest, zero));
    if _mm256_movemask_ps(inside) == 0 {
        return None;
    }
    let is_zero = |edge: __m256| _mm256_cmp_ps::<_CMP_EQ_OQ>(edge, zero);
    let on_edge = _mm256_or_ps(_mm256_or_ps(is_zero(u), is_zero(v)), is_zero(w));

    // Compute the distances, and test whether they are in range
    let weighted =
        _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(u, z[0]), _mm256_mul_ps(v, z[1])), _mm256_mul_ps(w, z[2]));
    let determinant = _mm256_add_ps(_mm256_add_ps(u, v), w);
    let scale = _mm256_set1_ps(ray.scale);
    let t = _mm256_div_ps(_mm256_mul_ps(weighted, scale), determinant);
    let in_range = _mm256_and_ps(
        _mm256_cmp_ps::<_CMP_GT_OQ>(t, zero),
        _mm256_cmp_ps::<_CMP_LT_OQ>(t, _mm256_set1_ps(ray.t_max)),
    );
    let mask = _mm256_movemask_ps(_mm256_and_ps(inside, _mm256_or_ps(on_edge, in_range)));
    if mask == 0 {
        return None;
    }

    // Find the hits that are certain: off the edges, with all corners ahead of the origin
    let [a, b, c] = z.map(|z| _mm256_cmp_ps::<_CMP_GT_OQ>(_mm256_mul_ps(z, scale), zero));
    let ahead = _mm256_and_ps(_mm256_and_ps(a, b), c);
    Some(TriangleCandidates {
        mask: mask as u32,
        certain: _mm256_movemask_ps(_mm256_andnot_ps(on_edge, ahead)) as u32,
        t: bytemuck::cast(t),
        edges: bytemuck::cast([v, w, determinant]),
    })
}
