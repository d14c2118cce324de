//! Tests of shapes that are far larger than what stands on them.

use glam::Vec3;

use super::Accel;
use super::test_scenes::{Rng, ray, sphere, static_scene, triangle_mesh};
use crate::scene::Shape;

/// Triangles enough that no scene with them is intersected by brute force.
fn far_triangles() -> Vec<[Vec3; 3]> {
    (0..60).map(|i| [Vec3::X, Vec3::Y, Vec3::Z].map(|corner| corner + i as f32 + 1000.0)).collect()
}

#[test]
fn rays_from_close_above_a_large_ground_meet_it_and_those_from_below_do_not() {
    let mut rng = Rng::new(21);
    for half in [1.0, 1e3, 1e5] {
        let corner = |x, z| half * Vec3::new(x, 0.0, z);
        let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let ground = vec![[a, b, c], [a, c, d]];
        let with_others = ground.iter().copied().chain(far_triangles()).collect();
        for triangles in [ground, with_others] {
            let scene = static_scene(vec![Shape::Mesh(triangle_mesh(&triangles))]);
            let accel = Accel::build(&scene);
            for side in [1.0, -1.0] {
                let rays: Vec<_> = (0..500)
                    .map(|_| {
                        let origin = 0.1 * half * rng.in_cube(1.0).with_y(side * 1.5e-5);
                        ray(origin, rng.in_cube(0.8).with_y(-0.6))
                    })
                    .collect();
                let mut hits = Vec::new();
                accel.intersect_all(rays.iter().copied(), |hit| hits.push(hit));
                for (ray, hit) in rays.iter().zip(hits) {
                    assert_eq!(hit.is_some(), side > 0.0, "{half} {} {ray:?}", triangles.len());
                }
            }
        }
    }
}

#[test]
fn no_ray_passes_between_long_triangles() {
    let strips: Vec<_> = (-30..30)
        .flat_map(|left| {
            let corner = |right: i32, z| Vec3::new((left + right) as f32, 0.0, z);
            let [a, b, c, d] = [corner(0, -300.0), corner(1, -300.0), corner(1, 300.0), corner(0, 300.0)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let scene = static_scene(vec![Shape::Mesh(triangle_mesh(&strips))]);
    let accel = Accel::build(&scene);
    let mut rng = Rng::new(22);
    for seam in -29..30 {
        for _ in 0..100 {
            let near_seam = Vec3::new(seam as f32 + 1e-5 * rng.in_cube(1.0).x, 0.0, 5.0 * rng.in_cube(1.0).z);
            let origin = near_seam + rng.in_cube(2.0).with_y(1.2);
            let ray = ray(origin, near_seam - origin);
            assert!(accel.intersect(&ray).is_some() && accel.occluded(&ray), "{ray:?}");
        }
    }
}

#[test]
fn rays_leave_a_large_sphere_close_to_it() {
    let radius = 6.4e6;
    let scene = static_scene(vec![sphere(Vec3::new(0.0, -radius, 0.0), radius)]);
    let accel = Accel::build(&scene);
    let mut rng = Rng::new(23);
    for _ in 0..200 {
        let down = ray(rng.in_cube(1.0).with_y(2.0), rng.in_cube(0.5).with_y(-1.0));
        let hit = accel.intersect(&down).expect("the ground");
        let point = accel.interaction(&down, &hit);
        let up = rng.in_cube(1.0).with_y(0.7);
        let origin = point.offset_origin(up);
        assert!(origin.distance(point.position) < 1e-5, "{origin} {}", point.position);
        assert!(accel.intersect(&ray(origin, up)).is_none());
        assert!(accel.intersect(&ray(point.offset_origin(-up), up)).is_some_and(|hit| hit.t < 1e-4));
    }
}
