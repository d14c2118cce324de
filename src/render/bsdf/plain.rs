//! BSDFs of the most frequent kinds, evaluated and sampled a lane for each: diffuse reflection, and metals
//! that are the same everywhere. No frame but the normal makes a difference to them.

use glam::{Vec2, Vec3};
use multiversion::multiversion;

use super::conductor::Conductor;
use super::diffuse::{Diffuse, cosine_pdf, cosine_sample};
use super::frame::{Frame, on_side_of, same_side};
use super::{BsdfSample, Scatter, Values, fresnel, on_horizon};
use crate::geometry::{LANES, Lanes, Lanes3, RayLanes, groups};
use crate::scene::material::{Metal, Roughness, RoughnessScale};
use crate::scene::texture::TexturePoint;
use crate::scene::{Material, MaterialKind, RgbTextureId, Textures};

/// A material of such a kind.
#[derive(Clone, Copy, Debug)]
pub enum Plain {
    /// Its colour, and whether that is the same everywhere.
    Diffuse {
        reflectance: RgbTextureId,
        constant: Option<Vec3>,
    },
    Metal(Conductor),
}

impl Plain {
    pub fn of(textures: &Textures, material: &Material) -> Option<Self> {
        if material.displacement.is_some() || material.normal_map.is_some() {
            return None;
        }
        // Of what is the same everywhere, any point will do.
        let values = Values { textures, at: TexturePoint { uv: Vec2::ZERO, position: Vec3::ZERO } };
        let same = |id| textures.constant_rgb(id).is_some();
        let isotropic = |roughness: Roughness| {
            let [u, v] = [roughness.u, roughness.v].map(|id| textures.constant_float(id));
            u.is_some() && u == v && roughness.scale != RoughnessScale::InverseExponent
        };
        match material.kind {
            MaterialKind::Diffuse { reflectance } => {
                let constant = same(reflectance).then(|| values.colour(reflectance));
                Some(Self::Diffuse { reflectance, constant })
            }
            MaterialKind::Conductor { metal, roughness } => {
                let is_constant = match metal {
                    Metal::Fresnel { eta, k } => same(eta) && same(k),
                    Metal::Reflectance(reflectance) => same(reflectance),
                };
                (is_constant && isotropic(roughness))
                    .then(|| values.conductor(metal, roughness))
                    .filter(|conductor| !conductor.is_specular())
                    .map(Self::Metal)
            }
            _ => None,
        }
    }

    /// Whether it is the same everywhere.
    pub fn is_constant(&self) -> bool {
        !matches!(self, Self::Diffuse { constant: None, .. })
    }
}

/// The surfaces at which paths are, where they are plain.
pub struct PlainSurfaces<'m> {
    materials: &'m [Option<Plain>],
    /// Index into `materials`, or [`PlainSurfaces::DIFFUSE`].
    kinds: Lanes<u32>,
    reflectance: Lanes3,
}

/// f |cos| and density, as [`super::Bsdf::eval_and_pdf`].
pub struct Evaluated {
    pub value: Lanes3,
    pub pdf: Lanes,
}

/// As [`BsdfSample`]; where a direction leads nowhere, the weight is 0.
pub struct Scattered {
    pub wi: Lanes3,
    pub weight: Lanes3,
    pub pdf: Lanes,
    pub eta: Lanes,
    pub is_specular: Lanes<u32>,
}

impl Evaluated {
    pub const NOTHING: Self = Self { value: Lanes3::ZERO, pdf: [0.0; LANES] };

    #[inline]
    pub fn set(&mut self, lane: usize, (value, pdf): (Vec3, f32)) {
        self.value.set(lane, value);
        self.pdf[lane] = pdf;
    }
}

impl Scattered {
    pub const NOTHING: Self = Self {
        wi: Lanes3::ZERO,
        weight: Lanes3::ZERO,
        pdf: [0.0; LANES],
        eta: [1.0; LANES],
        is_specular: [0; LANES],
    };

    #[inline]
    pub fn set(&mut self, lane: usize, sample: Option<BsdfSample>) {
        let Some(sample) = sample else { return };
        self.wi.set(lane, sample.wi);
        self.weight.set(lane, sample.weight);
        self.pdf[lane] = sample.pdf;
        self.eta[lane] = sample.eta;
        self.is_specular[lane] = u32::from(sample.specular);
    }
}

impl<'m> PlainSurfaces<'m> {
    const DIFFUSE: u32 = u32::MAX;

    /// Of the materials of a scene, those that are plain.
    pub fn new(materials: &'m [Option<Plain>]) -> Self {
        Self { materials, kinds: [Self::DIFFUSE; LANES], reflectance: Lanes3::ZERO }
    }

    /// Sets a lane; `at` is where its textures are looked up.
    #[inline]
    pub fn set(
        &mut self,
        lane: usize,
        material: u32,
        textures: &Textures,
        at: impl FnOnce() -> TexturePoint,
    ) {
        match self.materials[material as usize] {
            Some(Plain::Diffuse { constant: Some(colour), .. }) => {
                self.kinds[lane] = Self::DIFFUSE;
                self.reflectance.set(lane, colour);
            }
            Some(Plain::Diffuse { reflectance, constant: None }) => {
                self.kinds[lane] = Self::DIFFUSE;
                self.reflectance.set(lane, Values { textures, at: at() }.colour(reflectance));
            }
            Some(Plain::Metal(_)) | None => self.kinds[lane] = material,
        }
    }

    /// As [`super::Bsdf::albedo`].
    pub fn albedo(&self, lane: usize, normal: Vec3, wo: Vec3) -> Vec3 {
        match self.metal(self.kinds[lane]) {
            None => self.reflectance.at(lane),
            Some(metal) => metal.albedo(Vec3::new(0.0, 0.0, normal.dot(wo))),
        }
    }

    fn metal(&self, kind: u32) -> Option<&'m Conductor> {
        match self.materials.get(kind as usize) {
            Some(Some(Plain::Metal(metal))) => Some(metal),
            _ => None,
        }
    }

    /// What is scattered from `wi` against the rays, in a mask's lanes.
    pub fn eval(&self, mask: u32, rays: &RayLanes, normals: &Lanes3, wi: &Lanes3, into: &mut Evaluated) {
        groups(&self.kinds, mask, |kind, lanes| match self.metal(kind) {
            None => eval_diffuse(lanes, &self.reflectance, &rays.direction, normals, wi, into),
            Some(metal) => eval_metal(lanes, metal, &rays.direction, normals, wi, into),
        });
    }

    /// Draws directions in a mask's lanes.
    pub fn sample(&self, mask: u32, rays: &RayLanes, normals: &Lanes3, u: &[Lanes; 2], into: &mut Scattered) {
        groups(&self.kinds, mask, |kind, lanes| match self.metal(kind) {
            None => sample_diffuse(lanes, &self.reflectance, &rays.direction, normals, u, into),
            Some(metal) => sample_metal(lanes, metal, &rays.direction, normals, u, into),
        });
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn eval_diffuse(
    mask: u32,
    reflectance: &Lanes3,
    directions: &Lanes3,
    normals: &Lanes3,
    wi: &Lanes3,
    into: &mut Evaluated,
) {
    for lane in 0..LANES {
        let normal = normals.at(lane);
        // Nothing but the cosines makes a difference.
        let [wo, wi] = [-directions.at(lane), wi.at(lane)].map(|w| Vec3::new(0.0, 0.0, w.dot(normal)));
        let diffuse = Diffuse { reflectance: reflectance.at(lane), transmittance: Vec3::ZERO };
        let reaches = !on_horizon(wo) & !on_horizon(wi) & same_side(wo, wi);
        let value = if reaches { diffuse.eval(wo, wi) } else { Vec3::ZERO };
        let pdf = if reaches { cosine_pdf(wi) } else { 0.0 };
        let is_on = mask >> lane & 1 == 1;
        into.value.put(lane, is_on, value);
        into.pdf[lane] = if is_on { pdf } else { into.pdf[lane] };
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn eval_metal(
    mask: u32,
    metal: &Conductor,
    directions: &Lanes3,
    normals: &Lanes3,
    wi: &Lanes3,
    into: &mut Evaluated,
) {
    let Conductor { eta, k, ggx } = *metal;
    for lane in 0..LANES {
        let frame = Frame::around(normals.at(lane));
        let (wo, wi) = (frame.to_local(-directions.at(lane)), frame.to_local(wi.at(lane)));
        let (reflected, cos) = ggx.reflect_eval(wo, wi);
        let value = fresnel::conductor(cos, eta, k) * reflected;
        let pdf = ggx.reflect_pdf(wo, wi);
        let reaches = !on_horizon(wo) & !on_horizon(wi) & same_side(wo, wi);
        let is_on = mask >> lane & 1 == 1;
        into.value.put(lane, is_on, if reaches { value } else { Vec3::ZERO });
        let pdf = if reaches { pdf } else { 0.0 };
        into.pdf[lane] = if is_on { pdf } else { into.pdf[lane] };
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn sample_diffuse(
    mask: u32,
    reflectance: &Lanes3,
    directions: &Lanes3,
    normals: &Lanes3,
    u: &[Lanes; 2],
    into: &mut Scattered,
) {
    let [u_x, u_y] = u;
    for lane in 0..LANES {
        let frame = Frame::around(normals.at(lane));
        let wo = frame.to_local(-directions.at(lane));
        let wi = on_side_of(cosine_sample(Vec2::new(u_x[lane], u_y[lane])), wo);
        let reaches = !on_horizon(wo) & !on_horizon(wi);
        let is_on = mask >> lane & 1 == 1;
        into.wi.put(lane, is_on, frame.to_render(wi).normalize());
        into.weight.put(lane, is_on, if reaches { reflectance.at(lane) } else { Vec3::ZERO });
        into.pdf[lane] = if is_on { cosine_pdf(wi) } else { into.pdf[lane] };
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn sample_metal(
    mask: u32,
    metal: &Conductor,
    directions: &Lanes3,
    normals: &Lanes3,
    u: &[Lanes; 2],
    into: &mut Scattered,
) {
    let [u_x, u_y] = u;
    let Conductor { eta, k, ggx } = *metal;
    for lane in 0..LANES {
        let frame = Frame::around(normals.at(lane));
        let wo = frame.to_local(-directions.at(lane));
        let reflection = ggx.reflect(wo, Vec2::new(u_x[lane], u_y[lane]));
        let wi = reflection.wi;
        let pdf = ggx.reflect_pdf(wo, wi);
        let weight = fresnel::conductor(reflection.cos, eta, k) * reflection.weight;
        let reaches = !on_horizon(wo) & !on_horizon(wi) & same_side(wo, wi) & (pdf > 0.0);
        let is_on = mask >> lane & 1 == 1;
        into.wi.put(lane, is_on, frame.to_render(wi).normalize());
        into.weight.put(lane, is_on, if reaches { weight } else { Vec3::ZERO });
        into.pdf[lane] = if is_on { pdf } else { into.pdf[lane] };
    }
}
