//! `loopsubdiv`: Loop subdivision surfaces.
//!
//! Loop 1987, "Smooth subdivision surfaces based on triangles"; weights, limit positions and tangents
//! as in pbrt-v3, section 3.8 (after Zorin and others, "Subdivision for modeling and animation").

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::DVec3;

use super::mesh_description::MeshDescription;

/// Weight of each boundary neighbour of a boundary vertex: for refinement, and for the limit.
const BOUNDARY: f64 = 1.0 / 8.0;
const BOUNDARY_LIMIT: f64 = 1.0 / 5.0;

/// Subdivides a control mesh `levels` times and moves the vertices to the limit surface. The result has
/// the limit surface's normals. Also returns the number of vertices added by [`separate_fans`].
///
/// # Errors
/// One sentence, if an index is out of range, or an edge belongs to more than two triangles or to two of
/// opposite orientation.
pub fn subdivide(
    control: &[DVec3],
    triangles: &[[u32; 3]],
    levels: u32,
) -> Result<(MeshDescription, usize), String> {
    if let Some(index) = triangles.as_flattened().iter().find(|&&index| index as usize >= control.len()) {
        return Err(format!("index {index} of {} vertices; expected a smaller index", control.len()));
    }
    let mut positions = control.to_vec();
    let mut indices: Vec<[u32; 3]> =
        triangles.iter().copied().filter(|[a, b, c]| a != b && b != c && c != a).collect();
    separate_fans(&mut positions, &mut indices);
    let copies = positions.len() - control.len();
    for _ in 0..levels {
        (positions, indices) = refine(&positions, &indices)?;
    }
    let rings = Rings::new(positions.len(), &indices)?;
    let mut limit = Vec::with_capacity(positions.len());
    let mut normals = Vec::with_capacity(positions.len());
    let mut ring = Vec::new();
    for (vertex, &position) in positions.iter().enumerate() {
        let closed = rings.around(vertex, &positions, &mut ring);
        limit.push(if closed {
            average(position, &ring, 1.0 / (ring.len() as f64 + 3.0 / (8.0 * interior_weight(ring.len()))))
        } else {
            boundary_average(position, &ring, BOUNDARY_LIMIT)
        });
        normals.push(limit_normal(position, &ring, closed));
    }
    Ok((MeshDescription { positions: limit, normals, indices, ..MeshDescription::default() }, copies))
}

/// From one corner of a fan to the next in one direction; corners are numbered through all triangles.
type Step<'l> = &'l dyn Fn(usize) -> Option<usize>;

/// Gives a copy of the vertex to every fan of triangles but the first around a vertex where several fans
/// meet. Leaves meshes with an edge that occurs twice in the same direction as they are.
fn separate_fans(positions: &mut Vec<DVec3>, triangles: &mut [[u32; 3]]) {
    // Find the corner at the start of each edge
    let vertices = triangles.as_flattened().to_vec();
    let next = |corner: usize| corner / 3 * 3 + (corner + 1) % 3;
    let edges = (0..vertices.len()).map(|corner| ((vertices[corner], vertices[next(corner)]), corner));
    let corner_of_edge: HashMap<(u32, u32), usize> = edges.collect();
    if corner_of_edge.len() < vertices.len() {
        return;
    }

    // Find the corners of the adjacent triangles at the same vertex
    let after = |corner: usize| {
        let previous = vertices[next(next(corner))];
        corner_of_edge.get(&(vertices[corner], previous)).copied()
    };
    let before = |corner: usize| {
        let opposite = corner_of_edge.get(&(vertices[next(corner)], vertices[corner]));
        opposite.map(|&opposite| next(opposite))
    };

    // Visit each fan once, from one of its corners in both directions
    let mut has_fan = vec![false; positions.len()];
    let mut is_visited = vec![false; vertices.len()];
    for (start, mut vertex) in vertices.iter().copied().enumerate() {
        if is_visited[start] {
            continue;
        }
        if std::mem::replace(&mut has_fan[vertex as usize], true) {
            positions.push(positions[vertex as usize]);
            vertex = (positions.len() - 1) as u32;
        }
        for (first, step) in [(Some(start), &after as Step), (before(start), &before as Step)] {
            let mut corner = first;
            while let Some(unvisited) = corner.filter(|&corner| !is_visited[corner]) {
                is_visited[unvisited] = true;
                triangles[unvisited / 3][unvisited % 3] = vertex;
                corner = step(unvisited);
            }
        }
    }
}

/// One level of subdivision: every triangle becomes four.
fn refine(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<(Vec<DVec3>, Vec<[u32; 3]>), String> {
    let rings = Rings::new(positions.len(), triangles)?;
    let mut ring = Vec::new();
    let mut refined: Vec<DVec3> = (0..positions.len())
        .map(|vertex| {
            if rings.around(vertex, positions, &mut ring) {
                average(positions[vertex], &ring, interior_weight(ring.len()))
            } else {
                boundary_average(positions[vertex], &ring, BOUNDARY)
            }
        })
        .collect();

    // Add a vertex on each edge, in the order of first use
    let opposite: HashMap<(u32, u32), u32> =
        triangles.iter().flat_map(|&[a, b, c]| [((a, b), c), ((b, c), a), ((c, a), b)]).collect();
    let mut on_edge: HashMap<(u32, u32), u32> = HashMap::with_capacity(triangles.len() * 3 / 2);
    let mut split = |a: u32, b: u32| {
        *on_edge.entry((a.min(b), a.max(b))).or_insert_with(|| {
            let at = |vertex: u32| positions[vertex as usize];
            let ends = at(a) + at(b);
            refined.push(match (opposite.get(&(a, b)), opposite.get(&(b, a))) {
                (Some(&left), Some(&right)) => ends * 0.375 + (at(left) + at(right)) * 0.125,
                _ => ends * 0.5,
            });
            (refined.len() - 1) as u32
        })
    };
    let mut indices = Vec::with_capacity(triangles.len() * 4);
    for &[a, b, c] in triangles {
        let [ab, bc, ca] = [split(a, b), split(b, c), split(c, a)];
        indices.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    Ok((refined, indices))
}

/// Weight of each neighbour of an interior vertex, by valence.
fn interior_weight(valence: usize) -> f64 {
    if valence == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * valence as f64) }
}

/// The weighted mean of an interior vertex and its one-ring.
fn average(centre: DVec3, ring: &[DVec3], weight: f64) -> DVec3 {
    let sum: DVec3 = ring.iter().sum();
    centre * (1.0 - ring.len() as f64 * weight) + sum * weight
}

/// The weighted mean of a boundary vertex and its two boundary neighbours. An isolated vertex stays.
fn boundary_average(centre: DVec3, ring: &[DVec3], weight: f64) -> DVec3 {
    match ring {
        [first, .., last] => centre * (1.0 - 2.0 * weight) + (*first + *last) * weight,
        _ => centre,
    }
}

/// The limit normal, from two tangents. As in pbrt, it points to the side from which the triangles
/// appear clockwise.
fn limit_normal(centre: DVec3, ring: &[DVec3], closed: bool) -> DVec3 {
    let n = ring.len();
    let (s, t) = if closed {
        let wave = |f: fn(f64) -> f64| -> DVec3 {
            ring.iter().enumerate().map(|(i, p)| *p * f(2.0 * PI * i as f64 / n as f64)).sum()
        };
        (wave(f64::sin), wave(f64::cos))
    } else {
        let (Some(first), Some(last)) = (ring.first(), ring.last()) else { return DVec3::ZERO };
        let across = match ring {
            [_] => return DVec3::ZERO,
            [a, b] => *a + *b - centre * 2.0,
            [_, b, _] => *b - centre,
            [a, b, c, d] => -*a + *b * 2.0 + *c * 2.0 - *d - centre * 2.0,
            _ => {
                let theta = PI / (n - 1) as f64;
                let ends = (*first + *last) * theta.sin();
                let inner = ring[1..n - 1].iter().enumerate();
                let inner: DVec3 = inner.map(|(k, p)| *p * ((k + 1) as f64 * theta).sin()).sum();
                inner * (2.0 - 2.0 * theta.cos()) - ends
            }
        };
        (*last - *first, across)
    };
    s.cross(t)
}

/// The ordered one-ring of each vertex.
struct Rings {
    /// Corners of all vertices: the (next, previous) vertex in the triangle.
    corners: Vec<(u32, u32)>,
    /// Index of each vertex's first corner.
    starts: Vec<u32>,
}

impl Rings {
    fn new(vertices: usize, triangles: &[[u32; 3]]) -> Result<Self, String> {
        let mut starts = vec![0u32; vertices + 1];
        for &vertex in triangles.as_flattened() {
            starts[vertex as usize + 1] += 1;
        }
        for i in 0..vertices {
            starts[i + 1] += starts[i];
        }
        let mut free = starts.clone();
        let mut corners = vec![(0, 0); triangles.len() * 3];
        for &[a, b, c] in triangles {
            for (vertex, corner) in [(a, (b, c)), (b, (c, a)), (c, (a, b))] {
                corners[free[vertex as usize] as usize] = corner;
                free[vertex as usize] += 1;
            }
        }
        let mut rings = Self { corners, starts };
        let mut sorter = CornerSorter::default();
        for vertex in 0..vertices {
            let range = rings.range(vertex);
            if !sorter.sort(&mut rings.corners[range]) {
                return Err(format!(
                    "the triangles around vertex {vertex} do not form one oriented fan; expected a manifold"
                ));
            }
        }
        Ok(rings)
    }

    fn range(&self, vertex: usize) -> std::ops::Range<usize> {
        self.starts[vertex] as usize..self.starts[vertex + 1] as usize
    }

    /// Writes the neighbours' positions to `ring`, counterclockwise, and from boundary to boundary for a
    /// boundary vertex. Returns whether the vertex is interior.
    fn around(&self, vertex: usize, positions: &[DVec3], ring: &mut Vec<DVec3>) -> bool {
        ring.clear();
        let corners = &self.corners[self.range(vertex)];
        ring.extend(corners.iter().map(|(next, _)| positions[*next as usize]));
        let (Some((first, _)), Some((_, last))) = (corners.first(), corners.last()) else { return false };
        if first != last {
            ring.push(positions[*last as usize]);
        }
        first == last
    }
}

/// Buffers for sorting the corners of a vertex, reused between vertices.
#[derive(Default)]
struct CornerSorter {
    by_next: Vec<(u32, u32)>,
    previous: Vec<u32>,
}

impl CornerSorter {
    /// Sorts a vertex's corners so that each begins where the previous one ends. At a boundary vertex
    /// the fan begins at the neighbour that no corner ends at. Returns `false` if the corners do not
    /// form one fan.
    fn sort(&mut self, corners: &mut [(u32, u32)]) -> bool {
        let Self { by_next, previous } = self;
        by_next.clear();
        by_next.extend_from_slice(corners);
        by_next.sort_unstable();
        previous.clear();
        previous.extend(corners.iter().map(|&(_, previous)| previous));
        previous.sort_unstable();
        // If no neighbour occurs twice on either side, there are only chains and rings
        if !by_next.is_sorted_by(|a, b| a.0 < b.0) || !previous.is_sorted_by(|a, b| a < b) {
            return false;
        }
        if let Some(begin) = corners.iter().position(|(next, _)| previous.binary_search(next).is_err()) {
            corners.swap(0, begin);
        }
        for i in 1..corners.len() {
            let wanted = corners[i - 1].1;
            match by_next.binary_search_by_key(&wanted, |&(next, _)| next) {
                Ok(found) if wanted != corners[0].0 => corners[i] = by_next[found],
                _ => return false,
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let positions = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
        let triangles =
            vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
        (positions, triangles)
    }

    #[test]
    fn each_level_quarters_the_triangles_and_keeps_the_surface_closed() {
        let (positions, triangles) = octahedron();
        let (mesh, _) = subdivide(&positions, &triangles, 3).unwrap();
        assert_eq!(mesh.indices.len(), 8 * 64);
        // Euler: V − E + F = 2 with E = 3F/2.
        assert_eq!(mesh.positions.len(), 2 + mesh.indices.len() / 2);
    }

    #[test]
    fn the_limit_of_an_octahedron_is_round_and_its_normals_are_radial() {
        let (positions, triangles) = octahedron();
        let (mesh, _) = subdivide(&positions, &triangles, 4).unwrap();
        let radii = mesh.positions.iter().map(|p| p.length());
        let (low, high) = radii.fold((f64::MAX, 0.0f64), |(l, h), r| (l.min(r), h.max(r)));
        assert!(low > 0.4 && high <= 0.5, "{low} to {high}");
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            // Wound counterclockwise as seen from outside, the front is the inside, as in pbrt.
            assert!(position.normalize().dot(normal.normalize()) < -0.9);
        }
    }

    #[test]
    fn limit_positions_do_not_depend_on_the_level() {
        let (positions, triangles) = octahedron();
        let (coarse, _) = subdivide(&positions, &triangles, 0).unwrap();
        let (fine, _) = subdivide(&positions, &triangles, 2).unwrap();
        for (a, b) in coarse.positions.iter().zip(&fine.positions) {
            assert!((*a - *b).length() < 1e-12);
        }
    }

    #[test]
    fn a_flat_patch_stays_flat_with_a_straight_boundary_and_one_normal() {
        let positions: Vec<_> = (0..9).map(|i| DVec3::new(f64::from(i % 3), f64::from(i / 3), 0.0)).collect();
        let triangles: Vec<[u32; 3]> =
            [0, 1, 3, 4].into_iter().flat_map(|i| [[i, i + 1, i + 4], [i, i + 4, i + 3]]).collect();
        let (mesh, copies) = subdivide(&positions, &triangles, 2).unwrap();
        assert_eq!(copies, 0);
        assert!(mesh.positions.iter().all(|p| p.z == 0.0 && p.x >= 0.0 && p.x <= 2.0));
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            assert!((normal.normalize() + DVec3::Z).length() < 1e-12, "{normal} at {position}");
        }
    }

    #[test]
    fn non_manifold_meshes_are_errors() {
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Z];
        let book = [[0, 1, 2], [0, 1, 3], [0, 1, 4]];
        assert!(subdivide(&positions, &book, 1).unwrap_err().contains("manifold"));
        assert!(subdivide(&positions, &[[0, 1, 9]], 1).unwrap_err().contains("index 9"));
    }

    #[test]
    fn fans_that_meet_at_a_vertex_are_subdivided_like_separate_meshes() {
        let tetrahedron = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d], [a, d, b], [b, d, c]];
        let rings = |first: u32| [tetrahedron([0, 1, 2, 3]), tetrahedron([first, 4, 5, 6])].concat();
        let chains = |first: u32| vec![[0, 1, 2], [first, 3, 4], [0, 2, 5], [first, 4, 6]];
        let mut positions: Vec<DVec3> =
            (0..7).map(|i| DVec3::new(f64::from(i), f64::from(i * i), f64::from(i * i * i))).collect();
        let joined = [rings(0), chains(0)].map(|triangles| subdivide(&positions, &triangles, 2).unwrap());
        positions.push(positions[0]);
        let separate = [rings(7), chains(7)].map(|triangles| subdivide(&positions, &triangles, 2).unwrap());
        for ((joined, copies), (separate, none)) in joined.iter().zip(&separate) {
            assert_eq!((*copies, *none), (1, 0));
            assert_eq!(joined.positions, separate.positions);
            assert_eq!(joined.indices, separate.indices);
        }
    }

    #[test]
    fn corners_in_any_order_make_one_fan() {
        let ring: Vec<(u32, u32)> = (0..1000).map(|i| (i, (i + 1) % 1000)).collect();
        for (fan, closed) in [(&ring[..], true), (&ring[..999], false)] {
            let mut shuffled: Vec<_> = (0..fan.len()).map(|i| fan[i * 7 % fan.len()]).collect();
            shuffled.rotate_left(400);
            let first = shuffled[0];
            assert!(CornerSorter::default().sort(&mut shuffled));
            assert!(shuffled.windows(2).all(|pair| pair[0].1 == pair[1].0));
            assert_eq!(shuffled[0], if closed { first } else { fan[0] });
        }
    }
}
