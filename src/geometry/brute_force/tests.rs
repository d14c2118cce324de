use glam::Vec3;

use crate::geometry::test_scenes::{Rng, closed_sphere_mesh, ray, sphere, static_scene};
use crate::geometry::{Accel, Hit, Ray};
use crate::scene::Shape;

/// Agreement is to the last bit, also for rays at vertices, along edges, from behind, and rays that
/// are not finite.
#[test]
fn brute_force_and_hierarchy_find_the_same_hits() {
    let mesh = closed_sphere_mesh(Vec3::ZERO, 1.0, 4, 6);
    let scene = static_scene(vec![
        Shape::Mesh(mesh.clone()),
        sphere(Vec3::X, 0.7),
        sphere(Vec3::new(0.0, 0.0, 0.2), 9.0),
    ]);
    let accel = Accel::build(&scene);
    assert!(accel.brute_force.is_some());
    let mut rng = Rng::new(12);
    let mut rays = Vec::new();
    for step in 0..4003 {
        let origin = if step % 4 == 0 { Vec3::ZERO } else { rng.in_cube(2.0) };
        let vertex = mesh.positions[step % mesh.positions.len()];
        let direction = if step % 3 == 0 { vertex - origin } else { rng.direction() };
        let t_max = if step % 5 == 0 { rng.next() } else { f32::INFINITY };
        rays.push(Ray { t_max, ..ray(origin, direction) });
    }
    rays.push(ray(Vec3::ZERO, Vec3::ZERO));
    rays.push(ray(Vec3::NAN, Vec3::X));
    let (mut brute_force, mut bvh) = (Vec::new(), Vec::new());
    accel.intersect_all(rays.iter().copied(), |hit| brute_force.push(hit));
    accel.bvh().search(rays.iter().copied(), false, |hit| bvh.push(hit));
    for (ray, (brute_force, bvh)) in brute_force.iter().zip(&bvh).enumerate() {
        let surface = |hit: &Hit| (hit.t.to_bits(), hit.primitive, hit.instance);
        assert_eq!(brute_force.as_ref().map(surface), bvh.as_ref().map(surface), "{ray}");
        // At a vertex several triangles are equally near.
        if ray % 3 != 0 {
            let element = |hit: &Hit| (hit.element, hit.barycentric);
            assert_eq!(brute_force.as_ref().map(element), bvh.as_ref().map(element), "{ray}");
        }
    }
    for shape in [0, 1, 2] {
        let hits = brute_force.iter().flatten().filter(|hit| hit.primitive == shape).count();
        assert!(hits > 300, "{shape}: {hits}");
    }
}

#[test]
fn only_few_triangles_and_full_spheres_are_intersected_by_brute_force() {
    let is_brute_force = |shapes| Accel::build(&static_scene(shapes)).brute_force.is_some();
    let mesh = |columns| Shape::Mesh(closed_sphere_mesh(Vec3::ZERO, 1.0, 5, columns));
    assert!(is_brute_force(vec![mesh(5)]) && !is_brute_force(vec![mesh(50)]));
    let Shape::Sphere(whole) = sphere(Vec3::ZERO, 1.0) else { unreachable!() };
    assert!(!is_brute_force(vec![Shape::Sphere(crate::scene::Sphere { z_min: 0.0, ..whole })]));
}
