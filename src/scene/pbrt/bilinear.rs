//! Bilinear patches as triangles: two for a parallelogram, which they are exactly; otherwise a
//! grid of [`STEPS`] steps a side with the patch's own normals, off by at most 1/1024 of the
//! patch's twist (the distance between the middles of its diagonals).

use glam::{DVec2, DVec3};

use super::mesh::MeshDescription;
use super::params::Params;
use super::revolution::grid;
use super::shapes::MAX_TRIANGLES;
use super::state::Reader;
use super::{Fault, Result};

/// Steps along each side of a patch that is no parallelogram.
const STEPS: u32 = 16;
/// Largest twist of a parallelogram, of its diagonal.
const FLAT: f64 = 1e-7;
/// Corners in (u, v) in the order of their indices.
const CORNERS: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE];

impl Reader {
    /// The mesh of `bilinearmesh`.
    pub fn bilinear_mesh(&mut self, params: &Params) -> Result<MeshDescription> {
        let fault = |message: String| Fault::new(params.place, message);
        let positions = params
            .triples("P")?
            .ok_or_else(|| fault("a bilinear mesh without points; \"point3 P\" would be accepted".into()))?;
        // An image by which pbrt samples what the patch emits; what it emits is said elsewhere.
        params.get("emissionfilename");
        let normals = params.triples("N")?.unwrap_or_default();
        let normals = self.one_each(normals, "N", positions.len(), params);
        let uvs = params.pairs("uv")?.unwrap_or_default();
        let uvs = self.one_each(uvs, "uv", positions.len(), params);
        let patches = match self.indices::<4>(params)? {
            Some(patches) => patches,
            None if positions.len() == 4 => vec![[0, 1, 2, 3]],
            None => {
                return Err(fault(
                    "a bilinear mesh without \"integer indices\"; these, or four points, would be accepted"
                        .into(),
                ));
            }
        };
        if let Some(index) = patches.as_flattened().iter().find(|&&i| i as usize >= positions.len()) {
            return Err(fault(format!("index {index} of {} vertices", positions.len())));
        }
        let mut mesh = MeshDescription::default();
        for patch in patches {
            let corners = patch.map(|index| index as usize);
            let given = |list: &[DVec3]| (!list.is_empty()).then(|| corners.map(|i| list[i]));
            add(
                &mut mesh,
                corners.map(|i| positions[i]),
                given(&normals),
                if uvs.is_empty() { CORNERS } else { corners.map(|i| uvs[i]) },
            );
            if mesh.indices.len() > MAX_TRIANGLES {
                let message = format!(
                    "patches that become more than {MAX_TRIANGLES} triangles; fewer would be accepted"
                );
                return Err(fault(message));
            }
        }
        Ok(mesh)
    }
}

/// The value at (s, t) of what has these values at the corners.
fn interpolated<V>([a, b, c, d]: [V; 4], s: f64, t: f64) -> V
where
    V: std::ops::Mul<f64, Output = V> + std::ops::Add<Output = V>,
{
    (a * (1.0 - s) + b * s) * (1.0 - t) + (c * (1.0 - s) + d * s) * t
}

fn add(mesh: &mut MeshDescription, corners: [DVec3; 4], normals: Option<[DVec3; 4]>, uvs: [DVec2; 4]) {
    let [a, b, c, d] = corners;
    let twist = (a + d - b - c).length();
    let steps = if twist <= FLAT * a.distance(d).max(b.distance(c)) { 1 } else { STEPS };
    let first = mesh.positions.len() as u32;
    for row in 0..=steps {
        let t = f64::from(row) / f64::from(steps);
        for column in 0..=steps {
            let s = f64::from(column) / f64::from(steps);
            let along = (b - a) * (1.0 - t) + (d - c) * t;
            let across = (c - a) * (1.0 - s) + (d - b) * s;
            mesh.positions.push(interpolated(corners, s, t));
            mesh.normals.push(match normals {
                Some(normals) => interpolated(normals, s, t),
                None => along.cross(across),
            });
            mesh.uvs.push(interpolated(uvs, s, t));
        }
    }
    mesh.indices.extend(grid(steps, steps).iter().map(|triangle| triangle.map(|i| first + i)));
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scene::pbrt::read_str;
    use crate::scene::{Shape, TriangleMesh};

    fn patch(parameters: &str) -> Result<TriangleMesh, String> {
        let text = format!("WorldBegin Shape \"bilinearmesh\" {parameters}");
        let scene = read_str(&text, Path::new("")).map_err(|error| error.to_string())?;
        match &scene.primitives[0].shape {
            Shape::Mesh(mesh) => Ok((**mesh).clone()),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_rectangle_is_two_triangles_in_the_order_of_its_corners() {
        let mesh = patch("\"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0]").unwrap();
        assert_eq!(mesh.indices, [[0, 1, 3], [0, 3, 2]]);
        assert_eq!(mesh.normals[0], glam::Vec3::Z);
        assert_eq!(mesh.uvs[3], glam::Vec2::ONE);
    }

    #[test]
    fn a_twisted_patch_follows_its_surface() {
        let mesh = patch("\"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]").unwrap();
        assert_eq!(mesh.indices.len(), 2 * 16 * 16);
        assert!(mesh.positions.iter().all(|p| (p.z - p.x * p.y).abs() < 1e-6));
    }

    #[test]
    fn patches_that_are_none_are_errors() {
        for parameters in [
            "",
            "\"point3 P\" [0 0 0 1 0 0 0 1 0]",
            "\"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1] \"integer indices\" [0 1 2 4]",
        ] {
            assert!(patch(parameters).is_err(), "{parameters}");
        }
    }
}
