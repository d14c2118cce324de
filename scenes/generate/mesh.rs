//! Triangle meshes, and their binary PLY files.

use glam::{DAffine3, DVec2, DVec3};

/// Triangles with a normal for each vertex.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub positions: Vec<DVec3>,
    /// As many as positions, of unit length.
    pub normals: Vec<DVec3>,
    /// As many as positions, or none.
    pub uvs: Vec<DVec2>,
    /// Counter-clockwise about the outward normal, in right-handed reading.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// One mesh of several. All have texture coordinates, or none has.
    pub fn union(parts: impl IntoIterator<Item = Mesh>) -> Mesh {
        let mut whole = Mesh::default();
        for part in parts {
            whole.append(part);
        }
        whole
    }

    /// Adds the triangles of another mesh.
    pub fn append(&mut self, other: Mesh) {
        debug_assert!(self.positions.is_empty() || self.uvs.is_empty() == other.uvs.is_empty());
        let offset = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.uvs.extend(other.uvs);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|index| index + offset)));
    }

    /// The mesh moved. The transform keeps handedness.
    pub fn transformed(mut self, transform: DAffine3) -> Mesh {
        let normal_matrix = transform.matrix3.inverse().transpose();
        for position in &mut self.positions {
            *position = transform.transform_point3(*position);
        }
        for normal in &mut self.normals {
            *normal = (normal_matrix * *normal).normalize();
        }
        self
    }

    pub fn translated(self, x: f64, y: f64, z: f64) -> Mesh {
        self.transformed(DAffine3::from_translation(DVec3::new(x, y, z)))
    }

    /// A flat quadrilateral; its corners run counter-clockwise seen from the side of the normal.
    pub fn add_quad(&mut self, corners: [DVec3; 4], uvs: [DVec2; 4]) {
        let normal = (corners[2] - corners[0]).cross(corners[3] - corners[1]).normalize();
        self.add_smooth_quad(corners, [normal; 4], uvs);
    }

    /// A quadrilateral with given normals.
    pub fn add_smooth_quad(&mut self, corners: [DVec3; 4], normals: [DVec3; 4], uvs: [DVec2; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.normals.extend(normals);
        self.uvs.extend(uvs);
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    /// The file's bytes: `binary_little_endian` PLY, positions, normals and, if any, u and v.
    pub fn ply(&self) -> Vec<u8> {
        let uv_properties = if self.uvs.is_empty() { "" } else { "property float u\nproperty float v\n" };
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\n\
             property float x\nproperty float y\nproperty float z\n\
             property float nx\nproperty float ny\nproperty float nz\n{uv_properties}\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.positions.len(),
            self.triangles.len(),
        );
        let mut bytes = header.into_bytes();
        let mut push = |value: f64| bytes.extend((value as f32).to_le_bytes());
        for (index, (position, normal)) in self.positions.iter().zip(&self.normals).enumerate() {
            position.to_array().into_iter().chain(normal.to_array()).for_each(&mut push);
            if let Some(uv) = self.uvs.get(index) {
                uv.to_array().into_iter().for_each(&mut push);
            }
        }
        for triangle in &self.triangles {
            bytes.push(3);
            bytes.extend(triangle.iter().flat_map(|index| index.to_le_bytes()));
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quad() -> Mesh {
        let mut mesh = Mesh::default();
        let corners = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        mesh.add_quad(corners, [DVec2::ZERO; 4]);
        mesh
    }

    #[test]
    fn a_ply_file_has_the_length_its_header_promises() {
        let bytes = quad().ply();
        let header = String::from_utf8_lossy(&bytes).find("end_header\n").expect("has a header") + 11;
        assert_eq!(bytes.len() - header, 4 * 8 * 4 + 2 * 13);
    }

    #[test]
    fn counter_clockwise_corners_face_the_viewer() {
        assert_eq!(quad().normals, [DVec3::Z; 4]);
    }

    #[test]
    fn joined_meshes_keep_their_own_vertices() {
        let both = Mesh::union([quad(), quad().translated(0.0, 0.0, 1.0)]);
        assert_eq!(both.triangles[2], [4, 5, 6]);
        assert_eq!(both.positions[4], DVec3::Z);
    }
}
