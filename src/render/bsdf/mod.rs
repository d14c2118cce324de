//! Stand-in for the BSDFs.

use glam::{Vec2, Vec3};

use crate::geometry::SurfacePoint;
use crate::scene::{MaterialId, Scene};

pub struct Bsdf;

pub struct BsdfSample {
    pub wi: Vec3,
    pub weight: Vec3,
    pub pdf: f32,
    pub specular: bool,
    pub transmission: bool,
    pub eta: f32,
}

impl Bsdf {
    pub fn new(_: &Scene, _: MaterialId, _: &SurfacePoint, _: Vec3, _: f32) -> Option<Bsdf> {
        todo!()
    }
    pub fn eval(&self, _: Vec3, _: Vec3) -> Vec3 {
        todo!()
    }
    pub fn pdf(&self, _: Vec3, _: Vec3) -> f32 {
        todo!()
    }
    pub fn sample(&self, _: Vec3, _: f32, _: Vec2) -> Option<BsdfSample> {
        todo!()
    }
    pub fn is_specular(&self) -> bool {
        todo!()
    }
    pub fn albedo(&self) -> Vec3 {
        todo!()
    }
    pub fn shading_normal(&self) -> Vec3 {
        todo!()
    }
}
