//! The BSDFs at a packet of surface points, one in every SIMD lane, of [`SimdMaterial`]s.
//!
//! Takes rays towards the surfaces and shading normals; gives values, densities and sampled directions for the lanes
//! of a mask. Lanes with the same model are evaluated together.

use glam::Vec3;

use super::bsdf_sample::BsdfSamples;
use super::bsdf_values::BsdfValues;
use super::bxdf::Bxdf;
use super::conductor::Conductor;
use super::material_evaluator::MaterialEvaluator;
use super::simd_kernels;
use super::simd_material::SimdMaterial;
use crate::geometry::RayLanes;
use crate::scene::Textures;
use crate::scene::texture::TexturePoint;
use crate::simd::{LANES, Lanes, Lanes3, group_lanes};

/// A BSDF in every lane; lanes that are not shaded in SIMD are unused.
pub struct SimdBsdfs<'m> {
    materials: &'m [Option<SimdMaterial>],
    /// Index into `materials` for a conductor, or [`SimdBsdfs::DIFFUSE`].
    models: Lanes<u32>,
    reflectance: Lanes3,
}

impl<'m> SimdBsdfs<'m> {
    const DIFFUSE: u32 = u32::MAX;

    /// `materials`: for each material of the scene its [`SimdMaterial`], if it has one.
    pub fn new(materials: &'m [Option<SimdMaterial>]) -> Self {
        Self { materials, models: [Self::DIFFUSE; LANES], reflectance: Lanes3::ZERO }
    }

    /// Sets a lane to the BSDF of a material; `at` computes the point of texture lookup if there is one.
    #[inline]
    pub fn set(
        &mut self,
        lane: usize,
        material: u32,
        textures: &Textures,
        at: impl FnOnce() -> TexturePoint,
    ) {
        match self.materials[material as usize] {
            Some(SimdMaterial::Diffuse { constant: Some(colour), .. }) => {
                self.models[lane] = Self::DIFFUSE;
                self.reflectance.set(lane, colour);
            }
            Some(SimdMaterial::Diffuse { reflectance, constant: None }) => {
                self.models[lane] = Self::DIFFUSE;
                self.reflectance.set(lane, MaterialEvaluator { textures, at: at() }.colour(reflectance));
            }
            Some(SimdMaterial::Conductor(_)) | None => self.models[lane] = material,
        }
    }

    /// Albedo in a lane, as [`super::Bsdf::albedo`].
    pub fn albedo(&self, lane: usize, normal: Vec3, wo: Vec3) -> Vec3 {
        match self.conductor(self.models[lane]) {
            None => self.reflectance.at(lane),
            Some(conductor) => conductor.albedo(Vec3::new(0.0, 0.0, normal.dot(wo))),
        }
    }

    /// The conductor of a model; `None` for diffuse reflection.
    fn conductor(&self, model: u32) -> Option<&'m Conductor> {
        match self.materials.get(model as usize) {
            Some(Some(SimdMaterial::Conductor(conductor))) => Some(conductor),
            _ => None,
        }
    }

    /// Evaluates the BSDFs in the lanes of a mask, for light from `wi` that is scattered against the rays.
    pub fn eval(&self, mask: u32, rays: &RayLanes, normals: &Lanes3, wi: &Lanes3, values: &mut BsdfValues) {
        let directions = &rays.direction;
        group_lanes(&self.models, mask, |model, lanes| match self.conductor(model) {
            None => {
                simd_kernels::eval_diffuse(lanes, &self.reflectance, directions, normals, wi, values);
            }
            Some(conductor) => {
                simd_kernels::eval_conductor(lanes, conductor, directions, normals, wi, values);
            }
        });
    }

    /// Samples directions in the lanes of a mask by `u` in [0, 1)².
    pub fn sample(
        &self,
        mask: u32,
        rays: &RayLanes,
        normals: &Lanes3,
        u: &[Lanes; 2],
        samples: &mut BsdfSamples,
    ) {
        let directions = &rays.direction;
        group_lanes(&self.models, mask, |model, lanes| match self.conductor(model) {
            None => {
                simd_kernels::sample_diffuse(lanes, &self.reflectance, directions, normals, u, samples);
            }
            Some(conductor) => {
                simd_kernels::sample_conductor(lanes, conductor, directions, normals, u, samples);
            }
        });
    }
}
