use std::f32::consts::{PI, TAU};

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::ShapeSampler;
use crate::geometry::local_interaction::Detail;
use crate::geometry::test_scenes::{Rng, full_sphere, ray, static_scene, triangle_mesh};
use crate::geometry::{Accel, SurfaceInteraction, area};
use crate::scene::{Disk, Scene, Shape, Sphere};

const REFERENCE: Vec3 = Vec3::new(0.3, -0.2, 0.1);

fn stretched() -> DAffine3 {
    DAffine3::from_translation(DVec3::new(0.2, 0.4, 4.0))
        * DAffine3::from_rotation_x(0.6)
        * DAffine3::from_scale(DVec3::new(0.7, 1.2, 1.9))
}

/// One shape of every kind, with spheres seen from outside and inside. None occludes itself.
fn shapes() -> Vec<(&'static str, Shape)> {
    let disk = Disk { to_object: stretched(), height: 0.3, radius: 1.1, inner_radius: 0.4, phi_max: 4.0 };
    let centred = DAffine3::from_translation(REFERENCE.as_dvec3());
    vec![
        (
            "triangle",
            Shape::Mesh(triangle_mesh(&[[Vec3::Z, Vec3::new(2.0, 0.0, 1.5), Vec3::new(0.5, 1.5, 2.0)]])),
        ),
        ("disk", Shape::Disk(disk)),
        ("sphere", Shape::Sphere(Sphere { to_object: stretched(), ..full_sphere(0.9) })),
        ("around", Shape::Sphere(Sphere { to_object: stretched(), ..full_sphere(30.0) })),
        (
            "partial",
            Shape::Sphere(Sphere { to_object: centred, z_min: -0.5, phi_max: 5.0, ..full_sphere(2.0) }),
        ),
    ]
}

fn sampler(scene: &Scene, primitive: u32) -> ShapeSampler {
    ShapeSampler::new(&scene.primitives[primitive as usize], primitive, 0, Detail::All)
        .expect("a finite shape")
}

fn visible(accel: &Accel, direction: Vec3) -> Option<SurfaceInteraction> {
    let ray = ray(REFERENCE, direction);
    accel.intersect(&ray).map(|hit| accel.interaction(&ray, &hit))
}

#[test]
fn a_sample_lies_where_its_ray_hits_with_the_same_density() {
    for (name, shape) in shapes() {
        let scene = static_scene(vec![shape]);
        let (accel, sampler) = (Accel::build(&scene), sampler(&scene, 0));
        let mut rng = Rng::new(5);
        let mut met = 0;
        for _ in 0..500 {
            let u = Vec2::new(rng.next(), rng.next());
            let sample = sampler.sample(REFERENCE, u).expect("the shape is visible");
            // A ray to the border of a shape may miss it.
            let Some(hit) = visible(&accel, sample.position - REFERENCE) else { continue };
            let expected = sampler.pdf(REFERENCE, &hit);
            assert!((sample.pdf / expected - 1.0).abs() < 1e-2, "{name}: {} {expected}", sample.pdf);
            assert!(sample.position.distance(hit.position) < 1e-2, "{name}");
            assert!(sample.normal.dot(hit.geometric_normal) > 0.99, "{name}");
            assert!(sample.uv.distance(hit.uv) < 1e-2, "{name}");
            met += 1;
        }
        assert!(met >= 495, "{name}: {met}");
    }
}

#[test]
fn densities_integrate_to_one_over_all_directions() {
    for (name, shape) in shapes() {
        let scene = static_scene(vec![shape]);
        let (accel, sampler) = (Accel::build(&scene), sampler(&scene, 0));
        let mut rng = Rng::new(6);
        let (mut sum, mut squares) = (0.0f64, 0.0f64);
        let count = 100_000;
        for _ in 0..count {
            let value =
                visible(&accel, rng.direction()).map_or(0.0, |hit| 4.0 * PI * sampler.pdf(REFERENCE, &hit));
            sum += value as f64;
            squares += (value as f64).powi(2);
        }
        let mean = sum / count as f64;
        let deviation = ((squares / count as f64 - mean * mean) / count as f64).sqrt();
        // One seed in a million exceeds five standard deviations.
        assert!((mean - 1.0).abs() < 5.0 * deviation + 1e-4, "{name}: {mean} ± {deviation}");
        assert!(deviation < 0.05, "{name}: {deviation}");
    }
}

#[test]
fn mean_of_the_reciprocal_density_is_the_solid_angle() {
    for (name, shape) in shapes() {
        let scene = static_scene(vec![shape]);
        let (accel, sampler) = (Accel::build(&scene), sampler(&scene, 0));
        let mut rng = Rng::new(7);
        let count = 50_000;
        let seen = (0..count).filter(|_| visible(&accel, rng.direction()).is_some()).count();
        let expected = 4.0 * PI as f64 * seen as f64 / count as f64;
        let mean = (0..count)
            .filter_map(|_| {
                let u = Vec2::new(rng.next(), rng.next());
                sampler.sample(REFERENCE, u)
            })
            .map(|sample| (sample.pdf as f64).recip())
            .sum::<f64>()
            / count as f64;
        assert!((mean / expected - 1.0).abs() < 0.06, "{name}: {mean} {expected}");
    }
}

#[test]
fn areas_equal_the_closed_forms() {
    let close = |found: f32, expected: f32| {
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    };
    let triangle =
        static_scene(vec![Shape::Mesh(triangle_mesh(&[[Vec3::ZERO, 2.0 * Vec3::X, 3.0 * Vec3::Z]]))]);
    close(area(&triangle, 0, 0), 3.0);
    let doubled = DAffine3::from_scale(DVec3::splat(2.0));
    let sphere = Sphere { to_object: doubled, ..full_sphere(1.5) };
    close(area(&static_scene(vec![Shape::Sphere(sphere)]), 0, 0), 4.0 * PI * 9.0);
    // A spheroid with semi-axes 1, 1 and 2.
    let long = Sphere { to_object: DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0)), ..full_sphere(1.0) };
    let eccentricity = 0.75f32.sqrt();
    let expected = TAU * (1.0 + 2.0 / eccentricity * eccentricity.asin());
    close(area(&static_scene(vec![Shape::Sphere(long)]), 0, 0), expected);
    let flat = DAffine3::from_scale(DVec3::new(2.0, 3.0, 5.0));
    let disk = Disk { to_object: flat, height: 1.0, radius: 2.0, inner_radius: 1.0, phi_max: PI };
    close(area(&static_scene(vec![Shape::Disk(disk)]), 0, 0), 6.0 * 1.5 * PI);
}

#[test]
fn shapes_without_area_give_no_sample() {
    let flat = DAffine3::from_scale(DVec3::ZERO);
    let shapes = vec![
        Shape::Mesh(triangle_mesh(&[[Vec3::X, Vec3::X, Vec3::Y]])),
        Shape::Sphere(full_sphere(0.0)),
        Shape::Sphere(Sphere { to_object: flat, ..full_sphere(1.0) }),
        Shape::Disk(Disk { to_object: flat, height: 0.0, radius: 1.0, inner_radius: 0.0, phi_max: 1.0 }),
    ];
    let scene = static_scene(shapes);
    for primitive in 0..4 {
        assert!(sampler(&scene, primitive).sample(REFERENCE, Vec2::splat(0.3)).is_none());
        let area = area(&scene, primitive, 0);
        assert!(area == 0.0, "{area}");
    }
}
