//! Bounds of one element of an emissive primitive: a bounding sphere, and the direction that it emits in.

use glam::{DMat3, DVec3, Vec3};

use crate::scene::{Scene, Shape, TriangleMesh};

/// Bounds of a triangle, a disk or a sphere in render space.
#[derive(Clone, Copy, Debug)]
pub struct ElementBounds {
    pub centre: Vec3,
    pub radius: f32,
    /// Unit normal on the side that a one-sided light emits from; `None` if it varies over the element.
    pub normal: Option<Vec3>,
    /// Projected area over area: along the normal, or averaged over directions if the normal varies.
    pub projected_fraction: f32,
}

impl ElementBounds {
    /// Bounds of an element of a scene's primitive.
    pub fn new(scene: &Scene, primitive: u32, element: u32) -> Self {
        let primitive = &scene.primitives[primitive as usize];
        match &primitive.shape {
            Shape::Mesh(mesh) => Self::from_triangle(mesh, element, primitive.flip_normal),
            Shape::Disk(disk) => {
                let to_render = disk.to_object;
                let normal_matrix = to_render.matrix3.inverse().transpose();
                let normal = (normal_matrix * DVec3::Z).as_vec3().try_normalize();
                let side = if primitive.flip_normal { -1.0 } else { 1.0 };
                let centre = DVec3::new(0.0, 0.0, disk.height.into());
                Self {
                    centre: to_render.transform_point3(centre).as_vec3(),
                    radius: rounded_up(f64::from(disk.radius.abs()) * max_stretch(to_render.matrix3)),
                    normal: normal.map(|normal| side * normal),
                    projected_fraction: 1.0,
                }
            }
            // The mean projected area of a convex body is a quarter of its surface area (Cauchy).
            Shape::Sphere(sphere) => Self {
                centre: sphere.to_object.translation.as_vec3(),
                radius: rounded_up(f64::from(sphere.radius.abs()) * max_stretch(sphere.to_object.matrix3)),
                normal: None,
                projected_fraction: 0.25,
            },
        }
    }

    fn from_triangle(mesh: &TriangleMesh, triangle: u32, flip_normal: bool) -> Self {
        let indices = mesh.indices[triangle as usize];
        let corners = indices.map(|index| mesh.positions[index as usize].as_dvec3());
        let [a, b, c] = corners;
        let winding = (b - a).cross(c - a).normalize_or_zero().as_vec3();
        // The emitting side is that of the vertex normals, and varies if they disagree.
        let is_flipped = match mesh.normals.is_empty() {
            true => [flip_normal; 3],
            false => indices.map(|index| winding.dot(mesh.normals[index as usize]) < 0.0),
        };
        let normal = match is_flipped {
            [false, false, false] => Some(winding),
            [true, true, true] => Some(-winding),
            _ => None,
        };
        let centre = (0.5 * (a.min(b).min(c) + a.max(b).max(c))).as_vec3();
        let distances = corners.map(|corner| corner.distance(centre.as_dvec3()));
        Self {
            centre,
            radius: rounded_up(distances[0].max(distances[1]).max(distances[2])),
            normal: normal.filter(|normal| normal.is_normalized()),
            projected_fraction: 1.0,
        }
    }
}

/// Upper bound on the factor by which a linear map lengthens a vector, exact for rotations and scales: the
/// square root of the largest absolute column sum of MᵀM.
fn max_stretch(m: DMat3) -> f64 {
    let square = m.transpose() * m;
    let column_sums = square.abs().transpose() * DVec3::ONE;
    column_sums.max_element().sqrt()
}

/// Rounds to single precision, upwards.
fn rounded_up(x: f64) -> f32 {
    (x as f32).next_up()
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DQuat};

    use super::*;
    use crate::scene::TriangleMesh;

    #[test]
    fn a_triangle_emits_on_the_side_of_its_winding_or_its_vertex_normals() {
        let mut mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            indices: vec![[0, 1, 2]],
            ..TriangleMesh::default()
        };
        assert_eq!(ElementBounds::from_triangle(&mesh, 0, false).normal, Some(Vec3::Z));
        assert_eq!(ElementBounds::from_triangle(&mesh, 0, true).normal, Some(Vec3::NEG_Z));
        mesh.normals = vec![-Vec3::Z; 3];
        assert_eq!(ElementBounds::from_triangle(&mesh, 0, false).normal, Some(Vec3::NEG_Z));
        mesh.normals[1] = Vec3::Z;
        assert_eq!(ElementBounds::from_triangle(&mesh, 0, false).normal, None);
    }

    #[test]
    fn the_bounding_sphere_of_a_triangle_contains_its_corners() {
        let positions = vec![Vec3::new(1.0, 5.0, 2.0), Vec3::new(-3.0, 4.0, 2.5), Vec3::new(0.0, 0.1, 7.0)];
        let mesh = TriangleMesh { positions, indices: vec![[0, 1, 2]], ..TriangleMesh::default() };
        let ElementBounds { centre, radius, .. } = ElementBounds::from_triangle(&mesh, 0, false);
        let distance = mesh.positions.iter().map(|p| p.distance(centre)).fold(0.0, f32::max);
        assert!(distance <= radius && radius < distance * 1.001, "{distance} {radius}");
    }

    #[test]
    fn the_maximum_stretch_of_a_scale_is_its_largest_factor() {
        let rotated = DAffine3::from_quat(DQuat::from_rotation_x(1.0))
            * DAffine3::from_scale(DVec3::new(1.0, 3.0, 2.0));
        assert!((max_stretch(rotated.matrix3) - 3.0).abs() < 1e-12);
        let sheared = DMat3::from_cols(DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Z);
        let golden = 0.5 * (1.0 + 5.0f64.sqrt());
        assert!(max_stretch(sheared) >= golden && max_stretch(sheared) < 1.2 * golden);
    }
}
