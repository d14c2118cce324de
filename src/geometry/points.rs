//! From hits to the points on surfaces, a lane for each: [`super::surface`] for what has no instance and
//! needs no parametrisation.

#![expect(clippy::needless_range_loop, reason = "a lane is one of several arrays' at once")]

use multiversion::multiversion;

use super::lanes::{HitLanes, LANES, Lanes, Lanes3, PointLanes, RayLanes, groups, lanes_of, mask_of};
use super::local::{Detail, facing, unit, with_rounding};
use super::object::ObjectAccel;
use super::quadric::PlacedSphere;
use super::{Hit, mesh, surface};
use crate::scene::{Scene, Shape};

/// The triangles that were hit.
struct Triangles {
    corners: [Lanes3; 3],
    normals: [Lanes3; 3],
    has_normals: Lanes<u32>,
    flip_normal: Lanes<u32>,
}

/// The points at which the rays of a mask's lanes hit.
pub fn plain_points(
    scene: &Scene,
    objects: &[ObjectAccel],
    rays: &RayLanes,
    hits: &HitLanes,
    mask: u32,
    points: &mut PointLanes,
) {
    let mut triangles = Triangles {
        corners: [Lanes3::ZERO; 3],
        normals: [Lanes3::ZERO; 3],
        has_normals: [0; LANES],
        flip_normal: [0; LANES],
    };
    let (mut on_triangles, mut on_quadrics, mut others) = (0, 0, 0);
    for lane in lanes_of(mask) {
        let primitive = &scene.primitives[hits.primitive[lane] as usize];
        let Shape::Mesh(mesh) = &primitive.shape else {
            points.element[lane] = 0;
            on_quadrics |= u32::from(hits.instance[lane] == Hit::STATIC) << lane;
            others |= u32::from(hits.instance[lane] != Hit::STATIC) << lane;
            continue;
        };
        if hits.instance[lane] != Hit::STATIC {
            others |= 1 << lane;
            continue;
        }
        on_triangles |= 1 << lane;
        let element = hits.element[lane];
        points.element[lane] = element;
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
    if on_triangles != 0 {
        others |= on_triangles & triangle_points(&triangles, hits, on_triangles, points);
    }
    groups(&hits.element, on_quadrics, |element, lanes| {
        let quadric = objects[0].quadric(element);
        let flip = scene.primitives[quadric.primitive as usize].flip_normal;
        match quadric.sphere() {
            Some(sphere) => sphere_points(&sphere, flip, rays, &hits.t, lanes, points),
            None => others |= lanes,
        }
    });
    for lane in lanes_of(others) {
        if let Some(hit) = hits.at(lane) {
            points.set(lane, &surface::surface_point(scene, objects, &rays.at(lane), &hit, Detail::Plain));
        }
    }
}

/// Returns the lanes with triangles of a size that single precision has no normals for.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn triangle_points(triangles: &Triangles, hits: &HitLanes, mask: u32, points: &mut PointLanes) -> u32 {
    let Triangles { corners: [a, b, c], normals: [n_a, n_b, n_c], has_normals, flip_normal } = triangles;
    let [b_1, b_2] = &hits.barycentric;
    let mut inexact: Lanes<u32> = [0; LANES];
    for lane in 0..LANES {
        let corners = [a.at(lane), b.at(lane), c.at(lane)];
        let weights = mesh::weights(glam::Vec2::new(b_1[lane], b_2[lane]));
        let (winding, is_exact) = mesh::single_normal(corners);
        let blended = mesh::blend(weights, [n_a.at(lane), n_b.at(lane), n_c.at(lane)]);
        let blended = (has_normals[lane] != 0).then_some(blended);
        let (normal, has_normal, geometric) = mesh::sides(winding, blended, flip_normal[lane] != 0);
        let shading = if has_normal { facing(unit(normal), geometric) } else { geometric };
        let position = mesh::blend(weights, corners);
        let error = with_rounding(mesh::position_error(corners), position);
        inexact[lane] = u32::from(!is_exact);
        let is_on = mask >> lane & 1 == 1;
        points.position.put(lane, is_on, position);
        points.position_error.put(lane, is_on, error);
        points.geometric_normal.put(lane, is_on, geometric);
        points.shading_normal.put(lane, is_on, shading);
    }
    mask_of(|lane| inexact[lane] != 0)
}

/// Points of one sphere.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn sphere_points(
    sphere: &PlacedSphere,
    flip: bool,
    rays: &RayLanes,
    t: &Lanes,
    mask: u32,
    points: &mut PointLanes,
) {
    let PlacedSphere { extent, to_object, to_shape } = *sphere;
    for lane in 0..LANES {
        let (origin, direction) = (rays.origin.at(lane), rays.direction.at(lane));
        let near = origin.as_dvec3() + f64::from(t[lane]) * direction.as_dvec3();
        let on_sphere = extent.projected(to_shape.transform_point3(near));
        let point = extent.local_point(on_sphere, Detail::Plain).transformed(&to_object, &to_shape);
        let normal = if flip { -point.geometric_normal } else { point.geometric_normal };
        let position = point.position.as_vec3();
        let is_on = mask >> lane & 1 == 1;
        points.position.put(lane, is_on, position);
        points.position_error.put(lane, is_on, with_rounding(point.error, position));
        points.geometric_normal.put(lane, is_on, normal);
        points.shading_normal.put(lane, is_on, normal);
    }
}
