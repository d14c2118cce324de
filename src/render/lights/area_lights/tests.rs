use std::f32::consts::PI;

use glam::Vec2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::geometry::{Accel, Ray};
use crate::render::chi_squared::{p_value, significance};
use crate::scene::pbrt::read_str;

/// A scene with an area light whose image has 2×2 texels: red and green above, blue and white below.
fn scene(shape: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let texels: [[f32; 3]; 4] = [[0.0, 0.0, 1.0], [1.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut file = b"PF\n2 2\n-1.0\n".to_vec();
    file.extend(texels.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    std::fs::write(folder.path().join("a.pfm"), file).unwrap();
    let light = "AreaLightSource \"diffuse\" \"string filename\" \"a.pfm\" \"float scale\" 3";
    read_str(&format!("WorldBegin Material \"diffuse\" {light} {shape}"), folder.path()).unwrap()
}

/// Two triangles whose texture coordinates are discontinuous along their common edge and exceed [0, 1].
const MESH: &str = "Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 1 1 .3 -1 1 .3]
    \"integer indices\" [0 1 2 0 2 3] \"point2 uv\" [0 0 1.3 0 .8 1 0 .4]";

#[test]
fn the_first_row_of_an_image_is_at_v_one() {
    let scene = scene("Shape \"disk\"");
    let light = scene.primitives[0].area_light.unwrap();
    let at = |u: f32, v: f32| light.radiance_at(&scene.textures, Vec2::new(u, v));
    let [red, green, blue, white] = [(0.1, 0.9), (0.9, 0.9), (0.1, 0.1), (0.9, 0.1)].map(|(u, v)| at(u, v));
    assert_eq!([red, green, blue, white], [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE].map(|c| 3.0 * c));
    assert_eq!(light.mean_radiance(&scene.textures), Vec3::splat(1.5));
}

#[test]
fn light_sampling_and_uniform_sampling_agree_on_lights_with_images() {
    let from = Vec3::new(0.3, 0.2, 1.5);
    for shape in
        [MESH, "Shape \"disk\"", "Shape \"sphere\" \"float radius\" .9", "Shape \"sphere\" \"float zmax\" .8"]
    {
        let scene = scene(shape);
        let lights = AreaLights::new(&scene);
        let accel = Accel::build(&scene);
        let mut rng = Pcg32::seed_from_u64(1);
        let count = lights.bounds().count();
        let side = 300;
        let mut stratified = |i: usize| {
            Vec2::new((i % side) as f32 + rng.random::<f32>(), (i / side) as f32 + rng.random::<f32>())
                / side as f32
        };

        // Integrate by light sampling
        let mut by_light_sampling = Vec3::ZERO;
        for i in 0..side * side {
            let u = stratified(i);
            for light in 0..count {
                if let Some(sample) = lights.sample(light, from, u) {
                    by_light_sampling += sample.radiance / sample.pdf;
                }
            }
        }

        // Integrate by uniform directions
        let mut by_rays = Vec3::ZERO;
        for i in 0..4 * side * side {
            let u = stratified(i / 4);
            let z = 1.0 - 2.0 * u.x;
            let (sin, cos) = (2.0 * PI * u.y).sin_cos();
            let direction = Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            let ray = Ray { origin: from, direction, t_max: f32::INFINITY, time: 0.0 };
            // Emission needs texture coordinates even if the material does not.
            if let Some(hit) = accel.intersect(&ray) {
                let point = accel.minimal_interaction(&ray, &hit);
                by_rays += lights.emitted_radiance(&point, -direction).unwrap_or_default() * PI;
            }
        }

        let [by_light_sampling, by_rays] = [by_light_sampling, by_rays].map(|sum| sum / (side * side) as f32);
        let difference = (by_light_sampling - by_rays).abs().max_element();
        let largest = by_rays.max_element();
        assert!(largest > 0.2 && difference < 0.02 * largest, "{shape}: {by_light_sampling} {by_rays}");
    }
}

/// Bins of equal area, by the coordinates along the edges.
#[test]
fn samples_of_a_parallelogram_follow_their_density() {
    const BINS: usize = 8;
    /// Quadrature nodes along each side of a bin.
    const NODES: usize = 16;
    const SAMPLES: usize = 100_000;
    // Far from the light, near a corner, and near its plane.
    const POINTS: [Vec3; 3] =
        [Vec3::new(1.0, -2.0, 5.0), Vec3::new(2.2, 0.2, 0.9), Vec3::new(-3.0, 1.0, 0.1)];
    let [a, b, c, d] =
        [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.5), Vec3::new(2.5, 3.0, 0.7), Vec3::new(0.5, 3.0, 0.2)];
    let corners = [a, b, c, d].map(|p| format!("{} {} {}", p.x, p.y, p.z)).join(" ");
    let scene = read_str(
        &format!(
            "WorldBegin AreaLightSource \"diffuse\" \"bool twosided\" true
             Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" [ {corners} ]"
        ),
        std::path::Path::new(""),
    );
    let scene = scene.unwrap();
    let lights = AreaLights::new(&scene);
    let [light] = &lights.lights[..] else { panic!("one light") };
    let sampler = light.triangle().expect("a parallelogram");
    let edges = [b - a, d - a];
    let area = edges[0].cross(edges[1]);
    let normal = area.normalize();
    let mut rng = Pcg32::seed_from_u64(3);
    for from in POINTS {
        let side = BINS * NODES;
        let mut expected = vec![0.0; BINS * BINS];
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            let at = (Vec2::new(i as f32, j as f32) + 0.5) / side as f32;
            let point = a + at.x * edges[0] + at.y * edges[1];
            let to_point = point - from;
            let per_area = normal.dot(to_point.normalize()).abs() / to_point.length_squared();
            let mass = sampler.pdf(from, point) * per_area * area.length() / (side * side) as f32;
            expected[i / NODES * BINS + j / NODES] += f64::from(mass) * SAMPLES as f64;
        }
        let mut counts = vec![0.0; BINS * BINS];
        for _ in 0..SAMPLES {
            let u = Vec2::new(rng.random(), rng.random());
            let wi = lights.sample(0, from, u).expect("the light is visible").wi;
            let point = from + normal.dot(a - from) / normal.dot(wi) * wi - a;
            let along = [point.cross(edges[1]), edges[0].cross(point)];
            let [i, j] = along.map(|along| {
                let coordinate = along.dot(area) / area.length_squared();
                assert!((-1e-4..=1.0001).contains(&coordinate), "{from}: {coordinate}");
                ((coordinate * BINS as f32) as usize).min(BINS - 1)
            });
            counts[i * BINS + j] += 1.0;
        }
        let p = p_value(&counts, &expected);
        assert!(p > significance(POINTS.len()), "{from}: p = {p}");
    }
}
