//! `bilinearmesh`: bilinear patches as triangles.
//!
//! A parallelogram becomes two triangles, which are exact. Any other patch becomes a grid of
//! [`STEPS`] steps a side with the patch's normals; its error is at most 1/1024 of the patch's twist
//! (the distance between the midpoints of its diagonals). Patches of a large mesh, which are small, get fewer steps.

use std::ops::{Add, Mul};

use glam::{DVec2, DVec3};

use super::mesh_description::MeshDescription;
use super::triangle_grid::{MAX_TRIANGLES, grid_triangles};
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result};

/// Steps along each side of a patch that is not a parallelogram.
const STEPS: u32 = 16;
/// Triangles of a mesh with as many steps.
const MANY_TRIANGLES: usize = 1 << 22;
/// Largest twist of a parallelogram, as a fraction of its diagonal.
const FLAT: f64 = 1e-7;
/// Default (u, v) of the corners.
const CORNERS: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE];

impl SceneBuilder {
    /// The mesh of `bilinearmesh`.
    pub fn bilinear_mesh(&mut self, params: &ParameterDictionary) -> Result<MeshDescription> {
        let error = |message: String| ParseError::new(params.loc, message);
        // Read the vertices
        let positions = params
            .triples("P")?
            .ok_or_else(|| error("bilinear mesh without points; expected \"point3 P\"".into()))?;
        // pbrt samples emission by this image; the emission itself is the area light's
        params.get("emissionfilename");
        let normals = params.triples("N")?.unwrap_or_default();
        let normals = self.per_vertex(normals, "N", positions.len(), params);
        let uvs = params.pairs("uv")?.unwrap_or_default();
        let uvs = self.per_vertex(uvs, "uv", positions.len(), params);

        // Read the patches
        let patches = match self.indices::<4>(params)? {
            Some(patches) => patches,
            None if positions.len() == 4 => vec![[0, 1, 2, 3]],
            None => {
                return Err(error(
                    "bilinear mesh without \"integer indices\"; expected these, or exactly four points"
                        .into(),
                ));
            }
        };
        if let Some(index) = patches.as_flattened().iter().find(|&&i| i as usize >= positions.len()) {
            return Err(error(format!(
                "index {index} of {} vertices; expected a smaller index",
                positions.len()
            )));
        }

        // Tessellate them
        let steps = steps(patches.len());
        let mut mesh = MeshDescription::default();
        for patch in patches {
            let corners = patch.map(|index| index as usize);
            let given = |list: &[DVec3]| (!list.is_empty()).then(|| corners.map(|i| list[i]));
            add_patch(
                &mut mesh,
                corners.map(|i| positions[i]),
                given(&normals),
                if uvs.is_empty() { CORNERS } else { corners.map(|i| uvs[i]) },
                steps,
            );
            if mesh.indices.len() > MAX_TRIANGLES {
                let message = format!(
                    "bilinear mesh with too many patches; expected at most {MAX_TRIANGLES} triangles after tessellation"
                );
                return Err(error(message));
            }
        }
        Ok(mesh)
    }
}

/// Bilinear interpolation of four corner values at (s, t).
fn bilerp<V>([a, b, c, d]: [V; 4], s: f64, t: f64) -> V
where
    V: Mul<f64, Output = V> + Add<Output = V>,
{
    (a * (1.0 - s) + b * s) * (1.0 - t) + (c * (1.0 - s) + d * s) * t
}

/// Returns the steps along each side of the patches of a mesh.
fn steps(patches: usize) -> u32 {
    let affordable = (MANY_TRIANGLES as f64 / (2.0 * patches.max(1) as f64)).sqrt() as u32;
    affordable.clamp(1, STEPS)
}

/// Appends the triangles of one patch, of `most` steps along each side unless it is a parallelogram.
fn add_patch(
    mesh: &mut MeshDescription,
    corners: [DVec3; 4],
    normals: Option<[DVec3; 4]>,
    uvs: [DVec2; 4],
    most: u32,
) {
    let [a, b, c, d] = corners;
    let twist = (a + d - b - c).length();
    let steps = if twist <= FLAT * a.distance(d).max(b.distance(c)) { 1 } else { most };
    let first = mesh.positions.len() as u32;
    for row in 0..=steps {
        let t = f64::from(row) / f64::from(steps);
        for column in 0..=steps {
            let s = f64::from(column) / f64::from(steps);
            let along = (b - a) * (1.0 - t) + (d - c) * t;
            let across = (c - a) * (1.0 - s) + (d - b) * s;
            mesh.positions.push(bilerp(corners, s, t));
            mesh.normals.push(match normals {
                Some(normals) => bilerp(normals, s, t),
                None => along.cross(across),
            });
            mesh.uvs.push(bilerp(uvs, s, t));
        }
    }
    mesh.indices.extend(grid_triangles(steps, steps).iter().map(|triangle| triangle.map(|i| first + i)));
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
    fn a_rectangle_is_two_triangles() {
        let mesh = patch("\"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0]").unwrap();
        assert_eq!(mesh.indices, [[0, 1, 3], [0, 3, 2]]);
        assert_eq!(mesh.normals[0], glam::Vec3::Z);
        assert_eq!(mesh.uvs[3], glam::Vec2::ONE);
    }

    #[test]
    fn patches_of_a_large_mesh_get_fewer_steps() {
        assert_eq!([1, 1000, 8192].map(super::steps), [16; 3]);
        assert_eq!(super::steps(100_000), 4);
        assert_eq!(super::steps(usize::MAX), 1);
    }

    #[test]
    fn a_twisted_patch_follows_its_surface() {
        let mesh = patch("\"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]").unwrap();
        assert_eq!(mesh.indices.len(), 2 * 16 * 16);
        assert!(mesh.positions.iter().all(|p| (p.z - p.x * p.y).abs() < 1e-6));
    }

    #[test]
    fn invalid_patches_are_errors() {
        for parameters in [
            "",
            "\"point3 P\" [0 0 0 1 0 0 0 1 0]",
            "\"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1] \"integer indices\" [0 1 2 4]",
        ] {
            assert!(patch(parameters).is_err(), "{parameters}");
        }
    }
}
