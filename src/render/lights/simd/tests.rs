use std::f32::consts::{PI, TAU};
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::geometry::{Accel, Ray};
use crate::render::chi_squared::{p_value, significance};
use crate::render::lights::{LightSampleContext, Lights};
use crate::scene::pbrt::read_str;
use crate::simd::lanes_in;

/// Lights that rays can hit: an environment, a two-sided parallelogram and a one-sided triangle, which are
/// sampled in SIMD, and a disk, which is not.
const LIGHTS: &str = "WorldBegin
    LightSource \"infinite\" \"rgb L\" [ .4 .4 .4 ]
    AreaLightSource \"diffuse\" \"rgb L\" [ 3 3 3 ] \"bool twosided\" true
    Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" [ -2 2 -1  1 2 -1  2 2.5 1  -1 2.5 1 ]
    AreaLightSource \"diffuse\" \"rgb L\" [ 5 5 5 ]
    Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 ] \"point3 P\" [ 3 -1 -1  3 2 -1  3 0 2 ]
    AttributeBegin Translate -3 0 0 Rotate 80 0 1 0 Shape \"disk\" AttributeEnd";

const CONTEXTS: [LightSampleContext; 3] = [
    LightSampleContext { position: Vec3::ZERO, normal: Vec3::Y, transmits: false },
    LightSampleContext { position: Vec3::new(1.0, 0.5, 0.4), normal: Vec3::X, transmits: true },
    // Behind the one-sided triangle.
    LightSampleContext { position: Vec3::new(5.0, 0.0, -0.5), normal: Vec3::NEG_X, transmits: false },
];

/// Cells of equal solid angle over the sphere, and quadrature nodes along each side of one.
const SIDE: usize = 16;
const NODES: usize = 32;

fn contexts() -> LightSampleContexts {
    let mut contexts = LightSampleContexts::NONE;
    for lane in 0..LANES {
        let LightSampleContext { position, normal, transmits } = CONTEXTS[lane % CONTEXTS.len()];
        contexts.position.set(lane, position);
        contexts.normal.set(lane, normal);
        contexts.transmits[lane] = u32::from(transmits);
    }
    contexts
}

#[test]
fn lights_are_chosen_in_lanes_as_one_by_one() {
    let contexts = contexts();
    // The scene's lights, a row of many more, and one that only some of the points see
    let row: String =
        (0..40).map(|x| format!("LightSource \"point\" \"point3 from\" [ {x} 3 {} ]", x % 7)).collect();
    let seen_by_some =
        "AttributeBegin AreaLightSource \"diffuse\" Translate 0 -4 0 Shape \"disk\" AttributeEnd";
    let mut rng = Pcg32::seed_from_u64(9);
    for scene in [
        LIGHTS,
        &format!("{LIGHTS} {row}"),
        &format!("WorldBegin {row}"),
        &format!("WorldBegin {seen_by_some}"),
    ] {
        let scene = read_str(scene, Path::new("")).unwrap();
        let lights = Lights::new(&scene);
        let finite = lights.finite_irradiance(&contexts);
        for _ in 0..300 {
            let u: Lanes = std::array::from_fn(|_| rng.random());
            let mask = rng.random_range(1..1 << LANES);
            let chosen = lights.sampler.sample_lanes(mask, &contexts, &finite, &u);
            for lane in 0..LANES {
                let is_on = mask >> lane & 1 == 1;
                let context = contexts.at(lane);
                let expected =
                    is_on.then(|| lights.sampler.sample(&context, finite[lane], u[lane])).flatten();
                let is_chosen = chosen.mask >> lane & 1 == 1;
                let found = is_chosen.then(|| (chosen.light[lane] as usize, chosen.probability[lane]));
                assert_eq!(found, expected, "lane {lane}");
            }
        }
    }
}

fn cell(w: Vec3) -> usize {
    let coordinates = [0.5 * (w.z + 1.0), w.y.atan2(w.x) / TAU + 0.5];
    let [row, column] = coordinates.map(|x| ((x * SIDE as f32) as usize).min(SIDE - 1));
    row * SIDE + column
}

/// Density of sampling a direction, summed over all lights in that direction.
fn density(lights: &Lights, accel: &Accel, context: &LightSampleContext, direction: Vec3) -> f32 {
    let finite = lights.sampler.finite_irradiance(context);
    let environments = lights.environments(context.position, direction);
    let mut sum: f32 = environments.map(|(i, _)| lights.pdf_environment(context, finite, i, direction)).sum();
    let mut ray = Ray { origin: context.position, direction, t_max: f32::INFINITY, time: 0.0 };
    while let Some(hit) = accel.intersect(&ray) {
        let point = accel.interaction(&ray, &hit);
        if lights.emitted_radiance(&point, -direction).is_some() {
            sum += lights.pdf_area_light(context, &point);
        }
        ray.origin = point.offset_origin(direction);
    }
    sum
}

#[test]
fn directions_sampled_in_simd_follow_their_density() {
    const ROUNDS: usize = 20_000;
    let scene = read_str(LIGHTS, Path::new("")).unwrap();
    let (lights, accel) = (Lights::new(&scene), Accel::build(&scene));
    let contexts = contexts();

    // Count the sampled directions by cell; the last cell is for no sample
    let mut counts = [(); CONTEXTS.len()].map(|()| vec![0.0; SIDE * SIDE + 1]);
    let mut rng = Pcg32::seed_from_u64(8);
    for _ in 0..ROUNDS {
        let mut sample_values = || -> Lanes { std::array::from_fn(|_| rng.random()) };
        let (u_light, u) = (sample_values(), [sample_values(), sample_values()]);
        let mask = rng.random_range(1..1 << LANES);
        let mut samples = LightSamples::NONE;
        lights.sample(mask, &contexts, &u_light, &u, &mut samples);
        for lane in lanes_in(mask) {
            let is_sampled = samples.pdf[lane] > 0.0;
            let cell = if is_sampled { cell(samples.wi.at(lane)) } else { SIDE * SIDE };
            counts[lane % CONTEXTS.len()][cell] += 1.0;
        }
    }

    // Compare the counts with the integral of the density
    for (context, counts) in CONTEXTS.iter().zip(&counts) {
        let mut expected = vec![0.0; SIDE * SIDE];
        let fine = SIDE * NODES;
        let sampled: f64 = counts.iter().sum();
        for (row, column) in (0..fine).flat_map(|row| (0..fine).map(move |column| (row, column))) {
            let z = (2 * row + 1) as f32 / fine as f32 - 1.0;
            let (sin, cos) = (TAU * ((column as f32 + 0.5) / fine as f32 - 0.5)).sin_cos();
            let ring = (1.0 - z * z).sqrt();
            let direction = Vec3::new(ring * cos, ring * sin, z);
            let mass = density(&lights, &accel, context, direction) * 4.0 * PI / (fine * fine) as f32;
            expected[row / NODES * SIDE + column / NODES] += f64::from(mass) * sampled;
        }
        expected.push((sampled - expected.iter().sum::<f64>()).max(0.0));
        let p = p_value(counts, &expected);
        assert!(p > significance(CONTEXTS.len()), "{context:?}: p = {p}");
    }
}
