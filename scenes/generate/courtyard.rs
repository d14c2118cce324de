//! Assets of `courtyard`: a bay of an arcade, its column, roof tiles, pots, paving and plants.
//! A metre is a unit.

use std::f64::consts::PI;

use glam::{DAffine3, DVec2, DVec3};

use crate::foliage::{self, Planting, Sprig, unit};
use crate::mesh::Mesh;
use crate::noise::{Stream, fractal, hash};
use crate::sdf::smoothstep;
use crate::solids::{lathe, line, partial_lathe, rounded_box, spline};
use crate::{Asset, textures};

/// Width of a bay, radius of its arch, where the arch springs, and the wall's top and half thickness.
const BAY: f64 = 2.0;
const ARCH_RADIUS: f64 = 0.83;
const SPRINGING: f64 = 2.25;
const WALL_TOP: f64 = 3.45;
const HALF_THICKNESS: f64 = 0.19;
/// Segments of an arch.
const ARCH_SEGMENTS: usize = 40;

pub fn assets() -> Vec<Asset> {
    let mesh = |name: &str, mesh: Mesh| Asset::new(format!("courtyard/meshes/{name}.ply"), mesh.ply());
    let texture = |name: &str, png: Vec<u8>| Asset::new(format!("courtyard/textures/{name}.png"), png);
    let green = DVec3::new(0.075, 0.19, 0.03);
    let pink = DVec3::new(0.55, 0.025, 0.22);
    vec![
        mesh("bay", bay()),
        mesh("mouldings", mouldings()),
        mesh("column", column()),
        mesh("tiles", tiles()),
        mesh("pot", pot()),
        mesh("block", rounded_box(DVec3::new(-0.34, 0.0, -0.34), DVec3::new(0.34, 0.42, 0.34), 0.015)),
        mesh("soil", lathe(&[line((0.27, 0.44), (0.0, 0.46))], 24)),
        mesh(
            "trunk",
            lathe(
                &[spline(&[(0.035, 0.4), (0.024, 0.8), (0.028, 1.2), (0.012, 1.7)].map(DVec2::from), 4)],
                12,
            ),
        ),
        mesh("basin", basin()),
        mesh("sprig", Sprig { leaves: 22, stem: 0.16, leaf: DVec2::new(0.045, 0.095) }.mesh(61)),
        mesh("vine", Sprig { leaves: 18, stem: 0.22, leaf: DVec2::new(0.07, 0.10) }.mesh(62)),
        mesh("fern", Sprig { leaves: 16, stem: 0.05, leaf: DVec2::new(0.05, 0.42) }.mesh(63)),
        texture("leaf-mask", foliage::leaf_mask()),
        texture("leaf", foliage::leaf_colour(green, DVec3::new(0.22, 0.35, 0.10))),
        texture("petal", foliage::leaf_colour(pink, DVec3::new(0.75, 0.22, 0.42))),
        texture("paving", textures::colour(512, 512, paving)),
        texture("plaster", textures::colour(256, 256, plaster)),
        Asset::new("courtyard/meshes/plants.pbrt", plants()),
    ]
}

/// The wall over one arch, between x = ±BAY / 2, facing -z; the arch springs from columns.
fn bay() -> Mesh {
    let half = BAY / 2.0;
    let mut mesh = Mesh::default();
    let arch = |i: usize| {
        let (sin, cos) = (PI * i as f64 / ARCH_SEGMENTS as f64).sin_cos();
        DVec2::new(-ARCH_RADIUS * cos, SPRINGING + ARCH_RADIUS * sin)
    };
    // The lower outline of both faces: pier, arch, pier.
    let mut outline = vec![DVec2::new(-half, SPRINGING)];
    outline.extend((0..=ARCH_SEGMENTS).map(arch));
    outline.push(DVec2::new(half, SPRINGING));
    for pair in outline.windows(2) {
        for side in [-1.0, 1.0] {
            let at = |p: DVec2| p.extend(side * HALF_THICKNESS);
            let [a, b] = [pair[0], pair[1]];
            let (c, d) = (DVec2::new(b.x, WALL_TOP), DVec2::new(a.x, WALL_TOP));
            let order = if side > 0.0 { [a, b, c, d] } else { [b, a, d, c] };
            mesh.add_quad(order.map(at), order);
        }
        // The soffit, smooth around the arch.
        let normal = |p: DVec2| {
            let on_arch = p.x.abs() <= ARCH_RADIUS + 1e-9;
            if on_arch { (DVec2::new(0.0, SPRINGING) - p).normalize().extend(0.0) } else { DVec3::NEG_Y }
        };
        let (a, b) = (pair[0], pair[1]);
        let flat = a.y == b.y;
        let normals = if flat { [DVec3::NEG_Y; 4] } else { [normal(a), normal(a), normal(b), normal(b)] };
        let corners = [
            a.extend(-HALF_THICKNESS),
            a.extend(HALF_THICKNESS),
            b.extend(HALF_THICKNESS),
            b.extend(-HALF_THICKNESS),
        ];
        let corners = [corners[0], corners[3], corners[2], corners[1]];
        let normals = [normals[0], normals[3], normals[2], normals[1]];
        mesh.add_smooth_quad(corners, normals, corners.map(|p| DVec2::new(p.x + p.y, p.z)));
    }
    mesh
}

/// A stone band around the arch and courses along the top of the wall, for one bay.
fn mouldings() -> Mesh {
    let front = -HALF_THICKNESS;
    let mut mesh = Mesh::default();
    // The band's section, as (radius, z), from the arch outwards.
    let section = [
        DVec2::new(ARCH_RADIUS - 0.02, front + 0.06),
        DVec2::new(ARCH_RADIUS - 0.02, front - 0.05),
        DVec2::new(ARCH_RADIUS + 0.10, front - 0.05),
        DVec2::new(ARCH_RADIUS + 0.13, front - 0.03),
        DVec2::new(ARCH_RADIUS + 0.13, front),
    ];
    for i in 0..ARCH_SEGMENTS {
        let angles = [i, i + 1].map(|k| PI * k as f64 / ARCH_SEGMENTS as f64);
        for pair in section.windows(2) {
            let at =
                |s: DVec2, angle: f64| DVec3::new(-s.x * angle.cos(), SPRINGING + s.x * angle.sin(), s.y);
            let corners = [
                at(pair[0], angles[0]),
                at(pair[0], angles[1]),
                at(pair[1], angles[1]),
                at(pair[1], angles[0]),
            ];
            mesh.add_quad(corners, corners.map(|p| DVec2::new(p.x, p.y)));
        }
    }
    let half = BAY / 2.0;
    for (low, high, depth) in [(3.42, 3.52, 0.09), (5.0, 5.1, 0.10), (5.1, 5.2, 0.18)] {
        let corner = DVec3::new(half, high, HALF_THICKNESS);
        mesh.append(rounded_box(DVec3::new(-half, low, front - depth), corner, 0.012));
    }
    mesh
}

fn column() -> Mesh {
    let v = DVec2::new;
    let shaft = [
        spline(&[v(0.20, 0.16), v(0.225, 0.20), v(0.21, 0.25), v(0.18, 0.27)], 4),
        spline(&[v(0.18, 0.27), v(0.195, 0.30), v(0.18, 0.33), v(0.155, 0.36)], 4),
        spline(&[v(0.155, 0.36), v(0.158, 0.9), v(0.13, 1.88)], 4),
        spline(&[v(0.13, 1.88), v(0.155, 1.90), v(0.13, 1.93)], 4),
        spline(&[v(0.13, 1.93), v(0.14, 1.99), v(0.19, 2.06), v(0.215, 2.12)], 5),
    ];
    let mut mesh = lathe(&shaft, 32);
    mesh.append(rounded_box(DVec3::new(-0.24, 0.0, -0.24), DVec3::new(0.24, 0.16, 0.24), 0.012));
    mesh.append(rounded_box(DVec3::new(-0.225, 2.12, -0.225), DVec3::new(0.225, SPRINGING, 0.225), 0.012));
    mesh
}

/// Roof tiles over one bay: rows of half tubes that lie in each other.
fn tiles() -> Mesh {
    const ROWS: usize = 4;
    const COLUMNS: usize = 10;
    let width = BAY / COLUMNS as f64;
    // A tube along y, wider at its lower end, of which the upper half (towards -z) is kept.
    let profile = vec![DVec2::new(0.48 * width, 0.0), DVec2::new(0.40 * width, 0.42)];
    let rim = line((0.48 * width - 0.015, 0.0), (0.48 * width, 0.0));
    let tile = partial_lathe(&[rim, profile], 10, 0.0, PI);
    let mut mesh = Mesh::default();
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            let jitter = hash(row as i64, column as i64, 71) - 0.5;
            let place = DAffine3::from_translation(DVec3::new(
                (column as f64 + 0.5) * width - BAY / 2.0 + 0.008 * jitter,
                5.22 + 0.17 * row as f64,
                -HALF_THICKNESS - 0.26 + 0.31 * row as f64,
            )) * DAffine3::from_rotation_x(60f64.to_radians() + 0.04 * jitter);
            mesh.append(tile.clone().transformed(place));
        }
    }
    mesh
}

fn pot() -> Mesh {
    let v = DVec2::new;
    let wall = [
        spline(&[v(0.19, 0.0), v(0.205, 0.02), v(0.25, 0.2), v(0.28, 0.4)], 4),
        spline(&[v(0.28, 0.4), v(0.315, 0.405), v(0.325, 0.43), v(0.32, 0.48), v(0.30, 0.5)], 4),
        spline(&[v(0.30, 0.5), v(0.28, 0.495), v(0.27, 0.42)], 4),
    ];
    lathe(&wall, 40)
}

/// A fountain: a low basin and a bowl on a baluster.
fn basin() -> Mesh {
    let v = DVec2::new;
    let profile = [
        line((1.02, 0.0), (1.02, 0.10)),
        line((1.02, 0.10), (0.94, 0.10)),
        spline(&[v(0.94, 0.10), v(0.92, 0.2), v(0.95, 0.36), v(1.0, 0.42)], 4),
        spline(&[v(1.0, 0.42), v(1.03, 0.45), v(1.02, 0.49), v(0.98, 0.50)], 4),
        line((0.98, 0.50), (0.84, 0.50)),
        line((0.84, 0.50), (0.82, 0.2)),
        line((0.82, 0.2), (0.16, 0.2)),
        spline(
            &[
                v(0.16, 0.2),
                v(0.17, 0.3),
                v(0.09, 0.45),
                v(0.08, 0.6),
                v(0.12, 0.72),
                v(0.07, 0.82),
                v(0.09, 0.9),
            ],
            5,
        ),
        spline(&[v(0.09, 0.9), v(0.28, 0.93), v(0.42, 1.01), v(0.47, 1.09), v(0.46, 1.11)], 5),
        spline(&[v(0.46, 1.11), v(0.43, 1.10), v(0.36, 1.03), v(0.09, 0.98)], 5),
        spline(&[v(0.09, 0.98), v(0.05, 1.1), v(0.07, 1.18), v(0.03, 1.26), v(0.0, 1.28)], 5),
    ];
    lathe(&profile, 56)
}

/// Stone setts in rows of staggered blocks; repeats.
fn paving(u: f64, v: f64) -> DVec3 {
    const ROWS: f64 = 12.0;
    const COLUMNS: f64 = 8.0;
    let wobble = DVec2::new(
        fractal(DVec2::new(u, v) * 10.0, [10, 10], 2, 81) - 0.5,
        fractal(DVec2::new(u, v) * 10.0, [10, 10], 2, 82) - 0.5,
    );
    let y = v * ROWS + 0.22 * wobble.y;
    let row = y.floor().rem_euclid(ROWS);
    let x = u * COLUMNS + 0.5 * (row % 2.0) + 0.2 * hash(row as i64, 0, 83) + 0.16 * wobble.x;
    let column = x.floor().rem_euclid(COLUMNS);
    let within =
        DVec2::new((x - x.floor()).min(x.floor() + 1.0 - x) * 1.5, (y - y.floor()).min(y.floor() + 1.0 - y));
    let stone_share = smoothstep(0.04, 0.11, within.min_element());
    let tone = hash(row as i64, column as i64, 84);
    let grain = fractal(DVec2::new(u, v) * 48.0, [48, 48], 3, 85);
    let stone =
        DVec3::new(0.40, 0.355, 0.30).lerp(DVec3::new(0.27, 0.255, 0.245), tone) * (0.62 + 0.7 * grain);
    DVec3::new(0.085, 0.075, 0.05).lerp(stone, stone_share)
}

/// Lime plaster in patches of ochre; repeats.
fn plaster(u: f64, v: f64) -> DVec3 {
    let patches = fractal(DVec2::new(u, v) * 3.0, [3, 3], 5, 91);
    let streaks = fractal(DVec2::new(u * 14.0, v * 2.0), [14, 2], 3, 92);
    let base =
        DVec3::new(0.66, 0.47, 0.26).lerp(DVec3::new(0.73, 0.61, 0.43), smoothstep(0.35, 0.65, patches));
    base * (0.86 + 0.24 * streaks)
}

/// All plants: orange trees in pots, ferns, and a bougainvillea over the arcade.
fn plants() -> Vec<u8> {
    let mut planting = Planting::default();
    let mut stream = Stream::new(101);
    // Orange trees; their pots stand where courtyard.pbrt puts them.
    for (centre, radius, count) in [
        (DVec3::new(-1.62, 1.55, 4.1), 0.46, 330),
        (DVec3::new(2.75, 1.62, 4.6), 0.50, 330),
        (DVec3::new(3.1, 1.5, 1.55), 0.46, 300),
    ] {
        planting.plant_ball("sprig", centre, radius, count, &mut stream);
    }
    // Ferns in low pots.
    for centre in [DVec3::new(-2.66, 0.92, 1.4), DVec3::new(1.85, 0.5, 5.9), DVec3::new(3.3, 0.5, 2.9)] {
        for _ in 0..12 {
            let spread = unit(&mut stream) * DVec3::new(0.13, 0.0, 0.13);
            let growth = DVec3::Y + spread * 3.0;
            planting.plant("fern", centre + spread, growth, &mut stream);
        }
    }
    bougainvillea(&mut planting, &mut stream);
    planting.text()
}

/// Climbs a column of the far arcade and spreads along the wall; sprays hang into the arches.
fn bougainvillea(planting: &mut Planting, stream: &mut Stream) {
    const FACE: f64 = 7.75;
    let stem = [
        (-1.05, 0.0),
        (-0.95, 1.2),
        (-1.05, 2.3),
        (-0.75, 3.1),
        (0.2, 3.55),
        (1.6, 3.75),
        (3.2, 3.6),
        (4.7, 3.85),
    ];
    let curve = spline(&stem.map(DVec2::from), 40);
    for (i, point) in curve.iter().enumerate() {
        let share = i as f64 / curve.len() as f64;
        // Sparse at the foot, full at the top.
        let lush = smoothstep(0.05, 0.45, share);
        let count = (1.0 + 5.0 * lush) as usize;
        for _ in 0..count {
            let spread = (0.08 + 0.36 * lush) * stream.range(0.2, 1.0);
            let around = unit(stream);
            let hang = stream.range(0.0, 1.0).powi(3) * 0.55 * lush;
            let position = DVec3::new(
                point.x + around.x * spread,
                point.y + around.y * spread - hang,
                FACE - 0.10 - around.z.abs() * spread * 0.9,
            );
            let growth = DVec3::new(around.x, 0.25 + 0.6 * around.y - hang, -0.9);
            // Bracts outnumber leaves towards the light.
            let blooms = stream.range(0.0, 1.0) < 0.25 + 0.5 * lush;
            planting.plant(if blooms { "bloom" } else { "vine" }, position, growth, stream);
        }
    }
}
