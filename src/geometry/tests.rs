//! Tests of the acceleration structure as a whole.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::test_scenes::{
    Rng, closed_sphere_mesh, full_sphere, instanced, ray, sphere, static_scene, triangle_mesh,
};
use super::*;
use crate::scene::texture::Texture;
use crate::scene::{AnimatedTransform, Disk, MeshTangents, Shape, Sphere, TriangleMesh};

#[test]
fn the_nearest_of_random_triangles_is_found() {
    let mut rng = Rng::new(1);
    let triangles: Vec<_> = (0..500)
        .map(|_| {
            let centre = rng.in_cube(10.0);
            [centre + rng.in_cube(2.0), centre + rng.in_cube(2.0), centre + rng.in_cube(2.0)]
        })
        .collect();
    // Once as one mesh, and once each alone.
    let together = static_scene(vec![Shape::Mesh(triangle_mesh(&triangles))]);
    let accel = Accel::build(&together);
    let alone: Vec<_> =
        triangles.iter().map(|t| static_scene(vec![Shape::Mesh(triangle_mesh(&[*t]))])).collect();
    let each: Vec<_> = alone.iter().map(Accel::build).collect();
    let mut hits = 0;
    for _ in 0..1000 {
        let ray = ray(rng.in_cube(12.0), rng.direction());
        let expected = each
            .iter()
            .enumerate()
            .filter_map(|(index, accel)| accel.intersect(&ray).map(|hit| (index, hit.t)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let found = accel.intersect(&ray).map(|hit| (hit.element as usize, hit.t));
        assert_eq!(found, expected);
        assert_eq!(accel.occluded(&ray), expected.is_some());
        hits += expected.is_some() as u32;
    }
    assert!(hits > 200, "{hits}");
}

#[test]
fn the_nearest_of_random_spheres_is_found() {
    let mut rng = Rng::new(2);
    let balls: Vec<_> = (0..200).map(|_| (rng.in_cube(10.0), 0.2 + rng.next())).collect();
    let scene = static_scene(balls.iter().map(|&(centre, radius)| sphere(centre, radius)).collect());
    let accel = Accel::build(&scene);
    for _ in 0..1000 {
        let ray = ray(rng.in_cube(12.0), rng.direction());
        let expected = balls
            .iter()
            .enumerate()
            .filter_map(|(index, &(centre, radius))| {
                let to_centre = (ray.origin - centre).as_dvec3();
                let direction = ray.direction.as_dvec3();
                let b = to_centre.dot(direction);
                let c = to_centre.length_squared() - (radius as f64).powi(2);
                let root = (b * b - c * direction.length_squared()).sqrt();
                let a = direction.length_squared();
                let t = [(-b - root) / a, (-b + root) / a].into_iter().find(|&t| t > 0.0)?;
                Some((index as u32, t))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let found = accel.intersect(&ray);
        assert_eq!(found.map(|hit| hit.primitive), expected.map(|(index, _)| index));
        if let (Some(hit), Some((_, t))) = (found, expected) {
            assert!((hit.t as f64 - t).abs() < 1e-5 * t.max(1.0));
        }
    }
}

/// Rays from inside, at every vertex and at points of every edge.
#[test]
fn no_ray_leaves_a_closed_mesh_through_edges_or_vertices() {
    for (offset, scale) in [(0.0, 1.0), (50.0, 1.0), (1e6, 100.0), (0.0, 1e-3), (0.0, 1e3)] {
        let mesh = closed_sphere_mesh(Vec3::splat(offset), scale, 12, 24);
        let scene = static_scene(vec![Shape::Mesh(mesh.clone())]);
        let accel = Accel::build(&scene);
        let mut rng = Rng::new(3);
        for corners in &mesh.indices {
            let [a, b, c] = corners.map(|index| mesh.positions[index as usize]);
            for target in [a, b, c, a.midpoint(b), b.midpoint(c), a.lerp(c, 0.3)] {
                let origin = Vec3::splat(offset) + scale * rng.in_cube(0.4);
                let ray = ray(origin, target - origin);
                assert!(accel.intersect(&ray).is_some(), "{ray:?}");
                assert!(accel.occluded(&ray), "{ray:?}");
            }
        }
    }
}

fn turning() -> AnimatedTransform {
    let start = DAffine3::from_translation(DVec3::new(3.0, -1.0, 2.0));
    let end = DAffine3::from_translation(DVec3::new(-2.0, 4.0, 1.0))
        * DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 2.8)
        * DAffine3::from_scale(DVec3::new(1.5, 0.5, 1.0));
    AnimatedTransform::new(start, end, 0.2, 0.9)
}

#[test]
fn no_ray_leaves_a_closed_mesh_that_is_moved_or_moves() {
    let far = DAffine3::from_translation(DVec3::new(1e4, 50.0, -30.0))
        * DAffine3::from_rotation_y(1.0)
        * DAffine3::from_scale(DVec3::new(3.0, 0.2, 1.0));
    let sized = |at: f64, size: f64| {
        DAffine3::from_translation(DVec3::new(at, -at, at / 3.0))
            * DAffine3::from_rotation_z(0.7)
            * DAffine3::from_scale(DVec3::splat(size))
    };
    let moving = |start, end| AnimatedTransform::new(start, end, 0.0, 1.0);
    for transform in [
        AnimatedTransform::fixed(far),
        AnimatedTransform::fixed(sized(1e6, 100.0)),
        AnimatedTransform::fixed(sized(0.0, 1e-3)),
        AnimatedTransform::fixed(sized(0.0, 1e3)),
        turning(),
        moving(sized(1e6, 100.0), sized(1.001e6, 150.0)),
        moving(sized(0.0, 1e-3), sized(0.01, 1e-3)),
    ] {
        let mesh = closed_sphere_mesh(Vec3::splat(50.0), 1.0, 12, 24);
        let scene = instanced(Shape::Mesh(mesh.clone()), vec![transform.clone()]);
        let accel = Accel::build(&scene);
        let mut rng = Rng::new(4);
        for corners in &mesh.indices {
            let [a, b, c] = corners.map(|index| mesh.positions[index as usize]);
            for target in [a, b, c, a.midpoint(b), b.midpoint(c), a.lerp(c, 0.3)] {
                let time = rng.next();
                let to_render = transform.at_f64(time);
                let place = |p: Vec3| to_render.transform_point3(p.as_dvec3()).as_vec3();
                let origin = place(Vec3::splat(50.0) + rng.in_cube(0.4));
                let ray = Ray { origin, direction: place(target) - origin, t_max: f32::INFINITY, time };
                assert!(accel.intersect(&ray).is_some() && accel.occluded(&ray), "{ray:?}");
            }
        }
    }
}

#[test]
fn a_moving_sphere_is_where_its_time_puts_it() {
    let shift = DAffine3::from_translation(DVec3::new(10.0, 0.0, 0.0));
    let transform = AnimatedTransform::new(DAffine3::IDENTITY, shift, 0.0, 1.0);
    let scene = instanced(sphere(Vec3::ZERO, 1.0), vec![transform]);
    let accel = Accel::build(&scene);
    for step in 0..=10 {
        let time = step as f32 / 10.0;
        for (offset, expected) in [(0.0, true), (0.99, true), (1.01, false), (-1.01, false)] {
            let origin = Vec3::new(10.0 * time + offset, 0.0, 5.0);
            let ray = Ray { origin, direction: -Vec3::Z, t_max: f32::INFINITY, time };
            let hit = accel.intersect(&ray);
            assert_eq!(hit.is_some(), expected, "{time} {offset}");
            if let Some(hit) = hit {
                let point = accel.interaction(&ray, &hit);
                let centre = Vec3::new(10.0 * time, 0.0, 0.0);
                assert!((point.position.distance(centre) - 1.0).abs() < 1e-5);
                assert!(point.geometric_normal.distance(point.position - centre) < 1e-5);
                assert_eq!(hit.instance, 0);
            }
        }
    }
}

/// The box of a moving instance must not cut its path: the same rays, with and without the upper
/// level, at random times.
#[test]
fn the_box_of_a_moving_object_holds_all_of_its_path() {
    let mut rng = Rng::new(8);
    let triangles: Vec<_> = (0..50)
        .map(|_| {
            let corner = Vec3::new(5.0, 0.0, 0.0) + rng.in_cube(3.0);
            [corner, corner + rng.in_cube(1.0), corner + rng.in_cube(1.0)]
        })
        .collect();
    let shape = Shape::Mesh(triangle_mesh(&triangles));
    let still = static_scene(vec![shape.clone()]);
    let moving = instanced(shape, vec![turning()]);
    let (still, moving) = (Accel::build(&still), Accel::build(&moving));
    let mut hits = 0;
    for _ in 0..5000 {
        let time = rng.next();
        let to_object = turning().at_f64(time).inverse();
        // From anywhere towards some triangle as it is at that time.
        let target = triangles[(rng.next() * 50.0) as usize].iter().sum::<Vec3>() / 3.0;
        let target = turning().at_f64(time).transform_point3(target.as_dvec3()).as_vec3();
        let origin = rng.in_cube(20.0);
        let ray = Ray { origin, direction: target - origin, t_max: f32::INFINITY, time };
        let local = Ray {
            origin: to_object.transform_point3(ray.origin.as_dvec3()).as_vec3(),
            direction: to_object.transform_vector3(ray.direction.as_dvec3()).as_vec3(),
            ..ray
        };
        let expected = still.intersect(&local);
        let found = moving.intersect(&ray);
        assert_eq!(found.map(|hit| (hit.element, hit.t)), expected.map(|hit| (hit.element, hit.t)));
        hits += expected.is_some() as u32;
    }
    assert!(hits > 4500, "{hits}");
}

#[test]
fn partial_spheres_and_disks_end_where_they_should() {
    let dome = Sphere { z_min: 0.5, phi_max: PI, ..full_sphere(1.0) };
    let ring =
        Disk { to_object: DAffine3::IDENTITY, height: -2.0, radius: 1.0, inner_radius: 0.5, phi_max: PI };
    let scene = static_scene(vec![Shape::Sphere(dome), Shape::Disk(ring)]);
    let accel = Accel::build(&scene);
    let first = |origin: Vec3, direction: Vec3| {
        accel.intersect(&ray(origin, direction)).map(|hit| (hit.primitive, hit.t))
    };
    let down = -Vec3::Z;
    // Half the dome is there (y > 0), above z = 0.5 only.
    assert_eq!(first(Vec3::new(0.0, 0.6, 2.0), down).map(|hit| hit.0), Some(0));
    assert_eq!(first(Vec3::new(0.0, -0.6, 2.0), down), None);
    assert_eq!(first(Vec3::new(0.0, 0.9, 2.0), down), Some((1, 4.0)));
    // From inside, out through the dome, and through its missing part.
    assert_eq!(first(Vec3::ZERO, Vec3::new(0.0, 0.6, 0.8)), Some((0, 1.0)));
    assert_eq!(first(Vec3::ZERO, Vec3::new(0.0, 0.9, 0.2)), None);
    // The far wall of the dome, seen through the missing half.
    assert!(first(Vec3::new(0.0, -3.0, 0.6), Vec3::Y).is_some_and(|hit| (hit.1 - 3.8).abs() < 1e-6));
    // The ring's hole, and its missing half.
    assert_eq!(first(Vec3::new(0.0, 0.4, -1.0), down), None);
    assert_eq!(first(Vec3::new(0.0, 0.6, -1.0), down), Some((1, 1.0)));
    assert_eq!(first(Vec3::new(0.0, -0.6, -1.0), down), None);
    // Texture coordinates run around, and from the rim inwards.
    let from_below = ray(Vec3::new(0.0, 0.75, -3.0), Vec3::Z);
    let hit = accel.intersect(&from_below).expect("the ring");
    let point = accel.interaction(&from_below, &hit);
    assert!(point.uv.distance(Vec2::new(0.5, 0.5)) < 1e-6);
    assert_eq!(point.geometric_normal, Vec3::Z);
}

#[test]
fn spawned_rays_do_not_meet_the_surface_that_they_leave() {
    let convex_shapes = |scale: f32, centre: Vec3| {
        let squeezed = Sphere {
            to_object: DAffine3::from_translation(centre.as_dvec3())
                * DAffine3::from_scale(DVec3::new(1.0, 0.3, 2.0)),
            ..full_sphere(scale)
        };
        [
            Shape::Mesh(closed_sphere_mesh(centre, scale, 9, 13)),
            sphere(centre, scale),
            Shape::Sphere(squeezed),
        ]
    };
    let mut rng = Rng::new(9);
    for (scale, centre) in [(1e-3, 0.0), (1.0, 0.0), (1e3, 0.0), (1.0, 100.0), (1.0, 1e4)] {
        let centre = Vec3::splat(centre);
        for (kind, shape) in convex_shapes(scale, centre).into_iter().enumerate() {
            let moved = DAffine3::from_translation(DVec3::new(7.0 * scale as f64, 0.0, 1.0))
                * DAffine3::from_rotation_z(1.0);
            let placed = instanced(shape.clone(), vec![AnimatedTransform::fixed(moved)]);
            let centre_placed = moved.transform_point3(centre.as_dvec3()).as_vec3();
            for (scene, centre) in [(static_scene(vec![shape]), centre), (placed, centre_placed)] {
                let accel = Accel::build(&scene);
                for _ in 0..300 {
                    let origin = centre + 3.0 * scale * rng.direction();
                    let ray_in = ray(origin, centre + scale * rng.in_cube(0.2) - origin);
                    let hit = accel.intersect(&ray_in).expect("aimed at the inside");
                    let point = accel.interaction(&ray_in, &hit);
                    let direction = rng.direction();
                    let outwards = direction * direction.dot(point.geometric_normal).signum();
                    let out = ray(point.offset_origin(outwards), outwards);
                    let hit_out = accel.intersect(&out);
                    assert!(hit_out.is_none(), "{kind} {scale} {centre}: {hit_out:?}");
                    let inwards = ray(point.offset_origin(-outwards), -outwards);
                    let hit_in = accel.intersect(&inwards).expect("the other side");
                    assert!(kind > 0 || hit_in.element != hit.element, "{scale} {centre}");
                    let chord = 2.0 * scale * outwards.dot(point.geometric_normal);
                    assert!(
                        kind != 1 || hit_in.t > 0.9 * chord - 0.01 * scale,
                        "{scale} {centre}: {hit_in:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn odd_rays_and_degenerate_shapes_are_misses() {
    let nan = Vec3::splat(f32::NAN);
    let far = Vec3::splat(3e38);
    let mut triangles = vec![
        [nan, Vec3::X, Vec3::Y],
        [Vec3::X, Vec3::X, Vec3::Y],
        [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X],
        [far, -far, Vec3::X],
        [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)],
    ];
    triangles
        .extend([[Vec3::new(0.0, 0.0, -5.0), Vec3::new(1.0, 0.0, -5.0), Vec3::new(0.0, 1.0, -5.0)]; 3000]);
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let shapes = vec![
        Shape::Mesh(triangle_mesh(&triangles)),
        Shape::Mesh(triangle_mesh(&[])),
        Shape::Sphere(Sphere { to_object: flat, ..full_sphere(0.5) }),
        Shape::Sphere(full_sphere(0.0)),
        Shape::Sphere(full_sphere(f32::NAN)),
    ];
    let scene = static_scene(shapes);
    let accel = Accel::build(&scene);
    let hit = accel.intersect(&ray(Vec3::Z, -Vec3::Z)).expect("the good triangle");
    assert_eq!((hit.primitive, hit.element, hit.t), (0, 4, 1.0));
    for bad in [nan, Vec3::ZERO, Vec3::INFINITY, Vec3::new(0.0, f32::NEG_INFINITY, 1.0)] {
        assert!(accel.intersect(&ray(Vec3::Z, bad)).is_none(), "{bad}");
        assert!(!accel.occluded(&ray(Vec3::Z, bad)), "{bad}");
    }
    assert!(accel.intersect(&ray(nan, Vec3::Z)).is_none());
    assert!(accel.intersect(&Ray { t_max: 0.5, ..ray(Vec3::Z, -Vec3::Z) }).is_none());
    // Rays within the planes of boxes.
    assert!(accel.intersect(&ray(Vec3::new(-1.0, -1.0, 1.0), Vec3::new(0.0, -0.0, -1.0))).is_some());
}

#[test]
fn scenes_without_geometry_are_empty() {
    let mut scene = static_scene(Vec::new());
    assert!(Accel::build(&scene).intersect(&ray(Vec3::ZERO, Vec3::X)).is_none());
    scene.objects.clear();
    assert!(Accel::build(&scene).bounds().is_none());
    let empty =
        instanced(Shape::Mesh(triangle_mesh(&[])), vec![AnimatedTransform::fixed(DAffine3::IDENTITY)]);
    let accel = Accel::build(&empty);
    assert!(!accel.occluded(&ray(Vec3::ZERO, Vec3::X)));
    assert!(accel.bounds().is_none());
}

#[test]
fn bounds_hold_static_and_moving_parts_tightly() {
    let shift = DAffine3::from_translation(DVec3::new(8.0, 0.0, 0.0));
    let motion = AnimatedTransform::new(DAffine3::IDENTITY, shift, 0.0, 2.0);
    // The shutter closes at half the way.
    let scene = instanced(sphere(Vec3::ZERO, 1.0), vec![motion]);
    let (min, max) = Accel::build(&scene).bounds().expect("a sphere");
    assert!(min.distance(-Vec3::ONE) < 1e-4 && max.distance(Vec3::new(5.0, 1.0, 1.0)) < 1e-4, "{min} {max}");
    assert!(min.cmple(-Vec3::ONE).all() && max.cmpge(Vec3::new(5.0, 1.0, 1.0)).all());
}

#[test]
fn a_half_transparent_surface_stops_half_of_the_rays() {
    let mut scene = static_scene(vec![sphere(Vec3::ZERO, 1.0)]);
    let half = scene.textures.add(Texture::Constant(0.5));
    scene.primitives[0].alpha = Some(half);
    let accel = Accel::build(&scene);
    let mut rng = Rng::new(10);
    let mut counts = [0u32; 3];
    for _ in 0..4000 {
        let ray = ray(Vec3::new(0.0, 0.0, 5.0) + rng.in_cube(0.2), -Vec3::Z);
        let hit = accel.intersect(&ray);
        // The front, the back, or nothing; and the same each time.
        let layer = hit.map_or(2, |hit| (hit.t > 5.0) as usize);
        counts[layer] += 1;
        assert_eq!(accel.intersect(&ray).map(|hit| hit.t), hit.map(|hit| hit.t));
        assert_eq!(accel.occluded(&ray), hit.is_some());
    }
    // Expected 2000, 1000 and 1000; five standard deviations are 160.
    assert!(counts[0].abs_diff(2000) < 160, "{counts:?}");
    assert!(counts[1].abs_diff(1000) < 140, "{counts:?}");
}

#[test]
fn normals_and_tangents_follow_pbrt() {
    let corners = [Vec3::ZERO, 2.0 * Vec3::X, 4.0 * Vec3::Y];
    let plain = triangle_mesh(&[corners]);
    let smooth = TriangleMesh { normals: vec![-Vec3::Z + 0.5 * Vec3::X; 3], ..(*plain).clone() };
    let uvs = vec![Vec2::ZERO, Vec2::new(0.0, 2.0), Vec2::new(1.0, 0.0)];
    let mapped = TriangleMesh { uvs, ..(*plain).clone() };
    let down = ray(Vec3::new(0.5, 0.5, 1.0), -Vec3::Z);
    let point = |mesh: TriangleMesh, flip: bool| {
        let mut scene = static_scene(vec![Shape::Mesh(Arc::new(mesh))]);
        scene.primitives[0].flip_normal = flip;
        let accel = Accel::build(&scene);
        accel.interaction(&down, &accel.intersect(&down).expect("aimed at it"))
    };
    assert_eq!(point((*plain).clone(), false).geometric_normal, Vec3::Z);
    assert_eq!(point((*plain).clone(), true).geometric_normal, -Vec3::Z);
    // Without texture coordinates: u along the first edge, v along the second.
    let default = point((*plain).clone(), false);
    assert_eq!(default.dpdu, 2.0 * Vec3::X);
    assert_eq!(default.dpdv, Vec3::new(-2.0, 4.0, 0.0));
    assert!(default.position.distance(Vec3::new(0.5, 0.5, 0.0)) < 1e-6);
    // Vertex normals decide about the side, whatever `flip_normal` is.
    for flip in [false, true] {
        let smooth = point(smooth.clone(), flip);
        assert_eq!(smooth.geometric_normal, -Vec3::Z);
        assert!(smooth.shading_normal.distance(Vec3::new(0.5, 0.0, -1.0).normalize()) < 1e-6);
    }
    let mapped = point(mapped, false);
    assert_eq!(mapped.dpdu, 4.0 * Vec3::Y);
    assert_eq!(mapped.dpdv, Vec3::X);
    assert!(mapped.uv.distance(Vec2::new(0.125, 0.5)) < 1e-6);
}

/// By hand from pbrt's definitions, for a normal that is not the triangle's and a skewed parametrisation.
#[test]
fn tangents_of_meshes_with_normals_follow_the_dialect() {
    let corners = [Vec3::ZERO, 2.0 * Vec3::X, Vec3::new(1.0, 4.0, 0.0)];
    let down = ray(Vec3::new(0.5, 0.5, 1.0), -Vec3::Z);
    let normal = Vec3::new(0.6, 0.0, 0.8);
    let tangents = |tangents: MeshTangents| {
        let uvs = vec![Vec2::ZERO, Vec2::X, Vec2::Y];
        let mesh =
            TriangleMesh { uvs, normals: vec![normal; 3], tangents, ..(*triangle_mesh(&[corners])).clone() };
        let accel_scene = static_scene(vec![Shape::Mesh(Arc::new(mesh))]);
        let accel = Accel::build(&accel_scene);
        let point = accel.interaction(&down, &accel.intersect(&down).expect("aimed at it"));
        [point.dpdu, point.dpdv]
    };
    let [dpdu, dpdv] = tangents(MeshTangents::Parametric);
    assert_eq!([dpdu, dpdv], [2.0 * Vec3::X, Vec3::new(1.0, 4.0, 0.0)]);
    // n × 2x = 1.6 y
    let [dpdu, dpdv] = tangents(MeshTangents::Perpendicular);
    assert!(dpdu == 2.0 * Vec3::X && dpdv.distance(1.6 * Vec3::Y) < 1e-6, "{dpdv}");
    // The part of x that is perpendicular to n is along (0.8, 0, −0.6)
    let [dpdu, dpdv] = tangents(MeshTangents::Opposite);
    assert!(dpdu.distance(Vec3::new(-0.8, 0.0, 0.6)) < 1e-6, "{dpdu}");
    assert!(dpdv.distance(Vec3::NEG_Y) < 1e-6, "{dpdv}");
}

#[test]
fn degenerate_texture_coordinates_get_some_tangents() {
    let corners = [Vec3::ZERO, 2.0 * Vec3::X, 4.0 * Vec3::Y];
    let mesh = TriangleMesh { uvs: vec![Vec2::ONE; 3], ..(*triangle_mesh(&[corners])).clone() };
    let pole = ray(Vec3::new(0.0, 0.0, 9.0), -Vec3::Z);
    let scene = static_scene(vec![Shape::Mesh(Arc::new(mesh)), sphere(Vec3::new(0.0, 0.0, 4.0), 1.0)]);
    let accel = Accel::build(&scene);
    for ray in [ray(Vec3::new(0.5, 0.5, 1.0), -Vec3::Z), pole] {
        let point = accel.interaction(&ray, &accel.intersect(&ray).expect("aimed at it"));
        assert!(point.dpdu.cross(point.dpdv).length() > 0.0);
        assert!(point.dpdu.dot(Vec3::Z).abs() < 1e-6);
    }
}

#[test]
fn instances_transform_normals_by_the_inverse_transpose() {
    let stretch = DAffine3::from_scale(DVec3::new(1.0, 1.0, 4.0));
    let scene = instanced(sphere(Vec3::ZERO, 1.0), vec![AnimatedTransform::fixed(stretch)]);
    let accel = Accel::build(&scene);
    let ray = ray(Vec3::new(0.6, 0.0, 9.0), -Vec3::Z);
    let point = accel.interaction(&ray, &accel.intersect(&ray).expect("aimed at it"));
    // The ellipsoid x² + y² + z²/16 = 1 at (0.6, 0, 3.2).
    assert!(point.position.distance(Vec3::new(0.6, 0.0, 3.2)) < 1e-5);
    assert!(point.geometric_normal.distance(Vec3::new(0.6, 0.0, 0.2).normalize()) < 1e-5);
}
