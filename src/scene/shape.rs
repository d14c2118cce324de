//! Shapes, primitives, objects and instances.

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::{AnimatedTransform, AreaLight, FloatTextureId, MaterialId};

/// Triangles in the space of the object they belong to (render space for the static object).
///
/// `normals` and `uvs` are empty or as long as `positions`; every index is in range; positions are
/// finite. Every triangle has an area. Normals are of unit length. The reader guarantees this.
///
/// Normals determine the front side of a triangle, whatever its winding. Without normals, the winding
/// and [`Primitive::flip_normal`] determine it.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub indices: Vec<[u32; 3]>,
    pub tangents: MeshTangents,
}

/// The tangents along which heights tilt a mesh with normals. Without normals they are those of its parametrisation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MeshTangents {
    /// ∂p/∂u and ∂p/∂v.
    #[default]
    Parametric,
    /// ∂p/∂u and n × ∂p/∂u, whatever the direction and length of ∂p/∂v, as in pbrt-v4.
    Perpendicular,
    /// Unit vectors opposite to these, as in pbrt-v2 and v3, where heights are depths in units of the texture coordinates.
    Opposite,
}

/// A (possibly partial) sphere around the origin of its own space, as pbrt's `sphere`.
#[derive(Clone, Debug)]
pub struct Sphere {
    /// Sphere space to the object's space.
    pub to_object: DAffine3,
    pub radius: f32,
    pub z_min: f32,
    pub z_max: f32,
    /// Radians, in (0, 2π].
    pub phi_max: f32,
}

/// A (possibly partial) disk or ring perpendicular to z, as pbrt's `disk`.
#[derive(Clone, Debug)]
pub struct Disk {
    /// Disk space to the object's space.
    pub to_object: DAffine3,
    pub height: f32,
    pub radius: f32,
    pub inner_radius: f32,
    /// Radians, in (0, 2π].
    pub phi_max: f32,
}

/// Limit of coordinates. Products of three larger coordinates overflow single precision.
pub const LARGEST_COORDINATE: f32 = 1e12;

/// A shape.
#[derive(Clone, Debug)]
pub enum Shape {
    Mesh(Arc<TriangleMesh>),
    Sphere(Sphere),
    Disk(Disk),
}

impl Shape {
    /// Surface area in object space. A sphere with non-uniform scale counts as a sphere of the same
    /// volume.
    pub fn area(&self) -> f64 {
        match self {
            Shape::Mesh(mesh) => {
                let area = |triangle: &[u32; 3]| {
                    let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
                    (b - a).cross(c - a).length() / 2.0
                };
                mesh.indices.iter().map(area).sum()
            }
            Shape::Sphere(sphere) => {
                let scale = sphere.to_object.matrix3.determinant().abs().cbrt();
                let height = f64::from(sphere.z_max - sphere.z_min);
                f64::from(sphere.phi_max) * f64::from(sphere.radius) * height * scale * scale
            }
            Shape::Disk(disk) => {
                let axes = disk.to_object.matrix3;
                let ring = f64::from(disk.radius).powi(2) - f64::from(disk.inner_radius).powi(2);
                f64::from(disk.phi_max) / 2.0 * ring * axes.x_axis.cross(axes.y_axis).length()
            }
        }
    }

    /// Largest absolute coordinate of the bounding box of a full sphere or disk in object space; `None`
    /// for a mesh.
    pub fn max_coordinate(&self) -> Option<f32> {
        let (to_object, low, high) = match self {
            Shape::Mesh(_) => return None,
            Shape::Sphere(sphere) => {
                let radius = f64::from(sphere.radius);
                (sphere.to_object, DVec3::splat(-radius), DVec3::splat(radius))
            }
            Shape::Disk(disk) => {
                let [radius, height] = [disk.radius, disk.height].map(f64::from);
                (disk.to_object, DVec3::new(-radius, -radius, height), DVec3::new(radius, radius, height))
            }
        };
        let centre = to_object.transform_point3((low + high) / 2.0);
        let half = (high - low) / 2.0;
        let axes = to_object.matrix3;
        let extent = axes.x_axis.abs() * half.x + axes.y_axis.abs() * half.y + axes.z_axis.abs() * half.z;
        Some((centre.abs() + extent).max_element() as f32)
    }

    /// Bytes of heap memory.
    pub fn memory_bytes(&self) -> usize {
        let Shape::Mesh(mesh) = self else { return 0 };
        size_of_val(&mesh.positions[..])
            + size_of_val(&mesh.normals[..])
            + size_of_val(&mesh.uvs[..])
            + size_of_val(&mesh.indices[..])
    }
}

/// A shape with its material, alpha and emission.
#[derive(Clone, Debug)]
pub struct Primitive {
    pub shape: Shape,
    pub material: MaterialId,
    /// Opacity in [0, 1]; `None` is opaque.
    pub alpha: Option<FloatTextureId>,
    /// Only on primitives of the static object.
    pub area_light: Option<AreaLight>,
    /// Whether the geometric normal is flipped (`ReverseOrientation` xor a mirroring transform). The
    /// unflipped normal is (p1 − p0) × (p2 − p0) for a triangle and ∂p/∂u × ∂p/∂v for other shapes,
    /// in object space. Without effect on meshes with normals.
    pub flip_normal: bool,
}

/// An object: a range of [`super::Scene::primitives`].
#[derive(Clone, Debug)]
pub struct Object {
    pub name: String,
    pub primitives: std::ops::Range<usize>,
}

/// An instance of an object.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Index into [`super::Scene::objects`], never 0.
    pub object: usize,
    /// Object space to render space.
    pub transform: AnimatedTransform,
}
