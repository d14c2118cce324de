//! Textures: images of patterns, grain, blotches and writing, and masks with holes.

use glam::{DVec2, DVec3};

use super::numbers;
use super::world::World;
use crate::noise::{self, Stream};
use crate::sdf::smoothstep;
use crate::textures;

/// Side of a texture in pixels.
const SIDE: usize = 256;

/// A colour that paint, cloth or stone could have, each channel in [0.02, 0.9].
pub fn albedo(stream: &mut Stream) -> DVec3 {
    let grey = stream.range(0.05, 0.8);
    let saturation = stream.range(0.0, 1.0).powi(2);
    let tint = DVec3::new(stream.range(0.1, 1.6), stream.range(0.1, 1.4), stream.range(0.1, 1.6));
    (grey * DVec3::ONE.lerp(tint, saturation)).clamp(DVec3::splat(0.02), DVec3::splat(0.9))
}

/// Adds a texture of colours and returns its name. It repeats `repeats` times per unit of the texture coordinates.
pub fn colours(world: &mut World, repeats: f64, stream: &mut Stream) -> String {
    let (first, second) = (albedo(stream), albedo(stream));
    let name = world.name("colours");
    if stream.chance(0.2) {
        world.line(format!(
            "Texture \"{name}\" \"spectrum\" \"checkerboard\" \"rgb tex1\" {} \"rgb tex2\" {} \"float uscale\" {repeats:.4} \
             \"float vscale\" {repeats:.4}",
            numbers(&first.to_array()),
            numbers(&second.to_array())
        ));
        return name;
    }
    let pattern = pattern(stream);
    let file =
        world.file("png", textures::colour(SIDE, SIDE, |u, v| first.lerp(second, pattern(DVec2::new(u, v)))));
    image(world, &name, "spectrum", &file, repeats);
    name
}

/// Adds a texture of heights and returns its name.
pub fn heights(world: &mut World, repeats: f64, stream: &mut Stream) -> String {
    let name = world.name("heights");
    let pattern = pattern(stream);
    let file =
        world.file("png", textures::colour(SIDE, SIDE, |u, v| DVec3::splat(pattern(DVec2::new(u, v)))));
    let raw = world.name("pattern");
    image(world, &raw, "float", &file, repeats);
    let height = stream.log_range(0.001, 0.02) / repeats;
    world.line(format!(
        "Texture \"{name}\" \"float\" \"scale\" \"texture tex\" \"{raw}\" \"float scale\" {height:.6}"
    ));
    name
}

/// Adds a mask with holes and returns its name.
pub fn mask(world: &mut World, repeats: f64, stream: &mut Stream) -> String {
    let name = world.name("mask");
    let pattern = pattern(stream);
    let file = world.file("png", textures::mask(SIDE, SIDE, |u, v| pattern(DVec2::new(u, v)) > 0.45));
    image(world, &name, "float", &file, repeats);
    name
}

fn image(world: &mut World, name: &str, kind: &str, file: &str, repeats: f64) {
    world.line(format!(
        "Texture \"{name}\" \"{kind}\" \"imagemap\" \"string filename\" \"{file}\" \"float uscale\" {repeats:.4} \"float \
         vscale\" {repeats:.4}"
    ));
}

/// A function of the unit square with values in [0, 1], which repeats.
fn pattern(stream: &mut Stream) -> impl Fn(DVec2) -> f64 + use<> {
    let (kind, seed) = (stream.count(0, 6), stream.seed());
    let cells = f64::from(stream.count(2, 12));
    let stretch = f64::from(stream.count(1, 8));
    let sharpness = stream.range(0.02, 0.45);
    move |uv: DVec2| {
        let at = uv * cells;
        let period = [cells as i64; 2];
        match kind {
            // Stripes
            0 => smoothstep(0.5 - sharpness, 0.5 + sharpness, (at.x.fract() * 2.0 - 1.0).abs()),
            // Tiles with joints
            1 => {
                let row = at.y.floor();
                let x = (at.x + 0.5 * (row % 2.0)).rem_euclid(cells);
                let joint = x.fract().min(1.0 - x.fract()).min(at.y.fract().min(1.0 - at.y.fract()));
                let tile = 0.4 + 0.6 * noise::hash(x.floor() as i64, row as i64, seed);
                if joint < 0.04 { 0.0 } else { tile }
            }
            // Grain
            2 => {
                let warp = noise::fractal(at, period, 3, seed);
                let long = DVec2::new(at.x, at.y * stretch + 6.0 * warp);
                noise::fractal(long, [period[0], period[1] * stretch as i64], 4, seed + 9)
            }
            // Blotches
            3 => smoothstep(0.5 - sharpness, 0.5 + sharpness, noise::fractal(at, period, 5, seed)),
            // Dots
            4 => {
                let cell = at.floor();
                let radius = 0.15 + 0.3 * noise::hash(cell.x as i64, cell.y as i64, seed);
                if (at.fract() - 0.5).length() < radius { 1.0 } else { 0.0 }
            }
            // Rows of characters, each a few strokes in a grid of 3×5
            _ => {
                let at = DVec2::new(at.x * 2.4, at.y * 1.6);
                let letter = (at.x.floor() as i64, at.y.floor() as i64);
                let within = DVec2::new(at.x.fract() * 4.0, at.y.fract() * 7.0);
                let is_blank =
                    noise::hash(letter.0, letter.1, seed) < 0.15 || within.x >= 3.0 || within.y >= 5.0;
                let stroke =
                    noise::hash(letter.0 * 3 + within.x as i64, letter.1 * 5 + within.y as i64, seed + 1)
                        < 0.55;
                if !is_blank && stroke { 1.0 } else { 0.0 }
            }
        }
    }
}
