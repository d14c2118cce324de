//! `trianglemesh`, `loopsubdiv`, and the vertex attributes of meshes.

use glam::DVec3;

use super::loop_subdivision;
use super::mesh_description::MeshDescription;
use super::triangle_grid::MAX_TRIANGLES;
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result};

/// Largest number of subdivision levels; ten levels turn each triangle into a million.
const MAX_LEVELS: u32 = 10;

impl SceneBuilder {
    /// The mesh of `trianglemesh`.
    pub fn triangle_mesh(&mut self, params: &ParameterDictionary) -> Result<MeshDescription> {
        let positions = required_positions(params)?;
        let indices = match self.indices::<3>(params)? {
            Some(indices) => indices,
            None if positions.len() == 3 => vec![[0, 1, 2]],
            None => {
                let message = "mesh without \"integer indices\"; expected these, or exactly three points";
                return Err(ParseError::new(params.loc, message));
            }
        };
        let uvs_name = if params.get("uv").is_some() { "uv" } else { "st" };
        let mut uvs = params.pairs(uvs_name)?.unwrap_or_default();
        if self.dialect.truncates_surplus_uvs() {
            uvs.truncate(positions.len());
        }
        let uvs = self.per_vertex(uvs, uvs_name, positions.len(), params);
        let normals = params.triples("N")?.unwrap_or_default();
        let normals = self.per_vertex(normals, "N", positions.len(), params);
        Ok(MeshDescription { positions, normals, uvs, indices, tangents: self.dialect.mesh_tangents() })
    }

    /// The mesh of `loopsubdiv`.
    pub fn loop_subdivided(&mut self, params: &ParameterDictionary) -> Result<MeshDescription> {
        let positions = required_positions(params)?;
        let Some(indices) = self.indices::<3>(params)? else {
            return Err(ParseError::new(
                params.loc,
                "loopsubdiv without \"integer indices\"; expected the vertices of triangles",
            ));
        };
        let name = if params.get("nlevels").is_some() { "nlevels" } else { "levels" };
        let levels = params.integer_in(name, 3, 0..=MAX_LEVELS)?;
        params.get("scheme");
        if indices.len() << (2 * levels) > MAX_TRIANGLES {
            let message = format!(
                "{} triangles subdivided {levels} times; expected at most {MAX_TRIANGLES} triangles as the result",
                indices.len()
            );
            return Err(ParseError::new(params.loc, message));
        }
        let (mesh, copies) = loop_subdivision::subdivide(&positions, &indices, levels)
            .map_err(|message| ParseError::new(params.loc, message))?;
        if copies > 0 {
            let message =
                "\"loopsubdiv\" with separate surfaces that meet at a vertex; each has a vertex of its own";
            self.warnings.add(params.loc, message);
        }
        Ok(MeshDescription { tangents: self.dialect.mesh_tangents(), ..mesh })
    }

    /// The vertex indices of faces with `N` corners. As in pbrt, an empty list counts as not given,
    /// and an incomplete face at the end is dropped.
    pub fn indices<const N: usize>(&mut self, params: &ParameterDictionary) -> Result<Option<Vec<[u32; N]>>> {
        let Some(numbers) = params.integers("indices")?.filter(|numbers| !numbers.is_empty()) else {
            return Ok(None);
        };
        let param = params.get("indices").expect("its numbers were just found");
        let (faces, rest) = numbers.as_chunks::<N>();
        if !rest.is_empty() {
            let message = format!("\"indices\" after the last multiple of {N} are ignored");
            self.warnings.add(param.loc, message);
        }
        if let Some(index) = numbers.iter().find(|&&index| index < 0.0 || index > f64::from(u32::MAX)) {
            return Err(param.error(index, "the number of a vertex"));
        }
        Ok(Some(faces.iter().map(|face| face.map(|index| index as u32)).collect()))
    }

    /// A vertex attribute called `name`. As in pbrt, a list of the wrong length is dropped.
    pub fn per_vertex<T>(
        &mut self,
        list: Vec<T>,
        name: &str,
        vertices: usize,
        params: &ParameterDictionary,
    ) -> Vec<T> {
        if list.is_empty() || list.len() == vertices {
            return list;
        }
        let loc = params.get(name).map_or(params.loc, |param| param.loc);
        self.warnings.add(loc, format!("\"{name}\" does not match the number of points and is ignored"));
        Vec::new()
    }
}

/// The points of a mesh.
fn required_positions(params: &ParameterDictionary) -> Result<Vec<DVec3>> {
    let positions = params.triples("P")?;
    positions.ok_or_else(|| ParseError::new(params.loc, "mesh without points; expected \"point3 P\""))
}
