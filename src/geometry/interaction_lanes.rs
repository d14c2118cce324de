//! Computes the surface interactions at sixteen hits, one in each lane, without parametrisation.
//!
//! Hits on static triangles and spheres are computed in vector code; the results equal those of
//! [`interaction`](super::interaction::interaction), which computes all other hits one by one.

#![expect(clippy::needless_range_loop, reason = "a lane indexes several arrays at once")]

use glam::Vec2;

use super::interaction::interaction;
use super::lanes::{HitLanes, InteractionLanes, RayLanes};
use super::local_interaction::{Detail, face_forward, unit, with_rounding};
use super::object::ObjectAccel;
use super::quadric::TransformedSphere;
use super::{Hit, mesh};
use crate::scene::{Scene, Shape};
use crate::simd::{LANES, Lanes, Lanes3, apply, group_lanes, lane_mask, lanes_in, multiversioned};

/// The triangles that were hit, one in each lane.
struct TriangleLanes {
    corners: [Lanes3; 3],
    normals: [Lanes3; 3],
    has_normals: Lanes<u32>,
    flip_normal: Lanes<u32>,
}

/// Computes the interactions of the lanes in `mask`, without parametrisation.
pub fn minimal_interactions(
    scene: &Scene,
    objects: &[ObjectAccel],
    rays: &RayLanes,
    hits: &HitLanes,
    mask: u32,
    interactions: &mut InteractionLanes,
) {
    // Sort the lanes by kind of surface, and load the triangles
    let mut triangles = TriangleLanes {
        corners: [Lanes3::ZERO; 3],
        normals: [Lanes3::ZERO; 3],
        has_normals: [0; LANES],
        flip_normal: [0; LANES],
    };
    let (mut on_triangles, mut on_quadrics, mut scalar) = (0, 0, 0);
    for lane in lanes_in(mask) {
        let primitive = &scene.primitives[hits.primitive[lane] as usize];
        let Shape::Mesh(mesh) = &primitive.shape else {
            interactions.element[lane] = 0;
            on_quadrics |= u32::from(hits.instance[lane] == Hit::STATIC) << lane;
            scalar |= u32::from(hits.instance[lane] != Hit::STATIC) << lane;
            continue;
        };
        if hits.instance[lane] != Hit::STATIC {
            scalar |= 1 << lane;
            continue;
        }
        on_triangles |= 1 << lane;
        let element = hits.element[lane];
        interactions.element[lane] = element;
        let [a, b, c] = mesh::corners(mesh, element);
        triangles.corners[0].set(lane, a);
        triangles.corners[1].set(lane, b);
        triangles.corners[2].set(lane, c);
        triangles.flip_normal[lane] = u32::from(primitive.flip_normal);
        if let Some([a, b, c]) = mesh::corner_normals(mesh, element) {
            triangles.has_normals[lane] = 1;
            triangles.normals[0].set(lane, a);
            triangles.normals[1].set(lane, b);
            triangles.normals[2].set(lane, c);
        }
    }

    // Compute the lanes on triangles together
    if on_triangles != 0 {
        scalar |= on_triangles & triangle_interactions(&triangles, hits, on_triangles, interactions);
    }

    // Compute the lanes on each sphere together
    group_lanes(&hits.element, on_quadrics, |element, lanes| {
        let quadric = objects[0].quadric(element);
        let flip = scene.primitives[quadric.primitive as usize].flip_normal;
        match quadric.sphere() {
            Some(sphere) => sphere_interactions(&sphere, flip, rays, &hits.t, lanes, interactions),
            None => scalar |= lanes,
        }
    });

    // Compute the other lanes one by one
    for lane in lanes_in(scalar) {
        if let Some(hit) = hits.at(lane) {
            let interaction = interaction(scene, objects, &rays.at(lane), &hit, Detail::Minimal);
            interactions.set(lane, &interaction);
        }
    }
}

/// Computes interactions on triangles. Returns the lanes whose triangles are slivers, or too huge or tiny for a
/// normal in single precision.
#[apply(multiversioned!)]
fn triangle_interactions(
    triangles: &TriangleLanes,
    hits: &HitLanes,
    mask: u32,
    interactions: &mut InteractionLanes,
) -> u32 {
    let TriangleLanes { corners: [a, b, c], normals: [n_a, n_b, n_c], has_normals, flip_normal } = triangles;
    let [b_1, b_2] = &hits.barycentric;
    let mut inaccurate: Lanes<u32> = [0; LANES];
    for lane in 0..LANES {
        let corners = [a.at(lane), b.at(lane), c.at(lane)];
        let weights = mesh::weights(Vec2::new(b_1[lane], b_2[lane]));
        let (winding, is_accurate) = mesh::fast_unit_normal(corners);
        let interpolated = mesh::interpolate(weights, [n_a.at(lane), n_b.at(lane), n_c.at(lane)]);
        let interpolated = (has_normals[lane] != 0).then_some(interpolated);
        let (normal, has_normal, geometric) =
            mesh::oriented_normals(winding, interpolated, flip_normal[lane] != 0);
        let shading = if has_normal { face_forward(unit(normal), geometric) } else { geometric };
        let position = mesh::interpolate(weights, corners);
        let error = with_rounding(mesh::position_error(corners), position);
        inaccurate[lane] = u32::from(!is_accurate);
        let is_on = mask >> lane & 1 == 1;
        interactions.position.set_if(lane, is_on, position);
        interactions.position_error.set_if(lane, is_on, error);
        interactions.geometric_normal.set_if(lane, is_on, geometric);
        interactions.shading_normal.set_if(lane, is_on, shading);
    }
    lane_mask(|lane| inaccurate[lane] != 0)
}

/// Computes interactions on one sphere.
#[apply(multiversioned!)]
fn sphere_interactions(
    sphere: &TransformedSphere,
    flip: bool,
    rays: &RayLanes,
    t: &Lanes,
    mask: u32,
    interactions: &mut InteractionLanes,
) {
    let TransformedSphere { extent, to_object, to_shape } = *sphere;
    for lane in 0..LANES {
        let (origin, direction) = (rays.origin.at(lane), rays.direction.at(lane));
        let near = origin.as_dvec3() + f64::from(t[lane]) * direction.as_dvec3();
        let on_sphere = extent.projected(to_shape.transform_point3(near));
        let local =
            extent.interaction(on_sphere, Detail::Minimal).transformed_in_double(&to_object, &to_shape);
        let normal = if flip { -local.geometric_normal } else { local.geometric_normal };
        let position = local.position.as_vec3();
        let is_on = mask >> lane & 1 == 1;
        interactions.position.set_if(lane, is_on, position);
        interactions.position_error.set_if(lane, is_on, with_rounding(local.error, position));
        interactions.geometric_normal.set_if(lane, is_on, normal);
        interactions.shading_normal.set_if(lane, is_on, normal);
    }
}
