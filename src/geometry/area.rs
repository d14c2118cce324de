//! Areas of shapes in render space.

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec3};

use super::disk::DiskExtent;
use super::mesh;
use super::sphere::SphereExtent;
use crate::scene::{Scene, Shape};

/// Largest relative deviation from uniform scale of a transform that counts as a similarity.
const SIMILARITY_TOLERANCE: f64 = 1e-9;

/// Rows and columns of the grid over which the area of a stretched sphere is integrated.
const AREA_GRID: (u32, u32) = (64, 128);

/// Area of a primitive's element, in render space.
pub fn area(scene: &Scene, primitive: u32, element: u32) -> f32 {
    match &scene.primitives[primitive as usize].shape {
        Shape::Mesh(mesh) => triangle_area(mesh::corners(mesh, element)) as f32,
        Shape::Disk(disk) => (DiskExtent::new(disk).area() * area_stretch(&disk.to_object, DVec3::Z)) as f32,
        Shape::Sphere(sphere) => {
            let extent = SphereExtent::new(sphere);
            let stretch = similarity_stretch(&sphere.to_object.matrix3)
                .unwrap_or_else(|| mean_stretch(&extent, &sphere.to_object));
            (extent.area() * stretch) as f32
        }
    }
}

/// Factor by which a similarity transform (rotation, reflection, uniform scale) scales areas; `None` for
/// other transforms.
fn similarity_stretch(linear: &DMat3) -> Option<f64> {
    let squares = linear.transpose() * *linear;
    let stretch = (squares.x_axis.x + squares.y_axis.y + squares.z_axis.z) / 3.0;
    let deviation = squares - DMat3::from_diagonal(DVec3::splat(stretch));
    let is_similarity = deviation.to_cols_array().iter().all(|d| d.abs() <= SIMILARITY_TOLERANCE * stretch);
    is_similarity.then_some(stretch)
}

/// Factor by which a transform scales the area of a sphere, by numerical integration.
fn mean_stretch(extent: &SphereExtent, transform: &DAffine3) -> f64 {
    let (rows, columns) = AREA_GRID;
    let stretch = |cell: u32| {
        let cell = DVec2::new((cell % columns) as f64 + 0.5, (cell / columns) as f64 + 0.5);
        let u = DVec2::new(cell.y / rows as f64, cell.x / columns as f64);
        area_stretch(transform, extent.sample(u).normalize_or_zero())
    };
    (0..rows * columns).map(stretch).sum::<f64>() / (rows * columns) as f64
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::test_scenes::{full_sphere, static_scene};
    use crate::scene::Sphere;

    #[test]
    fn only_similarities_scale_all_areas_alike() {
        let turn = DMat3::from_rotation_x(0.7) * DMat3::from_rotation_z(2.0);
        let stretch = similarity_stretch(&(turn * -3.0)).expect("a similarity");
        assert!((stretch - 9.0).abs() < 1e-12, "{stretch}");
        assert_eq!(similarity_stretch(&DMat3::ZERO), Some(0.0));
        assert_eq!(similarity_stretch(&(turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1.001)))), None);
        let sheared = DMat3::from_cols(DVec3::X, DVec3::new(1e-3, 1.0, 0.0), DVec3::Z);
        assert_eq!(similarity_stretch(&sheared), None);
    }

    #[test]
    fn the_closed_form_of_a_zone_agrees_with_the_integral() {
        let transform = DAffine3::from_rotation_y(0.4) * DAffine3::from_scale(DVec3::splat(2.0));
        let sphere = Sphere { z_min: -0.2, phi_max: 2.0, to_object: transform, ..full_sphere(1.5) };
        let mean = mean_stretch(&SphereExtent::new(&sphere), &transform);
        assert!((mean - 4.0).abs() < 1e-9, "{mean}");
        let scene = static_scene(vec![Shape::Sphere(sphere)]);
        assert!((area(&scene, 0, 0) / (4.0 * 2.0 * 1.5 * 1.7) - 1.0).abs() < 1e-6);
    }
}
