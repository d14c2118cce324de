//! Skies and surroundings, as constants or as images.

use std::f64::consts::FRAC_PI_4;

use glam::{DVec2, DVec3};

use super::numbers;
use super::world::World;
use crate::noise::{self, Stream};

/// Side of an environment image in pixels.
const SIDE: usize = 128;

/// Adds an infinite light of mean radiance about `scale`, restricted to a portal if there is one.
pub fn sky(world: &mut World, scale: f64, portal: Option<[[f64; 3]; 4]>, stream: &mut Stream) {
    let portal = portal.map_or_else(String::new, |corners| {
        format!(" \"point3 portal\" {}", numbers(corners.as_flattened()))
    });
    if stream.chance(0.3) {
        let colour =
            DVec3::new(stream.range(0.7, 1.0), stream.range(0.8, 1.0), stream.range(0.8, 1.2)) * scale;
        world.line(format!("LightSource \"infinite\" \"rgb L\" {}{portal}", numbers(&colour.to_array())));
        return;
    }
    let name = world.file("pfm", image(stream));
    world.attribute(|world| {
        // Images have z up
        world.line("Rotate -90 1 0 0");
        world.line(format!(
            "LightSource \"infinite\" \"string filename\" \"{name}\" \"float scale\" {scale:.5}{portal}"
        ));
    });
}

/// A sky over land, with clouds, the sun or lamps, as PFM.
fn image(stream: &mut Stream) -> Vec<u8> {
    let seed = stream.seed();
    let [zenith, horizon, land] = [(0.2, 0.8), (0.5, 1.3), (0.05, 0.5)].map(|(low, high)| {
        let grey = stream.range(low, high);
        DVec3::new(grey * stream.range(0.6, 1.0), grey, grey * stream.range(0.8, 1.6))
    });
    let clouds = stream.range(0.0, 1.5);
    // Direction, cosine of the radius, and radiance of bright discs
    let discs: Vec<(DVec3, f64, f64)> = (0..stream.count(0, 4))
        .map(|_| {
            let y = stream.range(0.05, 1.0);
            let direction = DVec3::new(stream.range(-1.0, 1.0), stream.range(-1.0, 1.0), y).normalize();
            let radius: f64 = stream.log_range(0.03, 0.3);
            (direction, radius.cos(), stream.log_range(0.05, 1.0) / (radius * radius))
        })
        .collect();
    let radiance = |d: DVec3| {
        let sky = if d.z > 0.0 { horizon.lerp(zenith, d.z.sqrt()) } else { land };
        let at = DVec2::new(d.x, d.y) / (d.z.abs() + 0.15) + 64.0;
        let cloud = noise::fractal(at, [1024, 1024], 5, seed);
        let lit: f64 = discs.iter().filter(|(c, cos, _)| d.dot(*c) > *cos).map(|disc| disc.2).sum();
        sky * (1.0 + clouds * (cloud - 0.5)) + lit
    };
    let mut bytes = format!("PF\n{SIDE} {SIDE}\n-1.0\n").into_bytes();
    // PFM stores the lowest row first
    for y in (0..SIDE).rev() {
        for x in 0..SIDE {
            let uv = DVec2::new(x as f64 + 0.5, y as f64 + 0.5) / SIDE as f64;
            for value in radiance(equal_area_direction(uv)).to_array() {
                bytes.extend((value.max(0.0) as f32).to_le_bytes());
            }
        }
    }
    bytes
}

/// The direction of a point of the unit square by the equal-area mapping that pbrt-v4's images have (Clarberg 2008,
/// "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD").
fn equal_area_direction(uv: DVec2) -> DVec3 {
    let p = 2.0 * uv - 1.0;
    let signed = 1.0 - p.x.abs() - p.y.abs();
    let r = 1.0 - signed.abs();
    let angle = if r == 0.0 { FRAC_PI_4 } else { ((p.y.abs() - p.x.abs()) / r + 1.0) * FRAC_PI_4 };
    let side = r * (2.0 - r * r).sqrt();
    DVec3::new(
        side * angle.cos().copysign(p.x),
        side * angle.sin().copysign(p.y),
        (1.0 - r * r).copysign(signed),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_have_unit_length_and_are_spread_evenly() {
        let n = 64;
        let points = (0..n * n).map(|i| DVec2::new((i % n) as f64 + 0.5, (i / n) as f64 + 0.5) / n as f64);
        let directions: Vec<DVec3> = points.map(equal_area_direction).collect();
        assert!(directions.iter().all(|d| (d.length() - 1.0).abs() < 1e-9));
        let above = directions.iter().filter(|d| d.z > 0.5).count() as f64 / directions.len() as f64;
        assert!((above - 0.25).abs() < 0.02, "a quarter of the sphere's area: {above}");
    }
}
