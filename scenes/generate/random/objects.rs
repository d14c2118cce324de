//! Objects that stand on the ground: solids, pottery, furniture, blobs, wires, lattices, plants and hair.

use glam::{DAffine3, DVec2, DVec3};

use super::materials::material;
use super::numbers;
use super::patterns::{albedo, mask};
use super::place::{Kind, Place};
use super::world::World;
use crate::foliage::{Planting, Sprig, leaf_mask, unit};
use crate::implicit::polygonise;
use crate::mesh::Mesh;
use crate::noise::Stream;
use crate::sdf;
use crate::solids::{lathe, line, rounded_box, spline};

/// Distance of objects from walls and from where cameras are, in metres.
const CLEARANCE: f64 = 0.35;

/// Scatters objects over a place; some move if `moves`.
pub fn scatter(world: &mut World, place: &Place, moves: bool, stream: &mut Stream) {
    let free = match place.kind {
        Kind::Room { .. } => place.half - DVec2::splat(CLEARANCE),
        Kind::Outdoors | Kind::Studio => place.half * 0.8,
    };
    let mut taken: Vec<(DVec2, f64)> = Vec::new();
    for _ in 0..stream.count(6, 40) {
        let radius = stream.log_range(0.06, 0.7);
        let at = DVec2::new(stream.range(-1.0, 1.0) * free.x, stream.range(-0.8, 1.0) * free.y);
        if taken.iter().any(|(other, its)| other.distance(at) < 0.8 * (radius + its)) {
            continue;
        }
        taken.push((at, radius));
        let is_moving = moves && stream.chance(0.4);
        world.attribute(|world| {
            material(world, 1.0 / radius, stream);
            // Things lie on each other, or hang
            let y = if stream.chance(0.2) { stream.range(0.0, 1.2) } else { 0.0 };
            world.line(format!("Translate {:.4} {y:.4} {:.4}", at.x, at.y));
            world.line(format!("Rotate {:.2} 0 1 0", stream.range(0.0, 360.0)));
            if is_moving {
                let shift = unit(stream) * stream.log_range(0.02, 0.5);
                world.line("ActiveTransform EndTime");
                world.line(format!("Translate {:.4} {:.4} {:.4}", shift.x, shift.y.abs(), shift.z));
                if stream.chance(0.4) {
                    world.line(format!("Rotate {:.2} 0 1 0", stream.range(-60.0, 60.0)));
                }
                world.line("ActiveTransform All");
            }
            object(world, radius, is_moving, stream);
        });
    }
}

/// Adds an object of a radius about the y axis, on the ground.
fn object(world: &mut World, r: f64, is_moving: bool, stream: &mut Stream) {
    match stream.count(0, 12) {
        0 | 1 => {
            world.line(format!("Translate 0 {r:.4} 0"));
            world.line(format!("Shape \"sphere\" \"float radius\" {r:.4}"));
        }
        2 => {
            let height = r * stream.range(0.4, 5.0);
            let edge = stream.log_range(0.02, 0.3) * r.min(height / 2.0);
            let low = DVec3::new(-r, 0.0, -r * stream.range(0.3, 1.0));
            world.mesh(&rounded_box(low, DVec3::new(r, height, -low.z), edge), "");
        }
        3 | 4 => world.mesh(&vessel(r, stream), ""),
        5 => world.mesh(&blob(r, stream), ""),
        6 => {
            let tube = r * stream.range(0.08, 0.35);
            let torus = |p: DVec3| sdf::torus(p, DVec3::ZERO, r - tube, tube);
            let (low, high) = (DVec3::new(-r, -tube, -r) * 1.1, DVec3::new(r, tube, r) * 1.1);
            let tilt = DAffine3::from_rotation_x(stream.range(0.0, 1.5));
            let mesh = polygonise(torus, low, high, r / 24.0).transformed(tilt).translated(0.0, r, 0.0);
            world.mesh(&mesh, "");
        }
        7 => wires(world, r, stream),
        8 => lattice(world, r, stream),
        9 => {
            let mask = mask(world, 1.0 / r, stream);
            let height = r * stream.range(1.0, 4.0);
            let mut sheet = Mesh::default();
            let corners = [(-r, 0.0), (r, 0.0), (r, height), (-r, height)];
            sheet.add_quad(corners.map(|(x, y)| DVec3::new(x, y, 0.0)), corners.map(DVec2::from));
            world.mesh(&sheet, &format!("\"texture alpha\" \"{mask}\""));
        }
        // Instances and curves do not move
        10 if !is_moving => plant(world, r, stream),
        11 if !is_moving => hair(world, r, stream),
        _ => table(world, r, stream),
    }
}

/// A vase, bowl or bottle.
fn vessel(r: f64, stream: &mut Stream) -> Mesh {
    let height = r * stream.range(0.8, 4.0);
    let wall = r * stream.range(0.04, 0.12);
    let knots = stream.count(3, 7);
    let profile: Vec<DVec2> = (0..knots)
        .map(|k| DVec2::new(r * stream.range(0.3, 1.0), height * f64::from(k) / f64::from(knots - 1)))
        .collect();
    let outer = spline(&profile, 8);
    let is_closed = stream.chance(0.4);
    let (bottom, top) = (outer[0], outer[outer.len() - 1]);
    let mut pieces = vec![line((0.0, 0.0), (bottom.x, 0.0)), outer.clone()];
    if is_closed {
        pieces.push(line((top.x, height), (0.0, height)));
    } else {
        let inner: Vec<DVec2> =
            outer.iter().rev().map(|p| DVec2::new((p.x - wall).max(0.01 * r), p.y.max(wall))).collect();
        let (rim, floor) = (inner[0], inner[inner.len() - 1]);
        pieces.push(line((top.x, height), (rim.x, height)));
        pieces.push(inner);
        pieces.push(line((floor.x, floor.y), (0.0, floor.y)));
    }
    lathe(&pieces, 48)
}

/// A few balls grown together.
fn blob(r: f64, stream: &mut Stream) -> Mesh {
    let balls: Vec<(DVec3, f64)> = (0..stream.count(2, 7))
        .map(|_| {
            let size = r * stream.range(0.2, 0.5);
            let mut at = unit(stream) * (r - size);
            at.y = at.y.abs() + size;
            (at, size)
        })
        .collect();
    let blend = r * stream.range(0.05, 0.4);
    let field = |p: DVec3| {
        balls
            .iter()
            .map(|&(at, size)| sdf::sphere(p, at, size))
            .fold(f64::INFINITY, |a, b| if a.is_finite() { sdf::smooth_union(a, b, blend) } else { b })
    };
    polygonise(field, DVec3::new(-1.4, -0.5, -1.4) * r, DVec3::new(1.4, 2.2, 1.4) * r, r / 14.0)
}

/// Thin rods in all directions.
fn wires(world: &mut World, r: f64, stream: &mut Stream) {
    for _ in 0..stream.count(4, 24) {
        let radius = stream.log_range(0.0008, 0.02);
        let (at, direction) = (unit(stream) * r * 0.5, unit(stream));
        world.attribute(|world| {
            world.line(format!("Translate {:.4} {:.4} {:.4}", at.x, at.y.abs() + r * 0.6, at.z));
            let axis = unit(stream);
            world.line(format!(
                "Rotate {:.2} {:.4} {:.4} {:.4}",
                360.0 * direction.x,
                axis.x,
                axis.y,
                axis.z
            ));
            world.line(format!(
                "Shape \"cylinder\" \"float radius\" {radius:.5} \"float zmin\" {:.4} \"float zmax\" {r:.4}",
                -r
            ));
        });
    }
}

/// A screen of bars, which casts a shadow of many edges.
fn lattice(world: &mut World, r: f64, stream: &mut Stream) {
    let (bars, height) = (stream.count(3, 14), r * stream.range(1.0, 3.0));
    let thickness = r / f64::from(bars) * stream.range(0.1, 0.8);
    let bar = |low: DVec3, high: DVec3| rounded_box(low, high, thickness * 0.1);
    let mut mesh = Mesh::default();
    for k in 0..bars {
        let fraction = (f64::from(k) + 0.5) / f64::from(bars);
        let x = r * (2.0 * fraction - 1.0);
        let half = thickness / 2.0;
        mesh.append(bar(DVec3::new(x - half, 0.0, -half), DVec3::new(x + half, height, half)));
        let y = height * fraction;
        mesh.append(bar(DVec3::new(-r, y - half, -half * 0.5), DVec3::new(r, y + half, half * 0.5)));
    }
    world.mesh(&mesh, "");
}

/// A ball of leaves.
fn plant(world: &mut World, r: f64, stream: &mut Stream) {
    let name = world.name("sprig");
    let sprig = Sprig {
        leaves: stream.count(5, 14) as usize,
        stem: r * stream.range(0.2, 0.6),
        leaf: DVec2::new(r * stream.range(0.06, 0.2), r * stream.range(0.15, 0.4)),
    };
    let mask = world.file("png", leaf_mask());
    let texture = world.name("leaf");
    world.line(format!("Texture \"{texture}\" \"float\" \"imagemap\" \"string filename\" \"{mask}\""));
    let (front, through) = (albedo(stream) * 0.5, albedo(stream) * 0.4);
    world.attribute(|world| {
        world.line("Identity");
        world.line(format!("ObjectBegin \"{name}\""));
        world.line(format!(
            "Material \"diffusetransmission\" \"rgb reflectance\" {} \"rgb transmittance\" {}",
            numbers(&front.to_array()),
            numbers(&through.to_array())
        ));
        world.mesh(&sprig.mesh(stream.seed()), &format!("\"texture alpha\" \"{texture}\""));
        world.line("ObjectEnd");
    });
    let mut planting = Planting::default();
    planting.plant_ball(&name, DVec3::new(0.0, 1.2 * r, 0.0), r, stream.count(30, 160) as usize, stream);
    world.line(String::from_utf8_lossy(&planting.text()));
}

/// A tuft of hair.
fn hair(world: &mut World, r: f64, stream: &mut Stream) {
    let (width, length) = (stream.log_range(0.0008, 0.006), r * stream.range(0.4, 1.5));
    world.line(format!("Shape \"sphere\" \"float radius\" {:.4}", 0.4 * r));
    for _ in 0..stream.count(60, 300) {
        let mut direction = unit(stream);
        direction.y = direction.y.abs();
        let root = direction * 0.4 * r;
        let bend = unit(stream) * 0.3 * length;
        let points: Vec<f64> = [0.0, 0.33, 0.66, 1.0]
            .into_iter()
            .flat_map(|t| {
                let droop = DVec3::NEG_Y * (0.3 * length * t * t);
                (root + direction * (length * t) + bend * (t * t) + droop).to_array()
            })
            .collect();
        world.line(format!(
            "Shape \"curve\" \"string type\" \"cylinder\" \"point3 P\" {} \"float width0\" {width:.5} \"float width1\" {:.5}",
            numbers(&points),
            0.3 * width
        ));
    }
}

/// A board on legs, or on a foot.
fn table(world: &mut World, r: f64, stream: &mut Stream) {
    let (height, board) = (r * stream.range(0.8, 2.0), r * stream.range(0.04, 0.15));
    let leg = r * stream.range(0.05, 0.15);
    let depth = r * stream.range(0.4, 1.0);
    let edge = 0.2 * board.min(leg);
    let mut mesh = rounded_box(DVec3::new(-r, height - board, -depth), DVec3::new(r, height, depth), edge);
    for (x, z) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let at = DVec3::new(x * (r - leg), 0.0, z * (depth - leg));
        let half = DVec3::new(leg / 2.0, 0.0, leg / 2.0);
        mesh.append(rounded_box(at - half, at + half + DVec3::Y * (height - board), edge));
    }
    world.mesh(&mesh, "");

    // Things on the board
    for _ in 0..stream.count(0, 4) {
        let size = r * stream.range(0.08, 0.25);
        let (x, z) = (stream.range(-0.7, 0.7) * r, stream.range(-0.7, 0.7) * depth);
        world.attribute(|world| {
            material(world, 1.0 / size, stream);
            world.line(format!("Translate {x:.4} {height:.4} {z:.4}"));
            if stream.chance(0.5) {
                world.line(format!("Translate 0 {size:.4} 0"));
                world.line(format!("Shape \"sphere\" \"float radius\" {size:.4}"));
            } else {
                world.mesh(&vessel(size, stream), "");
            }
        });
    }
}
