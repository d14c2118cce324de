//! Whole renders against closed forms.
//!
//! Every pixel of these images estimates the same number with numbers of its own. Each comparison is a two-sided
//! t-test over pixels at a significance of 10⁻⁴, with a bound on the standard error so that it can
//! fail. Since neighbouring pixels complement each other, the mean mostly deviates less than the test assumes.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use prpf::geometry::Accel;
use prpf::render::Renderer;
use prpf::scene::camera::Projection;
use prpf::scene::light::{Environment, EnvironmentMap, Portal};
use prpf::scene::material::{Metal, Roughness, RoughnessScale};
use prpf::scene::texture::Texture;
use prpf::scene::{
    AnimatedTransform, AreaLight, Camera, Disk, Film, Integrator, Light, Material, MaterialId, MaterialKind,
    Object, PixelFilter, Primitive, SamplerKind, Scene, Shape, Sphere, TextureImage, Textures, TriangleMesh,
};
use prpf::stats::{Part, Row, Store};
use statrs::distribution::{ContinuousCDF, StudentsT};

const SIDE: usize = 8;
const SIGNIFICANCE: f64 = 1e-4;
/// Relative rounding errors of a path in `f32`.
const ROUNDING: f64 = 2e-5;

/// A camera at the origin that looks along z at next to a single point.
fn scene(max_depth: u32) -> Scene {
    Scene {
        source: String::new(),
        dialect: None,
        hash: String::new(),
        files: Vec::new(),
        origin: DVec3::ZERO,
        camera: Camera {
            to_render: AnimatedTransform::fixed(DAffine3::IDENTITY),
            projection: Projection::Perspective { tan_half_fov: 1e-4 },
            screen_window: [-1.0, 1.0, -1.0, 1.0],
            lens_radius: 0.0,
            focal_distance: 1.0,
            shutter_open: 0.0,
            shutter_close: 1.0,
        },
        film: Film {
            width: SIDE,
            height: SIDE,
            pixel_bounds: [0, SIDE, 0, SIDE],
            filter: PixelFilter::Box { radius: [0.5, 0.5] },
            filename: None,
            scale: 1.0,
            white_balance: None,
        },
        integrator: Integrator::Path { max_depth },
        sampler: SamplerKind::Sobol,
        spp: 1,
        textures: Textures::default(),
        materials: Vec::new(),
        primitives: Vec::new(),
        objects: vec![Object { name: String::new(), primitives: 0..0 }],
        instances: Vec::new(),
        lights: Vec::new(),
        warnings: Vec::new(),
    }
}

fn material(scene: &mut Scene, kind: MaterialKind) -> MaterialId {
    scene.materials.push(Material { name: String::new(), kind, displacement: None, normal_map: None });
    MaterialId(scene.materials.len() as u32 - 1)
}

fn diffuse(scene: &mut Scene, albedo: f32) -> MaterialId {
    let reflectance = scene.textures.add(Texture::Constant(Vec3::splat(albedo)));
    material(scene, MaterialKind::Diffuse { reflectance })
}

fn mirror(scene: &mut Scene, reflectance: f32) -> MaterialId {
    let reflectance = scene.textures.add(Texture::Constant(Vec3::splat(reflectance)));
    let zero = scene.textures.add(Texture::Constant(0.0));
    let roughness = Roughness { u: zero, v: zero, scale: RoughnessScale::Alpha };
    material(scene, MaterialKind::Conductor { metal: Metal::Reflectance(reflectance), roughness })
}

fn add(scene: &mut Scene, shape: Shape, material: MaterialId, emission: Option<f32>) {
    let area_light = emission.map(|e| AreaLight { radiance: Vec3::splat(e), image: None, two_sided: true });
    scene.primitives.push(Primitive { shape, material, alpha: None, area_light, flip_normal: false });
    scene.objects[0].primitives.end += 1;
}

fn sphere(centre: Vec3, radius: f32) -> Shape {
    Shape::Sphere(Sphere {
        to_object: DAffine3::from_translation(centre.as_dvec3()),
        radius,
        z_min: -radius,
        z_max: radius,
        phi_max: TAU,
    })
}

/// Perpendicular to z.
fn disk(centre: Vec3, radius: f32) -> Shape {
    let to_object = DAffine3::from_translation(centre.as_dvec3());
    Shape::Disk(Disk { to_object, height: 0.0, radius, inner_radius: 0.0, phi_max: TAU })
}

/// A square perpendicular to z, of two triangles.
fn square(centre: Vec3, half: f32) -> Shape {
    let corner = |x: f32, y: f32| centre + half * Vec3::new(x, y, 0.0);
    Shape::Mesh(Arc::new(TriangleMesh {
        positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }))
}

/// The camera sees a plane at z = 4, from where lights are on the camera's side.
const FLOOR: f32 = 4.0;

fn floor_scene(max_depth: u32, albedo: f32) -> Scene {
    let mut scene = scene(max_depth);
    let floor = diffuse(&mut scene, albedo);
    add(&mut scene, square(Vec3::Z * FLOOR, 100.0), floor, None);
    scene
}

fn render(scene: &Scene, spp: u32, seed: u64) -> Store {
    let accel = Accel::build(scene);
    let renderer = Renderer::new(scene, &accel, seed);
    let mut store = Store::new(SIDE, SIDE, renderer.layout().clone(), 0, 0);
    renderer.render_batch(&vec![spp; store.pixels()], &mut store);
    assert_eq!(store.rejected(), 0);
    store
}

/// Tests the mean over pixels of one plane.
fn assert_mean(values: &[f32], expected: f64, what: &str) {
    let n = values.len() as f64;
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let variance = values.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (variance / n).sqrt();
    assert!(error < 0.01 * expected.max(1e-3), "{what}: standard error {error} of {mean} proves nothing");
    let bound = StudentsT::new(0.0, 1.0, n - 1.0).unwrap().inverse_cdf(1.0 - SIGNIFICANCE / 2.0);
    let tolerance = bound * error + ROUNDING * expected;
    assert!((mean - expected).abs() <= tolerance, "{what}: {mean} ± {error}, expected {expected}");
}

fn assert_radiance(scene: &Scene, spp: u32, expected: f64, what: &str) {
    let store = render(scene, spp, 1);
    let planes = store.means(Part::Whole, store.layout().radiance());
    for channel in 0..3 {
        assert_mean(planes.plane(channel), expected, what);
    }
}

fn assert_colour(scene: &Scene, spp: u32, expected: f64, what: &str) {
    let store = render(scene, spp, 2);
    let planes = store.means(Part::Whole, store.layout().colour());
    for channel in 0..3 {
        assert_mean(planes.plane(channel), expected, what);
    }
}

#[test]
fn a_closed_glowing_room_fills_with_the_geometric_series() {
    let albedo = 0.6f64;
    for depth in [0, 1, 2, 3, 6, 60] {
        let mut room = scene(depth);
        let walls = diffuse(&mut room, albedo as f32);
        add(&mut room, sphere(Vec3::ZERO, 2.0), walls, Some(0.5));
        let expected: f64 = (0..=depth).map(|k| 0.5 * albedo.powi(k as i32)).sum();
        assert_radiance(&room, 128, expected, &format!("radiance at depth {depth}"));
        assert_colour(&room, 128, expected - 0.5, &format!("colour at depth {depth}"));
    }
}

#[test]
fn a_point_light_in_a_closed_sphere_gives_the_geometric_series() {
    let albedo = 0.7f64;
    for depth in [1, 2, 3, 80] {
        let mut room = scene(depth);
        let walls = diffuse(&mut room, albedo as f32);
        add(&mut room, sphere(Vec3::ZERO, 2.0), walls, None);
        room.lights.push(Light::Point { position: Vec3::ZERO, intensity: Vec3::splat(4.0) });
        let direct = albedo / std::f64::consts::PI;
        let expected: f64 = (0..depth).map(|k| direct * albedo.powi(k as i32)).sum();
        assert_radiance(&room, 256, expected, &format!("depth {depth}"));
    }
}

#[test]
fn a_sphere_in_a_uniform_environment_reflects_its_albedo() {
    for (albedo, integrator) in [
        (1.0, Integrator::Path { max_depth: 5 }),
        (0.3, Integrator::Path { max_depth: 1 }),
        (0.3, Integrator::Direct { max_depth: 5 }),
    ] {
        let mut furnace = scene(0);
        furnace.integrator = integrator;
        let ball = diffuse(&mut furnace, albedo);
        add(&mut furnace, sphere(Vec3::Z * 5.0, 1.0), ball, None);
        furnace.lights.push(Light::Environment(Environment {
            to_render: glam::Affine3A::IDENTITY,
            scale: Vec3::ONE,
            map: None,
            portal: None,
        }));
        assert_radiance(&furnace, 128, f64::from(albedo), &format!("{integrator:?}"));
    }
}

/// Environments of radiance 1, each seen through a rectangle of its own two units above the floor:
/// from `x` to `x` + 3 / `count`, and so on, and from -0.5 to 1.5 in y.
fn sky_lights(scene: &mut Scene, x: f32, count: usize, map: Option<EnvironmentMap>) {
    let width = 3.0 / count as f32;
    for i in 0..count {
        let right = x + (i + 1) as f32 * width;
        let portal = Some(Portal {
            corner: Vec3::new(right, -0.5, FLOOR - 2.0),
            edges: [Vec3::X * -width, Vec3::Y * 2.0],
        });
        let to_render = glam::Affine3A::from_rotation_x(0.3);
        scene.lights.push(Light::Environment(Environment { to_render, scale: Vec3::ONE, map, portal }));
    }
}

#[test]
fn a_floor_sees_an_environment_through_its_portals_only() {
    // Form factor of a rectangle above a point, one corner in its normal (Howell, B-3).
    let corner = |a: f64, b: f64| {
        let [a, b] = [a / 2.0, b / 2.0];
        let part = |a: f64, b: f64| a / a.hypot(1.0) * (b / a.hypot(1.0)).atan();
        (part(a, b) + part(b, a)) / std::f64::consts::TAU
    };
    let seen = corner(1.0, 0.5) + corner(1.0, 1.5) + corner(2.0, 0.5) + corner(2.0, 1.5);
    for (count, image) in [(1, false), (3, false), (1, true)] {
        for integrator in [Integrator::Path { max_depth: 1 }, Integrator::Path { max_depth: 4 }] {
            let mut view = floor_scene(1, 0.8);
            view.integrator = integrator;
            let map = image.then(|| {
                let texels = TextureImage::from_floats(8, 8, 1, vec![1.0; 64]);
                EnvironmentMap::EqualArea(view.textures.add_image(texels))
            });
            sky_lights(&mut view, -1.0, count, map);
            let what = format!("{count} portals, image {image}, {integrator:?}");
            assert_radiance(&view, 64, 0.8 * seen, &what);
            // A boundary on both sides of the portals changes nothing.
            let nothing = material(&mut view, MaterialKind::Interface);
            add(&mut view, sphere(Vec3::Z * FLOOR, 5.0), nothing, None);
            assert_radiance(&view, 64, 0.8 * seen, &format!("{what}, within a boundary"));
        }
    }
}

#[test]
fn a_mirror_shows_the_environment_where_the_portal_is_and_nothing_beside_it() {
    for (x, expected) in [(-1.0, 0.8), (0.1, 0.0), (-3.1, 0.0)] {
        let mut view = scene(3);
        let silver = mirror(&mut view, 0.8);
        add(&mut view, square(Vec3::Z * FLOOR, 10.0), silver, None);
        sky_lights(&mut view, x, 1, None);
        assert_radiance(&view, 8, expected, &format!("portal from {x}"));
    }
}

fn both_integrators(scene: &mut Scene, spp: u32, expected: f64, what: &str) {
    for sampler in [SamplerKind::Sobol, SamplerKind::Independent] {
        for integrator in [Integrator::Path { max_depth: 1 }, Integrator::Direct { max_depth: 4 }] {
            (scene.integrator, scene.sampler) = (integrator, sampler);
            assert_colour(scene, spp, expected, &format!("{what}, {integrator:?}, {sampler:?}"));
        }
    }
}

#[test]
fn a_point_light_lights_a_plane_by_the_inverse_square() {
    let mut plane = floor_scene(1, 0.5);
    let offset = Vec3::new(1.0, 2.0, -3.0);
    plane.lights.push(Light::Point { position: Vec3::Z * FLOOR + offset, intensity: Vec3::splat(10.0) });
    let squared = f64::from(offset.length_squared());
    let expected = 0.5 / f64::from(PI) * 10.0 * (3.0 / squared.sqrt()) / squared;
    both_integrators(&mut plane, 4, expected, "point light");
}

#[test]
fn a_distant_light_lights_a_plane_by_the_cosine() {
    let mut plane = floor_scene(1, 0.5);
    plane.lights.push(Light::Distant { direction: Vec3::new(0.6, 0.0, -0.8), radiance: Vec3::splat(2.0) });
    both_integrators(&mut plane, 4, 0.5 / f64::from(PI) * 2.0 * 0.8, "distant light");
}

#[test]
fn a_sphere_light_lights_a_plane_like_its_solid_angle() {
    for offset in [Vec3::new(0.5, 1.0, -2.0), Vec3::new(3.0, 0.0, -1.5)] {
        let mut plane = floor_scene(1, 0.5);
        let black = diffuse(&mut plane, 0.0);
        add(&mut plane, sphere(Vec3::Z * FLOOR + offset, 0.4), black, Some(7.0));
        let squared = f64::from(offset.length_squared());
        let cos = f64::from(-offset.z) / squared.sqrt();
        both_integrators(&mut plane, 256, 0.5 * 7.0 * 0.16 / squared * cos, "sphere light");
    }
}

#[test]
fn a_disk_light_lights_a_plane_by_its_form_factor() {
    let mut plane = floor_scene(1, 0.5);
    let black = diffuse(&mut plane, 0.0);
    add(&mut plane, disk(Vec3::Z * (FLOOR - 2.0), 1.5), black, Some(3.0));
    plane.camera.to_render = AnimatedTransform::fixed(DAffine3::from_translation(DVec3::new(0.0, 0.0, 3.0)));
    both_integrators(&mut plane, 256, 0.5 * 3.0 * 2.25 / (2.25 + 4.0), "disk light");
}

#[test]
fn a_square_light_lights_a_plane_by_its_form_factor() {
    let mut plane = floor_scene(1, 0.5);
    let black = diffuse(&mut plane, 0.0);
    add(&mut plane, square(Vec3::Z * (FLOOR - 1.0), 1.0), black, Some(3.0));
    plane.camera.to_render = AnimatedTransform::fixed(DAffine3::from_translation(DVec3::new(0.0, 0.0, 3.5)));
    // Four times a rectangle over one of its corners, with sides and distance 1 (Howell, B-3).
    let quarter = 2.0 / TAU as f64 * (0.5f64.sqrt() * 0.5f64.sqrt().atan()) * 2.0;
    both_integrators(&mut plane, 256, 0.5 * 3.0 * 4.0 * quarter / 2.0, "square light");
}

#[test]
fn light_passes_boundaries_without_effect() {
    for depth in [1, 3] {
        let mut plane = floor_scene(depth, 0.5);
        let black = diffuse(&mut plane, 0.0);
        let nothing = material(&mut plane, MaterialKind::Interface);
        let centre = Vec3::Z * FLOOR + Vec3::new(0.5, 1.0, -2.0);
        add(&mut plane, sphere(centre, 0.4), black, Some(7.0));
        add(&mut plane, sphere(centre, 0.5), nothing, None);
        add(&mut plane, sphere(Vec3::Z * FLOOR, 1.0), nothing, None);
        let squared = 5.25;
        let expected = 0.5 * 7.0 * 0.16 / squared * 2.0 / f64::sqrt(squared);
        assert_colour(&plane, 256, expected, &format!("depth {depth}"));
    }
}

#[test]
fn layers_of_which_half_is_not_there_let_a_half_pass_each() {
    let mut view = scene(1);
    let black = diffuse(&mut view, 0.0);
    let nothing = material(&mut view, MaterialKind::Interface);
    let amount = view.textures.add(Texture::Constant(0.5));
    let half = material(&mut view, MaterialKind::Mix { first: nothing, second: black, amount });
    for z in [1.0, 2.0, 3.0] {
        add(&mut view, square(Vec3::Z * z, 1.0), half, None);
    }
    add(&mut view, square(Vec3::Z * FLOOR, 1.0), black, Some(1.0));
    assert_radiance(&view, 4096, 0.125, "three layers");
}

#[test]
fn what_is_seen_in_a_mirror_is_visible_emission() {
    for integrator in [Integrator::Path { max_depth: 3 }, Integrator::Direct { max_depth: 3 }] {
        let mut view = scene(0);
        view.integrator = integrator;
        let silver = mirror(&mut view, 0.8);
        add(&mut view, square(Vec3::Z * 3.0, 10.0), silver, None);
        view.lights.push(Light::Environment(Environment {
            to_render: glam::Affine3A::IDENTITY,
            scale: Vec3::splat(2.0),
            map: None,
            portal: None,
        }));
        assert_radiance(&view, 8, 1.6, "radiance");
        let store = render(&view, 8, 0);
        let colour = store.means(Part::Whole, store.layout().colour());
        assert!(colour.data().iter().all(|&v| v == 0.0));
    }
}

#[test]
fn exposure_is_a_factor_of_both_colours() {
    let mut room = scene(1);
    room.film.scale = 3.0;
    let walls = diffuse(&mut room, 0.5);
    add(&mut room, sphere(Vec3::ZERO, 2.0), walls, Some(1.0));
    assert_radiance(&room, 64, 4.5, "radiance");
    assert_colour(&room, 64, 1.5, "colour");
}

/// Offsets of rays and thresholds follow the coordinates, so nothing has a size of its own.
#[test]
fn a_scene_looks_the_same_at_any_scale() {
    let image = |scale: f32| {
        let mut view = scene(4);
        view.camera.projection = Projection::Perspective { tan_half_fov: 0.5 };
        let white = diffuse(&mut view, 0.7);
        add(&mut view, square(scale * Vec3::Z * FLOOR, scale * 5.0), white, None);
        add(&mut view, sphere(scale * Vec3::new(0.5, 0.3, 3.0), scale * 0.5), white, None);
        add(&mut view, square(scale * Vec3::new(-0.5, -0.6, 3.5), scale * 0.4), white, None);
        add(&mut view, square(scale * Vec3::Y * 2.0, scale * 0.5), white, Some(9.0));
        let store = render(&view, 32, 3);
        store.means(Part::Whole, store.layout().radiance()).plane(1).to_vec()
    };
    let reference = image(1.0);
    let mean = |image: &[f32]| image.iter().sum::<f32>() / image.len() as f32;
    assert!(mean(&reference) > 0.05, "{}", mean(&reference));
    for scale in [1e-3, 1e3] {
        let scaled = image(scale);
        let pairs = reference.iter().zip(&scaled);
        // At an outline rounding decides whether a ray hits; everywhere else pixels agree.
        let differing = pairs.filter(|(a, b)| (*a - *b).abs() > 1e-3 * *a).count();
        assert!(differing <= SIDE * SIDE / 10, "{scale}: {differing} pixels differ");
        assert!((mean(&scaled) / mean(&reference) - 1.0).abs() < 2e-3, "{scale}");
    }
}

#[test]
fn neither_threads_nor_batches_nor_crops_change_a_sample() {
    let mut room = scene(6);
    room.camera.projection = Projection::Perspective { tan_half_fov: 1.0 };
    let walls = diffuse(&mut room, 0.8);
    let silver = mirror(&mut room, 0.9);
    add(&mut room, sphere(Vec3::ZERO, 10.0), walls, Some(0.1));
    add(&mut room, sphere(Vec3::new(1.0, 0.0, 5.0), 1.0), silver, None);
    add(&mut room, sphere(Vec3::new(-1.0, 0.5, 4.0), 0.5), walls, Some(3.0));
    let accel = Accel::build(&room);
    let renderer = Renderer::new(&room, &accel, 5);
    let empty = || Store::new(SIDE, SIDE, renderer.layout().clone(), 4, 5);
    let on = |threads: usize, batches: &[u32]| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut store = empty();
        for &spp in batches {
            pool.install(|| renderer.render_batch(&[spp; SIDE * SIDE], &mut store));
        }
        store
    };
    let reference = on(1, &[12]);
    assert_eq!(reference.rows(), on(2, &[12]).rows());
    assert_eq!(reference.rows(), on(2, &[5, 0, 4, 3]).rows());
    // Pixels with different counts side by side, most of them none.
    let first: Vec<u32> = (0..SIDE * SIDE).map(|i| (i * i % 13).saturating_sub(6) as u32).collect();
    let mut mixed = empty();
    renderer.render_batch(&first, &mut mixed);
    assert_eq!(mixed.counts(Part::Whole), first);
    renderer.render_batch(&first.iter().map(|n| 12 - n).collect::<Vec<_>>(), &mut mixed);
    assert_eq!(reference.rows(), mixed.rows());

    let mut cropped = room.clone();
    cropped.film.pixel_bounds = [2, 5, 3, 7];
    let crop_renderer = Renderer::new(&cropped, &accel, 5);
    let mut crop = Store::new(3, 4, crop_renderer.layout().clone(), 0, 5);
    crop_renderer.render_batch(&[12; 12], &mut crop);
    let (all, part) = (0..reference.layout().len(), 0..crop.layout().len());
    let (whole, crop) = (reference.means(Part::Whole, all), crop.means(Part::Whole, part));
    for (x, y, dim) in (0..3).flat_map(|x| (0..4).flat_map(move |y| (0..10).map(move |d| (x, y, d)))) {
        assert_eq!(crop.at(dim, x, y), whole.at(dim, x + 2, y + 3));
    }
}

#[test]
fn a_pixel_whose_indices_are_used_up_gets_no_more_samples() {
    let plane = floor_scene(1, 0.5);
    let accel = Accel::build(&plane);
    let renderer = Renderer::new(&plane, &accel, 0);
    let mut store = Store::new(SIDE, SIDE, renderer.layout().clone(), 0, 0);
    let row = &mut store.rows_mut()[0];
    let mut bytes = vec![0; Row::byte_len(SIDE, renderer.layout(), 0).unwrap()];
    row.to_bytes(&mut bytes);
    // Numbers of samples taken, then rejected, of all pixels of the row: all but three of the second pixel's.
    for counts in bytes.chunks_exact_mut(4 * SIDE).take(2) {
        counts[4..8].copy_from_slice(&(u32::MAX - 3).to_le_bytes());
    }
    row.read_bytes(&bytes).unwrap();
    renderer.render_batch(&[10; SIDE * SIDE], &mut store);
    assert_eq!(store.counts(Part::Whole)[..3], [10, 3, 10]);
    assert_eq!(store.rows()[0].next_index(1), u32::MAX);
    renderer.render_batch(&[10; SIDE * SIDE], &mut store);
    assert_eq!(store.counts(Part::Whole)[..3], [20, 3, 20]);
}
