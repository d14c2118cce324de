//! Path tracing (Kajiya 1986) with light sampling, multiple importance sampling and Russian
//! roulette, in the conventions of pbrt-v4's `path`: `max_depth` counts scattering events, so that
//! 0 shows emission only and 1 adds direct light.
//!
//! Many paths go on together, a stage at a time (a *wavefront*: Laine, Karras and Aila 2013). A
//! single path is one long chain of operations that wait for each other; the same stage of
//! different paths does not, so that the processor works on several at once.

use glam::Vec3;

use super::PathTracer;
use super::direct::{MAX_PASSES, power_heuristic, receiver, turned};
use crate::geometry::{Hit, Ray, SurfacePoint};
use crate::render::bsdf::Bsdf;
use crate::render::lights::Receiver;
use crate::render::record::Record;
use crate::render::sampler::{BounceNumbers, Source, Stream};

/// Scattering events after which paths may end by chance (as pbrt-v4).
pub(super) const ROULETTE_DEPTH: u32 = 2;

/// Distance, in scene diameters, at which a path that leaves the scene is recorded.
const FAR: f32 = 2.0;

/// A path, between two surfaces.
pub struct Path<S> {
    ray: Ray,
    numbers: Stream<S>,
    /// Scattering events so far.
    depth: u32,
    throughput: Vec3,
    /// Product of the squared changes of the index of refraction, which the throughput contains
    /// and Russian roulette must not see.
    eta_scale: f32,
    arrival: Arrival,
    /// No scattering event so far was other than perfectly specular.
    seen_directly: bool,
    /// Boundaries without effect that were passed.
    passes: u32,
    /// Radiance, and features and numbers of the first two hits.
    record: Record,
}

/// How a path came to where it is, and so by which techniques light can be found there.
#[derive(Clone, Copy)]
enum Arrival {
    /// From the camera or a perfectly specular surface: by this ray alone.
    Certain,
    /// From a scattering event at a point, drawn with this density per solid angle. Light sampling
    /// could have found the light as well, unless something else stood in its way.
    Scattered { from: Receiver, pdf: f32, light_sampling: bool },
}

/// Paths that are followed together, and what the stages hand on to each other.
pub struct Wavefront<'s, S> {
    paths: Vec<Path<S>>,
    /// Those that go on, by their index.
    active: Vec<u32>,
    hits: Vec<Option<Hit>>,
    arrived: Vec<Arrived>,
    events: Vec<Event<'s>>,
    shadows: Vec<Shadow>,
}

/// A path at a surface.
struct Arrived {
    path: u32,
    point: SurfacePoint,
    drawn: BounceNumbers,
}

/// A path where it scatters.
struct Event<'s> {
    /// Index among those that arrived.
    at: u32,
    bsdf: Bsdf<'s>,
    from: Receiver,
}

/// Light that reaches a path if nothing is in its way.
struct Shadow {
    path: u32,
    light: Vec3,
    ray: Ray,
}

impl<S> Wavefront<'_, S> {
    /// An empty one, for this many paths.
    pub fn with_capacity(capacity: usize) -> Self {
        Self {
            paths: Vec::with_capacity(capacity),
            active: Vec::with_capacity(capacity),
            hits: Vec::with_capacity(capacity),
            arrived: Vec::with_capacity(capacity),
            events: Vec::with_capacity(capacity),
            shadows: Vec::with_capacity(capacity),
        }
    }

    pub fn clear(&mut self) {
        self.paths.clear();
    }

    /// Adds a path that starts at the camera.
    #[inline]
    pub fn start(&mut self, ray: Ray, numbers: Stream<S>, record: Record) {
        self.paths.push(Path {
            ray,
            numbers,
            depth: 0,
            throughput: Vec3::ONE,
            eta_scale: 1.0,
            arrival: Arrival::Certain,
            seen_directly: true,
            passes: 0,
            record,
        });
    }

    /// What is remembered of the paths, in the order in which they were started.
    pub fn records(&self) -> impl Iterator<Item = &Record> {
        self.paths.iter().map(|path| &path.record)
    }
}

impl<'s> PathTracer<'s> {
    /// Follows all paths to their ends and fills in their records.
    pub fn trace<S: Source>(&self, wave: &mut Wavefront<'s, S>) {
        wave.active.clear();
        wave.active.extend(0..wave.paths.len() as u32);
        while !wave.active.is_empty() {
            self.intersect(wave);
            self.arrive(wave);
            self.prepare_to_scatter(wave);
            self.sample_lights(wave);
            self.add_visible_light(wave);
            self.scatter(wave);
        }
    }

    fn intersect<S>(&self, wave: &mut Wavefront<'s, S>) {
        let Wavefront { paths, active, hits, .. } = wave;
        hits.clear();
        self.accel.intersect_all(active.iter().map(|&i| paths[i as usize].ray), |hit| hits.push(hit));
    }

    /// Gathers what is emitted where paths arrive, and draws the numbers of those that are not at
    /// their end.
    fn arrive<S: Source>(&self, wave: &mut Wavefront<'s, S>) {
        wave.arrived.clear();
        for (&i, hit) in wave.active.iter().zip(&wave.hits) {
            let path = &mut wave.paths[i as usize];
            let Some(hit) = hit else {
                self.escape(path);
                continue;
            };
            let material = self.scene.primitives[hit.primitive as usize].material;
            let point = if self.parametrised[material.0 as usize] {
                self.accel.surface(&path.ray, hit)
            } else {
                self.accel.plain_surface(&path.ray, hit)
            };
            self.gather_emission(path, &point);

            // Nothing scatters at the last hit, but light may shine through it.
            if self.ends_at_hit(path) && path.depth > 0 && !self.has_interfaces {
                self.record_second_hit(path, &point);
                continue;
            }
            let drawn = self.dimensions.bounce(&mut path.numbers, path.depth);
            wave.arrived.push(Arrived { path: i, point, drawn });
        }
        wave.active.clear();
    }

    /// Makes the BSDFs where paths arrived; those at a boundary without effect go straight on.
    fn prepare_to_scatter<S>(&self, wave: &mut Wavefront<'s, S>) {
        wave.events.clear();
        for (at, Arrived { path: i, point, drawn }) in (0..).zip(&wave.arrived) {
            let i = *i;
            let path = &mut wave.paths[i as usize];
            let wo = -path.ray.direction;
            let material = self.scene.primitives[point.primitive as usize].material;
            let Some(bsdf) = Bsdf::new(self.scene, material, point, wo, drawn.mix) else {
                path.passes += 1;
                if path.passes <= MAX_PASSES {
                    self.pass(path, point);
                    wave.active.push(i);
                }
                continue;
            };
            if path.depth == 0 {
                path.record.light1 = drawn.light_uv;
                path.record.bsdf1 = drawn.bsdf_uv;
                self.record_first_hit(point, &bsdf, wo, &mut path.record);
            } else {
                self.record_second_hit(path, point);
            }
            if !self.ends_at_hit(path) {
                let from = receiver(point, &bsdf, wo);
                wave.events.push(Event { at, bsdf, from });
            }
        }
    }

    /// Light that one more scattering event brings, from a sampled light.
    fn sample_lights<S>(&self, wave: &mut Wavefront<'s, S>) {
        wave.shadows.clear();
        for Event { at, bsdf, from } in &wave.events {
            if bsdf.is_specular() {
                continue;
            }
            let Arrived { path: i, point, drawn } = &wave.arrived[*at as usize];
            let path = &wave.paths[*i as usize];
            let wo = -path.ray.direction;
            if let Some((light, ray)) = self.direct_light(point, from, bsdf, wo, drawn, path.ray.time) {
                wave.shadows.push(Shadow { path: *i, light: path.throughput * light, ray });
            }
        }
    }

    fn add_visible_light<S>(&self, wave: &mut Wavefront<'s, S>) {
        let Wavefront { paths, shadows, .. } = wave;
        let mut lit = shadows.iter();
        self.are_visible(shadows.iter().map(|shadow| shadow.ray), |is_visible| {
            if let Some(Shadow { path, light, .. }) = lit.next().filter(|_| is_visible) {
                paths[*path as usize].record.colour += *light;
            }
        });
    }

    /// Draws directions to go on in.
    fn scatter<S>(&self, wave: &mut Wavefront<'s, S>) {
        if !self.follows {
            return;
        }
        for event in &wave.events {
            let arrived = &wave.arrived[event.at as usize];
            if self.goes_on(arrived, event, &mut wave.paths[arrived.path as usize]) {
                wave.active.push(arrived.path);
            }
        }
    }

    /// Scatters a path; false if it ends by that.
    #[inline]
    fn goes_on<S>(&self, arrived: &Arrived, event: &Event, path: &mut Path<S>) -> bool {
        let (Arrived { point, drawn, .. }, Event { bsdf, from, .. }) = (arrived, event);
        let Some(sample) = bsdf.sample(-path.ray.direction, drawn.lobe, drawn.bsdf_uv) else { return false };
        path.throughput *= sample.weight;
        if path.throughput == Vec3::ZERO {
            return false;
        }
        path.depth += 1;
        path.eta_scale *= sample.eta * sample.eta;
        path.seen_directly &= sample.specular;
        path.arrival = if sample.specular {
            Arrival::Certain
        } else {
            Arrival::Scattered { from: *from, pdf: sample.pdf, light_sampling: true }
        };
        path.ray = Ray {
            origin: point.offset_origin(sample.wi),
            direction: sample.wi,
            t_max: f32::INFINITY,
            time: path.ray.time,
        };

        // The last ray can do nothing but find a light, or be recorded.
        let recorded = self.records_second_hit && path.depth == 1;
        if self.ends_at_hit(path) && !self.lights.found_by_rays() && !recorded {
            return false;
        }
        self.survives_roulette(path, drawn.roulette)
    }

    /// Whether the path may not scatter where it arrives next.
    #[inline]
    fn ends_at_hit<S>(&self, path: &Path<S>) -> bool {
        path.depth >= self.max_depth
            || (self.direct_only && matches!(path.arrival, Arrival::Scattered { .. }))
    }

    /// Ends paths that carry little, and makes up for them in those that go on.
    #[inline]
    fn survives_roulette<S>(&self, path: &mut Path<S>, number: f32) -> bool {
        if self.direct_only || path.depth < ROULETTE_DEPTH {
            return true;
        }
        // What is not a number survives, for the store to count.
        let survival = (path.throughput * path.eta_scale).max_element().min(1.0);
        path.throughput /= survival;
        number < survival
    }

    /// Goes straight on through a boundary without effect.
    fn pass<S>(&self, path: &mut Path<S>, point: &SurfacePoint) {
        path.ray.origin = point.offset_origin(path.ray.direction);
        // Light sampling sees through plain boundaries, but not through mixes with one.
        if let Arrival::Scattered { light_sampling, .. } = &mut path.arrival {
            *light_sampling &= self.is_interface(point);
        }
    }

    /// Light from a surface that is hit.
    #[inline]
    fn gather_emission<S>(&self, path: &mut Path<S>, point: &SurfacePoint) {
        if let Some(emitted) = self.lights.emitted(point, -path.ray.direction) {
            let share = path.arrival.share(|from| self.lights.pdf_surface(from, point));
            path.add(emitted * share);
        }
    }

    /// Light from around the scene, where nothing is hit.
    #[inline]
    fn escape<S: Source>(&self, path: &mut Path<S>) {
        let direction = path.ray.direction;
        for (i, radiance) in self.lights.environments(path.ray.origin, direction) {
            let share = path.arrival.share(|from| self.lights.pdf_environment(from, i, direction));
            path.add(radiance * share);
        }
        let record = &mut path.record;
        match path.depth {
            0 => {
                record.position1 = path.ray.origin * self.inverse_diameter + FAR * direction;
                record.position2 = record.position1;
                record.albedo = Vec3::ONE;
                if self.records_numbers {
                    // Numbers that were not used, but whose distribution must not show that.
                    let drawn = self.dimensions.bounce(&mut path.numbers, 0);
                    (record.light1, record.bsdf1) = (drawn.light_uv, drawn.bsdf_uv);
                }
            }
            1 => record.position2 = record.position1 + FAR * direction,
            _ => {}
        }
    }

    #[inline]
    fn record_first_hit(&self, point: &SurfacePoint, bsdf: &Bsdf, wo: Vec3, record: &mut Record) {
        record.hit = true;
        record.position1 = point.position * self.inverse_diameter;
        record.normal1 = turned(bsdf.shading_normal(), wo);
        record.position2 = record.position1;
        if self.records_albedo {
            let albedo = if bsdf.is_specular() { Vec3::ONE } else { bsdf.albedo() };
            let only_emits = albedo == Vec3::ZERO && self.lights.emitted(point, wo).is_some();
            record.albedo = if only_emits { Vec3::ONE } else { albedo };
        }
    }

    /// Position and normal of the hit, if it is the path's second. The normal is the interpolated
    /// one: what bends it further is not looked up where a path ends.
    #[inline]
    fn record_second_hit<S>(&self, path: &mut Path<S>, point: &SurfacePoint) {
        if path.depth == 1 {
            path.record.position2 = point.position * self.inverse_diameter;
            path.record.normal2 = turned(point.shading_normal, -path.ray.direction);
        }
    }
}

impl<S> Path<S> {
    #[inline]
    fn add(&mut self, radiance: Vec3) {
        let sum = if self.seen_directly { &mut self.record.visible } else { &mut self.record.colour };
        *sum += self.throughput * radiance;
    }
}

impl Arrival {
    /// Share of light found by the ray, where light sampling finds it with the density given by
    /// `light_pdf`, from where the ray started.
    #[inline]
    fn share(&self, light_pdf: impl FnOnce(&Receiver) -> f32) -> f32 {
        match self {
            Self::Scattered { from, pdf, light_sampling: true } => power_heuristic(*pdf, light_pdf(from)),
            Self::Certain | Self::Scattered { .. } => 1.0,
        }
    }
}
