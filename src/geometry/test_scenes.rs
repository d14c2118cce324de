//! Small scenes and random rays for this room's tests.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};

use super::Ray;
use crate::hash::{GAMMA, hash};
use crate::scene::camera::Projection;
use crate::scene::*;

/// A random number generator for tests (SplitMix64).
pub struct Rng(u64);

impl Rng {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    pub fn next(&mut self) -> f32 {
        let bits = hash(self.0);
        self.0 = self.0.wrapping_add(GAMMA);
        (bits >> 40) as f32 / (1 << 24) as f32
    }

    /// Uniform in the cube from -`half` to `half`.
    pub fn in_cube(&mut self, half: f32) -> Vec3 {
        let mut coordinate = || half * (2.0 * self.next() - 1.0);
        Vec3::new(coordinate(), coordinate(), coordinate())
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> Vec3 {
        let z = 2.0 * self.next() - 1.0;
        let (sin, cos) = (TAU * self.next()).sin_cos();
        let ring = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(ring * cos, ring * sin, z)
    }
}

pub fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray { origin, direction, t_max: f32::INFINITY, time: 0.0 }
}

/// A scene whose static object has these shapes. The shutter is open in [0, 1].
pub fn static_scene(shapes: Vec<Shape>) -> Scene {
    let primitives: Vec<_> = shapes.into_iter().map(primitive).collect();
    Scene {
        source: String::new(),
        dialect: None,
        hash: String::new(),
        files: Vec::new(),
        origin: DVec3::ZERO,
        camera: Camera {
            to_render: AnimatedTransform::fixed(DAffine3::IDENTITY),
            projection: Projection::Orthographic,
            screen_window: [-1.0, 1.0, -1.0, 1.0],
            lens_radius: 0.0,
            focal_distance: 1.0,
            shutter_open: 0.0,
            shutter_close: 1.0,
        },
        film: Film {
            width: 1,
            height: 1,
            pixel_bounds: [0, 1, 0, 1],
            filter: PixelFilter::Box { radius: [0.5, 0.5] },
            filename: None,
            scale: 1.0,
            white_balance: None,
        },
        integrator: Integrator::Path { max_depth: 1 },
        sampler: SamplerKind::Independent,
        spp: 1,
        textures: Textures::default(),
        materials: Vec::new(),
        objects: vec![Object { name: String::new(), primitives: 0..primitives.len() }],
        primitives,
        instances: Vec::new(),
        lights: Vec::new(),
        warnings: Vec::new(),
    }
}

/// A scene with an empty static object, and an instance of this shape for each transform.
pub fn instanced(shape: Shape, transforms: Vec<AnimatedTransform>) -> Scene {
    let mut scene = static_scene(vec![shape]);
    scene.objects.insert(0, Object { name: String::new(), primitives: 0..0 });
    scene.instances = transforms.into_iter().map(|transform| Instance { object: 1, transform }).collect();
    scene
}

pub fn primitive(shape: Shape) -> Primitive {
    Primitive { shape, material: MaterialId(0), alpha: None, area_light: None, flip_normal: false }
}

pub fn full_sphere(radius: f32) -> Sphere {
    Sphere { to_object: DAffine3::IDENTITY, radius, z_min: -radius, z_max: radius, phi_max: TAU }
}

pub fn sphere(centre: Vec3, radius: f32) -> Shape {
    Shape::Sphere(Sphere { to_object: DAffine3::from_translation(centre.as_dvec3()), ..full_sphere(radius) })
}

/// A mesh of triangles that share no vertices.
pub fn triangle_mesh(triangles: &[[Vec3; 3]]) -> Arc<TriangleMesh> {
    Arc::new(TriangleMesh {
        positions: triangles.as_flattened().to_vec(),
        indices: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..TriangleMesh::default()
    })
}

/// A closed triangle mesh of a sphere, facing outwards.
pub fn closed_sphere_mesh(centre: Vec3, radius: f32, rings: u32, columns: u32) -> Arc<TriangleMesh> {
    let mut positions = vec![centre + radius * Vec3::Z];
    for ring in 1..rings {
        for column in 0..columns {
            let (sin_theta, cos_theta) = (PI * ring as f32 / rings as f32).sin_cos();
            let (sin_phi, cos_phi) = (TAU * column as f32 / columns as f32).sin_cos();
            positions.push(centre + radius * Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta));
        }
    }
    positions.push(centre - radius * Vec3::Z);
    let last = positions.len() as u32 - 1;
    let at = |ring: u32, column: u32| match ring {
        0 => 0,
        ring if ring == rings => last,
        ring => 1 + (ring - 1) * columns + column % columns,
    };
    let mut indices = Vec::new();
    for ring in 0..rings {
        for column in 0..columns {
            let [a, b] = [at(ring, column), at(ring + 1, column)];
            let [c, d] = [at(ring + 1, column + 1), at(ring, column + 1)];
            if b != c {
                indices.push([a, b, c]);
            }
            if a != d {
                indices.push([a, c, d]);
            }
        }
    }
    Arc::new(TriangleMesh { positions, indices, ..TriangleMesh::default() })
}
