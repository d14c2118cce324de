//! Assets of `pool`: textures of balls, cloth and wood; rails and a corner pocket. Centimetres.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::Asset;
use crate::mesh::Mesh;
use crate::noise;
use crate::sdf::smoothstep;
use crate::solids::{bar, floor, line, partial_lathe, rounded_box, spline};
use crate::textures;

/// Half of the playing surface, along x and z: a table of nine feet.
const HALF_BED: DVec2 = DVec2::new(127.0, 63.5);
/// Height of a rail's top over the cloth, and of the cushion's nose.
const RAIL_HEIGHT: f64 = 4.0;
const NOSE_HEIGHT: f64 = 3.6;
/// Width of the cushion and of the wood behind it.
const CUSHION_WIDTH: f64 = 5.0;
const RAIL_WIDTH: f64 = 13.0;
/// Radius of a corner pocket, whose centre lies on the corner of the bed.
const POCKET_RADIUS: f64 = 6.2;
/// Where a cushion starts, measured from the corner along the rail.
const POCKET_MOUTH: f64 = 8.2;

pub fn assets() -> Vec<Asset> {
    let mut assets: Vec<Asset> = (1..=15)
        .map(|number| Asset::new(format!("pool/textures/ball-{number:02}.png"), ball(number)))
        .collect();
    assets.push(Asset::new("pool/textures/cloth.png", cloth()));
    assets.push(Asset::new("pool/textures/wood.png", textures::colour(768, 256, wood)));
    assets.push(Asset::new("pool/meshes/cloth.ply", cushions().ply()));
    assets.push(Asset::new("pool/meshes/rails.ply", rails().ply()));
    assets.push(Asset::new("pool/meshes/pocket.ply", pocket().ply()));
    assets.push(Asset::new("pool/meshes/sights.ply", sights().ply()));
    assets
}

/// Wooden grain that runs along u and repeats.
fn wood(u: f64, v: f64) -> DVec3 {
    let warp = noise::fractal(DVec2::new(u * 2.0, v * 3.0), [2, 3], 3, 11);
    let grain = noise::fractal(DVec2::new(u * 4.0, v * 24.0 + warp * 9.0), [4, 24], 4, 12);
    let pores = noise::fractal(DVec2::new(u * 16.0, v * 128.0), [16, 128], 2, 13);
    let light = DVec3::new(0.34, 0.135, 0.05);
    let dark = DVec3::new(0.10, 0.030, 0.012);
    light.lerp(dark, smoothstep(0.3, 0.75, grain)) * (0.75 + 0.25 * smoothstep(0.25, 0.5, pores))
}

/// Worsted cloth: two directions of thread and some unevenness.
fn cloth() -> Vec<u8> {
    textures::colour(256, 256, |u, v| {
        let warp = noise::value(DVec2::new(u * 128.0, v * 32.0), [128, 32], 21);
        let weft = noise::value(DVec2::new(u * 32.0, v * 128.0), [32, 128], 22);
        let uneven = noise::fractal(DVec2::new(u, v) * 3.0, [3, 3], 3, 23);
        DVec3::new(0.012, 0.20, 0.085) * (0.90 + 0.12 * (warp + weft) / 2.0 + 0.06 * uneven)
    })
}

/// Linear colours of 1 to 8; 9 to 15 have those of 1 to 7.
const BALL_COLOURS: [DVec3; 8] = [
    DVec3::new(0.88, 0.55, 0.02),
    DVec3::new(0.015, 0.05, 0.38),
    DVec3::new(0.60, 0.015, 0.015),
    DVec3::new(0.10, 0.015, 0.20),
    DVec3::new(0.80, 0.16, 0.015),
    DVec3::new(0.01, 0.17, 0.06),
    DVec3::new(0.22, 0.02, 0.03),
    DVec3::new(0.012, 0.012, 0.014),
];
const IVORY: DVec3 = DVec3::new(0.86, 0.82, 0.72);
const INK: DVec3 = DVec3::new(0.015, 0.015, 0.015);
/// Half the width of a striped ball's band, as a height on the unit sphere.
const STRIPE: f64 = 0.58;
/// Radius of the number's disc on the unit sphere.
const DISC: f64 = 0.42;

/// A ball as pbrt maps an image onto a sphere: u is the longitude, v goes from -z to z.
/// Its number stands upright (z up) on both sides along y.
fn ball(number: usize) -> Vec<u8> {
    let colour = BALL_COLOURS[(number - 1) % BALL_COLOURS.len()];
    textures::colour(512, 256, |u, v| {
        let (sin_phi, cos_phi) = (TAU * u).sin_cos();
        let (sin_theta, cos_theta) = (PI * v).sin_cos();
        let p = DVec3::new(cos_phi * sin_theta, sin_phi * sin_theta, -cos_theta);
        // Right of a viewer who looks along -y at the near disc; pbrt's coordinates are left-handed.
        let right = if p.y > 0.0 { p.x } else { -p.x };
        let on_disc = DVec2::new(right, p.z);
        if on_disc.length() < DISC {
            let ink = digits_distance(number, on_disc / (DISC * 0.62)) < 0.0;
            return if ink { INK } else { IVORY };
        }
        if number > 8 && p.z.abs() > STRIPE { IVORY } else { colour }
    })
}

/// Negative inside the strokes of a number drawn around the origin within about ±1.
fn digits_distance(number: usize, at: DVec2) -> f64 {
    const STROKE: f64 = 0.14;
    let digits: Vec<usize> = if number > 9 { vec![number / 10, number % 10] } else { vec![number] };
    let spacing = if digits.len() == 2 { 0.86 } else { 0.0 };
    digits
        .iter()
        .enumerate()
        .map(|(i, &digit)| {
            let centre = DVec2::new((i as f64 - (digits.len() - 1) as f64 / 2.0) * spacing, 0.0);
            polyline_distance(&digit_outline(digit), at - centre)
        })
        .fold(f64::INFINITY, f64::min)
        - STROKE
}

/// The stroke of a digit: 0.76 wide and 1.6 high, around the origin.
fn digit_outline(digit: usize) -> Vec<DVec2> {
    // An arc of an ellipse; angles in turns from +x towards +y.
    let arc = |cx: f64, cy: f64, rx: f64, ry: f64, from: f64, to: f64| {
        (0..=24).map(move |i| {
            let (sin, cos) = (TAU * (from + (to - from) * f64::from(i) / 24.0)).sin_cos();
            DVec2::new(cx + rx * cos, cy + ry * sin)
        })
    };
    let points = |list: &[(f64, f64)]| list.iter().map(|&p| DVec2::from(p)).collect::<Vec<_>>();
    match digit {
        0 => arc(0.0, 0.0, 0.38, 0.8, 0.0, 1.0).collect(),
        1 => points(&[(-0.22, 0.5), (0.05, 0.8), (0.05, -0.8)]),
        2 => arc(0.0, 0.42, 0.38, 0.38, 0.45, -0.1).chain(points(&[(-0.38, -0.8), (0.4, -0.8)])).collect(),
        3 => arc(0.0, 0.42, 0.36, 0.38, 0.42, -0.25).chain(arc(0.0, -0.38, 0.4, 0.42, 0.25, -0.42)).collect(),
        4 => points(&[(0.18, -0.8), (0.18, 0.8), (-0.42, -0.3), (0.42, -0.3)]),
        5 => points(&[(0.34, 0.8), (-0.28, 0.8), (-0.33, 0.1)])
            .into_iter()
            .chain(arc(0.0, -0.3, 0.4, 0.5, 0.36, -0.4))
            .collect(),
        6 => points(&[(0.22, 0.8)]).into_iter().chain(arc(0.0, -0.35, 0.39, 0.45, 0.46, 1.46)).collect(),
        7 => points(&[(-0.38, 0.8), (0.38, 0.8), (-0.1, -0.8)]),
        8 => arc(0.0, 0.4, 0.33, 0.4, -0.25, 0.75).chain(arc(0.0, -0.4, 0.4, 0.4, 0.25, 1.25)).collect(),
        _ => arc(0.0, 0.35, 0.39, 0.45, -0.04, 0.96).chain(points(&[(-0.22, -0.8)])).collect(),
    }
}

fn polyline_distance(points: &[DVec2], at: DVec2) -> f64 {
    let segment = |pair: &[DVec2]| {
        let (a, axis) = (pair[0], pair[1] - pair[0]);
        let t = if axis == DVec2::ZERO {
            0.0
        } else {
            ((at - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0)
        };
        at.distance(a + axis * t)
    };
    points.windows(2).map(segment).fold(f64::INFINITY, f64::min)
}

/// The bed and two cushions: the far long rail and the left short one.
fn cushions() -> Mesh {
    let bed = floor(-HALF_BED - CUSHION_WIDTH, HALF_BED + CUSHION_WIDTH, 0.0);
    // In (y, z) with z measured from the nose outwards; counter-clockwise seen from +x.
    let profile = [
        (0.0, 1.0),
        (NOSE_HEIGHT - 0.5, 0.15),
        (NOSE_HEIGHT, 0.0),
        (NOSE_HEIGHT + 0.25, 0.3),
        (RAIL_HEIGHT, 1.6),
        (RAIL_HEIGHT, CUSHION_WIDTH),
        (0.0, CUSHION_WIDTH),
    ];
    // The mouth opens outwards: cushions get shorter towards the nose.
    let cushion = |half: f64| bar(&profile, (-half + POCKET_MOUTH, -0.9), (half - POCKET_MOUTH, 0.9));
    let far = cushion(HALF_BED.x).translated(0.0, 0.0, HALF_BED.y);
    let left = cushion(HALF_BED.y).transformed(glam::DAffine3::from_rotation_y(-PI / 2.0)).translated(
        -HALF_BED.x,
        0.0,
        0.0,
    );
    Mesh::union([bed, far, left])
}

/// Wooden tops behind the cushions.
fn rails() -> Mesh {
    let (low, high) = (CUSHION_WIDTH, CUSHION_WIDTH + RAIL_WIDTH);
    let far = rounded_box(
        DVec3::new(-HALF_BED.x + POCKET_RADIUS, -14.0, HALF_BED.y + low),
        DVec3::new(HALF_BED.x, RAIL_HEIGHT + 0.2, HALF_BED.y + high),
        0.6,
    );
    let left = rounded_box(
        DVec3::new(-HALF_BED.x - high, -14.0, -HALF_BED.y),
        DVec3::new(-HALF_BED.x - low, RAIL_HEIGHT + 0.2, HALF_BED.y - POCKET_RADIUS),
        0.6,
    );
    Mesh::union([far, left])
}

/// The casting around the far left pocket.
fn pocket() -> Mesh {
    let outer = CUSHION_WIDTH + RAIL_WIDTH;
    let top = RAIL_HEIGHT + 0.5;
    let ring = [
        spline(&[DVec2::new(outer, -14.0), DVec2::new(outer, 2.0), DVec2::new(outer - 0.4, top - 0.4)], 4),
        spline(
            &[
                DVec2::new(outer - 0.4, top - 0.4),
                DVec2::new(outer - 1.2, top),
                DVec2::new(POCKET_RADIUS + 1.2, top),
                DVec2::new(POCKET_RADIUS + 0.3, top - 0.4),
                DVec2::new(POCKET_RADIUS, top - 1.4),
            ],
            6,
        ),
        line((POCKET_RADIUS, top - 1.4), (POCKET_RADIUS, -14.0)),
    ];
    // Three quadrants; the one towards the bed, from x to -z, stays open.
    partial_lathe(&ring, 48, TAU * 0.25, TAU).translated(-HALF_BED.x, 0.0, HALF_BED.y)
}

/// Diamonds of mother-of-pearl along the far and left rails, an eighth of the long side apart.
fn sights() -> Mesh {
    const HALF_LENGTH: f64 = 1.7;
    const HALF_WIDTH: f64 = 0.8;
    let spacing = HALF_BED.x / 4.0;
    let middle = CUSHION_WIDTH + RAIL_WIDTH / 2.0;
    let y = RAIL_HEIGHT + 0.22;
    let mut mesh = Mesh::default();
    let mut diamond = |x: f64, z: f64, half: DVec2| {
        let corners = [(x - half.x, z), (x, z + half.y), (x + half.x, z), (x, z - half.y)];
        mesh.add_quad(corners.map(|(x, z)| DVec3::new(x, y, z)), corners.map(DVec2::from));
    };
    for i in -3..=3 {
        diamond(f64::from(i) * spacing, HALF_BED.y + middle, DVec2::new(HALF_WIDTH, HALF_LENGTH));
    }
    for i in -1..=1 {
        diamond(-HALF_BED.x - middle, f64::from(i) * spacing, DVec2::new(HALF_LENGTH, HALF_WIDTH));
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_drawn_upright() {
        // The 7 has its bar on top and nothing at the lower right.
        assert!(digits_distance(7, DVec2::new(0.0, 0.8)) < 0.0);
        assert!(digits_distance(7, DVec2::new(0.3, -0.8)) > 0.0);
    }
}
