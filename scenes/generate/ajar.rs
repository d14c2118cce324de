//! Assets of `ajar`: a door, furniture, crockery and books. A metre is a unit.

use glam::{DAffine3, DVec2, DVec3};

use crate::mesh::Mesh;
use crate::noise::{Stream, fractal, hash};
use crate::sdf::smoothstep;
use crate::solids::{lathe, line, rounded_box, spline};
use crate::{Asset, textures};

pub fn assets() -> Vec<Asset> {
    let mesh = |name: &str, mesh: Mesh| Asset::new(format!("ajar/meshes/{name}.ply"), mesh.ply());
    let mut assets = vec![
        mesh("door", door()),
        mesh("handle", handle()),
        mesh("frame", frame()),
        mesh("skirting", skirting()),
        mesh("table", table()),
        mesh("chair", chair()),
        mesh("shelf", shelf()),
        mesh("carafe", carafe()),
        mesh("water", water()),
        mesh("vase", vase()),
        mesh("bowl", bowl()),
        mesh("picture", picture_frame()),
        Asset::new("ajar/textures/planks.png", textures::colour(512, 512, planks)),
        Asset::new("ajar/textures/oak.png", textures::colour(384, 128, oak)),
        Asset::new("ajar/textures/rug.png", textures::colour(256, 384, rug)),
        Asset::new("ajar/textures/picture.png", textures::colour(256, 192, picture)),
    ];
    let shelves = books();
    assets.extend(shelves.into_iter().enumerate().map(|(i, books)| mesh(&format!("books-{i}"), books)));
    assets
}

fn block(low: [f64; 3], high: [f64; 3], radius: f64) -> Mesh {
    rounded_box(DVec3::from(low), DVec3::from(high), radius)
}

/// A panelled leaf, 0.94 x 2.06, hinged at x = 0, closed in the plane z = 0.
fn door() -> Mesh {
    const WIDTH: f64 = 0.94;
    const HEIGHT: f64 = 2.06;
    const STILE: f64 = 0.12;
    let mut parts = vec![
        block([0.0, 0.0, -0.022], [STILE, HEIGHT, 0.022], 0.003),
        block([WIDTH - STILE, 0.0, -0.022], [WIDTH, HEIGHT, 0.022], 0.003),
        block([STILE, 0.0, -0.010], [WIDTH - STILE, HEIGHT, 0.010], 0.002),
        block([WIDTH / 2.0 - 0.05, 0.2, -0.0215], [WIDTH / 2.0 + 0.05, HEIGHT - STILE, 0.0215], 0.003),
    ];
    for (low, high) in [(0.0, 0.2), (0.82, 0.98), (HEIGHT - STILE, HEIGHT)] {
        parts.push(block([STILE, low, -0.022], [WIDTH - STILE, high, 0.022], 0.003));
    }
    for (left, right) in [(STILE, WIDTH / 2.0 - 0.05), (WIDTH / 2.0 + 0.05, WIDTH - STILE)] {
        for (low, high) in [(0.2, 0.82), (0.98, HEIGHT - STILE)] {
            parts.push(block([left + 0.04, low + 0.04, -0.017], [right - 0.04, high - 0.04, 0.017], 0.006));
        }
    }
    Mesh::union(parts)
}

/// A pair of knobs, in the door's space.
fn handle() -> Mesh {
    let v = DVec2::new;
    let knob = lathe(
        &[
            line((0.028, 0.022), (0.028, 0.028)),
            line((0.028, 0.028), (0.010, 0.029)),
            spline(
                &[
                    v(0.010, 0.029),
                    v(0.011, 0.05),
                    v(0.024, 0.06),
                    v(0.028, 0.072),
                    v(0.02, 0.086),
                    v(0.0, 0.09),
                ],
                6,
            ),
        ],
        32,
    );
    let quarter = DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let front = knob.clone().transformed(quarter.inverse()).translated(0.88, 1.0, 0.0);
    let back = knob.transformed(quarter).translated(0.88, 1.0, 0.0);
    Mesh::union([front, back])
}

/// The casing around the door's opening: x from -1.5 to -0.55, up to 2.08, on the wall z = 2.5.
fn frame() -> Mesh {
    Mesh::union([
        block([-1.60, 0.0, 2.475], [-1.495, 2.18, 2.64], 0.006),
        block([-0.555, 0.0, 2.475], [-0.45, 2.18, 2.64], 0.006),
        block([-1.60, 2.075, 2.47], [-0.45, 2.19, 2.645], 0.006),
    ])
}

/// Boards along the foot of the walls.
fn skirting() -> Mesh {
    Mesh::union([
        block([-2.3, 0.0, 2.48], [-1.6, 0.12, 2.5], 0.004),
        block([-0.45, 0.0, 2.48], [2.2, 0.12, 2.5], 0.004),
        block([2.18, 0.0, -3.2], [2.2, 0.12, 2.48], 0.004),
        block([-2.3, 0.0, -3.2], [-2.28, 0.12, 2.48], 0.004),
    ])
}

/// A round table, 0.74 high, around the origin.
fn table() -> Mesh {
    let v = DVec2::new;
    lathe(
        &[
            spline(&[v(0.26, 0.0), v(0.265, 0.015), v(0.25, 0.03), v(0.12, 0.06), v(0.05, 0.12)], 4),
            spline(
                &[
                    v(0.05, 0.12),
                    v(0.065, 0.25),
                    v(0.085, 0.34),
                    v(0.05, 0.42),
                    v(0.035, 0.55),
                    v(0.06, 0.67),
                ],
                5,
            ),
            line((0.06, 0.70), (0.50, 0.70)),
            spline(&[v(0.50, 0.70), v(0.522, 0.705), v(0.53, 0.72), v(0.522, 0.735), v(0.51, 0.74)], 3),
            line((0.51, 0.74), (0.0, 0.74)),
        ],
        72,
    )
}

/// A chair that faces -z, its seat 0.45 high, around the origin.
fn chair() -> Mesh {
    let v = DVec2::new;
    let leg = |x: f64, z: f64, top: f64| {
        let turned =
            [spline(&[v(0.013, 0.0), v(0.019, 0.12), v(0.016, 0.3), v(0.021, 0.42), v(0.015, top)], 4)];
        lathe(&turned, 14).translated(x, 0.0, z)
    };
    let mut parts = vec![
        block([-0.21, 0.43, -0.21], [0.21, 0.465, 0.21], 0.014),
        leg(-0.18, -0.18, 0.44),
        leg(0.18, -0.18, 0.44),
        leg(-0.18, 0.185, 0.96),
        leg(0.18, 0.185, 0.96),
    ];
    for (low, high) in [(0.62, 0.66), (0.74, 0.78), (0.86, 0.95)] {
        parts.push(block([-0.18, low, 0.175], [0.18, high, 0.195], 0.007));
    }
    for z in [-0.18, 0.185] {
        parts.push(block([-0.18, 0.2, z - 0.009], [0.18, 0.218, z + 0.009], 0.006));
    }
    Mesh::union(parts)
}

const SHELF_HEIGHTS: [f64; 5] = [0.08, 0.48, 0.88, 1.28, 1.66];

/// Shelves on the right wall: x from 1.9 to 2.2, z from 0.4 to 1.8.
fn shelf() -> Mesh {
    let mut parts = vec![
        block([1.9, 0.0, 0.38], [2.195, 1.72, 0.405], 0.004),
        block([1.9, 0.0, 1.795], [2.195, 1.72, 1.82], 0.004),
        block([2.18, 0.0, 0.4], [2.195, 1.7, 1.8], 0.003),
    ];
    parts.extend(SHELF_HEIGHTS.map(|y| block([1.9, y - 0.025, 0.4], [2.19, y, 1.8], 0.004)));
    Mesh::union(parts)
}

/// Books in three bindings, one mesh each.
fn books() -> [Mesh; 3] {
    let mut stream = Stream::new(111);
    let mut bindings: [Mesh; 3] = Default::default();
    for shelf in SHELF_HEIGHTS.iter().take(4) {
        let mut z = 0.42;
        while z < 1.74 {
            // Some gaps between the books.
            if stream.range(0.0, 1.0) < 0.07 {
                z += stream.range(0.05, 0.22);
                continue;
            }
            let (thick, high) = (stream.range(0.018, 0.05), stream.range(0.2, 0.31));
            let front = stream.range(1.925, 1.965);
            let binding = stream.range(0.0, 3.0) as usize;
            if z + thick < 1.78 {
                bindings[binding].append(block([front, *shelf, z], [2.15, shelf + high, z + thick], 0.004));
            }
            z += thick + 0.001;
        }
    }
    bindings
}

/// A glass carafe with walls of 4 mm, standing on the origin.
fn carafe() -> Mesh {
    let v = DVec2::new;
    lathe(
        &[
            line((0.0, 0.0), (0.058, 0.0)),
            spline(
                &[
                    v(0.058, 0.0),
                    v(0.066, 0.006),
                    v(0.078, 0.05),
                    v(0.080, 0.09),
                    v(0.06, 0.15),
                    v(0.03, 0.20),
                    v(0.026, 0.24),
                    v(0.040, 0.285),
                ],
                8,
            ),
            spline(&[v(0.040, 0.285), v(0.0395, 0.288), v(0.037, 0.287)], 3),
            spline(
                &[
                    v(0.037, 0.287),
                    v(0.022, 0.24),
                    v(0.026, 0.20),
                    v(0.056, 0.149),
                    v(0.076, 0.09),
                    v(0.074, 0.05),
                    v(0.060, 0.012),
                    v(0.0, 0.010),
                ],
                8,
            ),
        ],
        56,
    )
}

/// The water in the carafe. It overlaps the glass a little, so that no sheet of air lies between.
fn water() -> Mesh {
    let v = DVec2::new;
    lathe(
        &[
            spline(&[v(0.0, 0.0095), v(0.061, 0.0115), v(0.075, 0.05), v(0.0768, 0.085), v(0.074, 0.11)], 8),
            line((0.074, 0.11), (0.0, 0.11)),
        ],
        56,
    )
}

fn vase() -> Mesh {
    let v = DVec2::new;
    lathe(
        &[
            spline(
                &[
                    v(0.045, 0.0),
                    v(0.055, 0.01),
                    v(0.09, 0.09),
                    v(0.10, 0.16),
                    v(0.07, 0.25),
                    v(0.036, 0.31),
                    v(0.034, 0.34),
                    v(0.055, 0.38),
                ],
                6,
            ),
            spline(&[v(0.055, 0.38), v(0.05, 0.382), v(0.03, 0.34), v(0.031, 0.31), v(0.0, 0.2)], 6),
        ],
        48,
    )
}

fn bowl() -> Mesh {
    let v = DVec2::new;
    lathe(
        &[
            spline(&[v(0.05, 0.0), v(0.052, 0.012), v(0.10, 0.03), v(0.14, 0.075), v(0.152, 0.10)], 6),
            spline(&[v(0.152, 0.10), v(0.148, 0.102), v(0.134, 0.078), v(0.095, 0.037), v(0.0, 0.02)], 6),
        ],
        48,
    )
}

/// A frame around a picture of 0.9 x 0.675 in the plane z = 0, facing -z.
fn picture_frame() -> Mesh {
    let (x, y, wide) = (0.45, 0.3375, 0.045);
    Mesh::union([
        block([-x - wide, y, -0.03], [x + wide, y + wide, 0.0], 0.008),
        block([-x - wide, -y - wide, -0.03], [x + wide, -y, 0.0], 0.008),
        block([-x - wide, -y, -0.03], [-x, y, 0.0], 0.008),
        block([x, -y, -0.03], [x + wide, y, 0.0], 0.008),
    ])
}

/// Grain along u; repeats.
fn grain(u: f64, v: f64, seed: u64) -> f64 {
    let warp = fractal(DVec2::new(u * 2.0, v * 2.0), [2, 2], 2, seed);
    fractal(DVec2::new(u * 3.0, v * 24.0 + 5.0 * warp), [3, 24], 4, seed + 3)
}

/// Floor boards along v, eight to the image, with staggered ends; repeats.
fn planks(u: f64, v: f64) -> DVec3 {
    const BOARDS: f64 = 8.0;
    let board = (u * BOARDS).floor();
    let end = v * 2.0 + 0.37 * board;
    let piece = end.floor().rem_euclid(2.0);
    let across = u * BOARDS - board;
    let gap = across.min(1.0 - across) < 0.012 || (end - end.floor()).min(end.floor() + 1.0 - end) < 0.004;
    if gap {
        return DVec3::new(0.03, 0.016, 0.008);
    }
    let tone = hash(board as i64, piece as i64, 121);
    let g = smoothstep(0.3, 0.75, grain(v + 0.31 * tone, across * 0.5, 122 + board as u64 * 8));
    let light = DVec3::new(0.36, 0.185, 0.08);
    let dark = DVec3::new(0.17, 0.072, 0.027);
    light.lerp(dark, (0.55 * g + 0.45 * tone).min(1.0))
}

fn oak(u: f64, v: f64) -> DVec3 {
    let g = smoothstep(0.3, 0.7, grain(u, v, 131));
    DVec3::new(0.42, 0.25, 0.12).lerp(DVec3::new(0.24, 0.12, 0.05), g)
}

/// A woven rug: borders around a field of lozenges.
fn rug(u: f64, v: f64) -> DVec3 {
    let red = DVec3::new(0.34, 0.035, 0.03);
    let blue = DVec3::new(0.03, 0.055, 0.16);
    let cream = DVec3::new(0.60, 0.50, 0.34);
    // Distance from the edge, in widths of the rug, which is 2 : 3.
    let edge = (u.min(1.0 - u)).min(1.5 * v.min(1.0 - v));
    let lozenge = |scale: f64| {
        let (x, y) = ((u * scale).rem_euclid(1.0) - 0.5, (v * 1.5 * scale).rem_euclid(1.0) - 0.5);
        x.abs() + y.abs()
    };
    let colour = match edge {
        e if e < 0.03 => blue,
        e if e < 0.045 => cream,
        e if e < 0.13 => {
            if lozenge(14.0) < 0.28 {
                cream
            } else {
                red
            }
        }
        e if e < 0.145 => cream,
        _ => {
            let d = lozenge(4.0);
            if d < 0.12 {
                cream
            } else if d < 0.26 {
                red
            } else if d < 0.31 {
                cream
            } else {
                blue
            }
        }
    };
    let weave = fractal(DVec2::new(u * 96.0, v * 144.0), [96, 144], 1, 141);
    colour * (0.75 + 0.4 * weave)
}

/// A landscape: hills that fade into an evening sky, and a sun.
fn picture(u: f64, v: f64) -> DVec3 {
    let mut colour =
        DVec3::new(0.85, 0.42, 0.18).lerp(DVec3::new(0.16, 0.28, 0.50), smoothstep(0.35, 0.95, v));
    if DVec2::new((u - 0.68) * 1.333, v - 0.56).length() < 0.07 {
        colour = DVec3::new(0.95, 0.82, 0.5);
    }
    for ridge in 0..5 {
        let depth = f64::from(ridge) / 4.0;
        let at = DVec2::new(u * (3.0 + 2.0 * depth) + 7.3 * depth, 0.5);
        let height = 0.52 - 0.42 * depth + 0.22 * (fractal(at, [64, 64], 4, 151 + ridge as u64) - 0.5);
        if v < height {
            colour = DVec3::new(0.42, 0.30, 0.33).lerp(DVec3::new(0.02, 0.05, 0.04), depth.sqrt());
        }
    }
    colour
}
