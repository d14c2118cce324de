//! Emissive surfaces: every triangle of a mesh, every sphere and every disk is a light of its own;
//! two triangles that follow each other and make up a parallelogram are one.

use std::ops::Range;

use glam::{Vec2, Vec3};

use super::bounds::LightBounds;
use super::extent::Extent;
use super::{LightSample, brightness};
use crate::geometry::{SurfacePoint, TriangleSampler, area, offset_origin, pdf_shape, sample_shape};
use crate::scene::texture::TexturePoint;
use crate::scene::{AreaLight, FloatTextureId, Scene, Shape, TriangleMesh};

/// Emissive surfaces of a scene; its lights are numbered by primitive, then by element.
pub struct SurfaceLights<'s> {
    scene: &'s Scene,
    surfaces: Vec<Surface>,
    /// For each primitive the index into `surfaces`, or [`NO_LIGHT`].
    of_primitive: Vec<u32>,
    /// For each element of each surface the index into `lights`.
    of_element: Vec<u32>,
    lights: Vec<SurfaceLight>,
}

const NO_LIGHT: u32 = u32::MAX;

/// An element of an emissive primitive, or two.
struct SurfaceLight {
    /// Index into [`SurfaceLights::surfaces`].
    surface: u32,
    elements: Range<u32>,
    /// For elements of meshes.
    triangle: Option<TriangleSampler>,
}

/// An emissive primitive.
struct Surface {
    primitive: u32,
    /// Its first element's index into [`SurfaceLights::of_element`].
    first: usize,
    emission: AreaLight,
    /// Brightness of its radiance, on average.
    mean: f32,
    /// Where it is cut out, it does not emit.
    alpha: Option<FloatTextureId>,
    /// It is not cut out everywhere. One that is lights the scene without being seen, which scenes
    /// use to hide their lights; pbrt-v4 does the same.
    found_by_rays: bool,
}

impl<'s> SurfaceLights<'s> {
    pub fn new(scene: &'s Scene) -> Self {
        let mut lights = Self {
            scene,
            surfaces: Vec::new(),
            of_primitive: Vec::new(),
            of_element: Vec::new(),
            lights: Vec::new(),
        };
        for (i, primitive) in (0..).zip(&scene.primitives) {
            let emission = primitive.area_light.filter(|light| light.radiance != Vec3::ZERO);
            let Some(emission) = emission else {
                lights.of_primitive.push(NO_LIGHT);
                continue;
            };
            let surface = lights.surfaces.len() as u32;
            let hidden = primitive.alpha.is_some_and(|id| scene.textures.constant_float(id) == Some(0.0));
            lights.of_primitive.push(surface);
            lights.surfaces.push(Surface {
                primitive: i,
                first: lights.of_element.len(),
                emission,
                mean: brightness(emission.mean_radiance(&scene.textures)),
                alpha: primitive.alpha.filter(|_| !hidden),
                found_by_rays: !hidden,
            });
            match &primitive.shape {
                Shape::Mesh(mesh) => {
                    // What is cut out, and an image, go by the texture coordinates of each triangle.
                    let merges = (primitive.alpha.is_none() || hidden) && emission.image.is_none();
                    lights.add_triangles(surface, mesh, primitive.flip_normal, merges);
                }
                Shape::Sphere(_) | Shape::Disk(_) => lights.add(surface, 0..1, None),
            }
        }
        lights
    }

    fn add_triangles(&mut self, surface: u32, mesh: &TriangleMesh, flip_normal: bool, merges: bool) {
        let count = mesh.indices.len() as u32;
        let mut element = 0;
        while element < count {
            let next = element + 1;
            let both = (merges && next < count)
                .then(|| TriangleSampler::of_parallelogram(mesh, [element, next], flip_normal))
                .flatten();
            let end = if both.is_some() { next + 1 } else { next };
            let sampler = both.unwrap_or_else(|| TriangleSampler::new(mesh, element, flip_normal));
            self.add(surface, element..end, Some(sampler));
            element = end;
        }
    }

    fn add(&mut self, surface: u32, elements: Range<u32>, triangle: Option<TriangleSampler>) {
        self.of_element.extend(elements.clone().map(|_| self.lights.len() as u32));
        self.lights.push(SurfaceLight { surface, elements, triangle });
    }

    /// Whether a ray can hit one.
    pub fn found_by_rays(&self) -> bool {
        self.surfaces.iter().any(|surface| surface.found_by_rays)
    }

    /// What the choice among lights goes by, for each light.
    pub fn bounds(&self) -> impl Iterator<Item = LightBounds> {
        self.lights.iter().map(|light| {
            let mut elements =
                light.elements.clone().map(|element| self.element_bounds(light.surface, element));
            let first = elements.next().expect("a light has an element");
            elements.fold(first, |a, b| {
                let centre = light.triangle.as_ref().map_or(a.centre, TriangleSampler::middle);
                a.union(&b, centre)
            })
        })
    }

    fn element_bounds(&self, surface: u32, element: u32) -> LightBounds {
        let Surface { primitive, emission, mean, .. } = self.surfaces[surface as usize];
        let Extent { centre, radius, normal, seen_share } = Extent::of(self.scene, primitive, element);
        LightBounds {
            centre,
            radius,
            axis: normal.unwrap_or(Vec3::Z),
            cos_axes: if normal.is_some() { 1.0 } else { -1.0 },
            cos_emission: 0.0,
            two_sided: emission.two_sided,
            intensity: area(self.scene, primitive, element) * seen_share * mean,
        }
    }

    /// Light from a point of one of the lights.
    #[inline]
    pub fn sample(&self, light: usize, from: Vec3, u: Vec2) -> Option<LightSample> {
        let light = &self.lights[light];
        let surface = &self.surfaces[light.surface as usize];
        let point = match &light.triangle {
            Some(triangle) => triangle.sample(from, u)?,
            None => sample_shape(self.scene, surface.primitive, light.elements.start, from, u)?,
        };
        let wi = (point.position - from).try_normalize()?;
        let radiance = surface.radiance(self.scene, point.normal.dot(-wi), point.uv)?;
        // On average over the rays that meet a half-transparent surface.
        let opacity = surface.alpha.map_or(1.0, |alpha| {
            let at = TexturePoint { uv: point.uv, position: point.position };
            self.scene.textures.float(alpha, at).clamp(0.0, 1.0)
        });
        Some(LightSample {
            wi,
            radiance: radiance * opacity,
            pdf: point.pdf,
            found_by_rays: surface.found_by_rays,
            target: Some(point.offset_origin(-wi)),
        })
    }

    /// A light as [`PlainLight`], if it is one.
    #[inline]
    pub fn plain(&self, light: usize) -> Option<PlainLight<'_>> {
        let light = &self.lights[light];
        let surface = &self.surfaces[light.surface as usize];
        let is_plain = surface.alpha.is_none() && surface.emission.image.is_none();
        let shape = light.triangle.as_ref().filter(|shape| is_plain && shape.is_flat())?;
        Some(PlainLight {
            shape,
            radiance: surface.emission.radiance,
            two_sided: surface.emission.two_sided,
            found_by_rays: surface.found_by_rays,
        })
    }

    #[inline]
    pub fn is_light(&self, primitive: u32) -> bool {
        self.of_primitive[primitive as usize] != NO_LIGHT
    }

    /// Radiance in direction `wo`; `None` if the point is not on a light.
    #[inline]
    pub fn emitted(&self, point: &SurfacePoint, wo: Vec3) -> Option<Vec3> {
        self.at(point)?.radiance(self.scene, point.geometric_normal.dot(wo), point.uv)
    }

    /// The light that a point is on, and the density with which [`Self::sample`] gives the
    /// direction to that point.
    #[inline]
    pub fn pdf(&self, from: Vec3, point: &SurfacePoint) -> Option<(usize, f32)> {
        let surface = self.at(point)?;
        let light = self.of_element[surface.first + point.element as usize] as usize;
        let pdf = match &self.lights[light].triangle {
            Some(triangle) => triangle.pdf(from, point.position),
            None => pdf_shape(self.scene, point.primitive, point.element, from, point),
        };
        Some((light, pdf))
    }

    #[inline]
    fn at(&self, point: &SurfacePoint) -> Option<&Surface> {
        self.surfaces.get(self.of_primitive[point.primitive as usize] as usize)
    }
}

/// A light of triangles that is the same everywhere.
pub struct PlainLight<'l> {
    pub shape: &'l TriangleSampler,
    pub radiance: Vec3,
    pub two_sided: bool,
    pub found_by_rays: bool,
}

/// A point of a [`PlainLight`].
pub struct PlainSample {
    /// Unit direction towards it.
    pub wi: Vec3,
    /// Density per solid angle; 0 if it sends no light.
    pub pdf: f32,
    /// Where the shadow ray ends.
    pub target: Vec3,
}

impl PlainSample {
    /// Without a branch, so that it can be done for many points at once.
    #[inline(always)]
    pub fn of(shape: &TriangleSampler, two_sided: bool, from: Vec3, u: Vec2) -> Self {
        let position = shape.point(u).0;
        let wi = (position - from).normalize_or_zero();
        let (normal, error) = (shape.normal(), shape.position_error());
        let is_lit = two_sided | (normal.dot(-wi) > 0.0);
        let pdf = shape.pdf(from, position);
        let target = offset_origin(position, error, normal, -wi);
        Self { wi, pdf: if is_lit { pdf } else { 0.0 }, target }
    }
}

impl Surface {
    /// Radiance at a point in a direction with this cosine to the normal; `None` on a side that is dark.
    #[inline]
    fn radiance(&self, scene: &Scene, cos: f32, uv: Vec2) -> Option<Vec3> {
        (self.emission.two_sided || cos > 0.0).then(|| self.emission.radiance_at(&scene.textures, uv))
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use glam::Vec2;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::geometry::{Accel, Ray};
    use crate::render::chi_squared::{p_value, significance};
    use crate::scene::pbrt::read_str;

    /// A scene whose light emits an image of 2×2 texels: red and green above, blue and white below.
    fn scene(shape: &str) -> Scene {
        let folder = tempfile::tempdir().unwrap();
        let texels: [[f32; 3]; 4] = [[0.0, 0.0, 1.0], [1.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mut file = b"PF\n2 2\n-1.0\n".to_vec();
        file.extend(texels.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        std::fs::write(folder.path().join("a.pfm"), file).unwrap();
        let light = "AreaLightSource \"diffuse\" \"string filename\" \"a.pfm\" \"float scale\" 3";
        read_str(&format!("WorldBegin Material \"diffuse\" {light} {shape}"), folder.path()).unwrap()
    }

    /// Two triangles whose texture coordinates do not continue each other, not even beyond [0, 1].
    const MESH: &str = "Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 1 1 .3 -1 1 .3]
        \"integer indices\" [0 1 2 0 2 3] \"point2 uv\" [0 0 1.3 0 .8 1 0 .4]";

    #[test]
    fn an_image_stands_upright_on_its_surface() {
        let scene = scene("Shape \"disk\"");
        let light = scene.primitives[0].area_light.unwrap();
        let at = |u: f32, v: f32| light.radiance_at(&scene.textures, Vec2::new(u, v));
        let [red, green, blue, white] =
            [(0.1, 0.9), (0.9, 0.9), (0.1, 0.1), (0.9, 0.1)].map(|(u, v)| at(u, v));
        assert_eq!([red, green, blue, white], [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE].map(|c| 3.0 * c));
        assert_eq!(light.mean_radiance(&scene.textures), Vec3::splat(1.5));
    }

    #[test]
    fn light_sampled_from_an_image_is_the_light_that_rays_find() {
        let from = Vec3::new(0.3, 0.2, 1.5);
        for shape in [
            MESH,
            "Shape \"disk\"",
            "Shape \"sphere\" \"float radius\" .9",
            "Shape \"sphere\" \"float zmax\" .8",
        ] {
            let scene = scene(shape);
            let lights = SurfaceLights::new(&scene);
            let accel = Accel::build(&scene);
            let mut rng = Pcg32::seed_from_u64(1);
            let count = lights.bounds().count();
            let side = 300;
            let mut stratified = |i: usize| {
                Vec2::new((i % side) as f32 + rng.random::<f32>(), (i / side) as f32 + rng.random::<f32>())
                    / side as f32
            };

            let mut sampled = Vec3::ZERO;
            for i in 0..side * side {
                let u = stratified(i);
                for light in 0..count {
                    if let Some(sample) = lights.sample(light, from, u) {
                        sampled += sample.radiance / sample.pdf;
                    }
                }
            }
            let mut found = Vec3::ZERO;
            for i in 0..4 * side * side {
                let u = stratified(i / 4);
                let z = 1.0 - 2.0 * u.x;
                let (sin, cos) = (2.0 * PI * u.y).sin_cos();
                let direction = Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
                let ray = Ray { origin: from, direction, t_max: f32::INFINITY, time: 0.0 };
                // The material does not ask for texture coordinates.
                if let Some(hit) = accel.intersect(&ray) {
                    let point = accel.plain_surface(&ray, &hit);
                    found += lights.emitted(&point, -direction).unwrap_or_default() * PI;
                }
            }
            let [sampled, found] = [sampled, found].map(|sum| sum / (side * side) as f32);
            let difference = (sampled - found).abs().max_element();
            let size = found.max_element();
            assert!(size > 0.2 && difference < 0.02 * size, "{shape}: {sampled} {found}");
        }
    }

    /// In bins of equal area, by the coordinates along its edges.
    #[test]
    fn points_of_two_triangles_that_are_one_light_follow_their_density() {
        const BINS: usize = 8;
        /// Nodes of quadrature along each side of a bin.
        const NODES: usize = 16;
        const SAMPLES: usize = 100_000;
        // Far from it, near a corner, and near its plane.
        const POINTS: [Vec3; 3] =
            [Vec3::new(1.0, -2.0, 5.0), Vec3::new(2.2, 0.2, 0.9), Vec3::new(-3.0, 1.0, 0.1)];
        let [a, b, c, d] =
            [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.5), Vec3::new(2.5, 3.0, 0.7), Vec3::new(0.5, 3.0, 0.2)];
        let corners = [a, b, c, d].map(|p| format!("{} {} {}", p.x, p.y, p.z)).join(" ");
        let scene = read_str(
            &format!(
                "WorldBegin AreaLightSource \"diffuse\" \"bool twosided\" true
                 Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" [ {corners} ]"
            ),
            std::path::Path::new(""),
        );
        let scene = scene.unwrap();
        let lights = SurfaceLights::new(&scene);
        let [SurfaceLight { triangle: Some(sampler), .. }] = &lights.lights[..] else { panic!("one light") };
        let edges = [b - a, d - a];
        let area = edges[0].cross(edges[1]);
        let normal = area.normalize();
        let mut rng = Pcg32::seed_from_u64(3);
        for from in POINTS {
            let side = BINS * NODES;
            let mut expected = vec![0.0; BINS * BINS];
            for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
                let at = (Vec2::new(i as f32, j as f32) + 0.5) / side as f32;
                let point = a + at.x * edges[0] + at.y * edges[1];
                let to_point = point - from;
                let per_area = normal.dot(to_point.normalize()).abs() / to_point.length_squared();
                let mass = sampler.pdf(from, point) * per_area * area.length() / (side * side) as f32;
                expected[i / NODES * BINS + j / NODES] += f64::from(mass) * SAMPLES as f64;
            }
            let mut counts = vec![0.0; BINS * BINS];
            for _ in 0..SAMPLES {
                let u = Vec2::new(rng.random(), rng.random());
                let wi = lights.sample(0, from, u).expect("it is seen").wi;
                let point = from + normal.dot(a - from) / normal.dot(wi) * wi - a;
                let along = [point.cross(edges[1]), edges[0].cross(point)];
                let [i, j] = along.map(|along| {
                    let share = along.dot(area) / area.length_squared();
                    assert!((-1e-4..=1.0001).contains(&share), "{from}: {share}");
                    ((share * BINS as f32) as usize).min(BINS - 1)
                });
                counts[i * BINS + j] += 1.0;
            }
            let p = p_value(&counts, &expected);
            assert!(p > significance(POINTS.len()), "{from}: p = {p}");
        }
    }
}
