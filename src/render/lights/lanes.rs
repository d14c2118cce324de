//! Light at many points, a lane for each: those that chose the same light are served together.

#![expect(clippy::needless_range_loop, reason = "a lane is one of several arrays' at once")]

use glam::{Vec2, Vec3};
use multiversion::multiversion;

use super::bounds::LightBounds;
use super::environment::uniform_direction;
use super::surface::{PlainLight, PlainSample};
use super::{LightSample, Lights, Receiver, Source};
use crate::geometry::{LANES, Lanes, Lanes3, TriangleSampler, groups, lanes_of};

/// Receivers in lanes.
#[derive(Clone, Copy)]
pub struct Receivers {
    pub position: Lanes3,
    pub normal: Lanes3,
    pub transmits: Lanes<u32>,
}

impl Receivers {
    pub const NONE: Self = Self { position: Lanes3::ZERO, normal: Lanes3::ZERO, transmits: [0; LANES] };

    #[inline(always)]
    pub fn at(&self, lane: usize) -> Receiver {
        Receiver {
            position: self.position.at(lane),
            normal: self.normal.at(lane),
            transmits: self.transmits[lane] != 0,
        }
    }
}

/// [`LightSample`]s in lanes.
pub struct LightSamples {
    pub wi: Lanes3,
    pub radiance: Lanes3,
    /// 0 where there is no light.
    pub pdf: Lanes,
    pub found_by_rays: Lanes<u32>,
    target: Lanes3,
    has_target: Lanes<u32>,
}

impl LightSamples {
    pub const NONE: Self = Self {
        wi: Lanes3::ZERO,
        radiance: Lanes3::ZERO,
        pdf: [0.0; LANES],
        found_by_rays: [0; LANES],
        target: Lanes3::ZERO,
        has_target: [0; LANES],
    };

    fn set(&mut self, lane: usize, sample: Option<LightSample>) {
        let Some(sample) = sample else {
            self.pdf[lane] = 0.0;
            return;
        };
        self.wi.set(lane, sample.wi);
        self.radiance.set(lane, sample.radiance);
        self.pdf[lane] = sample.pdf;
        self.found_by_rays[lane] = u32::from(sample.found_by_rays);
        self.target.set(lane, sample.target.unwrap_or(Vec3::ZERO));
        self.has_target[lane] = u32::from(sample.target.is_some());
    }

    /// Direction and length of the ray from `origin` whose way must be free for the light to arrive.
    #[inline(always)]
    pub fn shadow_ray(&self, lane: usize, origin: Vec3) -> (Vec3, f32) {
        let has_target = self.has_target[lane] != 0;
        let direction = if has_target { self.target.at(lane) - origin } else { self.wi.at(lane) };
        (direction, if has_target { 1.0 - super::SHADOW_EPSILON } else { f32::INFINITY })
    }
}

impl Lights<'_> {
    /// What [`super::choice::LightChoice::expected_within`] gives for each receiver.
    pub fn expected_within(&self, receivers: &Receivers) -> Lanes {
        let mut expected = [0.0; LANES];
        if let Some(bounds) = self.choice.bounds_within() {
            importances(bounds, receivers, &mut expected);
        }
        expected
    }

    /// Light at the receivers of a mask's lanes: `choice` picks the lights, `u` points of them.
    pub fn sample(
        &self,
        mask: u32,
        receivers: &Receivers,
        choice: &Lanes,
        u: &[Lanes; 2],
        samples: &mut LightSamples,
    ) {
        let (mut lights, mut probabilities) = ([0; LANES], [0.0; LANES]);
        let within = self.expected_within(receivers);
        let mut lit = 0;
        for lane in lanes_of(mask) {
            match self.choice.sample(&receivers.at(lane), within[lane], choice[lane]) {
                Some((light, probability)) => {
                    (lights[lane], probabilities[lane]) = (light as u32, probability);
                    lit |= 1 << lane;
                }
                // No light reaches the receiver.
                None => samples.set(lane, None),
            }
        }
        groups(&lights, lit, |light, lanes| {
            let light = light as usize;
            match self.sources.get(light) {
                Some(Source::Environment(environment)) if environment.constant().is_some() => {
                    let radiance = environment.constant().unwrap_or(Vec3::ZERO);
                    sample_everywhere(lanes, radiance, u, samples);
                }
                None if self.surfaces.plain(light - self.sources.len()).is_some() => {
                    if let Some(plain) = self.surfaces.plain(light - self.sources.len()) {
                        let shape = plain.shape;
                        sample_surface(lanes, &plain, shape, &receivers.position, u, samples);
                    }
                }
                _ => {
                    for lane in lanes_of(lanes) {
                        let u = Vec2::new(u[0][lane], u[1][lane]);
                        samples.set(lane, self.sample_light(light, receivers.position.at(lane), u));
                    }
                }
            }
        });
        for lane in 0..LANES {
            samples.pdf[lane] *= probabilities[lane];
        }
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn importances(bounds: &LightBounds, receivers: &Receivers, importances: &mut Lanes) {
    let bounds = *bounds;
    for lane in 0..LANES {
        importances[lane] = bounds.importance(&receivers.at(lane));
    }
}

/// From an environment of one colour.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn sample_everywhere(mask: u32, radiance: Vec3, u: &[Lanes; 2], samples: &mut LightSamples) {
    let [u_x, u_y] = u;
    for lane in 0..LANES {
        let (wi, pdf) = uniform_direction(Vec2::new(u_x[lane], u_y[lane]));
        let is_on = mask >> lane & 1 == 1;
        samples.wi.put(lane, is_on, wi);
        samples.radiance.put(lane, is_on, radiance);
        samples.pdf[lane] = if is_on { pdf } else { samples.pdf[lane] };
        samples.found_by_rays[lane] = if is_on { 1 } else { samples.found_by_rays[lane] };
        samples.has_target[lane] = if is_on { 0 } else { samples.has_target[lane] };
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn sample_surface(
    mask: u32,
    light: &PlainLight,
    shape: &TriangleSampler,
    from: &Lanes3,
    u: &[Lanes; 2],
    samples: &mut LightSamples,
) {
    let [u_x, u_y] = u;
    let PlainLight { radiance, two_sided, found_by_rays, .. } = *light;
    let found_by_rays = u32::from(found_by_rays);
    for lane in 0..LANES {
        let sample = PlainSample::of(shape, two_sided, from.at(lane), Vec2::new(u_x[lane], u_y[lane]));
        let is_on = mask >> lane & 1 == 1;
        samples.wi.put(lane, is_on, sample.wi);
        samples.radiance.put(lane, is_on, radiance);
        samples.pdf[lane] = if is_on { sample.pdf } else { samples.pdf[lane] };
        samples.target.put(lane, is_on, sample.target);
        samples.found_by_rays[lane] = if is_on { found_by_rays } else { samples.found_by_rays[lane] };
        samples.has_target[lane] = if is_on { 1 } else { samples.has_target[lane] };
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::{PI, TAU};
    use std::path::Path;

    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::geometry::{Accel, Ray};
    use crate::render::chi_squared::{p_value, significance};
    use crate::scene::pbrt::read_str;

    /// All of these lights are seen by rays: a parallelogram and a triangle, one of them with one side, which
    /// are sampled in all lanes at once as the sky is, and a disk, which is not.
    const LIGHTS: &str = "WorldBegin
        LightSource \"infinite\" \"rgb L\" [ .4 .4 .4 ]
        AreaLightSource \"diffuse\" \"rgb L\" [ 3 3 3 ] \"bool twosided\" true
        Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" [ -2 2 -1  1 2 -1  2 2.5 1  -1 2.5 1 ]
        AreaLightSource \"diffuse\" \"rgb L\" [ 5 5 5 ]
        Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 ] \"point3 P\" [ 3 -1 -1  3 2 -1  3 0 2 ]
        AttributeBegin Translate -3 0 0 Rotate 80 0 1 0 Shape \"disk\" AttributeEnd";

    const RECEIVERS: [Receiver; 3] = [
        Receiver { position: Vec3::ZERO, normal: Vec3::Y, transmits: false },
        Receiver { position: Vec3::new(1.0, 0.5, 0.4), normal: Vec3::X, transmits: true },
        // The triangle is seen from its other side.
        Receiver { position: Vec3::new(5.0, 0.0, -0.5), normal: Vec3::NEG_X, transmits: false },
    ];

    /// Cells of equal solid angle over the sphere, and quadrature nodes along each side of one.
    const SIDE: usize = 16;
    const NODES: usize = 32;

    fn cell(w: Vec3) -> usize {
        let along = [0.5 * (w.z + 1.0), w.y.atan2(w.x) / TAU + 0.5];
        let [row, column] = along.map(|along| ((along * SIDE as f32) as usize).min(SIDE - 1));
        row * SIDE + column
    }

    /// Density of a direction, from whichever light it leads to.
    fn density(lights: &Lights, accel: &Accel, receiver: &Receiver, direction: Vec3) -> f32 {
        let within = lights.choice.expected_within(receiver);
        let around = lights.environments(receiver.position, direction);
        let mut sum: f32 = around.map(|(i, _)| lights.pdf_environment(receiver, within, i, direction)).sum();
        let mut ray = Ray { origin: receiver.position, direction, t_max: f32::INFINITY, time: 0.0 };
        while let Some(hit) = accel.intersect(&ray) {
            let point = accel.surface(&ray, &hit);
            if lights.emitted(&point, -direction).is_some() {
                sum += lights.pdf_surface(receiver, &point);
            }
            ray.origin = point.offset_origin(direction);
        }
        sum
    }

    #[test]
    fn directions_sampled_in_lanes_follow_their_density() {
        const ROUNDS: usize = 20_000;
        let scene = read_str(LIGHTS, Path::new("")).unwrap();
        let (lights, accel) = (Lights::new(&scene), Accel::build(&scene));
        let mut receivers = Receivers::NONE;
        for lane in 0..LANES {
            let Receiver { position, normal, transmits } = RECEIVERS[lane % RECEIVERS.len()];
            receivers.position.set(lane, position);
            receivers.normal.set(lane, normal);
            receivers.transmits[lane] = u32::from(transmits);
        }
        // The last cell is for numbers that give no light.
        let mut counts = [(); RECEIVERS.len()].map(|()| vec![0.0; SIDE * SIDE + 1]);
        let mut rng = Pcg32::seed_from_u64(8);
        for _ in 0..ROUNDS {
            let mut numbers = || -> Lanes { std::array::from_fn(|_| rng.random()) };
            let (choice, u) = (numbers(), [numbers(), numbers()]);
            let mask = rng.random_range(1..1 << LANES);
            let mut samples = LightSamples::NONE;
            lights.sample(mask, &receivers, &choice, &u, &mut samples);
            for lane in lanes_of(mask) {
                let is_lit = samples.pdf[lane] > 0.0;
                let cell = if is_lit { cell(samples.wi.at(lane)) } else { SIDE * SIDE };
                counts[lane % RECEIVERS.len()][cell] += 1.0;
            }
        }
        for (receiver, counts) in RECEIVERS.iter().zip(&counts) {
            let mut expected = vec![0.0; SIDE * SIDE];
            let fine = SIDE * NODES;
            let drawn: f64 = counts.iter().sum();
            for (row, column) in (0..fine).flat_map(|row| (0..fine).map(move |column| (row, column))) {
                let z = (2 * row + 1) as f32 / fine as f32 - 1.0;
                let (sin, cos) = (TAU * ((column as f32 + 0.5) / fine as f32 - 0.5)).sin_cos();
                let ring = (1.0 - z * z).sqrt();
                let direction = Vec3::new(ring * cos, ring * sin, z);
                let mass = density(&lights, &accel, receiver, direction) * 4.0 * PI / (fine * fine) as f32;
                expected[row / NODES * SIDE + column / NODES] += f64::from(mass) * drawn;
            }
            expected.push((drawn - expected.iter().sum::<f64>()).max(0.0));
            let p = p_value(counts, &expected);
            assert!(p > significance(RECEIVERS.len()), "{receiver:?}: p = {p}");
        }
    }
}
