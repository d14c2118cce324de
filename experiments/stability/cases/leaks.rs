//! Cases on watertightness: no ray passes through edges and vertices that triangles share.

use glam::Vec3;
use prpf::geometry::{Accel, Ray};
use prpf::scene::Shape;
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::case::Bound::{AtLeast, Exactly};
use super::case::Case;
use super::effort::Effort;
use super::renders::scene;

const STILL: &str = "Translate 50 -20 30 Scale 3 3 3";
const MOVING: &str =
    "ActiveTransform EndTime Translate 3 -2 1 Rotate 130 1 2 2 Scale 1.5 0.5 1 ActiveTransform All";

pub fn cases(effort: Effort) -> Vec<Case> {
    let rays = effort.select(20_000, 2_000_000);
    let ball = Ball::new(17, 29);
    let open = Ball { gap: 1, ..Ball::new(17, 29) };
    let name = |what: &str| format!("{rays} rays at edges and vertices of {what}");
    let figure = "rays that escape, by three queries";
    vec![
        Case::new(name("a closed mesh"), figure, Exactly(0.0), ball.escaped(STILL, rays)),
        Case::new(name("a moving closed mesh"), figure, Exactly(0.0), ball.escaped(MOVING, rays)),
        Case::new(
            "planted: a mesh without one of its triangles",
            figure,
            AtLeast(1.0),
            open.escaped(STILL, rays),
        ),
    ]
}

/// A sphere of triangles.
struct Ball {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// Number of triangles that are left out.
    gap: usize,
}

impl Ball {
    fn new(rings: u32, columns: u32) -> Self {
        use std::f32::consts::{PI, TAU};
        let point = |ring: u32, column: u32| {
            let (theta, phi) = (PI * ring as f32 / rings as f32, TAU * column as f32 / columns as f32);
            Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
        };
        let mut positions = vec![Vec3::Z, -Vec3::Z];
        positions.extend((1..rings).flat_map(|ring| (0..columns).map(move |column| point(ring, column))));
        let at = |ring: u32, column: u32| match ring {
            0 => 0,
            ring if ring == rings => 1,
            ring => 2 + (ring - 1) * columns + column % columns,
        };
        let mut triangles = Vec::new();
        for (ring, column) in (0..rings).flat_map(|ring| (0..columns).map(move |column| (ring, column))) {
            let (a, b) = (at(ring, column), at(ring + 1, column));
            let (c, d) = (at(ring + 1, column + 1), at(ring, column + 1));
            triangles.extend([[a, b, c], [a, c, d]].iter().filter(|[a, b, c]| a != b && b != c && a != c));
        }
        Self { positions, triangles, gap: 0 }
    }

    /// Counts the rays from inside that escape, by scalar queries and by batches of hit and occlusion queries.
    /// `transform` places the sphere.
    fn escaped(&self, transform: &str, rays: usize) -> f64 {
        let list = |values: Vec<String>| values.join(" ");
        let scene = scene(&format!(
            r#"TransformTimes 0 1 Camera "perspective" "float shutterclose" 1 WorldBegin {transform}
            Shape "trianglemesh" "point3 P" [ {} ] "integer indices" [ {} ]"#,
            list(self.positions.iter().map(|p| format!("{} {} {}", p.x, p.y, p.z)).collect()),
            list(self.triangles[self.gap..].iter().map(|[a, b, c]| format!("{a} {b} {c}")).collect()),
        ));
        let accel = Accel::build(&scene);
        // The mesh's vertices: in render space, or in object space if it moves
        let vertices = scene.primitives.iter().find_map(|primitive| match &primitive.shape {
            Shape::Mesh(mesh) => Some(&mesh.positions),
            _ => None,
        });
        let vertices = vertices.expect("the scene has a mesh");
        let to_render = |p: Vec3, time: f32| {
            let motion = scene.instances.first().map(|instance| instance.transform.at_f64(time));
            motion.map_or(p, |motion| motion.transform_point3(p.as_dvec3()).as_vec3())
        };
        let centre = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
        let mut rng = Pcg32::seed_from_u64(4);
        let rays: Vec<Ray> = (0..rays)
            .map(|i| {
                let corners = self.triangles[i % self.triangles.len()].map(|index| vertices[index as usize]);
                let target = on_edge(corners, &mut rng);
                // Start near the centre, on the way to any vertex
                let towards = vertices[rng.random_range(0..vertices.len())];
                let time = rng.random();
                let origin = to_render(centre.lerp(towards, 0.5 * rng.random::<f32>()), time);
                Ray { origin, direction: to_render(target, time) - origin, t_max: f32::INFINITY, time }
            })
            .collect();
        let mut escaped = rays.iter().filter(|ray| accel.intersect(ray).is_none()).count();
        accel.intersect_all(rays.iter().copied(), |hit| escaped += usize::from(hit.is_none()));
        accel.occluded_all(rays.iter().copied(), |occluded| escaped += usize::from(!occluded));
        escaped as f64
    }
}

/// A vertex, the midpoint of an edge, or a point of an edge that rounding may put on either side.
fn on_edge([a, b, c]: [Vec3; 3], rng: &mut impl Rng) -> Vec3 {
    match rng.random_range(0..4) {
        0 => a,
        1 => a.midpoint(b),
        _ => b.lerp(c, rng.random()),
    }
}
