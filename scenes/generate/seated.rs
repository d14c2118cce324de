//! A seated, meditating figure on a lotus, as an implicit surface. Facing -z, about 1.25 high.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::implicit::polygonise;
use crate::mesh::Mesh;
use crate::sdf::{cone, ellipsoid, smooth_difference, smooth_union, smoothstep, sphere, torus};

/// Where the figure sits on its lotus.
const SEAT: f64 = 0.2;
/// Centre of the head.
const HEAD: DVec3 = DVec3::new(0.0, 0.93, -0.005);

/// The statue, meshed with cells of a given size.
pub fn mesh(cell: f64) -> Mesh {
    polygonise(field, DVec3::new(-0.56, -0.03, -0.56), DVec3::new(0.56, 1.28, 0.56), cell)
}

fn field(p: DVec3) -> f64 {
    let body = smooth_union(torso(p), smooth_union(legs(p), arms(p), 0.03), 0.05);
    let figure = smooth_union(body, head(p), 0.03);
    figure.min(lotus(p))
}

/// `p` with its left side laid over its right.
fn mirrored(p: DVec3) -> DVec3 {
    DVec3::new(p.x.abs(), p.y, p.z)
}

fn seat(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y + SEAT, z)
}

fn torso(p: DVec3) -> f64 {
    let m = mirrored(p);
    let chest = ellipsoid(m, seat(0.075, 0.40, 0.02), DVec3::new(0.125, 0.145, 0.105));
    let belly = ellipsoid(p, seat(0.0, 0.17, 0.0), DVec3::new(0.165, 0.16, 0.125));
    let hips = ellipsoid(p, seat(0.0, 0.07, 0.04), DVec3::new(0.25, 0.10, 0.15));
    let shoulder = cone(m, seat(0.0, 0.53, 0.03), seat(0.195, 0.49, 0.03), 0.05, 0.068);
    let neck = cone(p, seat(0.0, 0.50, 0.025), seat(0.0, 0.68, 0.015), 0.068, 0.056);
    let trunk = smooth_union(smooth_union(chest, belly, 0.08), hips, 0.08);
    let rings = (0..3).fold(f64::INFINITY, |d, i| {
        d.min(torus(p, seat(0.0, 0.575 + 0.025 * f64::from(i), 0.02), 0.055, 0.009))
    });
    let upper = smooth_union(smooth_union(trunk, shoulder, 0.07), smooth_union(neck, rings, 0.01), 0.04);
    upper - robe(p, upper)
}

/// Folds of the robe over the left shoulder, and its rolled hem across the chest.
fn robe(p: DVec3, distance: f64) -> f64 {
    if distance.abs() > 0.06 {
        return 0.0;
    }
    // Distance below the hem, a slanting plane from the left shoulder to the right hip.
    let hem = (p - seat(-0.02, 0.36, 0.0)).dot(DVec3::new(0.74, -0.67, 0.1)) + 0.02;
    let below = smoothstep(-0.008, 0.008, hem) * smoothstep(0.56, 0.5, p.y - SEAT);
    // Folds hang in arcs between the shoulder and the lap.
    let from_shoulder = (p - seat(0.16, 0.56, -0.05)) * DVec3::new(1.0, 1.0, 0.6);
    let wave = (from_shoulder.length() * 115.0 + 3.0 * (p.x * 9.0).sin()).sin();
    let roll = 0.010 * (-(hem / 0.014).powi(2)).exp() * smoothstep(0.56, 0.5, p.y - SEAT);
    below * (0.007 + 0.0042 * wave) + roll
}

fn legs(p: DVec3) -> f64 {
    let m = mirrored(p);
    let thigh = cone(m, seat(0.12, 0.09, 0.02), seat(0.365, 0.075, -0.15), 0.115, 0.078);
    let lower = cone(p, seat(0.37, 0.065, -0.16), seat(-0.13, 0.07, -0.285), 0.075, 0.052);
    let upper = cone(p, seat(-0.37, 0.065, -0.16), seat(0.12, 0.115, -0.25), 0.075, 0.052);
    let limbs = smooth_union(smooth_union(thigh, lower, 0.04), upper, 0.02);
    // Folds run along the shins.
    let along = (p - seat(0.0, 0.3, 0.1)).length();
    let folds = 0.0045 * (along * 120.0).sin() * smoothstep(0.1, 0.2, p.x.abs());
    // A foot rests on the thigh, its sole turned up; cloth spreads in front.
    let foot = ellipsoid(p, seat(0.17, 0.145, -0.235), DVec3::new(0.095, 0.03, 0.04));
    let toes = (0..5).fold(f64::INFINITY, |d, i| {
        let z = -0.265 + 0.014 * f64::from(i);
        d.min(sphere(p, seat(0.262 - 0.004 * f64::from(i), 0.145, z), 0.0125))
    });
    let angle = p.x.atan2(-p.z);
    let hem_wave = 0.012 * (angle * 26.0).sin();
    let cloth = ellipsoid(p, seat(0.0, 0.012, -0.19), DVec3::new(0.26 + hem_wave, 0.035, 0.21 + hem_wave));
    let bare = smooth_union(foot, toes, 0.012);
    smooth_union(smooth_union(limbs - folds, cloth, 0.03), bare, 0.012)
}

fn arms(p: DVec3) -> f64 {
    let m = mirrored(p);
    let upper = cone(m, seat(0.215, 0.475, 0.03), seat(0.285, 0.24, 0.0), 0.068, 0.056);
    let fore = cone(m, seat(0.285, 0.235, -0.01), seat(0.10, 0.165, -0.205), 0.054, 0.036);
    let palms = ellipsoid(p, seat(0.0, 0.17, -0.235), DVec3::new(0.115, 0.026, 0.05));
    let thumbs = cone(m, seat(0.075, 0.185, -0.235), seat(0.006, 0.215, -0.245), 0.015, 0.011);
    // Fingers are lain across the palms.
    let fingers = (0..4).fold(f64::INFINITY, |d, i| {
        let z = -0.205 - 0.02 * f64::from(i);
        d.min(cone(p, seat(-0.10, 0.185, z), seat(0.07, 0.19, z), 0.012, 0.010))
    });
    let sleeve = 0.004 * ((p.y * 0.8 + m.x * 0.5) * 130.0).sin() * smoothstep(0.0, 0.05, p.x);
    let limbs = smooth_union(upper, fore, 0.03) - sleeve;
    let hands = smooth_union(smooth_union(palms, fingers, 0.01), thumbs, 0.012);
    smooth_union(limbs, hands, 0.025)
}

fn head(p: DVec3) -> f64 {
    // Far away a ball stands in for the details.
    let near = sphere(p, HEAD + DVec3::Y * 0.03, 0.21);
    if near > 0.1 {
        return near;
    }
    let q = p - HEAD;
    let m = mirrored(q);
    let v = DVec3::new;
    let skull = ellipsoid(q, v(0.0, 0.025, 0.012), v(0.096, 0.11, 0.106));
    let jaw = ellipsoid(q, v(0.0, -0.045, -0.022), v(0.074, 0.085, 0.078));
    let chin = sphere(q, v(0.0, -0.108, -0.068), 0.024);
    let cheeks = sphere(m, v(0.042, -0.03, -0.058), 0.038);
    let mut face = smooth_union(smooth_union(smooth_union(skull, jaw, 0.05), chin, 0.035), cheeks, 0.03);

    // Brows arch into the nose; eyes are lowered under heavy lids.
    let sockets = ellipsoid(m, v(0.037, 0.008, -0.104), v(0.026, 0.017, 0.014));
    face = smooth_difference(face, sockets, 0.018);
    let brow = cone(m, v(0.012, 0.024, -0.1), v(0.045, 0.038, -0.088), 0.006, 0.005).min(cone(
        m,
        v(0.045, 0.038, -0.088),
        v(0.074, 0.022, -0.066),
        0.005,
        0.003,
    ));
    face = smooth_union(face, brow, 0.014);
    let lid = ellipsoid(m, v(0.037, 0.004, -0.087), v(0.024, 0.0135, 0.014));
    let slit = ellipsoid(m, v(0.037, -0.0035, -0.103), v(0.022, 0.0018, 0.02));
    face = smooth_union(face, smooth_difference(lid, slit, 0.003), 0.004);
    let bridge = cone(q, v(0.0, 0.02, -0.1), v(0.0, -0.032, -0.121), 0.009, 0.0135);
    let nostril = sphere(m, v(0.013, -0.036, -0.107), 0.0095);
    face = smooth_union(face, smooth_union(bridge, nostril, 0.008), 0.014);
    let upper_lip = ellipsoid(m, v(0.010, -0.064, -0.103), v(0.017, 0.0058, 0.011));
    let lower_lip = ellipsoid(q, v(0.0, -0.0755, -0.1), v(0.019, 0.0065, 0.011));
    let corner = sphere(m, v(0.029, -0.0665, -0.093), 0.004);
    face = smooth_union(face, smooth_union(upper_lip.min(lower_lip), corner, 0.006), 0.006);
    let jewel = sphere(q, v(0.0, 0.046, -0.094), 0.0075);
    face = smooth_union(face, jewel, 0.002);

    let ear = ellipsoid(m, v(0.099, -0.012, 0.012), v(0.011, 0.052, 0.024));
    let lobe = ellipsoid(m, v(0.097, -0.075, 0.004), v(0.009, 0.035, 0.013));
    let conch = ellipsoid(m, v(0.112, 0.0, 0.008), v(0.008, 0.024, 0.012));
    let ears = smooth_difference(smooth_union(ear, lobe, 0.015), conch, 0.006);
    smooth_union(smooth_union(face, ears, 0.012), hair(q), 0.003)
}

/// Rows of curls over the skull and the knot on top, with a jewel.
fn hair(q: DVec3) -> f64 {
    let cap = ellipsoid(q, DVec3::new(0.0, 0.034, 0.02), DVec3::new(0.1, 0.112, 0.108));
    let knot = ellipsoid(q, DVec3::new(0.0, 0.146, 0.025), DVec3::new(0.052, 0.05, 0.052));
    let shell = smooth_union(cap, knot, 0.015);
    if shell > 0.03 {
        return shell;
    }
    // The hairline runs over the brow and behind the ears.
    let hairline = 0.072 - 0.9 * smoothstep(-0.06, 0.06, q.z) * 0.15;
    let below = hairline - q.y;
    // Curls: rows by height, staggered by half a curl.
    let row_height = 0.0155;
    let arc = (q.y / 0.11).clamp(-0.99, 1.6);
    let row = (if q.y < 0.11 { arc.clamp(-0.99, 0.99).asin() * 0.1 } else { 0.157 + (q.y - 0.11) }
        / row_height)
        .floor();
    let row_middle = (row + 0.5) * row_height;
    let middle_y = if row_middle < 0.14 { (row_middle / 0.1).sin() * 0.11 } else { row_middle - 0.047 };
    let ring = if row_middle < 0.125 { (row_middle / 0.1).cos() * 0.1 } else { 0.05 };
    let count = (TAU * ring / row_height).round().max(5.0);
    let turn = (q.x.atan2(-(q.z - 0.02)) / TAU) * count + 0.5 * row.rem_euclid(2.0);
    let across = (turn - turn.floor() - 0.5) * TAU * ring / count;
    let offset = DVec2::new(across, q.y - middle_y).length() / (0.5 * row_height);
    let curl = 0.007 * (1.0 - offset * offset).max(0.0).sqrt();
    let finial = cone(q, DVec3::new(0.0, 0.19, 0.025), DVec3::new(0.0, 0.222, 0.025), 0.014, 0.003);
    smooth_union(smooth_difference(shell - curl, -below, 0.004).max(below), finial, 0.006)
}

/// Two rows of petals, one up and one down, between mouldings.
fn lotus(p: DVec3) -> f64 {
    const PETALS: f64 = 16.0;
    let (radius, angle) = (DVec2::new(p.x, p.z).length(), p.z.atan2(p.x));
    let petal = |shift: f64, tilt: f64, y: f64| {
        let sector = (angle / TAU * PETALS + shift).rem_euclid(1.0) - 0.5;
        let local = sector * TAU / PETALS;
        let at = DVec3::new(radius * local.cos(), p.y, radius * local.sin());
        let (sin, cos) = tilt.sin_cos();
        let d = at - DVec3::new(0.4, y, 0.0);
        let leaf = DVec3::new(cos * d.x - sin * d.y, sin * d.x + cos * d.y, d.z);
        // A petal narrows to a point and has a rib.
        let rise = leaf.y * tilt.signum();
        let width = 0.088 - 0.55 * rise.max(0.0);
        let rib = 0.006 * (-(leaf.z / 0.008).powi(2)).exp();
        ellipsoid(leaf, DVec3::ZERO, DVec3::new(0.035, 0.085, width.max(0.03))) - rib
    };
    let slab = |low: f64, high: f64, r: f64| {
        let d = DVec2::new(radius - r, (p.y - (low + high) / 2.0).abs() - (high - low) / 2.0);
        d.max(DVec2::ZERO).length() + d.max_element().min(0.0) - 0.008
    };
    let up = petal(0.0, 0.35, 0.135).min(petal(0.5, 0.2, 0.14));
    let down = petal(0.5, -0.45, 0.055);
    let core = slab(0.0, SEAT - 0.01, 0.385);
    let plinth = slab(0.0, 0.022, 0.46);
    let beads = {
        let sector = ((angle / TAU * 60.0).rem_euclid(1.0) - 0.5) * TAU / 60.0;
        let at = DVec3::new(radius * sector.cos(), p.y, radius * sector.sin());
        sphere(at, DVec3::new(0.41, SEAT - 0.005, 0.0), 0.013)
    };
    let flower = smooth_union(up.min(down), core, 0.012).max(p.y - SEAT - 0.01).max(-0.008 - p.y);
    flower.min(beads).min(plinth)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_figure_is_whole() {
        assert!(crate::implicit::tests::is_closed(&super::mesh(0.03)));
    }
}
