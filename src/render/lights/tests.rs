use std::fmt::Write;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::emission_bounds::average;
use super::light_tree::ONE_MINUS_EPSILON;
use super::uniform_sphere::sample_uniform_sphere;
use super::*;
use crate::scene::light::ImageProjection;
use crate::scene::pbrt::read_str;

fn scene(world: &str) -> Scene {
    read_str(&format!("WorldBegin {world}"), Path::new("")).unwrap()
}

/// A scene that may refer to a square image, half of it black, and to a wide one without a black texel.
fn scene_with_images(world: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, size: &str, texels: &[f32]| {
        let bytes = texels.iter().flat_map(|v| v.to_le_bytes());
        let header = format!("Pf\n{size}\n-1\n");
        std::fs::write(folder.path().join(name), header.bytes().chain(bytes).collect::<Vec<u8>>()).unwrap();
    };
    let half = |i: usize| if i < 8 { 0.0 } else { 0.2 * i as f32 };
    write("square.pfm", "4 4", &std::array::from_fn::<_, 16, _>(half));
    write("wide.pfm", "3 2", &[0.5, 1.0, 0.2, 2.0, 0.1, 1.5]);
    read_str(&format!("WorldBegin {world}"), folder.path()).unwrap()
}

fn point(rng: &mut Pcg32, size: f32) -> Vec3 {
    let mut coordinate = || size * (2.0 * rng.random::<f32>() - 1.0);
    Vec3::new(coordinate(), coordinate(), coordinate())
}

/// A random point among the lights of [`scene_of_many_lights`].
fn random_context(rng: &mut Pcg32) -> LightSampleContext {
    LightSampleContext {
        position: point(rng, 6.0),
        normal: point(rng, 1.0).normalize(),
        transmits: rng.random::<f32>() < 0.3,
    }
}

/// All kinds of lights except those with an image.
const WITHOUT_IMAGES: &[usize] = &[0, 1, 4, 5, 6, 7];
const ALL_KINDS: &[usize] = &[0, 1, 2, 3, 4, 5, 6, 7];

/// A scene with ten lights of each of these kinds, large and small, one-sided and two-sided.
fn scene_of_many_lights(rng: &mut Pcg32, kinds: &[usize]) -> Scene {
    let mut world = String::new();
    let mut add = |kind| {
        let (p, q) = (point(rng, 5.0), point(rng, 1.0));
        let size = 2.0 * rng.random::<f32>().powi(3) + 0.01;
        let sides = if rng.random::<f32>() < 0.2 { "\"bool twosided\" true" } else { "" };
        let transform = |scale: &str| {
            let rotate = format!("Rotate {} {} {} {}", 180.0 * q.z, q.x, q.y, q.z);
            format!("AttributeBegin Translate {} {} {} {rotate} {scale}", p.x, p.y, p.z)
        };
        let light = match kind {
            0 => format!("LightSource \"point\" \"point3 from\" [ {} {} {} ]", p.x, p.y, p.z),
            1 => format!(
                "LightSource \"spot\" \"point3 from\" [ {} {} {} ] \"point3 to\" [ {} {} {} ]
                 \"float coneangle\" {}",
                p.x,
                p.y,
                p.z,
                q.x,
                q.y,
                q.z,
                10.0 + 60.0 * size
            ),
            2 => {
                let light = "LightSource \"goniometric\" \"string filename\" \"square.pfm\"";
                format!("{} {light} AttributeEnd", transform(""))
            }
            3 => {
                let light = "LightSource \"projection\" \"string filename\" \"wide.pfm\"";
                format!("{} {light} \"float fov\" {} AttributeEnd", transform(""), 15.0 + 50.0 * size)
            }
            shape => format!(
                "{} AreaLightSource \"diffuse\" {sides} {} AttributeEnd",
                transform(&format!("Scale {size} {} {size}", 2.0 * size)),
                match shape {
                    4 => "Shape \"sphere\"",
                    5 => "Shape \"disk\" \"float innerradius\" .3",
                    6 => "ReverseOrientation Shape \"disk\"",
                    _ => {
                        "Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ]
                         \"point3 P\" [ 0 0 0 1 0 0 1 1 .2 0 1 .2 ]"
                    }
                }
            ),
        };
        writeln!(world, "{light}").unwrap();
    };
    (0..10).flat_map(|_| kinds).for_each(|&kind| add(kind));
    world += "LightSource \"infinite\" \"rgb L\" [ .1 .1 .1 ] LightSource \"distant\" ";
    world += "LightSource \"infinite\" \"point3 portal\" [ -2 -1 3  -2 1 3  1 1 3  1 -1 3 ] ";
    scene_with_images(&world)
}

fn choose(lights: &Lights, context: &LightSampleContext, u: f32) -> Option<(usize, f32)> {
    lights.sampler.sample(context, lights.sampler.finite_irradiance(context), u)
}

fn probability(lights: &Lights, light: usize, context: &LightSampleContext) -> f32 {
    lights.sampler.probability(light, context, lights.sampler.finite_irradiance(context))
}

fn count(lights: &Lights) -> usize {
    lights.surfaceless.len() + lights.area_lights.bounds().count()
}

#[test]
fn lights_are_chosen_with_their_probability() {
    // The sum of the probabilities, at one point and on average: below 1, since spot and projection lights are
    // narrow, and a point near scene_of_many_lights of them may be outside all of their cones.
    for (kinds, least, least_mean) in [(WITHOUT_IMAGES, 0.5, 0.5), (ALL_KINDS, 0.3, 0.75)] {
        let mut rng = Pcg32::seed_from_u64(1);
        let scene = scene_of_many_lights(&mut rng, kinds);
        let lights = Lights::new(&scene);
        const POINTS: usize = 20;
        let mut mean = 0.0;
        for _ in 0..POINTS {
            let sum = check_probabilities(&lights, &random_context(&mut rng));
            assert!(sum > least, "{sum}");
            mean += sum / POINTS as f32;
        }
        assert!(mean > least_mean, "{mean}");
    }
}

/// Asserts that lights are chosen at a point with their probabilities, and returns the sum of these.
fn check_probabilities(lights: &Lights, context: &LightSampleContext) -> f32 {
    // Of the less likely child of a node, whose probability is 1 minus the other's.
    let rounding = 2.0 * f32::EPSILON;
    let probabilities: Vec<f32> =
        (0..count(lights)).map(|light| probability(lights, light, context)).collect();
    let n = 20_000;
    let mut frequencies = vec![0.0; probabilities.len()];
    let mut unchosen = 0.0;
    for i in 0..n {
        let Some((light, p)) = choose(lights, context, (i as f32 + 0.5) / n as f32) else {
            unchosen += 1.0 / n as f32;
            continue;
        };
        assert!((p - probabilities[light]).abs() <= 1e-4 * p + rounding, "{light}: {p}");
        frequencies[light] += 1.0 / n as f32;
    }
    for (light, (f, p)) in frequencies.iter().zip(&probabilities).enumerate() {
        // Each light is chosen by the sample values of an interval; only one at either end may be misplaced.
        assert!((f - p).abs() < 2.0 / n as f32 + 1e-4 * p, "{light}: {f} {p}");
    }
    let sum: f32 = probabilities.iter().sum();
    assert!((sum + unchosen - 1.0).abs() < 1e-3, "{sum} {unchosen}");
    sum
}

#[test]
fn no_light_that_illuminates_a_point_has_probability_zero() {
    let mut rng = Pcg32::seed_from_u64(2);
    let scene = scene_of_many_lights(&mut rng, ALL_KINDS);
    let lights = Lights::new(&scene);
    let (mut illuminated, mut never_chosen) = (0, 0);
    for _ in 0..2000 {
        let context = random_context(&mut rng);
        for light in 0..count(&lights) {
            let u = Vec2::new(rng.random(), rng.random());
            let probability = probability(&lights, light, &context);
            let illuminates = lights
                .sample_light(light, context.position, u)
                .is_some_and(|s| context.transmits || s.wi.dot(context.normal) > 1e-6);
            assert!(!illuminates || probability > 0.0, "light {light} at {context:?}");
            illuminated += u32::from(illuminates);
            never_chosen += u32::from(probability == 0.0);
        }
    }
    assert!(illuminated > 20_000 && never_chosen > 20_000, "{illuminated} {never_chosen}");
}

#[test]
fn a_single_light_needs_no_choice() {
    let mut rng = Pcg32::seed_from_u64(3);
    for light in [
        "LightSource \"point\"",
        "LightSource \"infinite\"",
        "AreaLightSource \"diffuse\" Shape \"disk\"",
        // Black lights do not count.
        "LightSource \"infinite\" \"rgb L\" [ 0 0 0 ] LightSource \"point\"",
    ] {
        let scene = scene(light);
        let lights = Lights::new(&scene);
        assert!(!lights.needs_choice(), "{light}");
        for u in [0.0, 0.5, ONE_MINUS_EPSILON] {
            let (_, probability) = choose(&lights, &random_context(&mut rng), u).unwrap();
            assert!((probability - 1.0).abs() < 1e-6, "{light}: {probability}");
        }
    }
    assert!(choose(&Lights::new(&scene("")), &random_context(&mut rng), 0.5).is_none());
}

#[test]
fn near_lights_are_more_likely_and_those_below_the_horizon_never_chosen() {
    let at = |z: f32| format!("LightSource \"point\" \"point3 from\" [ 0 0 {z} ] ");
    let scene = scene(&(at(1.0) + &at(3.0) + &at(-1.0)));
    let lights = Lights::new(&scene);
    let facing = LightSampleContext { position: Vec3::ZERO, normal: Vec3::Z, transmits: false };
    let probabilities = |context| [0, 1, 2].map(|light| probability(&lights, light, &context));
    let [near, far, below] = probabilities(facing);
    assert!(near > far && far > 0.0, "{near} {far}");
    assert_eq!(below, 0.0);
    let [near, _, below] = probabilities(LightSampleContext { transmits: true, ..facing });
    assert!(below > 0.0 && near > 0.0);
    // No sample value chooses a light of probability 0.
    for u in [0.0, 0.3, ONE_MINUS_EPSILON] {
        assert_ne!(choose(&lights, &facing, u).unwrap().0, 2);
    }
}

#[test]
fn the_extent_of_the_scene_does_not_raise_the_probability_of_an_environment() {
    let world = "LightSource \"infinite\" \"rgb L\" [ .05 .05 .05 ]
        Shape \"disk\" \"float radius\" 1000
        Translate 0 0 8 ReverseOrientation AreaLightSource \"diffuse\" \"rgb L\" [ 15 15 15 ]
        Shape \"disk\" \"float radius\" 2";
    let scene = scene(world);
    let lights = Lights::new(&scene);
    let below = LightSampleContext { position: Vec3::ZERO, normal: Vec3::Z, transmits: false };
    assert!(probability(&lights, 1, &below) > 0.8);
}

#[test]
fn a_lamp_far_away_does_not_lower_the_probability_of_one_that_is_near() {
    let scene = scene(
        "LightSource \"infinite\" \"rgb L\" [ 1 1 1 ]
         LightSource \"point\" \"point3 from\" [ -500 0 0 ] \"rgb I\" [ 100 100 100 ]
         LightSource \"point\" \"point3 from\" [ 500 0 0 ] \"rgb I\" [ 100 100 100 ]",
    );
    let lights = Lights::new(&scene);
    // The lamp's irradiance is twice the sky's
    let below =
        LightSampleContext { position: Vec3::new(500.0, 0.0, -4.0), normal: Vec3::Z, transmits: false };
    let probability = probability(&lights, 2, &below);
    assert!(probability > 0.6, "{probability}");
}

#[test]
fn the_probability_of_a_goniometric_light_follows_the_mean_of_its_image() {
    let scene = scene_with_images(
        "LightSource \"point\" \"point3 from\" [ -1 0 2 ]
         Translate 1 0 2 LightSource \"goniometric\" \"string filename\" \"square.pfm\"",
    );
    let lights = Lights::new(&scene);
    let mut rng = Pcg32::seed_from_u64(4);
    const DIRECTIONS: usize = 40_000;
    let mut mean = 0.0;
    for _ in 0..DIRECTIONS {
        let u = Vec2::new(rng.random(), rng.random());
        let from = Vec3::new(1.0, 0.0, 2.0) + sample_uniform_sphere(u);
        let light = lights.sample_light(1, from, Vec2::ZERO);
        mean += light.map_or(0.0, |sample| average(sample.radiance)) / DIRECTIONS as f32;
    }
    let between = LightSampleContext { position: Vec3::ZERO, normal: Vec3::Z, transmits: false };
    let [point, image] = [0, 1].map(|light| probability(&lights, light, &between));
    assert!((image / point / mean - 1.0).abs() < 0.02, "{point} {image} {mean}");
}

#[test]
fn the_corners_of_a_projection_have_a_positive_probability() {
    for fov in [15, 60, 120] {
        let scene = scene_with_images(&format!(
            "LightSource \"point\" Translate 1 2 3 Rotate 40 1 2 3
             LightSource \"projection\" \"string filename\" \"wide.pfm\" \"float fov\" {fov}"
        ));
        let Light::Projector { position, from_render, image, .. } = scene.lights[1] else { panic!("{fov}") };
        let ImageProjection::Perspective { tan_half_fov, .. } = image else { panic!("{image:?}") };
        let half = ImageProjection::half_extent(tan_half_fov, 3, 2);
        let lights = Lights::new(&scene);
        for sign in [Vec2::ONE, Vec2::NEG_ONE, Vec2::new(1.0, -1.0), Vec2::new(-1.0, 1.0)] {
            let towards = |scale: f32| {
                let direction = (from_render.inverse() * (scale * sign * half).extend(1.0)).normalize();
                LightSampleContext {
                    position: position + 2.0 * direction,
                    normal: -direction,
                    transmits: false,
                }
            };
            let is_lit =
                |context: LightSampleContext| lights.sample_light(1, context.position, Vec2::ZERO).is_some();
            let inside = towards(0.999);
            assert!(is_lit(inside) && !is_lit(towards(1.001)), "{fov} {sign}");
            assert!(probability(&lights, 1, &inside) > 0.0, "{fov} {sign}");
        }
    }
}
