//! Solids that furniture, architecture and pottery are made of. Texture coordinates are in scene
//! units along the surface, so that one texture scale serves all solids of a scene.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;

/// Quadrilaterals across the rounded edge of a [`rounded_box`], to either side of its middle; normals
/// do the rest.
const EDGE_STEPS: i32 = 1;

/// A box with rounded edges.
pub fn rounded_box(low: DVec3, high: DVec3, radius: f64) -> Mesh {
    let (centre, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let inner = half - radius;
    // Along each axis, grid lines that cut the rounded edge into equal angles.
    let lines = |axis: usize| -> Vec<f64> {
        let bevel = (0..=EDGE_STEPS).map(|step| {
            let angle = f64::from(EDGE_STEPS - step) / f64::from(EDGE_STEPS) * TAU / 8.0;
            inner[axis] + radius * angle.tan()
        });
        let positive: Vec<f64> = bevel.collect();
        positive.iter().map(|x| -x).chain(positive.iter().rev().copied()).collect()
    };
    let mut mesh = Mesh::default();
    for face in 0..6 {
        let (axis, sign) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
        // Tangents with u × v along the outward normal.
        let (u, v) =
            if sign > 0.0 { ((axis + 1) % 3, (axis + 2) % 3) } else { ((axis + 2) % 3, (axis + 1) % 3) };
        let (us, vs) = (lines(u), lines(v));
        let first = mesh.positions.len() as u32;
        for &y in &vs {
            for &x in &us {
                let mut p = DVec3::ZERO;
                (p[axis], p[u], p[v]) = (sign * half[axis], x, y);
                let core = p.clamp(-inner, inner);
                let normal = (p - core).normalize();
                mesh.positions.push(centre + core + normal * radius);
                mesh.normals.push(normal);
                // The longer tangent is u, so that grain runs along the piece.
                let uv = DVec2::new(x + centre[u], y + centre[v]);
                mesh.uvs.push(if half[u] >= half[v] { uv } else { DVec2::new(uv.y, uv.x) });
            }
        }
        add_grid_triangles(&mut mesh, first, us.len(), vs.len());
    }
    mesh
}

/// Triangles of a grid of vertices, `columns` along u and `rows` along v, with u × v outward.
pub fn add_grid_triangles(mesh: &mut Mesh, first: u32, columns: usize, rows: usize) {
    let columns = columns as u32;
    for row in 0..rows as u32 - 1 {
        for column in 0..columns - 1 {
            let a = first + row * columns + column;
            let (b, c, d) = (a + 1, a + columns + 1, a + columns);
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
}

/// A surface of revolution about the y axis.
///
/// Each piece is a smooth curve of (radius, height); creases lie between pieces. Going along a
/// curve, the outside is on the left of a right-handed (radius, height) plane turned by 180°, that is:
/// an outer wall runs upwards.
pub fn lathe(pieces: &[Vec<DVec2>], segments: usize) -> Mesh {
    partial_lathe(pieces, segments, 0.0, TAU)
}

/// The part of a [`lathe`] between two angles about y, from x towards -z.
pub fn partial_lathe(pieces: &[Vec<DVec2>], segments: usize, from: f64, to: f64) -> Mesh {
    let mut mesh = Mesh::default();
    for piece in pieces {
        let first = mesh.positions.len() as u32;
        let mut along = 0.0;
        for (i, &point) in piece.iter().enumerate() {
            let (before, after) = (piece[i.saturating_sub(1)], piece[(i + 1).min(piece.len() - 1)]);
            along += point.distance(before);
            let tangent = (after - before).normalize_or(DVec2::Y);
            for segment in 0..=segments {
                let share = segment as f64 / segments as f64;
                let (sin, cos) = (from + (to - from) * share).sin_cos();
                mesh.positions.push(DVec3::new(point.x * cos, point.y, -point.x * sin));
                mesh.normals.push(DVec3::new(tangent.y * cos, -tangent.x, -tangent.y * sin));
                mesh.uvs.push(DVec2::new(share, along));
            }
        }
        add_grid_triangles(&mut mesh, first, segments + 1, piece.len());
    }
    mesh
}

/// A smooth curve through points (Catmull-Rom), `steps` points a span.
pub fn spline(points: &[DVec2], steps: usize) -> Vec<DVec2> {
    let at = |i: isize| points[i.clamp(0, points.len() as isize - 1) as usize];
    let mut curve = Vec::with_capacity((points.len() - 1) * steps + 1);
    for span in 0..points.len() as isize - 1 {
        let [a, b, c, d] = [at(span - 1), at(span), at(span + 1), at(span + 2)];
        for step in 0..steps {
            let t = step as f64 / steps as f64;
            let cubic = 2.0 * b
                + (c - a) * t
                + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t
                + (3.0 * b - a - 3.0 * c + d) * t * t * t;
            curve.push(cubic / 2.0);
        }
    }
    curve.push(at(points.len() as isize - 1));
    curve
}

/// A straight piece of a [`lathe`].
pub fn line(from: (f64, f64), to: (f64, f64)) -> Vec<DVec2> {
    vec![DVec2::from(from), DVec2::from(to)]
}

/// A flat-sided bar along x. The convex profile's corners (y, z) run counter-clockwise seen from +x;
/// each end lies at x = `end.0` + `end.1` · z, so that bars can be mitred.
pub fn bar(profile: &[(f64, f64)], left: (f64, f64), right: (f64, f64)) -> Mesh {
    let mut mesh = Mesh::default();
    let at = |y: f64, z: f64, end: (f64, f64)| DVec3::new(end.0 + end.1 * z, y, z);
    for (end, outward) in [(left, -1.0), (right, 1.0)] {
        let first = mesh.positions.len() as u32;
        for &(y, z) in profile {
            mesh.positions.push(at(y, z, end));
            mesh.normals.push(DVec3::new(outward, 0.0, -outward * end.1).normalize());
            mesh.uvs.push(DVec2::new(y, z));
        }
        for i in 1..profile.len() as u32 - 1 {
            let (a, b) = if outward > 0.0 { (i, i + 1) } else { (i + 1, i) };
            mesh.triangles.push([first, first + a, first + b]);
        }
    }
    let mut around = 0.0;
    for (i, &(y0, z0)) in profile.iter().enumerate() {
        let (y1, z1) = profile[(i + 1) % profile.len()];
        let width = DVec2::new(y1 - y0, z1 - z0).length();
        let corners = [at(y0, z0, left), at(y1, z1, left), at(y1, z1, right), at(y0, z0, right)];
        let v = [around, around + width, around + width, around];
        let uvs = [0, 1, 2, 3].map(|k| DVec2::new(corners[k].x, v[k]));
        mesh.add_quad(corners, uvs);
        around += width;
    }
    mesh
}

/// A horizontal rectangle facing up.
pub fn floor(low: DVec2, high: DVec2, y: f64) -> Mesh {
    let mut mesh = Mesh::default();
    let corners = [(low.x, low.y), (low.x, high.y), (high.x, high.y), (high.x, low.y)];
    let at = corners.map(|(x, z)| DVec3::new(x, y, z));
    mesh.add_quad(at, corners.map(DVec2::from));
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume enclosed by a closed mesh: positive if triangles face outward.
    fn volume(mesh: &Mesh) -> f64 {
        let signed = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            a.dot(b.cross(c)) / 6.0
        };
        mesh.triangles.iter().map(signed).sum()
    }

    fn normals_agree_with_triangles(mesh: &Mesh) -> bool {
        mesh.triangles.iter().all(|t| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            let face = (b - a).cross(c - a);
            t.iter().all(|&i| mesh.normals[i as usize].dot(face) >= 0.0)
        })
    }

    #[test]
    fn a_rounded_box_has_nearly_the_volume_of_the_box() {
        let mesh = rounded_box(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), 0.01);
        assert!((volume(&mesh) - 6.0).abs() < 0.01, "volume {}", volume(&mesh));
        assert!(normals_agree_with_triangles(&mesh));
    }

    #[test]
    fn a_turned_cylinder_has_its_volume() {
        let pieces =
            [line((0.0, 0.0), (1.0, 0.0)), line((1.0, 0.0), (1.0, 2.0)), line((1.0, 2.0), (0.0, 2.0))];
        let mesh = lathe(&pieces, 256);
        assert!((volume(&mesh) - TAU).abs() < 1e-2, "volume {}", volume(&mesh));
        assert!(normals_agree_with_triangles(&mesh));
    }

    #[test]
    fn a_bar_faces_outward_and_a_floor_faces_up() {
        let mesh = bar(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], (0.0, 0.0), (2.0, 0.0));
        let centre = DVec3::new(1.0, 0.5, 0.5);
        assert!(mesh.positions.iter().zip(&mesh.normals).all(|(p, n)| n.dot(*p - centre) > 0.0));
        assert!((volume(&mesh) - 2.0).abs() < 1e-12 && normals_agree_with_triangles(&mesh));
        assert_eq!(floor(DVec2::ZERO, DVec2::ONE, 0.0).normals[0], DVec3::Y);
    }
}
