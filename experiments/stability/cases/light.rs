//! Renders against closed forms, and samples of lights against their densities.

use glam::{Vec2, Vec3};
use prpf::adaptive::Sampling;
use prpf::geometry::{Accel, Ray, pdf_shape, sample_shape};
use prpf::scene::Scene;
use prpf::stats::Part;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::Bound::{AtLeast, AtMost};
use super::circle::{circle, settings};
use super::pictures::{green, mean, render, scene};
use super::surfaces::{Cells, NO_ACCIDENT, deviations};
use super::{Case, Effort, largest};

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = radiance(effort.of(64, 1024));
    cases.extend(light_samplers(effort.of(40_000, 1_000_000)));
    cases
}

/// Every pixel of these images sees next to the same point, with numbers of its own: pixels are
/// independent estimates of one number, whatever the sampler does within a pixel.
pub fn one_point(look: &str, integrator: &str, world: &str) -> Scene {
    scene(&format!(
        r#"LookAt {look} Camera "perspective" "float fov" 0.01 Integrator {integrator}
        Sampler "zsobol" Film "rgb" "integer xresolution" 20 "integer yresolution" 20 WorldBegin {world}"#
    ))
}

/// Deviations of the mean of the pixels from what is expected; not a number where the mean is too noisy to
/// prove anything.
fn off(scene: &Scene, sampling: Sampling, samples: u32, expected: f64) -> f64 {
    /// Relative rounding errors of a path in `f32`.
    const ROUNDING: f64 = 2e-5;
    /// Of the mean, relative to what is expected.
    const LARGEST_ERROR: f64 = 0.002;
    let store = match sampling {
        Sampling::Uniform => render(scene, samples, 1),
        Sampling::Adaptive => circle(scene, &settings(samples, sampling, 1)).store,
    };
    let (mean, error) = mean(&green(&store, Part::Whole));
    if error > LARGEST_ERROR * expected {
        return f64::NAN;
    }
    ((mean - expected).abs() - ROUNDING * expected).max(0.0) / error.max(f64::MIN_POSITIVE)
}

fn radiance(samples: u32) -> Vec<Case> {
    const FLOOR: &str = r#"Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ]
        "point3 P" [ -100 0 -100  -100 0 100  100 0 100  100 0 -100 ]"#;
    /// Sees the floor's origin from the side, past any light.
    const FROM_THE_SIDE: &str = "-4 1.5 0  0 0 0  0 1 0";
    let floor = |albedo: f64, light: &str| {
        format!(
            "AttributeBegin Material \"diffuse\" \"rgb reflectance\" [ {albedo} {albedo} {albedo} ] {FLOOR} AttributeEnd {light}"
        )
    };
    let lamp = "Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ] AreaLightSource \"diffuse\" \"rgb L\" [ 7 7 7 ] \"bool twosided\" true";
    let ball = format!("{lamp} Translate 0.5 2 1 Shape \"sphere\" \"float radius\" 0.4");
    let disk = format!("{lamp} Translate 0 2 0 Rotate 90 1 0 0 Shape \"disk\" \"float radius\" 1.5");
    let sky = "LightSource \"infinite\" \"rgb L\" [ 1.5 1.5 1.5 ]";
    let direct = ["\"path\" \"integer maxdepth\" 1", "\"directlighting\" \"integer maxdepth\" 3"];
    // The solid angle and the cosine of the ball's centre; the form factor of a parallel disk.
    let by_ball = 0.5 * 7.0 * 0.16 / 5.25 * 2.0 / 5.25f64.sqrt();
    let by_disk = 0.5 * 7.0 * 2.25 / (2.25 + 4.0);
    let scenes = [
        ("a ball of light over a plane", FROM_THE_SIDE, floor(0.5, &ball), direct.to_vec(), by_ball),
        ("a disk of light over a plane", FROM_THE_SIDE, floor(0.5, &disk), direct.to_vec(), by_disk),
        ("a plane under a uniform sky", FROM_THE_SIDE, floor(0.6, sky), direct.to_vec(), 0.9),
        (
            "energy in a closed glowing room",
            "0.2 0 0  1 0 0.3  0 1 0",
            "Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.6 ] \
             AreaLightSource \"diffuse\" \"rgb L\" [ 0.5 0.5 0.5 ] \"bool twosided\" true Shape \"sphere\" \"float radius\" 2"
                .to_owned(),
            vec!["\"path\" \"integer maxdepth\" 60"],
            0.5 / (1.0 - 0.6),
        ),
    ];
    let mut cases = Vec::new();
    for (name, look, world, integrators, expected) in &scenes {
        for (sampling, how) in [(Sampling::Uniform, "uniform"), (Sampling::Adaptive, "adaptive")] {
            let off = integrators
                .iter()
                .map(|integrator| off(&one_point(look, integrator, world), sampling, samples, *expected));
            let name = format!("{name}, {how}");
            cases.push(Case::new(name, "deviations from the closed form", AtMost(NO_ACCIDENT), largest(off)));
        }
    }
    let brighter = one_point(FROM_THE_SIDE, direct[0], &floor(0.505, &ball));
    let noticed = off(&brighter, Sampling::Uniform, samples, by_ball);
    cases.push(Case::new(
        "planted: a BSDF that is off by 1 %",
        "deviations from the closed form",
        AtLeast(NO_ACCIDENT),
        noticed,
    ));
    cases
}

/// Points drawn from lights, by the directions in which they are seen.
fn light_samplers(samples: usize) -> Vec<Case> {
    const BY_CONE: &str = "a ball seen from outside";
    let lamp = "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ]";
    let shapes = [
        (
            "a triangle",
            "Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 ] \"point3 P\" [ -1 1 -1  2 1 0  0 1.5 2 ]",
        ),
        ("a disk", "Translate 0.3 1 0.2 Rotate 70 1 0 0 Shape \"disk\" \"float radius\" 1.2"),
        (BY_CONE, "Translate 0.5 1 0.5 Shape \"sphere\" \"float radius\" 0.8"),
        ("a ball seen from inside", "Translate 0.2 0.1 0 Shape \"sphere\" \"float radius\" 1.5"),
        (
            "a part of a stretched ball",
            "Scale 1 2 1 Shape \"sphere\" \"float radius\" 1.5 \"float zmax\" 0.7 \"float phimax\" 250",
        ),
    ];
    let of_shape = |(name, shape): (&str, &str)| {
        let scene = scene(&format!("WorldBegin {lamp} {shape}"));
        let accel = Accel::build(&scene);
        let mut numbers = Pcg32::seed_from_u64(9);
        // The last cell is for numbers that give no point.
        let mut counts = vec![0.0; Cells::COUNT + 1];
        for _ in 0..samples {
            let u = Vec2::new(numbers.random(), numbers.random());
            let sample = sample_shape(&scene, 0, 0, Vec3::ZERO, u);
            counts[sample.map_or(Cells::COUNT, |sample| Cells::of(sample.position.normalize()))] += 1.0;
        }
        // Where points are drawn by area, a ray may meet two of them; where directions are drawn, either
        // point has the density of both.
        let density = |w: Vec3| {
            let mut ray = Ray { origin: Vec3::ZERO, direction: w, t_max: f32::INFINITY, time: 0.0 };
            let mut sum = 0.0;
            while let Some(hit) = accel.intersect(&ray) {
                let point = accel.surface(&ray, &hit);
                sum += pdf_shape(&scene, 0, 0, Vec3::ZERO, &point);
                if name == BY_CONE {
                    break;
                }
                ray.origin = point.offset_origin(w);
            }
            sum
        };
        let points = Cells::integrate(density).into_iter().map(|m| m * samples as f64);
        let expected: Vec<f64> = points.chain([0.0]).collect();
        let name = format!("points of {name} against their density");
        Case::new(name, "deviations, by χ²", AtMost(NO_ACCIDENT), deviations(&counts, &expected))
    };
    shapes.map(of_shape).to_vec()
}
