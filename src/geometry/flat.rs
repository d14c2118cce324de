//! Search through scenes of a few surfaces without a tree: each surface is tested against many rays
//! at once, a lane for each. Where every ray would open most leaves anyway, that saves the way to
//! them, and no lane is empty.
//!
//! The tests are those of the tree (Woop, Benthin and Wald 2013 for triangles, double precision for
//! spheres), operation by operation, and find the same to the last bit. What takes more than they
//! have, a ray through an edge, is left to the tree.

use glam::{DAffine3, DVec3, Vec3};
use multiversion::multiversion;

use super::lanes::{HitLanes, LANES, Lanes, RayLanes, lanes_of, mask_of};
use super::object::ObjectAccel;
use super::rounding::gamma;
use super::{Hit, Ray, sphere};

/// Surfaces beyond which a tree is quicker, a sphere counting as two triangles.
const MOST_TRIANGLES: usize = 48;

/// Rays below which most lanes would be empty, and the tree is quicker.
const FEWEST: usize = 4;

/// No surface.
const NOTHING: u32 = u32::MAX;

/// The surfaces of a scene that has few.
#[derive(Debug)]
pub struct FlatAccel {
    triangles: Vec<Triangle>,
    spheres: Vec<WholeSphere>,
    /// Primitive and element of each triangle, then of each sphere, and then of no surface.
    places: Vec<(u32, u32)>,
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    corners: [Vec3; 3],
    /// The largest coordinate.
    size: f32,
}

#[derive(Clone, Copy, Debug)]
struct WholeSphere {
    to_shape: DAffine3,
    radius: f64,
    /// A sphere in render space that it lies in.
    centre: Vec3,
    reach: f32,
}

/// Rays in lanes.
struct Packet {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    /// Shear that takes the direction to its largest component, and distance for a unit along that,
    /// as in [`super::traverse::TraversalRay`]. Here the axes are permuted in a circle whatever the
    /// direction, which gives the same, as both windings are looked at.
    major: Lanes<u32>,
    shear: [Lanes; 2],
    scale: Lanes,
    nearest: Nearest,
}

/// What is nearest of all that the rays have met so far.
#[derive(Clone, Copy)]
struct Nearest {
    t_max: Lanes,
    /// Triangles, then spheres, by their index.
    surface: Lanes<u32>,
    /// Weights of vertices 1 and 2, and the sum that they are to be divided by.
    weights: [Lanes; 3],
    /// Weights of vertices 1 and 2 of the nearest triangle; 0 if it is not a triangle.
    barycentric: [Lanes; 2],
    /// The tree has to decide.
    doubtful: Lanes<u32>,
}

impl FlatAccel {
    /// `None` where a tree does better, or knows more.
    pub fn of(object: &ObjectAccel) -> Option<Self> {
        let triangles: Vec<_> = object
            .triangles()
            .map(|(corners, _, _)| {
                let size = corners.iter().fold(0.0, |size, corner| corner.abs().max_element().max(size));
                Triangle { corners, size }
            })
            .collect();
        let spheres: Vec<_> = object
            .quadrics()
            .iter()
            .map(|quadric| {
                let (to_shape, radius) = quadric.whole_sphere()?;
                Some(WholeSphere::new(to_shape, radius))
            })
            .collect::<Option<_>>()?;
        let places = object.triangles().map(|(_, primitive, element)| (primitive, element));
        let quadrics = object.quadrics().iter().map(|quadric| quadric.primitive).zip(0..);
        let places = places.chain(quadrics).chain([(HitLanes::NOTHING, 0)]).collect();
        (triangles.len() + 2 * spheres.len() <= MOST_TRIANGLES).then_some(Self { triangles, spheres, places })
    }

    /// Finds the nearest hit of each of the first `count` rays. `by_tree` searches for one that this
    /// cannot, or not as quickly, tell.
    #[inline]
    pub fn find(
        &self,
        rays: &RayLanes,
        count: usize,
        by_tree: impl Fn(&Ray) -> Option<Hit>,
        hits: &mut HitLanes,
    ) {
        if count < FEWEST {
            (0..count).for_each(|lane| hits.set(lane, by_tree(&rays.at(lane))));
            return;
        }
        let mut packet = Packet::of(rays, count);
        search(self, &mut packet);
        let nearest = &packet.nearest;
        hits.t = nearest.t_max;
        hits.instance = [Hit::STATIC; LANES];
        hits.barycentric = nearest.barycentric;
        for lane in 0..count {
            let surface = (nearest.surface[lane] as usize).min(self.places.len() - 1);
            (hits.primitive[lane], hits.element[lane]) = self.places[surface];
        }
        for lane in lanes_of(nearest.undecided()).take_while(|&lane| lane < count) {
            hits.set(lane, by_tree(&rays.at(lane)));
        }
    }

    /// Finds those of the first `count` rays in whose way something is; `by_tree` as above.
    #[inline]
    pub fn find_blocked(&self, rays: &RayLanes, count: usize, by_tree: impl Fn(&Ray) -> bool) -> u32 {
        let of_tree = |lanes: u32| {
            let blocked = lanes_of(lanes).filter(|&lane| by_tree(&rays.at(lane)));
            blocked.fold(0, |mask, lane| mask | 1 << lane)
        };
        let all = (1 << count) - 1;
        if count < FEWEST {
            return of_tree(all);
        }
        let mut packet = Packet::of(rays, count);
        search(self, &mut packet);
        let undecided = all & packet.nearest.undecided();
        let blocked = mask_of(|lane| packet.nearest.surface[lane] != NOTHING);
        all & blocked & !undecided | of_tree(undecided)
    }
}

impl WholeSphere {
    fn new(to_shape: DAffine3, radius: f64) -> Self {
        let to_render = to_shape.inverse();
        // No vector is stretched by more than the root of the largest eigenvalue of AᵀA, which is not beyond
        // the largest sum of a row (Gershgorin).
        let [x, y, z] = [to_render.matrix3.x_axis, to_render.matrix3.y_axis, to_render.matrix3.z_axis];
        let row = |axis: DVec3| axis.dot(x).abs() + axis.dot(y).abs() + axis.dot(z).abs();
        let reach = radius * row(x).max(row(y)).max(row(z)).sqrt();
        Self { to_shape, radius, centre: to_render.translation.as_vec3(), reach: reach as f32 }
    }
}

impl Packet {
    /// Lanes from `count` on have a ray that can hit nothing.
    fn of(rays: &RayLanes, count: usize) -> Self {
        let zero = [0.0; LANES];
        let none = [0; LANES];
        let (o, d) = (&rays.origin, &rays.direction);
        let mut t_max = rays.t_max;
        t_max[count..].fill(0.0);
        Self {
            origin: [o.x, o.y, o.z],
            direction: [d.x, d.y, d.z],
            major: none,
            shear: [zero; 2],
            scale: zero,
            nearest: Nearest {
                t_max,
                surface: [NOTHING; LANES],
                weights: [zero; 3],
                barycentric: [zero; 2],
                doubtful: none,
            },
        }
    }

    /// Sets up the rays that were loaded, and returns their origins' largest coordinate.
    #[inline(always)]
    fn prepare(&mut self) -> f32 {
        for lane in 0..LANES {
            let [d_x, d_y, d_z] = [self.direction[0][lane], self.direction[1][lane], self.direction[2][lane]];
            let x_is_major = (d_x.abs() > d_y.abs()) & (d_x.abs() > d_z.abs());
            let y_or_z = if d_y.abs() > d_z.abs() { 1 } else { 2 };
            self.major[lane] = if x_is_major { 0 } else { y_or_z };
        }
        // In a loop of its own: the two together would not become vectors.
        for lane in 0..LANES {
            let [o_x, o_y, o_z] = [self.origin[0][lane], self.origin[1][lane], self.origin[2][lane]];
            let [d_x, d_y, d_z] = [self.direction[0][lane], self.direction[1][lane], self.direction[2][lane]];
            let [along, a, b] = turned([d_x, d_y, d_z], self.major[lane]);
            // Zero times what is not finite is not a number.
            let nothing = 0.0 * o_x + 0.0 * o_y + 0.0 * o_z + 0.0 * d_x + 0.0 * d_y + 0.0 * d_z;
            let scale = 1.0 / along;
            self.shear[0][lane] = a * scale;
            self.shear[1][lane] = b * scale;
            self.scale[lane] = scale;
            let t_max = self.nearest.t_max[lane];
            self.nearest.t_max[lane] = if (nothing == 0.0) & (along != 0.0) { t_max } else { 0.0 };
        }
        // Magnitudes are ordered as their bits are, and those are compared in vectors.
        let size = |coordinates: &Lanes| coordinates.iter().fold(0, |size, c| c.abs().to_bits().max(size));
        let [x, y, z] = &self.origin;
        f32::from_bits(size(x).max(size(y)).max(size(z)))
    }

    /// Tests a triangle; whether some lane is in doubt about a hit near its origin. Of hits whose
    /// weighted distance is more than `certain` there is no doubt; `thorough` leaves none at all.
    #[inline(always)]
    fn meet_triangle(
        &self,
        nearest: &mut Nearest,
        triangle: &Triangle,
        index: u32,
        certain: f32,
        thorough: bool,
    ) -> bool {
        let mut doubts = 0;
        for lane in 0..LANES {
            let major = self.major[lane];
            let [o_x, o_y, o_z] = [self.origin[0][lane], self.origin[1][lane], self.origin[2][lane]];
            let [shear_x, shear_y] = [self.shear[0][lane], self.shear[1][lane]];
            let sheared = |p: Vec3| {
                let [along, a, b] = turned([p.x - o_x, p.y - o_y, p.z - o_z], major);
                [a - shear_x * along, b - shear_y * along, along]
            };
            let [corner_0, corner_1, corner_2] = triangle.corners;
            let [x_0, y_0, z_0] = sheared(corner_0);
            let [x_1, y_1, z_1] = sheared(corner_1);
            let [x_2, y_2, z_2] = sheared(corner_2);
            let u = x_2 * y_1 - y_2 * x_1;
            let v = x_0 * y_2 - y_0 * x_2;
            let w = x_1 * y_0 - y_1 * x_0;
            let (least, greatest) = (smaller(u, smaller(v, w)), larger(u, larger(v, w)));
            let inside = (least > 0.0) | (greatest < 0.0);
            let on_edge = (least == 0.0) | (greatest == 0.0);
            let determinant = u + v + w;
            let weighted = u * z_0 + v * z_1 + w * z_2;
            let t = weighted * self.scale[lane] / determinant;
            let t_max = nearest.t_max[lane];
            let in_range = (t > 0.0) & (t < t_max);
            let mut ahead = weighted.abs() > certain;
            if thorough {
                let largest = |a: f32, b: f32, c: f32| larger(a.abs(), larger(b.abs(), c.abs()));
                let size = [largest(x_0, x_1, x_2), largest(y_0, y_1, y_2), largest(z_0, z_1, z_2)];
                let scale = self.scale[lane];
                ahead = ((z_0 * scale > 0.0) & (z_1 * scale > 0.0) & (z_2 * scale > 0.0))
                    | (weighted.abs() > 3.0 * weighted_error(size, largest(u, v, w)));
            }
            let hits = inside & in_range & ahead;
            doubts |= (inside & in_range & !ahead) as u32;
            nearest.doubtful[lane] |= (on_edge & (t_max > 0.0)) as u32;
            nearest.t_max[lane] = if hits { t } else { t_max };
            nearest.surface[lane] = if hits { index } else { nearest.surface[lane] };
            nearest.weights[0][lane] = if hits { v } else { nearest.weights[0][lane] };
            nearest.weights[1][lane] = if hits { w } else { nearest.weights[1][lane] };
            nearest.weights[2][lane] = if hits { determinant } else { nearest.weights[2][lane] };
        }
        doubts != 0
    }

    /// Whether some ray may meet a sphere, by a rough test that errs on that side by far more than it rounds.
    #[inline(always)]
    fn may_meet(&self, nearest: &Nearest, sphere: &WholeSphere) -> bool {
        let centre = sphere.centre;
        let squared_reach = sphere.reach * sphere.reach * (1.0 + 1e-4) + 1e-5 * centre.length_squared();
        let mut may = 0;
        for lane in 0..LANES {
            let [o_x, o_y, o_z] = [self.origin[0][lane], self.origin[1][lane], self.origin[2][lane]];
            let [d_x, d_y, d_z] = [self.direction[0][lane], self.direction[1][lane], self.direction[2][lane]];
            let [x, y, z] = [centre.x - o_x, centre.y - o_y, centre.z - o_z];
            let along = x * d_x + y * d_y + z * d_z;
            let squared = x * x + y * y + z * z;
            let limit = squared_reach + 1e-5 * (squared + o_x * o_x + o_y * o_y + o_z * o_z);
            // Beside the ray, or behind its origin.
            let squared_length = d_x * d_x + d_y * d_y + d_z * d_z;
            let misses =
                (squared - along * along / squared_length > limit) | ((along < 0.0) & (squared > limit));
            may |= u32::from(!misses & (nearest.t_max[lane] > 0.0));
        }
        may != 0
    }

    #[inline(always)]
    fn meet_sphere(&self, nearest: &mut Nearest, sphere: &WholeSphere, index: u32) {
        for lane in 0..LANES {
            let [o_x, o_y, o_z] = [self.origin[0][lane], self.origin[1][lane], self.origin[2][lane]];
            let [d_x, d_y, d_z] = [self.direction[0][lane], self.direction[1][lane], self.direction[2][lane]];
            let origin = sphere.to_shape.transform_point3(DVec3::new(o_x.into(), o_y.into(), o_z.into()));
            let direction = sphere.to_shape.transform_vector3(DVec3::new(d_x.into(), d_y.into(), d_z.into()));
            let [first, last] = sphere::distances(sphere.radius, origin, direction);
            let (first, last) = (first as f32, last as f32);
            // The last is not nearer; NaN is no hit.
            let t = if first > 0.0 { first } else { last };
            let t_max = nearest.t_max[lane];
            let hits = (t > 0.0) & (t < t_max);
            nearest.t_max[lane] = if hits { t } else { t_max };
            nearest.surface[lane] = if hits { index } else { nearest.surface[lane] };
        }
    }
}

impl Nearest {
    /// The lanes in which the tree has to decide.
    fn undecided(&self) -> u32 {
        mask_of(|lane| self.doubtful[lane] != 0)
    }

    /// Works out the weights at the nearest triangles, the first `triangles` of all surfaces being triangles.
    #[inline(always)]
    fn weigh(&mut self, triangles: u32) {
        for lane in 0..LANES {
            let is_triangle = self.surface[lane] < triangles;
            let determinant = self.weights[2][lane];
            let [v, w] = [self.weights[0][lane] / determinant, self.weights[1][lane] / determinant];
            self.barycentric[0][lane] = if is_triangle { v } else { 0.0 };
            self.barycentric[1][lane] = if is_triangle { w } else { 0.0 };
        }
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+fma+avx2+popcnt+lzcnt",
    "x86_64+avx2+fma+bmi1+bmi2+popcnt+lzcnt"
))]
fn search(surfaces: &FlatAccel, packet: &mut Packet) {
    let farthest = packet.prepare();
    let mut nearest = packet.nearest;
    let mut index = 0;
    for triangle in &surfaces.triangles {
        // In sheared space, coordinates are twice as large at most, and their products eight times.
        let reach = farthest + triangle.size;
        let certain = 3.0 * weighted_error([2.0 * reach, 2.0 * reach, reach], 8.0 * reach * reach);
        if packet.meet_triangle(&mut nearest, triangle, index, certain, false) {
            packet.meet_triangle(&mut nearest, triangle, index, certain, true);
        }
        index += 1;
    }
    for sphere in &surfaces.spheres {
        if packet.may_meet(&nearest, sphere) {
            packet.meet_sphere(&mut nearest, sphere, index);
        }
        index += 1;
    }
    nearest.weigh(surfaces.triangles.len() as u32);
    packet.nearest = nearest;
}

/// Components from the axis `major` on, in a circle.
#[inline(always)]
fn turned([x, y, z]: [f32; 3], major: u32) -> [f32; 3] {
    let pick = |x, y, z| {
        if major == 0 {
            x
        } else if major == 1 {
            y
        } else {
            z
        }
    };
    [pick(x, y, z), pick(y, z, x), pick(z, x, y)]
}

/// Bound on the error of the distance, times the sum of the edge functions, in units along the major
/// axis: from the largest coordinates in the sheared space and the largest edge function (pbrt-v4,
/// section 6.8.3).
#[inline(always)]
fn weighted_error([x, y, z]: [f32; 3], edge: f32) -> f32 {
    let (error_x, error_y) = (gamma(5) * (x + z), gamma(5) * (y + z));
    let error_edge = 2.0 * (gamma(2) * x * y + error_y * x + error_x * y);
    2.0 * gamma(3) * edge * z + error_edge * z
}

/// Without what [`f32::min`] and [`f32::max`] do for NaN.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::test_scenes::{Numbers, closed_sphere_mesh, ray, scene_of, sphere};
    use crate::geometry::{Accel, search};
    use crate::scene::Shape;

    /// To the last bit; also for rays at vertices, along edges, from behind and from nowhere.
    #[test]
    fn lanes_find_what_the_tree_finds() {
        let mesh = closed_sphere_mesh(Vec3::ZERO, 1.0, 4, 6);
        let scene = scene_of(vec![
            Shape::Mesh(mesh.clone()),
            sphere(Vec3::X, 0.7),
            sphere(Vec3::new(0.0, 0.0, 0.2), 9.0),
        ]);
        let accel = Accel::build(&scene);
        assert!(accel.flat.is_some());
        let mut numbers = Numbers::new(12);
        let mut rays = Vec::new();
        for step in 0..4003 {
            let origin = if step % 4 == 0 { Vec3::ZERO } else { numbers.in_cube(2.0) };
            let vertex = mesh.positions[step % mesh.positions.len()];
            let direction = if step % 3 == 0 { vertex - origin } else { numbers.direction() };
            let t_max = if step % 5 == 0 { numbers.next() } else { f32::INFINITY };
            rays.push(Ray { t_max, ..ray(origin, direction) });
        }
        rays.push(ray(Vec3::ZERO, Vec3::ZERO));
        rays.push(ray(Vec3::NAN, Vec3::X));
        let (mut flat, mut tree) = (Vec::new(), Vec::new());
        accel.intersect_all(rays.iter().copied(), |hit| flat.push(hit));
        search::find(&accel, rays.iter().copied(), false, |hit| tree.push(hit));
        for (ray, (flat, tree)) in flat.iter().zip(&tree).enumerate() {
            let place = |hit: &Hit| (hit.t.to_bits(), hit.primitive, hit.instance);
            assert_eq!(flat.as_ref().map(place), tree.as_ref().map(place), "{ray}");
            // At a vertex, triangles may be equally near.
            if ray % 3 != 0 {
                let part = |hit: &Hit| (hit.element, hit.barycentric);
                assert_eq!(flat.as_ref().map(part), tree.as_ref().map(part), "{ray}");
            }
        }
        for shape in [0, 1, 2] {
            let hits = flat.iter().flatten().filter(|hit| hit.primitive == shape).count();
            assert!(hits > 300, "{shape}: {hits}");
        }
    }

    #[test]
    fn only_scenes_of_a_few_triangles_and_whole_spheres_are_flat() {
        let is_flat = |shapes| Accel::build(&scene_of(shapes)).flat.is_some();
        let mesh = |columns| Shape::Mesh(closed_sphere_mesh(Vec3::ZERO, 1.0, 5, columns));
        assert!(is_flat(vec![mesh(5)]) && !is_flat(vec![mesh(50)]));
        let Shape::Sphere(whole) = sphere(Vec3::ZERO, 1.0) else { unreachable!() };
        assert!(!is_flat(vec![Shape::Sphere(crate::scene::Sphere { z_min: 0.0, ..whole })]));
    }
}
