//! Rays per second against a million generated triangles: coherent camera rays, shadow rays to one
//! light, rays scattered where camera rays hit, and rays without any order. Set `RAYON_NUM_THREADS`
//! to choose the threads. With `PRPF_RAYS` naming a folder, mesh and rays are written there for
//! `experiments/embree`, which runs Embree on them.

use std::f32::consts::{PI, TAU};
use std::path::Path;
use std::sync::Arc;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use glam::{DAffine3, DVec3, Vec3};
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
const LIGHT: Vec3 = Vec3::new(4.0, 6.0, 8.0);
/// Balls in the scene; each has 2 · 100 · 50 triangles.
const BALLS: usize = 100;
const RINGS: u32 = 50;
const COLUMNS: u32 = 100;
/// Waves around a ball, and their height as a share of its radius.
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
        source: String::new(),
        hash: String::new(),
        origin: DVec3::ZERO,
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
        },
        integrator: Integrator::Path { max_depth: 1 },
        sampler: SamplerKind::Independent,
        spp: 1,
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

fn camera_rays() -> Vec<Ray> {
    let coordinate = |pixel: usize| 2.0 * (pixel as f32 + 0.5) / IMAGE as f32 - 1.0;
    (0..IMAGE * IMAGE)
        .map(|pixel| Ray {
            origin: Vec3::new(0.1, 0.2, 6.0),
            direction: Vec3::new(0.5 * coordinate(pixel % IMAGE), 0.5 * coordinate(pixel / IMAGE), -1.0),
            t_max: f32::INFINITY,
            time: 0.0,
        })
        .collect()
}

fn random_rays() -> Vec<Ray> {
    let mut random = Pcg64Mcg::seed_from_u64(2);
    let mut point = || Vec3::from_array(std::array::from_fn(|_| random.random_range(-2.5f32..2.5)));
    (0..IMAGE * IMAGE)
        .map(|_| {
            let origin = point();
            Ray { origin, direction: point() - origin, t_max: f32::INFINITY, time: 0.0 }
        })
        .collect()
}

fn shadow_rays(accel: &Accel, camera_rays: &[Ray]) -> Vec<Ray> {
    let spawn = |ray: &Ray| {
        let point = accel.surface(ray, &accel.intersect(ray)?);
        let origin = point.offset_origin(LIGHT - point.position);
        Some(Ray { origin, direction: LIGHT - origin, t_max: 1.0, time: 0.0 })
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
        let point = accel.surface(ray, &accel.intersect(ray)?);
        let side = -ray.direction.dot(point.geometric_normal).signum();
        let direction = side * point.geometric_normal + unit();
        let origin = point.offset_origin(direction);
        Some(Ray { origin, direction, t_max: f32::INFINITY, time: 0.0 })
    };
    camera_rays.iter().filter_map(spawn).collect()
}

/// Writes what another program needs to trace the same rays, as plain numbers.
fn write_rays(folder: &Path, mesh: &TriangleMesh, rays: &[(&str, &[Ray])]) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("positions"), bytemuck::cast_slice(&mesh.positions))?;
    std::fs::write(folder.join("indices"), bytemuck::cast_slice(&mesh.indices))?;
    for (name, rays) in rays {
        let numbers: Vec<Vec3> = rays.iter().flat_map(|ray| [ray.origin, ray.direction]).collect();
        std::fs::write(folder.join(name), bytemuck::cast_slice(&numbers))?;
    }
    Ok(())
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

fn rays(criterion: &mut Criterion) {
    let mesh = million_triangles();
    let scene = scene_of(mesh.clone());
    let accel = Accel::build(&scene);
    let camera = camera_rays();
    let shadow = shadow_rays(&accel, &camera);
    let bounce = bounce_rays(&accel, &camera);
    let random = random_rays();
    if let Some(folder) = std::env::var_os("PRPF_RAYS") {
        let rays: [(&str, &[Ray]); 4] =
            [("primary", &camera), ("shadow", &shadow), ("bounce", &bounce), ("incoherent", &random)];
        write_rays(Path::new(&folder), &mesh, &rays).expect("PRPF_RAYS names a folder to write to");
    }

    let mut group = criterion.benchmark_group("rays");
    let mut measure = |name: &str, rays: &[Ray], count: fn(&Accel, &[Ray]) -> usize| {
        group.throughput(Throughput::Elements(rays.len() as u64));
        group.bench_function(name, |bencher| {
            bencher.iter(|| rays.par_chunks(TILE).map(|tile| count(&accel, tile)).sum::<usize>());
        });
    };
    measure("primary", &camera, hits);
    measure("shadow", &shadow, occluded);
    measure("bounce", &bounce, hits);
    measure("incoherent", &random, hits);
    group.finish();

    criterion.bench_function("build", |bencher| {
        bencher.iter_batched(|| (), |()| Accel::build(&scene), BatchSize::PerIteration);
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = rays
}
criterion_main!(benches);
