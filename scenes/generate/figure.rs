//! Assets of `figure`: the seated figure, its pedestal, and the niche it sits in. A metre is a unit.

use glam::{DVec2, DVec3};

use crate::Asset;
use crate::mesh::Mesh;
use crate::seated;
use crate::solids::{lathe, line, rounded_box, spline};

/// Grid cell of the statue's mesh: about 90 000 triangles.
const CELL: f64 = 0.0098;

pub fn assets() -> Vec<Asset> {
    vec![
        Asset::new("figure/meshes/seated.ply", seated::mesh(CELL).ply()),
        Asset::new("figure/meshes/pedestal.ply", pedestal().ply()),
    ]
}

/// A round stone pedestal on a square foot, its top at height 0.
fn pedestal() -> Mesh {
    let v = DVec2::new;
    let shaft = [
        spline(&[v(0.60, -0.78), v(0.62, -0.74), v(0.60, -0.70), v(0.52, -0.66), v(0.48, -0.58)], 4),
        line((0.48, -0.58), (0.48, -0.18)),
        spline(&[v(0.48, -0.18), v(0.50, -0.12), v(0.56, -0.09), v(0.57, -0.05)], 4),
        spline(&[v(0.57, -0.05), v(0.578, -0.02), v(0.572, -0.004), v(0.56, 0.0)], 4),
        line((0.56, 0.0), (0.0, 0.0)),
    ];
    let mut mesh = lathe(&shaft, 72);
    mesh.append(rounded_box(DVec3::new(-0.66, -1.0, -0.66), DVec3::new(0.66, -0.78, 0.66), 0.015));
    mesh
}
