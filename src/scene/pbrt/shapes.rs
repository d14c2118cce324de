//! Shapes.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DVec2, DVec3};

use super::directives::Statement;
use super::lights::brightened;
use super::mesh::MeshDescription;
use super::objects::Placement;
use super::params::{ParamType, Params};
use super::state::{Emission, Reader};
use super::{Fault, Result, curve, loop_subdivision, ply, revolution};
use crate::scene::material::MaterialKind;
use crate::scene::shape::LARGEST_COORDINATE;
use crate::scene::texture::{FloatTextureId, Texture};
use crate::scene::{Disk, Primitive, Shape, Sphere};

/// Levels of subdivision: ten make a million triangles of each.
const MAX_LEVELS: u32 = 10;
/// Most heights along a side of a height field.
const MAX_GRID: u32 = 1 << 14;
/// Most triangles that one shape of something else may become: some gigabytes while it does.
pub(super) const MAX_TRIANGLES: usize = 1 << 24;

impl Reader {
    pub fn shape(&mut self, statement: &Statement) -> Result<()> {
        let kind = statement.strings[0].as_str();
        let params = &*self.params_for("shape", statement);
        let fault = |message: String| Fault::new(statement.place, message);
        match kind {
            "sphere" => self.sphere(params)?,
            "disk" => self.disk(params)?,
            "trianglemesh" => {
                let mesh = self.triangle_mesh(params)?;
                self.mesh(params, &mesh, fault)?;
            }
            "loopsubdiv" => {
                let mesh = self.loop_subdivided(params)?;
                self.mesh(params, &mesh, fault)?;
            }
            "plymesh" => {
                let Some(name) = params.string("filename")? else {
                    return Err(fault(
                        "plymesh without a file; \"string filename\" would be accepted".into(),
                    ));
                };
                let path = self.resolve_content(name);
                let named = |message: String| fault(format!("mesh \"{}\": {message}", path.display()));
                let mesh = ply::read(&path)
                    .map_err(|message| named(format!("{message}; a sound PLY file would be accepted")))?;
                self.mesh(params, &mesh, named)?;
            }
            "bilinearmesh" => {
                let mesh = self.bilinear_mesh(params)?;
                self.mesh(params, &mesh, fault)?;
            }
            "curve" => {
                if curve::is_flat(params)? {
                    self.warnings.add(params.place, "curves of type \"flat\" are shaded as round ones");
                }
                self.mesh(params, &curve::mesh(params)?, fault)?
            }
            "cylinder" | "cone" | "paraboloid" | "hyperboloid" => {
                self.mesh(params, &revolution::mesh(kind, params)?, fault)?;
            }
            "heightfield" => self.mesh(params, &height_field(params)?, fault)?,
            "nurbs" => {
                self.warnings.add(statement.place, format!("shape \"{kind}\" is left out"));
                statement.params.mark_all_used();
            }
            other => {
                return Err(fault(format!(
                    "shape \"{other}\"; sphere, disk, cylinder, trianglemesh, plymesh, bilinearmesh, curve and \
                     loopsubdiv are accepted"
                )));
            }
        }
        statement.params.mark_used_in(params);
        Ok(())
    }

    fn sphere(&mut self, params: &Params) -> Result<()> {
        let radius = params.positive_or("radius", 1.0)?;
        let z_min = params.float_or("zmin", -radius)?.clamp(-radius, radius);
        let z_max = params.float_or("zmax", radius)?.clamp(-radius, radius);
        let phi_max = phi_max(params)?;
        self.add(params, DVec3::ZERO, |to_object| {
            Shape::Sphere(Sphere {
                to_object,
                radius: radius as f32,
                z_min: z_min.min(z_max) as f32,
                z_max: z_min.max(z_max) as f32,
                phi_max,
            })
        })
    }

    fn disk(&mut self, params: &Params) -> Result<()> {
        let radius = params.positive_or("radius", 1.0)?;
        let inner_radius = params.float_or("innerradius", 0.0)?.clamp(0.0, radius);
        let height = params.float_or("height", 0.0)?;
        let phi_max = phi_max(params)?;
        self.add(params, DVec3::new(0.0, 0.0, height), |to_object| {
            Shape::Disk(Disk {
                to_object,
                height: height as f32,
                radius: radius as f32,
                inner_radius: inner_radius as f32,
                phi_max,
            })
        })
    }

    fn add(&mut self, params: &Params, reference: DVec3, make: impl FnOnce(DAffine3) -> Shape) -> Result<()> {
        let Placement { group, to_group } = self.place_shape(reference, params.place)?;
        let flip_normal = self.state.reverse_orientation != mirrors(to_group);
        let shape = make(to_group);
        if !shape.reach().is_some_and(|reach| reach < LARGEST_COORDINATE) {
            let message = format!("a shape that reaches further than {LARGEST_COORDINATE:e} is left out");
            self.warnings.add(params.place, message);
            return Ok(());
        }
        self.add_primitive(params, group, shape, flip_normal)
    }

    /// Adds a mesh; `fault` says whose fault it is if there is something wrong with it.
    fn mesh(
        &mut self,
        params: &Params,
        mesh: &MeshDescription,
        fault: impl Fn(String) -> Fault,
    ) -> Result<()> {
        let reference = mesh.positions.first().copied().filter(|p| p.is_finite()).unwrap_or_default();
        let Placement { group, to_group } = self.place_shape(reference, params.place)?;
        let reverse = self.state.reverse_orientation;
        let flip_normal = reverse != mirrors(to_group);
        let mut baked = mesh.bake(to_group, flip_normal, reverse).map_err(fault)?;
        if baked.leave_out_beyond(LARGEST_COORDINATE) {
            let message =
                format!("triangles of a mesh that reach further than {LARGEST_COORDINATE:e} are left out");
            self.warnings.add(params.place, message);
        }
        if baked.indices.is_empty() {
            self.warnings.add(params.place, "a mesh without any triangle that has an area is left out");
            return Ok(());
        }
        self.add_primitive(params, group, Shape::Mesh(Arc::new(baked)), flip_normal)
    }

    fn add_primitive(
        &mut self,
        params: &Params,
        group: usize,
        shape: Shape,
        flip_normal: bool,
    ) -> Result<()> {
        let alpha = self.alpha(params)?;
        let material = self.material_of_shape(params)?;
        let mut area_light = self.state.area_light;
        if area_light.is_some() && group != 0 {
            self.warnings.add(params.place, "area lights on moving or instanced shapes are not simulated");
            area_light = None;
        }
        if area_light.is_some() && matches!(self.materials[material.0 as usize].kind, MaterialKind::Interface)
        {
            // As in pbrt-v4: a boundary without a surface has nothing that could emit.
            self.warnings.add(params.place, "an area light on the material \"interface\" is left out");
            area_light = None;
        }
        let area_light = match area_light {
            Some(Emission { mut light, power: Some(power) }) => {
                let sides = if light.two_sided { 2.0 } else { 1.0 };
                light.radiance =
                    brightened(light.radiance, power / (PI * sides * shape.area()), params.place)?;
                if light.image.is_some() {
                    self.powered_images.push((self.groups[group].primitives.len(), params.place));
                }
                Some(light)
            }
            emission => emission.map(|emission| emission.light),
        };
        self.reading.shapes += 1;
        if let Shape::Mesh(mesh) = &shape {
            self.reading.triangles += mesh.indices.len();
        }
        (self.report)(self.reading);
        self.groups[group].primitives.push(Primitive { shape, material, alpha, area_light, flip_normal });
        Ok(())
    }

    fn triangle_mesh(&mut self, params: &Params) -> Result<MeshDescription> {
        let positions = required_positions(params)?;
        let indices = match self.indices::<3>(params)? {
            Some(indices) => indices,
            None if positions.len() == 3 => vec![[0, 1, 2]],
            None => {
                let message =
                    "a mesh without \"integer indices\"; these, or exactly three points, would be accepted";
                return Err(Fault::new(params.place, message));
            }
        };
        let uvs_name = if params.get("uv").is_some() { "uv" } else { "st" };
        let mut uvs = params.pairs(uvs_name)?.unwrap_or_default();
        if self.dialect.surplus_uvs_are_cut() {
            uvs.truncate(positions.len());
        }
        let uvs = self.one_each(uvs, uvs_name, positions.len(), params);
        let normals = params.triples("N")?.unwrap_or_default();
        let normals = self.one_each(normals, "N", positions.len(), params);
        Ok(MeshDescription { positions, normals, uvs, indices })
    }

    fn loop_subdivided(&mut self, params: &Params) -> Result<MeshDescription> {
        let positions = required_positions(params)?;
        let Some(indices) = self.indices::<3>(params)? else {
            return Err(Fault::new(
                params.place,
                "loopsubdiv without \"integer indices\"; these would be accepted",
            ));
        };
        let name = if params.get("nlevels").is_some() { "nlevels" } else { "levels" };
        let levels = params.integer_in(name, 3, 0..=MAX_LEVELS)?;
        params.get("scheme");
        if indices.len() << (2 * levels) > MAX_TRIANGLES {
            let message =
                format!("{} triangles, {levels} times subdivided; less would be accepted", indices.len());
            return Err(Fault::new(params.place, message));
        }
        loop_subdivision::subdivide(&positions, &indices, levels)
            .map_err(|message| Fault::new(params.place, message))
    }

    /// The vertices of faces of `N` corners. An empty list is none, and what is left over at its end is passed over,
    /// as in pbrt.
    pub fn indices<const N: usize>(&mut self, params: &Params) -> Result<Option<Vec<[u32; N]>>> {
        let Some(numbers) = params.integers("indices")?.filter(|numbers| !numbers.is_empty()) else {
            return Ok(None);
        };
        let param = params.get("indices").expect("its numbers were just found");
        let (faces, rest) = numbers.as_chunks::<N>();
        if !rest.is_empty() {
            let message = format!("\"indices\" beyond the last multiple of {N} are left out");
            self.warnings.add(param.place, message);
        }
        if let Some(index) = numbers.iter().find(|&&index| index < 0.0 || index > f64::from(u32::MAX)) {
            return Err(param.fault(index, "the number of a vertex"));
        }
        Ok(Some(faces.iter().map(|face| face.map(|index| index as u32)).collect()))
    }

    /// What a mesh has at its vertices; nothing, as in pbrt, if that is not one for each.
    pub fn one_each<T>(&mut self, list: Vec<T>, name: &str, vertices: usize, params: &Params) -> Vec<T> {
        if list.is_empty() || list.len() == vertices {
            return list;
        }
        let place = params.get(name).map_or(params.place, |param| param.place);
        self.warnings.add(place, format!("\"{name}\" of another number than the points is left out"));
        Vec::new()
    }

    /// Opacity: a texture or a number, unless it is opaque.
    fn alpha(&mut self, params: &Params) -> Result<Option<FloatTextureId>> {
        let Some(param) = params.get("alpha") else { return Ok(None) };
        let id = match param.kind {
            ParamType::Texture => self.float_texture_or(params, "alpha", 1.0)?,
            _ => {
                let alpha = params.float_or("alpha", 1.0)? as f32;
                self.textures.add(Texture::Constant(alpha))
            }
        };
        let id =
            if self.dialect.alpha_is_a_mask() { self.textures.add(Texture::<f32>::NotZero(id)) } else { id };
        Ok((self.textures.constant_float(id) != Some(1.0)).then_some(id))
    }
}

/// Whether a transform changes handedness.
fn mirrors(transform: DAffine3) -> bool {
    transform.matrix3.determinant() < 0.0
}

fn phi_max(params: &Params) -> Result<f32> {
    let degrees = params.positive_or("phimax", 360.0)?.min(360.0);
    Ok(degrees.to_radians() as f32)
}

/// Heights over a grid of the unit square, as pbrt-v2 and v3 have them.
fn height_field(params: &Params) -> Result<MeshDescription> {
    let side = |name| params.integer_in(name, 2, 2..=MAX_GRID);
    let (columns, rows) = (side("nu")?, side("nv")?);
    let heights = params.floats("Pz")?.unwrap_or_default();
    if heights.len() as u64 != u64::from(columns) * u64::from(rows) {
        let message = format!("{} heights; {columns} times {rows} (nu, nv) would be accepted", heights.len());
        return Err(Fault::new(params.place, message));
    }
    let share = |i: u32, count: u32| f64::from(i) / f64::from(count - 1);
    let uvs: Vec<DVec2> = (0..rows)
        .flat_map(|y| (0..columns).map(move |x| DVec2::new(share(x, columns), share(y, rows))))
        .collect();
    let positions = uvs.iter().zip(heights).map(|(uv, &height)| uv.extend(height)).collect();
    let indices = revolution::grid(rows - 1, columns - 1);
    Ok(MeshDescription { positions, normals: Vec::new(), uvs, indices })
}

fn required_positions(params: &Params) -> Result<Vec<DVec3>> {
    let positions = params.triples("P")?;
    positions.ok_or_else(|| Fault::new(params.place, "a mesh without points; \"point3 P\" would be accepted"))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
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
