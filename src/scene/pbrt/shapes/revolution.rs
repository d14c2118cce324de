//! Quadrics of revolution (cylinder, cone, paraboloid, hyperboloid) as triangle meshes with the exact
//! surface's normals.
//!
//! A full turn has [`TURN_STEPS`] steps: no point is further than 7.5·10⁻⁵ of the radius from the
//! surface.

use std::f64::consts::PI;

use glam::{DMat3, DVec2, DVec3};

use super::mesh_description::MeshDescription;
use super::triangle_grid::grid_triangles;
use crate::scene::pbrt::parser::{ParameterDictionary, ParseError, Result};

/// Steps of φ in a full turn.
const TURN_STEPS: f64 = 256.0;
/// Steps of v along a curved profile.
const CURVED_STEPS: u32 = 64;

/// A profile curve for v in [0, 1]: a point and its derivative with respect to v.
type Profile<'l> = &'l dyn Fn(f64) -> (DVec3, DVec3);

/// The mesh of the shape type `kind`, one of the four.
pub fn mesh(kind: &str, params: &ParameterDictionary) -> Result<MeshDescription> {
    // Read the extent
    let radius = params.positive_or("radius", 1.0)?;
    let phi_max = params.positive_or("phimax", 360.0)?.min(360.0).to_radians();
    let (z_min, z_max) = match kind {
        "paraboloid" => (params.float_or("zmin", 0.0)?.max(0.0), params.positive_or("zmax", 1.0)?),
        "cylinder" => (params.float_or("zmin", -1.0)?, params.float_or("zmax", 1.0)?),
        _ => (0.0, 1.0),
    };
    let (z_min, z_max) = (z_min.min(z_max), z_min.max(z_max));
    let height = z_max - z_min;

    // Revolve the profile
    Ok(match kind {
        "cylinder" => {
            let line = |v: f64| (DVec3::new(radius, 0.0, z_min + v * height), DVec3::Z * height);
            revolve(&line, 1, phi_max)
        }
        "cone" => {
            let height = params.positive_or("height", 1.0)?;
            let line =
                |v: f64| (DVec3::new(radius * (1.0 - v), 0.0, v * height), DVec3::new(-radius, 0.0, height));
            revolve(&line, 1, phi_max)
        }
        "paraboloid" => {
            let line = |v: f64| {
                let z = z_min + v * height;
                let r = radius * (z / z_max).sqrt();
                // The slope is infinite at the apex, where the tangent is radial
                let slope = if r > 0.0 { radius * radius / (2.0 * z_max * r) } else { 1.0 };
                let rise = if r > 0.0 { height } else { 0.0 };
                (DVec3::new(r, 0.0, z), DVec3::new(slope * height, 0.0, rise))
            };
            revolve(&line, CURVED_STEPS, phi_max)
        }
        _ => {
            let p1 = params.triple_or("p1", DVec3::ZERO)?;
            let p2 = params.triple_or("p2", DVec3::ONE)?;
            if p1 == p2 {
                let message = "hyperboloid with p1 equal to p2; expected two different points";
                return Err(ParseError::new(params.loc, message));
            }
            revolve(&|v: f64| (p1.lerp(p2, v), p2 - p1), CURVED_STEPS, phi_max)
        }
    })
}

/// The surface that a profile sweeps about the z axis by `phi_max` radians, in `rows` steps of v.
fn revolve(profile: Profile, rows: u32, phi_max: f64) -> MeshDescription {
    let columns = (TURN_STEPS * phi_max / (2.0 * PI)).ceil().max(1.0) as u32;
    let mut mesh = MeshDescription::default();
    for row in 0..=rows {
        let v = f64::from(row) / f64::from(rows);
        let (point, along) = profile(v);
        for column in 0..=columns {
            let u = f64::from(column) / f64::from(columns);
            let turn = DMat3::from_rotation_z(u * phi_max);
            // On the axis, use the tangent of a point nearby
            let around = if point.truncate() == DVec2::ZERO { DVec3::Y } else { DVec3::Z.cross(point) };
            mesh.positions.push(turn * point);
            mesh.normals.push(turn * around.cross(along));
            mesh.uvs.push(DVec2::new(u, v));
        }
    }
    mesh.indices = grid_triangles(rows, columns);
    mesh
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::pbrt::read_str;
    use crate::scene::{Shape, TriangleMesh};

    fn shape(text: &str) -> TriangleMesh {
        let scene = read_str(&format!("WorldBegin Shape {text}"), std::path::Path::new("")).unwrap();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        match &scene.primitives[0].shape {
            Shape::Mesh(mesh) => (**mesh).clone(),
            other => panic!("{other:?}"),
        }
    }

    fn area(mesh: &TriangleMesh) -> f64 {
        let area = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|i| mesh.positions[i as usize].as_dvec3());
            (b - a).cross(c - a).length() / 2.0
        };
        mesh.indices.iter().map(|&triangle| area(triangle)).sum()
    }

    #[test]
    fn areas_are_those_of_the_exact_surfaces() {
        let root = 2f64.sqrt();
        let cases = [
            ("\"cylinder\" \"float radius\" 2 \"float zmin\" 0 \"float zmax\" 3", 12.0 * PI),
            ("\"cylinder\" \"float phimax\" 90", PI),
            ("\"cone\"", PI * root),
            // π / 6 (5√5 − 1) for r² = z up to 1.
            ("\"paraboloid\"", PI / 6.0 * (5.0 * 5f64.sqrt() - 1.0)),
            ("\"hyperboloid\" \"point3 p1\" [1 0 0] \"point3 p2\" [1 0 2]", 4.0 * PI),
        ];
        for (text, expected) in cases {
            let found = area(&shape(text));
            assert!((found / expected - 1.0).abs() < 2e-3, "{text}: {found} {expected}");
        }
    }

    #[test]
    fn normals_point_away_from_the_axis_and_fit_the_triangles() {
        for text in ["\"cylinder\"", "\"cone\"", "\"paraboloid\""] {
            let mesh = shape(text);
            for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
                let away = p.truncate().dot(n.truncate());
                assert!((n.length() - 1.0).abs() < 1e-4 && away >= -1e-5, "{text}: {p} {n}");
            }
            for [a, b, c] in mesh.indices.iter().map(|t| t.map(|i| i as usize)) {
                let normal =
                    (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
                assert!(normal.dot(mesh.normals[a] + mesh.normals[b] + mesh.normals[c]) > 0.0, "{text}");
            }
        }
    }

    #[test]
    fn a_grid_has_its_front_towards_the_viewer() {
        let mesh = MeshDescription {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)],
            indices: grid_triangles(1, 1),
            ..Default::default()
        };
        let baked = mesh.bake(DAffine3::IDENTITY, false, false).unwrap();
        assert!((area(&baked) - 1.0).abs() < 1e-6);
    }
}
