//! Scalar reference of the path tracer: traces one path at a time, step by step as pbrt-v4's
//! `PathIntegrator::Li` (section 14.4.1).
//!
//! Takes the ray of a camera sample and the address of its sample values; gives the radiance of the path. The
//! wavefront tracer computes the same estimate from the same sample values, and a test compares both sample by
//! sample.

use glam::{Vec2, Vec3};

use super::mis::power_heuristic;
use super::path_event::PathEvent;
use super::path_tracer::{MAX_INTERFACES, PathTracer};
use super::termination::{Termination, survival_probability};
use crate::geometry::{Hit, Ray, SurfaceInteraction, face_forward};
use crate::render::bsdf::Bsdf;
use crate::render::lights::LightSampleContext;
use crate::render::sampler::{BounceSamples, SampleAddress, SampleAddresses, Sampler};
use crate::scene::MaterialId;
use crate::simd::LANES;

/// Radiance of one path, by how the light was found.
#[derive(Clone, Copy, Debug, Default)]
pub struct PathRadiance {
    /// Light sampled at scattering events.
    pub light_sampled: Vec3,
    /// Emission hit by rays of BSDF sampling.
    pub bsdf_sampled: Vec3,
    /// Emission seen by the camera, directly or by perfectly specular scattering only.
    pub visible_emission: Vec3,
}

/// A path up to its current ray.
struct PathState {
    ray: Ray,
    throughput: Vec3,
    /// Scattering events so far.
    depth: u32,
    /// Interfaces passed so far.
    interfaces: u32,
    /// Product of the squared changes of the index of refraction.
    eta_scale: f32,
    specular_bounce: bool,
    only_specular: bool,
    /// Whether light sampling at the last scattering event could have sampled the next hit.
    reached_by_light_sampling: bool,
    prev_context: LightSampleContext,
    bsdf_pdf: f32,
}

impl PathTracer<'_> {
    /// Returns the radiance along a camera ray, for the sample at `address`. `events` is called with every event of the
    /// path.
    pub fn reference_radiance<S: Sampler>(
        &self,
        ray: Ray,
        address: SampleAddress,
        events: &mut dyn FnMut(PathEvent),
    ) -> PathRadiance {
        let mut radiance = PathRadiance::default();
        let prev_context = LightSampleContext { position: ray.origin, normal: Vec3::ZERO, transmits: false };
        let mut path = PathState {
            ray,
            throughput: Vec3::ONE,
            depth: 0,
            interfaces: 0,
            eta_scale: 1.0,
            specular_bounce: true,
            only_specular: true,
            reached_by_light_sampling: false,
            prev_context,
            bsdf_pdf: 0.0,
        };
        while path.interfaces <= MAX_INTERFACES {
            // Intersect the ray with the scene
            let Ray { origin, direction, .. } = path.ray;
            events(PathEvent::Ray { depth: path.depth, origin, direction });
            let wo = -direction;
            let Some(hit) = self.accel.intersect(&path.ray) else {
                events(PathEvent::Miss);
                self.add_reference_environments(&path, &mut radiance, events);
                break;
            };
            let (material, point) = self.reference_interaction(&path.ray, &hit, events);

            // Add the emission of the surface
            if let Some(emitted) = self.lights.emitted_radiance(&point, wo) {
                path.add_emission(
                    emitted,
                    self.lights.pdf_area_light(&path.prev_context, &point),
                    &mut radiance,
                    events,
                );
            }

            // Get the BSDF, or pass an interface
            let samples = self.reference_samples::<S>(&path, address);
            let u_mix = samples.mix_after(0, path.interfaces, address);
            let Some(bsdf) = Bsdf::new(self.scene, material, &point, wo, u_mix) else {
                events(PathEvent::Interface);
                path.ray.origin = point.offset_origin(path.ray.direction);
                path.reached_by_light_sampling &= self.is_interface(&point);
                path.interfaces += 1;
                continue;
            };

            // End the path at its greatest depth
            if self.termination.ends_at_hit(path.depth, !path.specular_bounce) {
                events(PathEvent::GreatestDepth);
                break;
            }

            // Sample direct illumination
            let context = LightSampleContext {
                position: point.offset_origin(wo),
                normal: face_forward(bsdf.shading_normal(), wo),
                transmits: bsdf.transmits(),
            };
            if !bsdf.is_specular() {
                let light = self.sample_reference_light(&path, &point, &bsdf, &context, &samples);
                events(PathEvent::LightSample { radiance: path.throughput * light });
                radiance.light_sampled += path.throughput * light;
            }

            // Sample the BSDF to get the new direction, and end the path by Russian roulette
            if !path.scatter(&point, &bsdf, context, &samples, &self.termination, events) {
                break;
            }
        }
        radiance
    }

    /// Returns the surface that a ray hits, and its material.
    fn reference_interaction(
        &self,
        ray: &Ray,
        hit: &Hit,
        events: &mut dyn FnMut(PathEvent),
    ) -> (MaterialId, SurfaceInteraction) {
        let material = self.scene.primitives[hit.primitive as usize].material;
        // Tangents are arbitrary where the material does not need them, but decide the sampled directions.
        let point = if self.material_traits[material.0 as usize].needs_parametrisation {
            self.accel.interaction(ray, hit)
        } else {
            self.accel.minimal_interaction(ray, hit)
        };
        events(PathEvent::Hit {
            distance: hit.t,
            position: point.position,
            normal: point.shading_normal,
            primitive: hit.primitive,
            material: material.0,
        });
        (material, point)
    }

    /// Returns the sample values of the path's next scattering event, in lane 0.
    fn reference_samples<S: Sampler>(&self, path: &PathState, address: SampleAddress) -> BounceSamples {
        self.dimensions.bounce::<S>(&SampleAddresses::splat(address), &[path.depth; LANES])
    }

    /// Adds the emission of environments to a path that leaves the scene.
    fn add_reference_environments(
        &self,
        path: &PathState,
        radiance: &mut PathRadiance,
        events: &mut dyn FnMut(PathEvent),
    ) {
        let (context, direction) = (&path.prev_context, path.ray.direction);
        let finite = self.lights.finite_irradiance_at(context);
        for (light, emitted) in self.lights.environments(context.position, direction) {
            let light_pdf = self.lights.pdf_environment(context, finite, light, direction);
            path.add_emission(emitted, light_pdf, radiance, events);
        }
    }

    /// Samples a light and returns the radiance that the surface scatters from it, with its MIS weight.
    fn sample_reference_light(
        &self,
        path: &PathState,
        point: &SurfaceInteraction,
        bsdf: &Bsdf,
        context: &LightSampleContext,
        samples: &BounceSamples,
    ) -> Vec3 {
        // Sample a light
        let u = Vec2::new(samples.light_uv[0][0], samples.light_uv[1][0]);
        let Some(light) = self.lights.sample_one(context, samples.light_choice[0], u) else {
            return Vec3::ZERO;
        };

        // Evaluate the BSDF for the light's direction
        let (scattered, bsdf_pdf) = bsdf.eval_and_pdf(-path.ray.direction, light.wi);
        let scattered = scattered * light.radiance;
        if scattered == Vec3::ZERO || light.pdf <= 0.0 {
            return Vec3::ZERO;
        }

        // Return the light's contribution if it is unoccluded
        let (origin, time) = (point.offset_origin(light.wi), path.ray.time);
        let (direction, t_max) = light.shadow_ray(origin);
        if !self.is_unoccluded(Ray { origin, direction, t_max, time }) {
            return Vec3::ZERO;
        }
        let weight = if light.can_be_hit { power_heuristic(light.pdf, bsdf_pdf) } else { 1.0 };
        scattered * (weight / light.pdf)
    }
}

impl PathState {
    /// Scatters the path at a surface; returns whether it goes on.
    fn scatter(
        &mut self,
        point: &SurfaceInteraction,
        bsdf: &Bsdf,
        context: LightSampleContext,
        samples: &BounceSamples,
        termination: &Termination,
        events: &mut dyn FnMut(PathEvent),
    ) -> bool {
        // Sample the BSDF to get the new direction
        let wo = -self.ray.direction;
        let Some(sample) = bsdf.sample(wo, samples.lobe[0], samples.bsdf_uv_at(0)) else {
            events(PathEvent::Absorbed);
            return false;
        };
        events(PathEvent::Scatter {
            direction: sample.wi,
            weight: sample.weight,
            pdf: sample.pdf,
            is_specular: sample.specular,
        });
        self.throughput *= sample.weight;
        self.depth += 1;
        self.eta_scale *= sample.eta * sample.eta;
        self.specular_bounce = sample.specular;
        self.only_specular &= sample.specular;
        self.reached_by_light_sampling = !sample.specular;
        self.prev_context = context;
        self.bsdf_pdf = sample.pdf;
        self.ray.origin = point.offset_origin(sample.wi);
        self.ray.direction = sample.wi;
        if self.throughput == Vec3::ZERO {
            return false;
        }

        // End the path by Russian roulette
        if termination.has_roulette(self.depth, self.throughput) {
            let survival = survival_probability((self.throughput * self.eta_scale).max_element());
            let survives = samples.roulette[0] < survival;
            events(PathEvent::Roulette { survival, survives });
            if !survives {
                return false;
            }
            self.throughput /= survival;
        }
        true
    }

    /// Adds emission that the current ray reaches. `light_pdf` is the density with which light sampling at the
    /// last scattering event samples the ray's direction.
    fn add_emission(
        &self,
        emitted: Vec3,
        light_pdf: f32,
        radiance: &mut PathRadiance,
        events: &mut dyn FnMut(PathEvent),
    ) {
        let has_mis = !self.specular_bounce && self.reached_by_light_sampling;
        let weight = if has_mis { power_heuristic(self.bsdf_pdf, light_pdf) } else { 1.0 };
        events(PathEvent::Emission { emitted, mis_weight: weight, throughput: self.throughput });
        let sum =
            if self.only_specular { &mut radiance.visible_emission } else { &mut radiance.bsdf_sampled };
        *sum += self.throughput * (emitted * weight);
    }
}
