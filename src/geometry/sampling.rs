//! Points on emissive surfaces, and the densities of drawing them.
//!
//! Triangles, disks and partial spheres are sampled uniformly by area, whole spheres seen from
//! outside uniformly over the cone that they fill (pbrt-v4, sections 6.2.4, 6.3.4 and 6.5.4).
//! Shapes are sampled in their own space; densities are carried over with the Jacobian of the
//! transform, so that they are right under any affine transform.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};

use super::disk::DiskExtent;
use super::local::{Detail, LocalPoint};
use super::sphere::SphereExtent;
use super::triangle_sampling::TriangleSampler;
use super::{SurfacePoint, mesh, rounding};
use crate::scene::{Primitive, Scene, Shape, Sphere};

/// Sides of the grid over which a stretched sphere's area is integrated.
const AREA_GRID: (u32, u32) = (64, 128);

/// A point drawn from a surface.
#[derive(Clone, Copy, Debug)]
pub struct ShapeSample {
    pub position: Vec3,
    /// As [`SurfacePoint::position_error`].
    pub position_error: Vec3,
    /// As [`SurfacePoint::geometric_normal`].
    pub normal: Vec3,
    pub uv: Vec2,
    /// Density by solid angle at the reference; positive and finite.
    pub pdf: f32,
}

impl ShapeSample {
    /// As [`SurfacePoint::offset_origin`].
    pub fn offset_origin(&self, w: Vec3) -> Vec3 {
        rounding::offset_origin(self.position, self.position_error, self.normal, w)
    }
}

/// Draws a point of a primitive's element, as seen from `reference`, with `u` in [0, 1)².
///
/// Only for primitives of the static object. `None` if the element has no area, or is seen edge-on.
pub fn sample_shape(
    scene: &Scene,
    primitive: u32,
    element: u32,
    reference: Vec3,
    u: Vec2,
) -> Option<ShapeSample> {
    let owner = &scene.primitives[primitive as usize];
    let (point, cone_density) = match &owner.shape {
        Shape::Mesh(mesh) => {
            return TriangleSampler::new(mesh, element, owner.flip_normal).sample(reference, u);
        }
        Shape::Sphere(sphere) => {
            let extent = SphereExtent::of(sphere);
            let cone = Cone::towards(sphere, reference);
            let p = match &cone {
                Some(cone) => cone.point(u.as_dvec2()),
                None => uniform_on_sphere(&extent, u.as_dvec2()),
            };
            let point = in_object(owner, &sphere.to_object, p, |p| extent.local_point(p, Detail::Full));
            let density = cone.map(|cone| cone.density(point.position - reference.as_dvec3()));
            (point, density)
        }
        Shape::Disk(disk) => {
            let extent = DiskExtent::of(disk);
            let p = uniform_on_disk(&extent, u.as_dvec2());
            (in_object(owner, &disk.to_object, p, |p| extent.local_point(p, Detail::Full)), None)
        }
    };
    let density = cone_density.unwrap_or_else(|| {
        let normal = point.geometric_normal.as_dvec3();
        area_density(owner, element, normal)
            * area_to_solid_angle(point.position - reference.as_dvec3(), normal)
    });
    let point = point.rounded(primitive, element);
    let pdf = density as f32;
    (pdf > 0.0 && pdf.is_finite()).then_some(ShapeSample {
        position: point.position,
        position_error: point.position_error,
        normal: point.geometric_normal,
        uv: point.uv,
        pdf,
    })
}

/// Density by solid angle with which [`sample_shape`] draws the direction from `reference` to
/// `surface`, a point of that element; 0 if it never does.
pub fn pdf_shape(
    scene: &Scene,
    primitive: u32,
    element: u32,
    reference: Vec3,
    surface: &SurfacePoint,
) -> f32 {
    let owner = &scene.primitives[primitive as usize];
    let to_surface = surface.position.as_dvec3() - reference.as_dvec3();
    let cone = match &owner.shape {
        Shape::Sphere(sphere) => Cone::towards(sphere, reference),
        Shape::Mesh(_) | Shape::Disk(_) => None,
    };
    let density = match cone {
        Some(cone) => cone.density(to_surface),
        None => {
            let normal = surface.geometric_normal.as_dvec3();
            area_density(owner, element, normal) * area_to_solid_angle(to_surface, normal)
        }
    };
    let pdf = density as f32;
    if pdf.is_finite() { pdf } else { 0.0 }
}

/// Area of a primitive's element, in render space.
pub fn area(scene: &Scene, primitive: u32, element: u32) -> f32 {
    match &scene.primitives[primitive as usize].shape {
        Shape::Mesh(mesh) => triangle_area(mesh::corners(mesh, element)) as f32,
        Shape::Disk(disk) => {
            (disk_area(&DiskExtent::of(disk)) * area_stretch(&disk.to_object, DVec3::Z)) as f32
        }
        Shape::Sphere(sphere) => {
            let extent = SphereExtent::of(sphere);
            let (rows, columns) = AREA_GRID;
            let mean_stretch = (0..rows * columns)
                .map(|cell| {
                    let cell = DVec2::new((cell % columns) as f64 + 0.5, (cell / columns) as f64 + 0.5);
                    let u = DVec2::new(cell.y / rows as f64, cell.x / columns as f64);
                    area_stretch(&sphere.to_object, uniform_on_sphere(&extent, u).normalize_or_zero())
                })
                .sum::<f64>()
                / (rows * columns) as f64;
            (sphere_area(&extent) * mean_stretch) as f32
        }
    }
}

/// Density by area, in render space, of uniform sampling in a shape's own space.
fn area_density(owner: &Primitive, element: u32, normal: DVec3) -> f64 {
    match &owner.shape {
        Shape::Mesh(mesh) => triangle_area(mesh::corners(mesh, element)).recip(),
        Shape::Disk(disk) => {
            (disk_area(&DiskExtent::of(disk)) * area_stretch(&disk.to_object, DVec3::Z)).recip()
        }
        Shape::Sphere(sphere) => {
            // A normal comes back to the sphere's space by the transpose of the linear part.
            let own_normal = (sphere.to_object.matrix3.transpose() * normal).normalize_or_zero();
            (sphere_area(&SphereExtent::of(sphere)) * area_stretch(&sphere.to_object, own_normal)).recip()
        }
    }
}

fn triangle_area(corners: [Vec3; 3]) -> f64 {
    0.5 * mesh::scaled_normal(corners).length()
}

fn disk_area(disk: &DiskExtent) -> f64 {
    0.5 * disk.phi_max * (disk.radius * disk.radius - disk.inner_radius * disk.inner_radius)
}

/// Archimedes: the area of a zone depends on its height alone.
fn sphere_area(sphere: &SphereExtent) -> f64 {
    sphere.phi_max * sphere.radius * (sphere.z_max - sphere.z_min)
}

/// Factor by which a transform enlarges a small area with this unit normal: the length of the
/// normal under the cofactor matrix.
fn area_stretch(transform: &DAffine3, normal: DVec3) -> f64 {
    let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    (normal.x * y.cross(z) + normal.y * z.cross(x) + normal.z * x.cross(y)).length()
}

/// Factor from densities by area to densities by solid angle.
fn area_to_solid_angle(to_point: DVec3, normal: DVec3) -> f64 {
    let squared = to_point.length_squared();
    squared * squared.sqrt() / to_point.dot(normal).abs()
}

fn in_object(
    owner: &Primitive,
    to_object: &DAffine3,
    p: DVec3,
    surface: impl Fn(DVec3) -> LocalPoint,
) -> LocalPoint {
    let point = surface(p).transformed(to_object, &to_object.inverse());
    if owner.flip_normal { point.flipped() } else { point }
}

fn uniform_on_disk(disk: &DiskExtent, u: DVec2) -> DVec3 {
    let squared = |x: f64| x * x;
    let distance =
        (squared(disk.inner_radius) + u.x * (squared(disk.radius) - squared(disk.inner_radius))).sqrt();
    let (sin, cos) = (u.y * disk.phi_max).sin_cos();
    DVec3::new(distance * cos, distance * sin, disk.height)
}

fn uniform_on_sphere(sphere: &SphereExtent, u: DVec2) -> DVec3 {
    let z = sphere.z_min + u.x * (sphere.z_max - sphere.z_min);
    let ring = (sphere.radius * sphere.radius - z * z).max(0.0).sqrt();
    let (sin, cos) = (u.y * sphere.phi_max).sin_cos();
    DVec3::new(ring * cos, ring * sin, z)
}

/// The directions in which a whole sphere is seen from outside, in the sphere's space.
struct Cone {
    /// Unit vector from the sphere's centre to the reference.
    axis: DVec3,
    radius: f64,
    sin_max: f64,
    /// 1 - cos of the half angle.
    height: f64,
    to_shape: DAffine3,
}

impl Cone {
    /// `None` for partial spheres, and from inside.
    fn towards(sphere: &Sphere, reference: Vec3) -> Option<Self> {
        let extent = SphereExtent::of(sphere);
        let to_shape = sphere.to_object.inverse();
        let from = to_shape.transform_point3(reference.as_dvec3());
        let distance = from.length();
        let outside = extent.is_full() && distance > extent.radius && extent.radius > 0.0;
        outside.then(|| {
            let sin_max = extent.radius / distance;
            let squared = sin_max * sin_max;
            // Without the cancellation of 1 - cos at small angles.
            let height = squared / (1.0 + (1.0 - squared).sqrt());
            Self { axis: from / distance, radius: extent.radius, sin_max, height, to_shape }
        })
    }

    /// The near point of the sphere in a direction drawn uniformly from the cone.
    fn point(&self, u: DVec2) -> DVec3 {
        let height = u.x * self.height;
        let cos = 1.0 - height;
        let sin_squared = height * (2.0 - height);
        // Angle at the sphere's centre between the axis and the point.
        let cos_centre = sin_squared / self.sin_max
            + cos * (1.0 - sin_squared / (self.sin_max * self.sin_max)).max(0.0).sqrt();
        let sin_centre = (1.0 - cos_centre * cos_centre).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (TAU * u.y).sin_cos();
        let (x, y) = self.axis.any_orthonormal_pair();
        self.radius * (sin_centre * (cos_phi * x + sin_phi * y) + cos_centre * self.axis)
    }

    /// Density by solid angle, in the object's space, along `direction`.
    fn density(&self, direction: DVec3) -> f64 {
        let linear = self.to_shape.matrix3;
        let stretch = (linear * direction.normalize_or_zero()).length();
        linear.determinant().abs() / (stretch * stretch * stretch) / (TAU * self.height)
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;
    use crate::geometry::test_scenes::{Numbers, full_sphere, mesh_of, ray, scene_of};
    use crate::geometry::{Accel, SurfacePoint};
    use crate::scene::Disk;

    const REFERENCE: Vec3 = Vec3::new(0.3, -0.2, 0.1);

    fn stretched() -> DAffine3 {
        DAffine3::from_translation(DVec3::new(0.2, 0.4, 4.0))
            * DAffine3::from_rotation_x(0.6)
            * DAffine3::from_scale(DVec3::new(0.7, 1.2, 1.9))
    }

    /// One shape of every kind, the spheres from outside and inside, none of which hides itself.
    fn shapes() -> Vec<(&'static str, Shape)> {
        let disk = Disk { to_object: stretched(), height: 0.3, radius: 1.1, inner_radius: 0.4, phi_max: 4.0 };
        let centred = DAffine3::from_translation(REFERENCE.as_dvec3());
        vec![
            (
                "triangle",
                Shape::Mesh(mesh_of(&[[Vec3::Z, Vec3::new(2.0, 0.0, 1.5), Vec3::new(0.5, 1.5, 2.0)]])),
            ),
            ("disk", Shape::Disk(disk)),
            ("sphere", Shape::Sphere(Sphere { to_object: stretched(), ..full_sphere(0.9) })),
            ("around", Shape::Sphere(Sphere { to_object: stretched(), ..full_sphere(30.0) })),
            (
                "partial",
                Shape::Sphere(Sphere { to_object: centred, z_min: -0.5, phi_max: 5.0, ..full_sphere(2.0) }),
            ),
        ]
    }

    fn visible(accel: &Accel, direction: Vec3) -> Option<SurfacePoint> {
        let ray = ray(REFERENCE, direction);
        accel.intersect(&ray).map(|hit| accel.surface(&ray, &hit))
    }

    #[test]
    fn a_sample_lies_where_its_ray_hits_with_the_same_density() {
        for (name, shape) in shapes() {
            let scene = scene_of(vec![shape]);
            let accel = Accel::build(&scene);
            let mut numbers = Numbers::new(5);
            let mut met = 0;
            for _ in 0..500 {
                let u = Vec2::new(numbers.next(), numbers.next());
                let sample = sample_shape(&scene, 0, 0, REFERENCE, u).expect("a lit shape");
                // Exactly at a border the ray may pass by.
                let Some(hit) = visible(&accel, sample.position - REFERENCE) else { continue };
                let expected = pdf_shape(&scene, 0, 0, REFERENCE, &hit);
                assert!((sample.pdf / expected - 1.0).abs() < 1e-2, "{name}: {} {expected}", sample.pdf);
                assert!(sample.position.distance(hit.position) < 1e-2, "{name}");
                assert!(sample.normal.dot(hit.geometric_normal) > 0.99, "{name}");
                assert!(sample.uv.distance(hit.uv) < 1e-2, "{name}");
                met += 1;
            }
            assert!(met >= 495, "{name}: {met}");
        }
    }

    #[test]
    fn densities_integrate_to_one_over_all_directions() {
        for (name, shape) in shapes() {
            let scene = scene_of(vec![shape]);
            let accel = Accel::build(&scene);
            let mut numbers = Numbers::new(6);
            let (mut sum, mut squares) = (0.0f64, 0.0f64);
            let count = 100_000;
            for _ in 0..count {
                let value = visible(&accel, numbers.direction())
                    .map_or(0.0, |hit| 4.0 * PI * pdf_shape(&scene, 0, 0, REFERENCE, &hit));
                sum += value as f64;
                squares += (value as f64).powi(2);
            }
            let mean = sum / count as f64;
            let deviation = ((squares / count as f64 - mean * mean) / count as f64).sqrt();
            // Five standard deviations: one failure in a million of other seeds.
            assert!((mean - 1.0).abs() < 5.0 * deviation + 1e-4, "{name}: {mean} ± {deviation}");
            assert!(deviation < 0.05, "{name}: {deviation}");
        }
    }

    #[test]
    fn mean_of_the_reciprocal_density_is_the_solid_angle() {
        for (name, shape) in shapes() {
            let scene = scene_of(vec![shape]);
            let accel = Accel::build(&scene);
            let mut numbers = Numbers::new(7);
            let count = 50_000;
            let seen = (0..count).filter(|_| visible(&accel, numbers.direction()).is_some()).count();
            let expected = 4.0 * PI as f64 * seen as f64 / count as f64;
            let mean = (0..count)
                .filter_map(|_| {
                    let u = Vec2::new(numbers.next(), numbers.next());
                    sample_shape(&scene, 0, 0, REFERENCE, u)
                })
                .map(|sample| (sample.pdf as f64).recip())
                .sum::<f64>()
                / count as f64;
            assert!((mean / expected - 1.0).abs() < 0.06, "{name}: {mean} {expected}");
        }
    }

    #[test]
    fn areas_are_those_of_the_textbook() {
        let close = |found: f32, expected: f32| {
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
        };
        let triangle = scene_of(vec![Shape::Mesh(mesh_of(&[[Vec3::ZERO, 2.0 * Vec3::X, 3.0 * Vec3::Z]]))]);
        close(area(&triangle, 0, 0), 3.0);
        let doubled = DAffine3::from_scale(DVec3::splat(2.0));
        let sphere = Sphere { to_object: doubled, ..full_sphere(1.5) };
        close(area(&scene_of(vec![Shape::Sphere(sphere)]), 0, 0), 4.0 * PI * 9.0);
        // A spheroid with semi-axes 1, 1 and 2.
        let long = Sphere { to_object: DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0)), ..full_sphere(1.0) };
        let eccentricity = 0.75f32.sqrt();
        let expected = TAU as f32 * (1.0 + 2.0 / eccentricity * eccentricity.asin());
        close(area(&scene_of(vec![Shape::Sphere(long)]), 0, 0), expected);
        let flat = DAffine3::from_scale(DVec3::new(2.0, 3.0, 5.0));
        let disk = Disk { to_object: flat, height: 1.0, radius: 2.0, inner_radius: 1.0, phi_max: PI };
        close(area(&scene_of(vec![Shape::Disk(disk)]), 0, 0), 6.0 * 1.5 * PI);
    }

    #[test]
    fn shapes_without_area_give_no_sample() {
        let flat = DAffine3::from_scale(DVec3::ZERO);
        let shapes = vec![
            Shape::Mesh(mesh_of(&[[Vec3::X, Vec3::X, Vec3::Y]])),
            Shape::Sphere(full_sphere(0.0)),
            Shape::Sphere(Sphere { to_object: flat, ..full_sphere(1.0) }),
            Shape::Disk(Disk { to_object: flat, height: 0.0, radius: 1.0, inner_radius: 0.0, phi_max: 1.0 }),
        ];
        let scene = scene_of(shapes);
        for primitive in 0..4 {
            assert!(sample_shape(&scene, primitive, 0, REFERENCE, Vec2::splat(0.3)).is_none());
            let area = area(&scene, primitive, 0);
            assert!(area == 0.0, "{area}");
        }
    }
}
