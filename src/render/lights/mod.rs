//! All lights of a scene, the choice of one of them by what could arrive from it at a point, and
//! the densities of those choices.

mod bounds;
mod choice;
mod delta;
mod distribution;
mod environment;
mod extent;
mod images;
mod lanes;
mod portal;
mod projected;
mod surface;
mod tree;
mod windowed;

use glam::{Vec2, Vec3};

pub use self::bounds::Receiver;
use self::choice::{LightChoice, Reach};
use self::delta::DeltaLight;
use self::environment::EnvironmentLight;
use self::images::LightImages;
pub use self::lanes::{LightSamples, Receivers};
use self::surface::SurfaceLights;
use crate::geometry::SurfacePoint;
use crate::scene::{Light, Scene};

/// Shadow rays towards a point end this share of the way before it, beyond the error bounds of
/// both ends, since the length itself is rounded (as pbrt).
const SHADOW_EPSILON: f32 = 1e-4;

/// The lights of a scene: first those without a surface, in the scene's order, then every element
/// of every emissive surface.
pub struct Lights<'s> {
    choice: LightChoice,
    sources: Vec<Source>,
    /// Which of the sources are environments that shine.
    environments: Vec<usize>,
    surfaces: SurfaceLights<'s>,
}

/// A light without a surface.
enum Source {
    Delta(DeltaLight),
    Environment(Box<EnvironmentLight>),
}

/// Light from one of the lights that could arrive at a point, if nothing is in between.
#[derive(Clone, Copy, Debug)]
struct LightSample {
    /// Unit direction towards the light.
    wi: Vec3,
    radiance: Vec3,
    /// Density per solid angle; 1 for a light without extent.
    pdf: f32,
    /// A scattered ray can find this light as well.
    found_by_rays: bool,
    /// Where the shadow ray ends; `None` is infinitely far.
    target: Option<Vec3>,
}

impl<'s> Lights<'s> {
    pub fn new(scene: &'s Scene) -> Self {
        let mut images = LightImages::new(&scene.textures);
        let sources: Vec<Source> = scene
            .lights
            .iter()
            .map(|light| match light {
                Light::Environment(environment) => {
                    Source::Environment(Box::new(EnvironmentLight::new(&mut images, environment)))
                }
                Light::Point { .. }
                | Light::Spot { .. }
                | Light::Projector { .. }
                | Light::Distant { .. } => Source::Delta(DeltaLight::new(&mut images, light)),
            })
            .collect();
        let surfaces = SurfaceLights::new(scene);
        let reach = |source: &Source| match source {
            Source::Delta(light) => light.reach(),
            Source::Environment(light) => light.reach(),
        };
        let shines =
            |i: &usize| matches!(&sources[*i], Source::Environment(light) if light.mean_irradiance() > 0.0);
        Self {
            choice: LightChoice::new(sources.iter().map(reach).chain(surfaces.bounds().map(Reach::Within))),
            environments: (0..sources.len()).filter(shines).collect(),
            sources,
            surfaces,
        }
    }

    /// Whether there is more than one light to choose from.
    pub fn need_choice(&self) -> bool {
        self.choice.len() > 1
    }

    /// Whether a ray that is not aimed at a light can find one.
    pub fn found_by_rays(&self) -> bool {
        !self.environments.is_empty() || self.surfaces.found_by_rays()
    }

    /// Light from one light.
    #[inline]
    fn sample_light(&self, light: usize, from: Vec3, u: Vec2) -> Option<LightSample> {
        match self.sources.get(light) {
            Some(Source::Delta(delta)) => delta.sample(from),
            Some(Source::Environment(environment)) => {
                let (wi, radiance, pdf) = environment.sample(from, u)?;
                Some(LightSample { wi, radiance, pdf, found_by_rays: true, target: None })
            }
            None => self.surfaces.sample(light - self.sources.len(), from, u),
        }
    }

    /// Whether a primitive is a light.
    #[inline]
    pub fn is_light(&self, primitive: u32) -> bool {
        self.surfaces.is_light(primitive)
    }

    /// Radiance that a surface emits at a point in direction `wo`; `None` if it is no light.
    #[inline]
    pub fn emitted(&self, point: &SurfacePoint, wo: Vec3) -> Option<Vec3> {
        self.surfaces.emitted(point, wo)
    }

    /// Density with which [`Self::sample`] gives the direction to a point of an emissive surface.
    #[inline]
    pub fn pdf_surface(&self, receiver: &Receiver, point: &SurfacePoint) -> f32 {
        self.surfaces.pdf(receiver.position, point).map_or(0.0, |(light, pdf)| {
            let within = self.choice.expected_within(receiver);
            pdf * self.choice.probability(self.sources.len() + light, receiver, within)
        })
    }

    /// The environments: radiance at a point from a unit direction, and what
    /// [`Self::pdf_environment`] takes.
    #[inline]
    pub fn environments(&self, from: Vec3, direction: Vec3) -> impl Iterator<Item = (usize, Vec3)> {
        self.environments.iter().filter_map(move |&i| match &self.sources[i] {
            Source::Environment(light) => Some((i, light.radiance(from, direction))),
            Source::Delta(_) => None,
        })
    }

    /// Density with which [`Self::sample`] gives a unit direction to an environment; `within` is
    /// [`Self::expected_within`] of the receiver.
    #[inline]
    pub fn pdf_environment(
        &self,
        receiver: &Receiver,
        within: f32,
        environment: usize,
        direction: Vec3,
    ) -> f32 {
        match &self.sources[environment] {
            Source::Environment(light) => {
                light.pdf(receiver.position, direction)
                    * self.choice.probability(environment, receiver, within)
            }
            Source::Delta(_) => 0.0,
        }
    }
}

/// The largest number below 1.
const BELOW_ONE: f32 = 1.0 - 0.5 * f32::EPSILON;

/// What lights are compared by: the mean of the channels.
fn brightness(colour: Vec3) -> f32 {
    colour.element_sum() / 3.0
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;
    use std::path::Path;

    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::scene::light::Projected;
    use crate::scene::pbrt::read_str;

    fn scene(world: &str) -> Scene {
        read_str(&format!("WorldBegin {world}"), Path::new("")).unwrap()
    }

    /// A scene that may name a square image, dark in a half, and a wide one, which is light everywhere.
    fn with_images(world: &str) -> Scene {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, size: &str, texels: &[f32]| {
            let bytes = texels.iter().flat_map(|v| v.to_le_bytes());
            let header = format!("Pf\n{size}\n-1\n");
            std::fs::write(folder.path().join(name), header.bytes().chain(bytes).collect::<Vec<u8>>())
                .unwrap();
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

    /// Anywhere among the lights of [`many`], on some surface of either kind.
    fn receiver(rng: &mut Pcg32) -> Receiver {
        Receiver {
            position: point(rng, 6.0),
            normal: point(rng, 1.0).normalize(),
            transmits: rng.random::<f32>() < 0.3,
        }
    }

    /// Lights of all kinds but those that shine an image, large and small, with one side and two.
    const WITHOUT_IMAGES: &[usize] = &[0, 1, 4, 5, 6, 7];
    /// Of all kinds.
    const ALL_KINDS: &[usize] = &[0, 1, 2, 3, 4, 5, 6, 7];

    /// Ten lights of each of these kinds.
    fn many(rng: &mut Pcg32, kinds: &[usize]) -> Scene {
        let mut world = String::new();
        let mut add = |kind| {
            let (p, q) = (point(rng, 5.0), point(rng, 1.0));
            let size = 2.0 * rng.random::<f32>().powi(3) + 0.01;
            let sides = if rng.random::<f32>() < 0.2 { "\"bool twosided\" true" } else { "" };
            let placed = |scale: &str| {
                let turned = format!("Rotate {} {} {} {}", 180.0 * q.z, q.x, q.y, q.z);
                format!("AttributeBegin Translate {} {} {} {turned} {scale}", p.x, p.y, p.z)
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
                    format!("{} {light} AttributeEnd", placed(""))
                }
                3 => {
                    let light = "LightSource \"projection\" \"string filename\" \"wide.pfm\"";
                    format!("{} {light} \"float fov\" {} AttributeEnd", placed(""), 15.0 + 50.0 * size)
                }
                shape => format!(
                    "{} AreaLightSource \"diffuse\" {sides} {} AttributeEnd",
                    placed(&format!("Scale {size} {} {size}", 2.0 * size)),
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
        with_images(&world)
    }

    fn choose(lights: &Lights, receiver: &Receiver, u: f32) -> Option<(usize, f32)> {
        lights.choice.sample(receiver, lights.choice.expected_within(receiver), u)
    }

    fn probability(lights: &Lights, light: usize, receiver: &Receiver) -> f32 {
        lights.choice.probability(light, receiver, lights.choice.expected_within(receiver))
    }

    fn count(lights: &Lights) -> usize {
        lights.sources.len() + lights.surfaces.bounds().count()
    }

    #[test]
    fn lights_are_chosen_as_often_as_their_probability_says() {
        // The share of numbers that lead to a light, at one receiver and over all: beams are narrow, and what is
        // near most of them need not be in any.
        for (kinds, least, least_mean, rounding) in
            [(WITHOUT_IMAGES, 0.5, 0.5, 0.0), (ALL_KINDS, 0.3, 0.75, 2.0 * f32::EPSILON)]
        {
            let mut rng = Pcg32::seed_from_u64(1);
            let scene = many(&mut rng, kinds);
            let lights = Lights::new(&scene);
            const RECEIVERS: usize = 20;
            let mut reached = 0.0;
            for _ in 0..RECEIVERS {
                let share = chosen(&lights, &receiver(&mut rng), rounding);
                assert!(share > least, "{share}");
                reached += share / RECEIVERS as f32;
            }
            assert!(reached > least_mean, "{reached}");
        }
    }

    /// Holds choices at a receiver to their probabilities; the sum of these. `rounding`: what the less likely side of a
    /// fork may be off, which is known by what 1 lacks of the other's share only.
    fn chosen(lights: &Lights, receiver: &Receiver, rounding: f32) -> f32 {
        let probabilities: Vec<f32> =
            (0..count(lights)).map(|light| probability(lights, light, receiver)).collect();
        let n = 20_000;
        let mut frequencies = vec![0.0; probabilities.len()];
        let mut dead_ends = 0.0;
        for i in 0..n {
            let Some((light, p)) = choose(lights, receiver, (i as f32 + 0.5) / n as f32) else {
                dead_ends += 1.0 / n as f32;
                continue;
            };
            assert!((p - probabilities[light]).abs() <= 1e-4 * p + rounding, "{light}: {p}");
            frequencies[light] += 1.0 / n as f32;
        }
        for (light, (f, p)) in frequencies.iter().zip(&probabilities).enumerate() {
            // Each light is an interval of numbers, which holds as many as its length says but
            // for two at its ends.
            assert!((f - p).abs() < 2.0 / n as f32 + 1e-4 * p, "{light}: {f} {p}");
        }
        let sum: f32 = probabilities.iter().sum();
        assert!((sum + dead_ends - 1.0).abs() < 1e-3, "{sum} {dead_ends}");
        sum
    }

    #[test]
    fn no_light_that_could_arrive_is_ruled_out() {
        let mut rng = Pcg32::seed_from_u64(2);
        let scene = many(&mut rng, ALL_KINDS);
        let lights = Lights::new(&scene);
        let (mut arrived, mut ruled_out) = (0, 0);
        for _ in 0..2000 {
            let receiver = receiver(&mut rng);
            for light in 0..count(&lights) {
                let u = Vec2::new(rng.random(), rng.random());
                let probability = probability(&lights, light, &receiver);
                let arrives = lights
                    .sample_light(light, receiver.position, u)
                    .is_some_and(|s| receiver.transmits || s.wi.dot(receiver.normal) > 1e-6);
                assert!(!arrives || probability > 0.0, "light {light} at {receiver:?}");
                arrived += u32::from(arrives);
                ruled_out += u32::from(probability == 0.0);
            }
        }
        assert!(arrived > 20_000 && ruled_out > 20_000, "{arrived} {ruled_out}");
    }

    #[test]
    fn a_single_light_needs_no_choice() {
        let mut rng = Pcg32::seed_from_u64(3);
        for light in [
            "LightSource \"point\"",
            "LightSource \"infinite\"",
            "AreaLightSource \"diffuse\" Shape \"disk\"",
            // Dark lights do not count.
            "LightSource \"infinite\" \"rgb L\" [ 0 0 0 ] LightSource \"point\"",
        ] {
            let scene = scene(light);
            let lights = Lights::new(&scene);
            assert!(!lights.need_choice(), "{light}");
            for u in [0.0, 0.5, BELOW_ONE] {
                let (_, probability) = choose(&lights, &receiver(&mut rng), u).unwrap();
                assert!((probability - 1.0).abs() < 1e-6, "{light}: {probability}");
            }
        }
        assert!(choose(&Lights::new(&scene("")), &receiver(&mut rng), 0.5).is_none());
    }

    #[test]
    fn near_lights_are_preferred_and_those_below_the_horizon_never_chosen() {
        let at = |z: f32| format!("LightSource \"point\" \"point3 from\" [ 0 0 {z} ] ");
        let scene = scene(&(at(1.0) + &at(3.0) + &at(-1.0)));
        let lights = Lights::new(&scene);
        let facing = Receiver { position: Vec3::ZERO, normal: Vec3::Z, transmits: false };
        let probabilities = |receiver| [0, 1, 2].map(|light| probability(&lights, light, &receiver));
        let [near, far, below] = probabilities(facing);
        assert!(near > far && far > 0.0, "{near} {far}");
        assert_eq!(below, 0.0);
        let [near, _, below] = probabilities(Receiver { transmits: true, ..facing });
        assert!(below > 0.0 && near > 0.0);
        // Whatever number is drawn, a probability of 0 is not chosen.
        for u in [0.0, 0.3, BELOW_ONE] {
            assert_ne!(choose(&lights, &facing, u).unwrap().0, 2);
        }
    }

    #[test]
    fn a_wide_scene_does_not_give_the_light_to_its_dim_environment() {
        let world = "LightSource \"infinite\" \"rgb L\" [ .05 .05 .05 ]
            Shape \"disk\" \"float radius\" 1000
            Translate 0 0 8 ReverseOrientation AreaLightSource \"diffuse\" \"rgb L\" [ 15 15 15 ]
            Shape \"disk\" \"float radius\" 2";
        let scene = scene(world);
        let lights = Lights::new(&scene);
        let below = Receiver { position: Vec3::ZERO, normal: Vec3::Z, transmits: false };
        assert!(probability(&lights, 1, &below) > 0.8);
    }

    #[test]
    fn an_image_around_a_light_counts_by_its_mean() {
        let scene = with_images(
            "LightSource \"point\" \"point3 from\" [ -1 0 2 ]
             Translate 1 0 2 LightSource \"goniometric\" \"string filename\" \"square.pfm\"",
        );
        let lights = Lights::new(&scene);
        let mut rng = Pcg32::seed_from_u64(4);
        const DIRECTIONS: usize = 40_000;
        let mut mean = 0.0;
        for _ in 0..DIRECTIONS {
            let u = Vec2::new(rng.random(), rng.random());
            let from = Vec3::new(1.0, 0.0, 2.0) + environment::uniform_direction(u).0;
            let light = lights.sample_light(1, from, Vec2::ZERO);
            mean += light.map_or(0.0, |sample| brightness(sample.radiance)) / DIRECTIONS as f32;
        }
        let between = Receiver { position: Vec3::ZERO, normal: Vec3::Z, transmits: false };
        let [point, image] = [0, 1].map(|light| probability(&lights, light, &between));
        assert!((image / point / mean - 1.0).abs() < 0.02, "{point} {image} {mean}");
    }

    #[test]
    fn a_projection_is_not_ruled_out_where_its_corners_fall() {
        for fov in [15, 60, 120] {
            let scene = with_images(&format!(
                "LightSource \"point\" Translate 1 2 3 Rotate 40 1 2 3
                 LightSource \"projection\" \"string filename\" \"wide.pfm\" \"float fov\" {fov}"
            ));
            let Light::Projector { position, from_render, image, .. } = scene.lights[1] else {
                panic!("{fov}")
            };
            let Projected::Window { tan_half_fov, .. } = image else { panic!("{image:?}") };
            let half = Projected::half_window(tan_half_fov, 3, 2);
            let lights = Lights::new(&scene);
            for sign in [Vec2::ONE, Vec2::NEG_ONE, Vec2::new(1.0, -1.0), Vec2::new(-1.0, 1.0)] {
                let towards = |share: f32| {
                    let direction = (from_render.inverse() * (share * sign * half).extend(1.0)).normalize();
                    Receiver { position: position + 2.0 * direction, normal: -direction, transmits: false }
                };
                let arrives =
                    |receiver: Receiver| lights.sample_light(1, receiver.position, Vec2::ZERO).is_some();
                let inside = towards(0.999);
                assert!(arrives(inside) && !arrives(towards(1.001)), "{fov} {sign}");
                assert!(probability(&lights, 1, &inside) > 0.0, "{fov} {sign}");
            }
        }
    }
}
