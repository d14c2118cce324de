//! Areas of shapes in render space.

use glam::{DAffine3, DVec2, DVec3, Vec3};

use super::disk::DiskExtent;
use super::mesh;
use super::sphere::SphereExtent;
use crate::scene::{Scene, Shape};

/// Rows and columns of the grid over which the area of a stretched sphere is integrated.
const AREA_GRID: (u32, u32) = (64, 128);

/// Area of a primitive's element, in render space.
pub fn area(scene: &Scene, primitive: u32, element: u32) -> f32 {
    match &scene.primitives[primitive as usize].shape {
        Shape::Mesh(mesh) => triangle_area(mesh::corners(mesh, element)) as f32,
        Shape::Disk(disk) => (DiskExtent::new(disk).area() * area_stretch(&disk.to_object, DVec3::Z)) as f32,
        Shape::Sphere(sphere) => {
            let extent = SphereExtent::new(sphere);
            let (rows, columns) = AREA_GRID;
            let mean_stretch = (0..rows * columns)
                .map(|cell| {
                    let cell = DVec2::new((cell % columns) as f64 + 0.5, (cell / columns) as f64 + 0.5);
                    let u = DVec2::new(cell.y / rows as f64, cell.x / columns as f64);
                    area_stretch(&sphere.to_object, extent.sample(u).normalize_or_zero())
                })
                .sum::<f64>()
                / (rows * columns) as f64;
            (extent.area() * mean_stretch) as f32
        }
    }
}

fn triangle_area(corners: [Vec3; 3]) -> f64 {
    0.5 * mesh::scaled_normal(corners).length()
}

/// Factor by which a transform scales a differential area with this unit normal: the length of the
/// normal times the cofactor matrix.
pub fn area_stretch(transform: &DAffine3, normal: DVec3) -> f64 {
    let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    (normal.x * y.cross(z) + normal.y * z.cross(x) + normal.z * x.cross(y)).length()
}
