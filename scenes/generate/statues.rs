//! Assets of `statues`: a dragon, its plinth, and a marble floor. A metre is a unit.

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;
use crate::noise;
use crate::sdf::smoothstep;
use crate::solids::{lathe, line, spline};
use crate::{Asset, dragon, textures};

/// Grid cell of the dragon's mesh: about 89 000 triangles.
const CELL: f64 = 0.0118;

pub fn assets() -> Vec<Asset> {
    vec![
        Asset::new("statues/meshes/dragon.ply", dragon::mesh(CELL).ply()),
        Asset::new("statues/meshes/plinth.ply", plinth().ply()),
        Asset::new("statues/textures/floor.png", textures::colour(384, 384, floor)),
    ]
}

/// A low round plinth, its top at height 0.
fn plinth() -> Mesh {
    let v = DVec2::new;
    let profile = [
        spline(&[v(0.94, -0.24), v(0.95, -0.21), v(0.92, -0.18), v(0.86, -0.16), v(0.84, -0.11)], 4),
        spline(&[v(0.84, -0.11), v(0.86, -0.07), v(0.90, -0.05), v(0.90, -0.02), v(0.88, 0.0)], 4),
        line((0.88, 0.0), (0.0, 0.0)),
    ];
    lathe(&profile, 72)
}

/// Two by two marble tiles in a chequered pattern, with joints; repeats.
fn floor(u: f64, v: f64) -> DVec3 {
    const JOINT: f64 = 0.006;
    let tile = DVec2::new(u, v) * 2.0;
    let cell = tile.floor();
    let within = tile - cell;
    let edge = within.min(1.0 - within).min_element();
    if edge < JOINT {
        return DVec3::splat(0.10);
    }
    // Veins run where a warped noise crosses its middle; each tile is cut from another block.
    let dark = (cell.x + cell.y) as i64 % 2 == 0;
    let seed = 31 + (cell.x + 2.0 * cell.y) as u64 * 10;
    let period = [64, 64];
    let warp = noise::fractal(within * 3.0, period, 4, seed) - 0.5;
    let at = within * DVec2::new(2.0, 1.3) + warp * 1.6;
    let vein = (noise::fractal(at, period, 4, seed + 5) - 0.5).abs();
    let cloud = noise::fractal(within * 4.0, period, 4, seed + 7);
    let line = 1.0 - smoothstep(0.0, 0.035, vein);
    if dark {
        let stone = DVec3::new(0.035, 0.05, 0.045) * (0.6 + 0.8 * cloud);
        stone.lerp(DVec3::new(0.42, 0.45, 0.42), 0.6 * line)
    } else {
        let stone = DVec3::new(0.68, 0.64, 0.57) * (0.8 + 0.25 * cloud);
        stone.lerp(DVec3::new(0.30, 0.25, 0.20), 0.55 * line)
    }
}
