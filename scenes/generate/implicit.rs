//! Meshes of implicit surfaces by surface nets (Gibson 1998): one vertex for each grid cell that the
//! surface crosses, moved onto the surface along the gradient; two triangles for each crossed edge.
//! Normals are gradients of the field, so that they carry detail finer than the grid.

use std::collections::HashMap;

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use crate::mesh::Mesh;

/// Cells along the side of a block that is skipped as a whole where the surface is far.
const BLOCK: i32 = 8;
/// Blocks are skipped where the field exceeds their half diagonal times this: fields made by
/// blending and displacing are not quite distances.
const DISTANCE_SAFETY: f64 = 1.6;
/// Steps of Newton's method that bring a vertex onto the surface.
const NEWTON_STEPS: usize = 4;
/// Length over which the gradient is taken, in cells.
const GRADIENT_STEP: f64 = 0.05;

/// Meshes the surface `field` = 0 (negative inside) within a box. The box contains the surface.
pub fn polygonise(field: impl Fn(DVec3) -> f64 + Sync, low: DVec3, high: DVec3, cell: f64) -> Mesh {
    let size = ((high - low) / cell).ceil().as_ivec3();
    let at = |grid: IVec3| low + grid.as_dvec3() * cell;
    let gradient = |p: DVec3| {
        let h = GRADIENT_STEP * cell;
        let slope = |axis: DVec3| (field(p + axis * h) - field(p - axis * h)) / (2.0 * h);
        DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))
    };

    // Find the cells that the surface crosses, with their vertices.
    let blocks = size / BLOCK + 1;
    let crossed: Vec<Vec<CrossedCell>> = (0..blocks.x * blocks.y * blocks.z)
        .into_par_iter()
        .map(|block| {
            let origin =
                IVec3::new(block % blocks.x, block / blocks.x % blocks.y, block / (blocks.x * blocks.y));
            crossed_cells(&field, &gradient, &at, origin * BLOCK, cell)
        })
        .collect();
    let cells: Vec<CrossedCell> = crossed.into_iter().flatten().collect();
    let index: HashMap<IVec3, u32> = cells.iter().enumerate().map(|(i, c)| (c.grid, i as u32)).collect();

    // Join the four cells around each crossed edge.
    let mut mesh = Mesh::default();
    for c in &cells {
        mesh.positions.push(c.vertex);
        mesh.normals.push(c.normal);
    }
    for c in &cells {
        for (axis, &(u, v)) in
            [(IVec3::Y, IVec3::Z), (IVec3::Z, IVec3::X), (IVec3::X, IVec3::Y)].iter().enumerate()
        {
            let end_inside = c.inside & (1 << (1 << axis)) != 0;
            let start_inside = c.inside & 1 != 0;
            if start_inside == end_inside {
                continue;
            }
            let around = [c.grid, c.grid - u, c.grid - u - v, c.grid - v];
            let Some(ring) = around.iter().map(|g| index.get(g).copied()).collect::<Option<Vec<u32>>>()
            else {
                continue;
            };
            let ring = if start_inside {
                [ring[0], ring[1], ring[2], ring[3]]
            } else {
                [ring[0], ring[3], ring[2], ring[1]]
            };
            add_quad(&mut mesh, ring);
        }
    }
    mesh
}

struct CrossedCell {
    grid: IVec3,
    vertex: DVec3,
    normal: DVec3,
    /// Bit x + 2y + 4z: whether that corner is inside.
    inside: u8,
}

fn crossed_cells(
    field: &impl Fn(DVec3) -> f64,
    gradient: &impl Fn(DVec3) -> DVec3,
    at: &impl Fn(IVec3) -> DVec3,
    origin: IVec3,
    cell: f64,
) -> Vec<CrossedCell> {
    let centre = (at(origin) + at(origin + BLOCK)) / 2.0;
    let half_diagonal = 0.5 * 3f64.sqrt() * f64::from(BLOCK) * cell;
    if field(centre).abs() > DISTANCE_SAFETY * half_diagonal {
        return Vec::new();
    }
    let side = BLOCK + 1;
    let values: Vec<f64> = (0..side * side * side)
        .map(|i| field(at(origin + IVec3::new(i % side, i / side % side, i / (side * side)))))
        .collect();
    let value = |c: IVec3| values[(c.x + side * (c.y + side * c.z)) as usize];

    let mut found = Vec::new();
    for i in 0..BLOCK * BLOCK * BLOCK {
        let local = IVec3::new(i % BLOCK, i / BLOCK % BLOCK, i / (BLOCK * BLOCK));
        let corners: [f64; 8] = std::array::from_fn(|bit| value(local + corner_offset(bit)));
        let inside = (0..8).filter(|&bit| corners[bit] < 0.0).fold(0u8, |bits, bit| bits | 1 << bit);
        if inside == 0 || inside == u8::MAX {
            continue;
        }
        let grid = origin + local;
        let vertex = settle(field, gradient, at(grid) + cell * mean_crossing(&corners), cell);
        found.push(CrossedCell { grid, vertex, normal: gradient(vertex).normalize_or(DVec3::Y), inside });
    }
    found
}

fn corner_offset(bit: usize) -> IVec3 {
    IVec3::new(bit as i32 & 1, bit as i32 >> 1 & 1, bit as i32 >> 2 & 1)
}

/// Mean of the points where the surface crosses the edges of a unit cell.
fn mean_crossing(corners: &[f64; 8]) -> DVec3 {
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for start in 0..8 {
        for axis in 0..3 {
            let end = start | 1 << axis;
            if end == start || (corners[start] < 0.0) == (corners[end] < 0.0) {
                continue;
            }
            let t = corners[start] / (corners[start] - corners[end]);
            sum += corner_offset(start).as_dvec3().lerp(corner_offset(end).as_dvec3(), t);
            count += 1.0;
        }
    }
    sum / count
}

/// Moves a point onto the surface, by no more than half a cell.
fn settle(
    field: &impl Fn(DVec3) -> f64,
    gradient: &impl Fn(DVec3) -> DVec3,
    start: DVec3,
    cell: f64,
) -> DVec3 {
    let mut p = start;
    for _ in 0..NEWTON_STEPS {
        let g = gradient(p);
        let length_squared = g.length_squared();
        if length_squared < 1e-12 {
            break;
        }
        p -= g * (field(p) / length_squared);
    }
    start + (p - start).clamp_length_max(0.5 * cell)
}

/// Splits along the shorter diagonal, which avoids slivers.
fn add_quad(mesh: &mut Mesh, [a, b, c, d]: [u32; 4]) {
    let p = |index: u32| mesh.positions[index as usize];
    if p(a).distance_squared(p(c)) <= p(b).distance_squared(p(d)) {
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    } else {
        mesh.triangles.extend([[a, b, d], [b, c, d]]);
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    fn ball() -> Mesh {
        polygonise(|p| p.length() - 1.0, DVec3::splat(-1.3), DVec3::splat(1.3), 0.1)
    }

    /// How often each edge is used, forwards less backwards; all 0 if the mesh is closed.
    fn edge_balances(mesh: &Mesh) -> HashMap<(u32, u32), i32> {
        let mut edges = HashMap::new();
        for t in &mesh.triangles {
            for (from, to) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry((from.min(to), from.max(to))).or_insert(0) += if from < to { 1 } else { -1 };
            }
        }
        edges
    }

    /// Whether a sculpture lies whole in the box it is meshed in.
    pub fn is_closed(mesh: &Mesh) -> bool {
        !mesh.triangles.is_empty() && edge_balances(mesh).values().all(|&balance| balance == 0)
    }

    #[test]
    fn vertices_of_a_ball_lie_on_it_with_radial_normals() {
        let mesh = ball();
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            assert!((position.length() - 1.0).abs() < 1e-6);
            assert!(normal.dot(position.normalize()) > 0.999_999);
        }
    }

    #[test]
    fn a_ball_is_closed_and_every_triangle_faces_outward() {
        let mesh = ball();
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
        assert!(is_closed(&mesh));
        let edges = edge_balances(&mesh).len();
        assert_eq!(mesh.positions.len() + mesh.triangles.len(), edges + 2, "Euler's formula");
    }

    #[test]
    fn a_ball_that_leaves_its_box_is_not_closed() {
        assert!(!is_closed(&polygonise(|p| p.length() - 1.0, DVec3::splat(-0.9), DVec3::splat(1.3), 0.1)));
    }
}
