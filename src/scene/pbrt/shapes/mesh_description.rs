//! Meshes as files describe them, and their conversion to [`TriangleMesh`]: transformed in f64 and
//! validated.

use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};

use crate::scene::{MeshTangents, TriangleMesh};

/// A mesh in shape space, not yet validated.
#[derive(Debug, Default)]
pub struct MeshDescription {
    pub positions: Vec<DVec3>,
    /// Empty, or one for each position.
    pub normals: Vec<DVec3>,
    /// Empty, or one for each position.
    pub uvs: Vec<DVec2>,
    pub indices: Vec<[u32; 3]>,
    pub tangents: MeshTangents,
}

impl MeshDescription {
    /// Transforms the mesh, validates it and drops triangles without area.
    ///
    /// As in pbrt, normals determine the front of a triangle, and its corners keep their order, by which
    /// default texture coordinates are assigned. `flip_normal` says whether the front of a triangle
    /// without normals is opposite to the winding's normal, and `reverse` whether the given normals are
    /// reversed.
    ///
    /// # Errors
    /// One sentence, if a coordinate of a triangle is not finite, an index is out of range, or a list has the wrong
    /// length.
    pub fn bake(
        &self,
        transform: DAffine3,
        flip_normal: bool,
        reverse: bool,
    ) -> Result<TriangleMesh, String> {
        // Validate the vertices and indices
        let count = self.positions.len();
        for (name, length) in [("normals", self.normals.len()), ("uvs", self.uvs.len())] {
            if length != 0 && length != count {
                return Err(format!("{length} {name} for {count} vertices; expected none or as many"));
            }
        }
        let mut positions: Vec<Vec3> =
            self.positions.iter().map(|&p| transform.transform_point3(p).as_vec3()).collect();
        if let Some(index) = self.indices.as_flattened().iter().find(|&&index| index as usize >= count) {
            return Err(format!("index {index} of {count} vertices; expected 0 to {}", count as i64 - 1));
        }
        if positions.iter().any(|p| !p.is_finite()) {
            let mut corners = self.indices.as_flattened().iter().map(|&index| index as usize);
            if let Some(vertex) = corners.find(|&vertex| !positions[vertex].is_finite()) {
                return Err(format!("vertex {vertex} is not finite; expected finite coordinates"));
            }
            // No triangle has them
            positions.iter_mut().filter(|p| !p.is_finite()).for_each(|p| *p = Vec3::ZERO);
        }

        // Transform the normals and add the triangles
        let to_normal = transform.matrix3.inverse().transpose();
        let sign = if reverse { -1.0 } else { 1.0 };
        let normals: Vec<Vec3> =
            self.normals.iter().map(|&n| (sign * (to_normal * n)).normalize_or_zero().as_vec3()).collect();
        // Exporters write those of triangles without area in the texture as NaN
        let finite = |uv: Vec2| if uv.is_finite() { uv } else { Vec2::ZERO };
        let uvs = self.uvs.iter().map(|uv| finite(uv.as_vec2())).collect();
        let indices = Vec::with_capacity(self.indices.len());
        let mut mesh = TriangleMesh { positions, normals, uvs, indices, tangents: self.tangents };
        for &triangle in &self.indices {
            mesh.add(triangle, flip_normal);
        }
        Ok(mesh)
    }
}

impl TriangleMesh {
    /// Removes triangles with a coordinate of `limit` or more. Returns whether there were any.
    pub fn remove_triangles_beyond(&mut self, limit: f32) -> bool {
        let count = self.indices.len();
        let positions = &self.positions;
        let is_near = |&vertex: &u32| positions[vertex as usize].abs().max_element() < limit;
        self.indices.retain(|triangle| triangle.iter().all(is_near));
        self.indices.len() < count
    }

    /// Adds a triangle unless it has no area. Zero normals of its vertices are replaced by its own.
    fn add(&mut self, [a, b, c]: [u32; 3], flip_normal: bool) {
        let [pa, pb, pc] = [a, b, c].map(|i| self.positions[i as usize].as_dvec3());
        // The area of a small triangle may underflow in f32
        let Some(cross) = (pb - pa).cross(pc - pa).try_normalize() else { return };
        let normal = (if flip_normal { -cross } else { cross }).as_vec3();
        for vertex in [a, b, c] {
            if let Some(stored) = self.normals.get_mut(vertex as usize)
                && *stored == Vec3::ZERO
            {
                *stored = normal;
            }
        }
        self.indices.push([a, b, c]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> MeshDescription {
        MeshDescription {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            indices: vec![[0, 1, 2]],
            ..Default::default()
        }
    }

    #[test]
    fn a_distant_mesh_is_transformed_before_it_is_rounded() {
        let far = DVec3::new(1e7, 1e7, 1e7);
        let mut mesh = triangle();
        mesh.positions.iter_mut().for_each(|p| *p = *p * 1e-3 + far);
        let baked = mesh.bake(DAffine3::from_translation(-far), false, false).unwrap();
        assert!((baked.positions[1].x - 1e-3).abs() < 1e-8);
    }

    #[test]
    fn normals_follow_the_inverse_transpose() {
        let mut mesh = triangle();
        mesh.normals = vec![DVec3::new(1.0, 0.0, 1.0); 3];
        let baked = mesh.bake(DAffine3::from_scale(DVec3::new(2.0, 1.0, 1.0)), false, false).unwrap();
        assert!((baked.normals[0] - Vec3::new(1.0, 0.0, 2.0).normalize()).length() < 1e-6);
    }

    #[test]
    fn normals_leave_the_corners_in_their_order() {
        let mut mesh = triangle();
        mesh.normals = vec![-DVec3::Z; 3];
        for (flip_normal, reverse) in [(false, false), (true, true), (true, false)] {
            let baked = mesh.bake(DAffine3::IDENTITY, flip_normal, reverse).unwrap();
            assert_eq!(baked.indices, [[0, 1, 2]]);
            assert_eq!(baked.normals[0], if reverse { Vec3::Z } else { Vec3::NEG_Z });
        }
    }

    #[test]
    fn zero_normals_are_replaced_and_degenerate_triangles_dropped() {
        let mut mesh = triangle();
        mesh.normals = vec![DVec3::ZERO, DVec3::NAN, DVec3::Z];
        mesh.indices.push([0, 1, 1]);
        let baked = mesh.bake(DAffine3::IDENTITY, false, false).unwrap();
        assert_eq!(baked.normals, [Vec3::Z; 3]);
        assert_eq!(baked.indices, [[0, 1, 2]]);
    }

    #[test]
    fn uvs_that_are_not_finite_are_zero_and_so_are_vertices_of_no_triangle() {
        let mut mesh = triangle();
        mesh.positions.push(DVec3::INFINITY);
        mesh.uvs = vec![DVec2::ONE, DVec2::new(f64::NAN, 1.0), DVec2::X, DVec2::ONE];
        let baked = mesh.bake(DAffine3::IDENTITY, false, false).unwrap();
        assert_eq!((baked.uvs[1], baked.positions[3]), (Vec2::ZERO, Vec3::ZERO));
        assert_eq!(baked.indices, [[0, 1, 2]]);
    }

    #[test]
    fn non_finite_values_and_invalid_indices_are_errors() {
        let error = |change: fn(&mut MeshDescription)| {
            let mut mesh = triangle();
            change(&mut mesh);
            mesh.bake(DAffine3::IDENTITY, false, false).unwrap_err()
        };
        assert!(error(|m| m.positions[1].y = f64::NAN).contains("vertex 1"));
        assert!(error(|m| m.positions[2].y = 1e300).contains("vertex 2"));
        assert!(error(|m| m.indices[0][2] = 3).contains("index 3 of 3"));
        assert!(error(|m| m.uvs = vec![DVec2::ZERO]).contains("1 uvs for 3 vertices"));
    }
}
