//! `heightfield`: heights over a grid of the unit square (pbrt-v2 and v3).

use glam::DVec2;

use super::mesh_description::MeshDescription;
use super::triangle_grid::grid_triangles;
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result};

/// Largest number of heights along a side.
const MAX_GRID: u32 = 1 << 14;

/// The mesh of `heightfield`.
pub fn mesh(params: &ParameterDictionary) -> Result<MeshDescription> {
    let side = |name| params.integer_in(name, 2, 2..=MAX_GRID);
    let (columns, rows) = (side("nu")?, side("nv")?);
    let heights = params.floats("Pz")?.unwrap_or_default();
    if heights.len() as u64 != u64::from(columns) * u64::from(rows) {
        let message =
            format!("\"Pz\" has {} heights; expected {columns} times {rows} (nu, nv)", heights.len());
        return Err(ParseError::new(params.loc, message));
    }
    let fraction = |i: u32, count: u32| f64::from(i) / f64::from(count - 1);
    let uvs: Vec<DVec2> = (0..rows)
        .flat_map(|y| (0..columns).map(move |x| DVec2::new(fraction(x, columns), fraction(y, rows))))
        .collect();
    let positions = uvs.iter().zip(heights).map(|(uv, &height)| uv.extend(height)).collect();
    let indices = grid_triangles(rows - 1, columns - 1);
    Ok(MeshDescription { positions, uvs, indices, ..MeshDescription::default() })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scene::Shape;
    use crate::scene::pbrt::read_str;

    #[test]
    fn a_height_field_is_a_grid_over_the_unit_square() {
        let text =
            "WorldBegin Shape \"heightfield\" \"integer nu\" 3 \"integer nv\" 2 \"float Pz\" [0 1 2 3 4 5]";
        let scene = read_str(text, Path::new("")).unwrap();
        let Shape::Mesh(mesh) = &scene.primitives[0].shape else { panic!() };
        assert_eq!((mesh.indices.len(), mesh.positions[4]), (4, glam::Vec3::new(0.5, 1.0, 4.0)));
        assert!(read_str(&text.replace("[0 ", "["), Path::new("")).is_err());
    }
}
