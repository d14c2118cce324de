//! Cases on light: renders against closed forms, and light samples against their densities.

use glam::{Vec2, Vec3};
use prpf::adaptive::Sampling;
use prpf::geometry::{Accel, Detail, Ray, ShapeSampler};
use prpf::scene::Scene;
use prpf::stats::Part;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::case::Bound::{AtLeast, AtMost};
use super::case::{Case, largest};
use super::chi_squared::{MAX_Z, chi_squared_z};
use super::effort::Effort;
use super::render_loop::{run_loop, settings};
use super::renders::{green, mean, render, scene};
use super::sphere_cells::SphereCells;

pub fn cases(effort: Effort) -> Vec<Case> {
    let mut cases = radiance(effort.select(64, 1024));
    cases.extend(light_samplers(effort.select(40_000, 1_000_000)));
    cases
}

/// A scene whose pixels all see nearly the same point, with random numbers of their own: estimates of one radiance, whose
/// mean mostly deviates less than that of independent ones, because neighbouring pixels complement each other.
pub fn one_point(look: &str, integrator: &str, world: &str) -> Scene {
    scene(&format!(
        r#"LookAt {look} Camera "perspective" "float fov" 0.01 Integrator {integrator}
        Sampler "zsobol" Film "rgb" "integer xresolution" 20 "integer yresolution" 20 WorldBegin {world}"#
    ))
}

/// z-score of the mean of all pixels against the expected radiance; NaN if the mean is too noisy for a test.
fn mean_z(scene: &Scene, sampling: Sampling, samples: u32, expected: f64) -> f64 {
    /// Relative rounding error of a path in `f32`.
    const ROUNDING: f64 = 2e-5;
    /// Largest relative standard error of the mean.
    const MAX_ERROR: f64 = 0.002;
    let store = match sampling {
        Sampling::Uniform => render(scene, samples, 1),
        Sampling::Adaptive => run_loop(scene, &settings(samples, sampling, 1)).store,
    };
    let (mean, error) = mean(&green(&store, Part::Whole));
    if error > MAX_ERROR * expected {
        return f64::NAN;
    }
    ((mean - expected).abs() - ROUNDING * expected).max(0.0) / error.max(f64::MIN_POSITIVE)
}

/// Radiance of lit planes and of a closed emitter.
fn radiance(samples: u32) -> Vec<Case> {
    // Describe the scenes
    const FLOOR: &str = r#"Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ]
        "point3 P" [ -100 0 -100  -100 0 100  100 0 100  100 0 -100 ]"#;
    /// A view of the floor's origin past all lights.
    const SIDE_VIEW: &str = "-4 1.5 0  0 0 0  0 1 0";
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
    // Closed forms: projected solid angle of a ball, form factor of a parallel disk
    let by_ball = 0.5 * 7.0 * 0.16 / 5.25 * 2.0 / 5.25f64.sqrt();
    let by_disk = 0.5 * 7.0 * 2.25 / (2.25 + 4.0);
    let scenes = [
        ("a spherical light over a plane", SIDE_VIEW, floor(0.5, &ball), direct.to_vec(), by_ball),
        ("a disk light over a plane", SIDE_VIEW, floor(0.5, &disk), direct.to_vec(), by_disk),
        ("a plane under a uniform sky", SIDE_VIEW, floor(0.6, sky), direct.to_vec(), 0.9),
        (
            "radiance in a closed emitting sphere",
            "0.2 0 0  1 0 0.3  0 1 0",
            "Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.6 ] \
             AreaLightSource \"diffuse\" \"rgb L\" [ 0.5 0.5 0.5 ] \"bool twosided\" true Shape \"sphere\" \"float radius\" 2"
                .to_owned(),
            vec!["\"path\" \"integer maxdepth\" 60"],
            0.5 / (1.0 - 0.6),
        ),
    ];

    // Compare their radiance with the closed forms
    let mut cases = Vec::new();
    for (name, look, world, integrators, expected) in &scenes {
        for (sampling, how) in [(Sampling::Uniform, "uniform"), (Sampling::Adaptive, "adaptive")] {
            let z = integrators
                .iter()
                .map(|integrator| mean_z(&one_point(look, integrator, world), sampling, samples, *expected));
            let name = format!("{name}, {how}");
            cases.push(Case::new(name, "z-score against the closed form", AtMost(MAX_Z), largest(z)));
        }
    }

    // Plant an error
    let brighter = one_point(SIDE_VIEW, direct[0], &floor(0.505, &ball));
    let planted = mean_z(&brighter, Sampling::Uniform, samples, by_ball);
    cases.push(Case::new(
        "planted: a BSDF that is off by 1 %",
        "z-score against the closed form",
        AtLeast(MAX_Z),
        planted,
    ));
    cases
}

/// Samples of lights against their densities in solid angle.
fn light_samplers(samples: usize) -> Vec<Case> {
    const BY_CONE: &str = "a sphere seen from outside";
    let lamp = "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ]";
    let shapes = [
        (
            "a triangle",
            "Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 ] \"point3 P\" [ -1 1 -1  2 1 0  0 1.5 2 ]",
        ),
        ("a disk", "Translate 0.3 1 0.2 Rotate 70 1 0 0 Shape \"disk\" \"float radius\" 1.2"),
        (BY_CONE, "Translate 0.5 1 0.5 Shape \"sphere\" \"float radius\" 0.8"),
        ("a sphere seen from inside", "Translate 0.2 0.1 0 Shape \"sphere\" \"float radius\" 1.5"),
        (
            "a part of a stretched sphere",
            "Scale 1 2 1 Shape \"sphere\" \"float radius\" 1.5 \"float zmax\" 0.7 \"float phimax\" 250",
        ),
    ];
    let case = |(name, shape): (&str, &str)| {
        let scene = scene(&format!("WorldBegin {lamp} {shape}"));
        let accel = Accel::build(&scene);
        let light = ShapeSampler::new(&scene.primitives[0], 0, 0, Detail::Minimal).expect("a finite shape");
        let mut rng = Pcg32::seed_from_u64(9);
        // The last cell counts failed samples.
        let mut counts = vec![0.0; SphereCells::COUNT + 1];
        for _ in 0..samples {
            let u = Vec2::new(rng.random(), rng.random());
            let sample = light.sample(Vec3::ZERO, u);
            counts[sample
                .map_or(SphereCells::COUNT, |sample| SphereCells::index(sample.position.normalize()))] += 1.0;
        }
        // Shapes that are sampled by area add up the densities of all intersections. The sphere seen from outside
        // is sampled by direction, and has one density for both.
        let density = |w: Vec3| {
            let mut ray = Ray { origin: Vec3::ZERO, direction: w, t_max: f32::INFINITY, time: 0.0 };
            let mut sum = 0.0;
            while let Some(hit) = accel.intersect(&ray) {
                let point = accel.interaction(&ray, &hit);
                sum += light.pdf(Vec3::ZERO, &point);
                if name == BY_CONE {
                    break;
                }
                ray.origin = point.offset_origin(w);
            }
            sum
        };
        let mass = SphereCells::integrate(density).into_iter().map(|m| m * samples as f64);
        let expected: Vec<f64> = mass.chain([0.0]).collect();
        let name = format!("samples of {name} against their density");
        Case::new(name, "z-score by χ²", AtMost(MAX_Z), chi_squared_z(&counts, &expected))
    };
    shapes.map(case).to_vec()
}
