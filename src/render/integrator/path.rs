//! Path tracing (Kajiya 1986) with light sampling, multiple importance sampling and Russian
//! roulette, in the conventions of pbrt-v4's `path`: `max_depth` counts scattering events, so that
//! 0 shows emission only and 1 adds direct light.

use glam::Vec3;

use super::PathTracer;
use super::direct::{MAX_PASSES, power_heuristic, receiver, turned};
use crate::geometry::{Ray, SurfacePoint};
use crate::render::bsdf::Bsdf;
use crate::render::lights::Receiver;
use crate::render::record::Record;
use crate::render::sampler::{Source, Stream};

/// Scattering events after which paths may end by chance (as pbrt-v4).
pub(super) const ROULETTE_DEPTH: u32 = 2;

/// Distance, in scene diameters, at which a path that leaves the scene is recorded.
const FAR: f32 = 2.0;

/// The state of a path between two surfaces.
struct Path {
    ray: Ray,
    /// Scattering events so far.
    depth: u32,
    throughput: Vec3,
    /// Product of the squared changes of the index of refraction, which the throughput contains
    /// and Russian roulette must not see.
    eta_scale: f32,
    arrival: Arrival,
    /// No scattering event so far was other than perfectly specular.
    seen_directly: bool,
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

impl PathTracer<'_> {
    /// Follows a path from the camera and fills in the record: radiance, and features and numbers
    /// of the first two hits.
    #[inline]
    pub fn trace<S: Source>(&self, ray: Ray, numbers: &mut Stream<S>, record: &mut Record) {
        let mut path = Path {
            ray,
            depth: 0,
            throughput: Vec3::ONE,
            eta_scale: 1.0,
            arrival: Arrival::Certain,
            seen_directly: true,
        };
        let mut passes = 0;
        loop {
            let Some(hit) = self.accel.intersect(&path.ray) else {
                self.escape(&path, numbers, record);
                break;
            };
            let point = self.accel.surface(&path.ray, &hit);
            let wo = -path.ray.direction;
            self.gather_emission(&path, &point, wo, record);

            // Nothing scatters at the last hit, but light may shine through it.
            let ends = self.ends_at_hit(&path);
            if ends && path.depth > 0 && !self.has_interfaces {
                self.record_second_hit(&path, &point, record);
                break;
            }
            let drawn = self.dimensions.bounce(numbers, path.depth);
            let material = self.scene.primitives[point.primitive as usize].material;
            let Some(bsdf) = Bsdf::new(self.scene, material, &point, wo, drawn.mix) else {
                passes += 1;
                if passes > MAX_PASSES {
                    break;
                }
                self.pass(&mut path, &point);
                continue;
            };
            if path.depth == 0 {
                record.light1 = drawn.light_uv;
                record.bsdf1 = drawn.bsdf_uv;
                self.record_first_hit(&point, &bsdf, wo, record);
            } else {
                self.record_second_hit(&path, &point, record);
            }
            if ends {
                break;
            }

            // Light that one more scattering event brings, from a sampled light.
            let from = receiver(&point, &bsdf, wo);
            if !bsdf.is_specular() {
                let light = self.direct_light(&point, &from, &bsdf, wo, &drawn, path.ray.time);
                record.colour += path.throughput * light;
            }

            // A direction to go on in.
            if !self.follows {
                break;
            }
            let Some(sample) = bsdf.sample(wo, drawn.lobe, drawn.bsdf_uv) else { break };
            path.throughput *= sample.weight;
            if path.throughput == Vec3::ZERO {
                break;
            }
            path.depth += 1;
            path.eta_scale *= sample.eta * sample.eta;
            path.seen_directly &= sample.specular;
            path.arrival = if sample.specular {
                Arrival::Certain
            } else {
                Arrival::Scattered { from, pdf: sample.pdf, light_sampling: true }
            };
            path.ray = Ray {
                origin: point.offset_origin(sample.wi),
                direction: sample.wi,
                t_max: f32::INFINITY,
                time: path.ray.time,
            };

            // The last ray can do nothing but find a light, or be recorded.
            let recorded = self.records_second_hit && path.depth == 1;
            if self.ends_at_hit(&path) && !self.lights.found_by_rays() && !recorded {
                break;
            }
            if !self.survives_roulette(&mut path, drawn.roulette) {
                break;
            }
        }
    }

    /// Whether the path may not scatter where it arrives next.
    #[inline]
    fn ends_at_hit(&self, path: &Path) -> bool {
        path.depth >= self.max_depth
            || (self.direct_only && matches!(path.arrival, Arrival::Scattered { .. }))
    }

    /// Ends paths that carry little, and makes up for them in those that go on.
    #[inline]
    fn survives_roulette(&self, path: &mut Path, number: f32) -> bool {
        if self.direct_only || path.depth < ROULETTE_DEPTH {
            return true;
        }
        // What is not a number survives, for the store to count.
        let survival = (path.throughput * path.eta_scale).max_element().min(1.0);
        path.throughput /= survival;
        number < survival
    }

    /// Goes straight on through a boundary without effect.
    fn pass(&self, path: &mut Path, point: &SurfacePoint) {
        path.ray.origin = point.offset_origin(path.ray.direction);
        // Light sampling sees through plain boundaries, but not through mixes with one.
        if let Arrival::Scattered { light_sampling, .. } = &mut path.arrival {
            *light_sampling &= self.is_interface(point);
        }
    }

    /// Light from a surface that is hit.
    #[inline]
    fn gather_emission(&self, path: &Path, point: &SurfacePoint, wo: Vec3, record: &mut Record) {
        if let Some(emitted) = self.lights.emitted(point, wo) {
            let share = path.arrival.share(|from| self.lights.pdf_surface(from, point));
            path.add(emitted * share, record);
        }
    }

    /// Light from around the scene, where nothing is hit.
    #[inline]
    fn escape<S: Source>(&self, path: &Path, numbers: &mut Stream<S>, record: &mut Record) {
        let direction = path.ray.direction;
        for (i, radiance) in self.lights.environments(direction) {
            let share = path.arrival.share(|from| self.lights.pdf_environment(from, i, direction));
            path.add(radiance * share, record);
        }
        match path.depth {
            0 => {
                record.position1 = path.ray.origin * self.inverse_diameter + FAR * direction;
                record.position2 = record.position1;
                record.albedo = Vec3::ONE;
                if self.records_numbers {
                    // Numbers that were not used, but whose distribution must not show that.
                    let drawn = self.dimensions.bounce(numbers, 0);
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
    fn record_second_hit(&self, path: &Path, point: &SurfacePoint, record: &mut Record) {
        if path.depth == 1 {
            record.position2 = point.position * self.inverse_diameter;
            record.normal2 = turned(point.shading_normal, -path.ray.direction);
        }
    }
}

impl Path {
    #[inline]
    fn add(&self, radiance: Vec3, record: &mut Record) {
        let sum = if self.seen_directly { &mut record.visible } else { &mut record.colour };
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
