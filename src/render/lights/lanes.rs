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
