//! Rays per second against a million generated triangles, and against San Miguel if `PRPF_SCENES` names the
//! folder of public scenes: coherent camera rays, shadow rays to one light, rays scattered where camera rays
//! hit, and rays without any order. San Miguel is traced with its instances, as the renderer does, and once
//! more as a single mesh; what is cut out of its leaves stays in. Set `RAYON_NUM_THREADS` to choose the
//! threads. With `PRPF_RAYS` naming a folder, meshes and rays are written there for `experiments/embree`,
//! which runs Embree on them.

use std::f32::consts::{PI, TAU};
use std::path::Path;
use std::sync::Arc;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use prpf::geometry::{Accel, Ray};
use prpf::scene::camera::Projection;
use prpf::scene::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// That of the program: its large pages spare incoherent rays a seventh of their time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Side of the image of camera rays.
const IMAGE: usize = 512;
const SAN_MIGUEL: &str = "pbrt-v3/sanmiguel/sanmiguel-courtyard.pbrt";
/// Balls in the generated scene; each has 2 · 100 · 50 triangles.
const BALLS: usize = 100;
const RINGS: u32 = 50;
const COLUMNS: u32 = 100;
/// Waves around a ball, and their height as a fraction of its radius.
const WAVES: f32 = 7.0;
const WAVE_HEIGHT: f32 = 0.1;

/// Wavy balls of all sizes in a cube.
fn million_triangles() -> TriangleMesh {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let mut mesh = TriangleMesh::default();
    for _ in 0..BALLS {
        let centre = Vec3::from_array(std::array::from_fn(|_| random.random_range(-2.0..2.0)));
        let radius = random.random_range(0.05f32..0.4);
        let first = mesh.positions.len() as u32;
        for ring in 0..=RINGS {
            for column in 0..COLUMNS {
                let (sin_theta, cos_theta) = (PI * ring as f32 / RINGS as f32).sin_cos();
                let (sin_phi, cos_phi) = (TAU * column as f32 / COLUMNS as f32).sin_cos();
                let direction = Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta);
                let wave = (WAVES * direction.x).sin() * (WAVES * direction.y).cos();
                mesh.positions.push(centre + radius * (1.0 + WAVE_HEIGHT * wave) * direction);
            }
        }
        for ring in 0..RINGS {
            for column in 0..COLUMNS {
                let at = |r: u32, c: u32| first + r * COLUMNS + c % COLUMNS;
                let [a, b] = [at(ring, column), at(ring + 1, column)];
                let [c, d] = [at(ring + 1, column + 1), at(ring, column + 1)];
                mesh.indices.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh
}

fn scene_of(mesh: TriangleMesh) -> Scene {
    Scene {
        // Describe no files
        source: String::new(),
        dialect: None,
        hash: String::new(),
        files: Vec::new(),
        origin: DVec3::ZERO,
        // Set a camera and a film, which no ray uses
        camera: Camera {
            to_render: AnimatedTransform::fixed(DAffine3::IDENTITY),
            projection: Projection::Orthographic,
            screen_window: [-1.0, 1.0, -1.0, 1.0],
            lens_radius: 0.0,
            focal_distance: 1.0,
            shutter_open: 0.0,
            shutter_close: 0.0,
        },
        film: Film {
            width: IMAGE,
            height: IMAGE,
            pixel_bounds: [0, IMAGE, 0, IMAGE],
            filter: PixelFilter::Box { radius: [0.5, 0.5] },
            filename: None,
            scale: 1.0,
            white_balance: None,
        },
        integrator: Integrator::Path { max_depth: 1 },
        sampler: SamplerKind::Independent,
        spp: 1,
        // Place the mesh
        textures: Textures::default(),
        materials: Vec::new(),
        primitives: vec![Primitive {
            shape: Shape::Mesh(Arc::new(mesh)),
            material: MaterialId(0),
            alpha: None,
            area_light: None,
            flip_normal: false,
        }],
        objects: vec![Object { name: String::new(), primitives: 0..1 }],
        instances: Vec::new(),
        lights: Vec::new(),
        warnings: Vec::new(),
    }
}

/// San Miguel with whole leaves: Embree knows nothing of what alpha cuts out.
fn san_miguel() -> Option<Scene> {
    let file = Path::new(&std::env::var_os("PRPF_SCENES")?).join(SAN_MIGUEL);
    let mut scene = pbrt::read(&file).inspect_err(|error| println!("{error}")).ok()?;
    scene.primitives.iter_mut().for_each(|primitive| primitive.alpha = None);
    Some(scene)
}

/// All triangles of a scene, and nothing else of it, instances copied, in render space.
fn flattened(scene: &Scene) -> TriangleMesh {
    let mut flat = TriangleMesh::default();
    let fixed = (0, DAffine3::IDENTITY);
    let placed = scene.instances.iter().map(|instance| (instance.object, instance.transform.at_f64(0.0)));
    for (object, to_render) in std::iter::once(fixed).chain(placed) {
        for primitive in &scene.primitives[scene.objects[object].primitives.clone()] {
            let Shape::Mesh(mesh) = &primitive.shape else { continue };
            let first = flat.positions.len() as u32;
            let moved = |p: &Vec3| to_render.transform_point3(p.as_dvec3()).as_vec3();
            flat.positions.extend(mesh.positions.iter().map(moved));
            flat.indices.extend(mesh.indices.iter().map(|triangle| triangle.map(|i| first + i)));
        }
    }
    flat
}

/// A pinhole's rays into a square image.
fn camera_rays(to_render: DAffine3, tan_half_fov: f32) -> Vec<Ray> {
    let coordinate = |pixel: usize| 2.0 * (pixel as f32 + 0.5) / IMAGE as f32 - 1.0;
    let ray = |pixel: usize| {
        let [x, y] = [pixel % IMAGE, pixel / IMAGE].map(|at| tan_half_fov * coordinate(at));
        Ray {
            origin: to_render.translation.as_vec3(),
            direction: to_render.transform_vector3(DVec3::new(x.into(), y.into(), 1.0)).as_vec3(),
            t_max: f32::INFINITY,
            time: 0.0,
        }
    };
    (0..IMAGE * IMAGE).map(ray).collect()
}

/// From any point of a box to any other.
fn random_rays([min, max]: [Vec3; 2]) -> Vec<Ray> {
    let mut random = Pcg64Mcg::seed_from_u64(2);
    let mut point = || min + (max - min) * Vec3::from_array(std::array::from_fn(|_| random.random::<f32>()));
    (0..IMAGE * IMAGE)
        .map(|_| {
            let origin = point();
            Ray { origin, direction: point() - origin, t_max: f32::INFINITY, time: 0.0 }
        })
        .collect()
}

fn shadow_rays(accel: &Accel, camera_rays: &[Ray], light: Vec3) -> Vec<Ray> {
    let spawn = |ray: &Ray| {
        let point = accel.interaction(ray, &accel.intersect(ray)?);
        let origin = point.offset_origin(light - point.position);
        Some(Ray { origin, direction: light - origin, t_max: 1.0, time: 0.0 })
    };
    camera_rays.iter().filter_map(spawn).collect()
}

/// Diffusely scattered where the camera rays hit.
fn bounce_rays(accel: &Accel, camera_rays: &[Ray]) -> Vec<Ray> {
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let mut unit = || loop {
        let point = Vec3::from_array(std::array::from_fn(|_| random.random_range(-1f32..1.0)));
        if let Some(direction) = point.try_normalize().filter(|_| point.length_squared() < 1.0) {
            return direction;
        }
    };
    let spawn = |ray: &Ray| {
        let point = accel.interaction(ray, &accel.intersect(ray)?);
        let side = -ray.direction.dot(point.geometric_normal).signum();
        let direction = side * point.geometric_normal + unit();
        let origin = point.offset_origin(direction);
        Some(Ray { origin, direction, t_max: f32::INFINITY, time: 0.0 })
    };
    camera_rays.iter().filter_map(spawn).collect()
}

/// Rays by kind.
struct Rays {
    primary: Vec<Ray>,
    shadow: Vec<Ray>,
    bounce: Vec<Ray>,
    incoherent: Vec<Ray>,
}

impl Rays {
    fn new(accel: &Accel, primary: Vec<Ray>, light: Vec3, bounds: [Vec3; 2]) -> Self {
        let shadow = shadow_rays(accel, &primary, light);
        let bounce = bounce_rays(accel, &primary);
        Self { primary, shadow, bounce, incoherent: random_rays(bounds) }
    }

    /// Of the scene's own camera: the light is half way to what it sees, and rays without order go from any of
    /// that to any other.
    fn from_camera(accel: &Accel, camera: &Camera) -> Self {
        let to_render = camera.to_render.at_f64(0.0);
        let Projection::Perspective { tan_half_fov } = camera.projection else {
            panic!("a perspective camera")
        };
        let primary = camera_rays(to_render, tan_half_fov);
        let point = |ray: &Ray| Some(ray.origin + accel.intersect(ray)?.t * ray.direction);
        let seen: Vec<Vec3> = primary.iter().filter_map(point).collect();
        let nowhere = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let bounds = seen.iter().fold(nowhere, |[min, max], &p| [min.min(p), max.max(p)]);
        let mean = seen.iter().sum::<Vec3>() / seen.len() as f32;
        let light = to_render.translation.as_vec3().midpoint(mean);
        Self::new(accel, primary, light, bounds)
    }

    /// Writes what another program needs to trace the same rays, as plain numbers.
    fn write(&self, folder: &Path, mesh: &TriangleMesh) -> std::io::Result<()> {
        std::fs::create_dir_all(folder)?;
        std::fs::write(folder.join("positions"), bytemuck::cast_slice(&mesh.positions))?;
        std::fs::write(folder.join("indices"), bytemuck::cast_slice(&mesh.indices))?;
        let Self { primary, shadow, bounce, incoherent } = self;
        for (name, rays) in
            [("primary", primary), ("shadow", shadow), ("bounce", bounce), ("incoherent", incoherent)]
        {
            let numbers: Vec<Vec3> = rays.iter().flat_map(|ray| [ray.origin, ray.direction]).collect();
            std::fs::write(folder.join(name), bytemuck::cast_slice(&numbers))?;
        }
        Ok(())
    }
}

/// Tiles of this many rays are handed to threads.
const TILE: usize = 1024;

fn hits(accel: &Accel, rays: &[Ray]) -> usize {
    let mut count = 0;
    accel.intersect_all(rays.iter().copied(), |hit| count += usize::from(hit.is_some()));
    count
}

fn occluded(accel: &Accel, rays: &[Ray]) -> usize {
    let mut count = 0;
    accel.occluded_all(rays.iter().copied(), |occluded| count += usize::from(occluded));
    count
}

fn measure(criterion: &mut Criterion, name: &str, accel: &Accel, rays: &Rays) {
    let mut group = criterion.benchmark_group(name);
    let mut measure_kind = |name: &str, rays: &[Ray], count: fn(&Accel, &[Ray]) -> usize| {
        println!("{name}: {:.4} hit", count(accel, rays) as f64 / rays.len() as f64);
        group.throughput(Throughput::Elements(rays.len() as u64));
        group.bench_function(name, |bencher| {
            bencher.iter(|| rays.par_chunks(TILE).map(|tile| count(accel, tile)).sum::<usize>());
        });
    };
    measure_kind("primary", &rays.primary, hits);
    measure_kind("shadow", &rays.shadow, occluded);
    measure_kind("bounce", &rays.bounce, hits);
    measure_kind("incoherent", &rays.incoherent, hits);
    group.finish();
}

/// Writes rays and mesh to where `PRPF_RAYS` says.
fn write_for_embree(name: &str, rays: &Rays, mesh: &TriangleMesh) {
    let Some(folder) = std::env::var_os("PRPF_RAYS") else { return };
    rays.write(&Path::new(&folder).join(name), mesh).expect("PRPF_RAYS names a folder to write to");
}

fn generated(criterion: &mut Criterion) {
    let mesh = million_triangles();
    let scene = scene_of(mesh.clone());
    let accel = Accel::build(&scene);
    let camera_to_render = DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 1.0, -1.0),
        DQuat::IDENTITY,
        DVec3::new(0.1, 0.2, 6.0),
    );
    let bounds = [Vec3::splat(-2.5), Vec3::splat(2.5)];
    let rays = Rays::new(&accel, camera_rays(camera_to_render, 0.5), Vec3::new(4.0, 6.0, 8.0), bounds);
    write_for_embree("million", &rays, &mesh);
    measure(criterion, "million", &accel, &rays);
    criterion.bench_function("build", |bencher| {
        bencher.iter_batched(|| (), |()| Accel::build(&scene), BatchSize::PerIteration);
    });
}

fn instanced(criterion: &mut Criterion) {
    let Some(scene) = san_miguel() else {
        return println!("San Miguel is left out: PRPF_SCENES names no folder with {SAN_MIGUEL}");
    };
    let accel = Accel::build(&scene);
    let rays = Rays::from_camera(&accel, &scene.camera);
    let mesh = flattened(&scene);
    write_for_embree("sanmiguel", &rays, &mesh);
    measure(criterion, "sanmiguel", &accel, &rays);
    let flat = scene_of(mesh);
    measure(criterion, "sanmiguel as one mesh", &Accel::build(&flat), &rays);
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = generated, instanced
}
criterion_main!(benches);
