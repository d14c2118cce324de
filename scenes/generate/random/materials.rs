//! Materials of every kind, with colours and textures by chance.

use super::numbers;
use super::patterns::{albedo, colours, heights};
use super::world::World;
use crate::noise::Stream;

/// The large surfaces of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    Floor,
    Wall,
}

/// Metals that pbrt knows.
const METALS: [&str; 6] = ["Ag", "Al", "Au", "Cu", "CuZn", "MgO"];

/// Adds the material of a large surface, whose texture coordinates are metres.
pub fn wall(world: &mut World, surface: Surface, stream: &mut Stream) {
    let is_textured = stream.chance(if surface == Surface::Floor { 0.7 } else { 0.3 });
    let repeats = stream.log_range(0.3, 2.0);
    let colour = reflectance(world, is_textured.then_some(repeats), stream);
    let bumps = bumps(world, if surface == Surface::Floor { 0.2 } else { 0.1 }, repeats, stream);
    let kind = stream.range(0.0, 1.0);
    if kind < 0.08 {
        metal(world, stream.log_range(0.05, 0.5), &bumps, stream);
    } else if surface == Surface::Floor && kind < 0.4 {
        world.line(format!(
            "Material \"coateddiffuse\" {colour} \"float roughness\" {:.4}{bumps}",
            stream.log_range(0.005, 0.4)
        ));
    } else {
        world.line(format!("Material \"diffuse\" {colour}{bumps}"));
    }
}

/// Adds the material of an object; `repeats` is that of its textures per unit of its texture coordinates.
pub fn material(world: &mut World, repeats: f64, stream: &mut Stream) {
    let is_textured = stream.chance(0.4);
    let bumps = bumps(world, 0.15, repeats, stream);
    let roughness = stream.log_range(0.001, 0.6);
    let kind = stream.range(0.0, 1.0);
    if kind < 0.36 {
        let colour = reflectance(world, is_textured.then_some(repeats), stream);
        world.line(format!("Material \"diffuse\" {colour}{bumps}"));
    } else if kind < 0.58 {
        let colour = reflectance(world, is_textured.then_some(repeats), stream);
        world.line(format!("Material \"coateddiffuse\" {colour} \"float roughness\" {roughness:.4}{bumps}"));
    } else if kind < 0.76 {
        metal(world, roughness, &bumps, stream);
    } else if kind < 0.88 {
        let roughness = if stream.chance(0.7) { 0.0 } else { stream.log_range(0.02, 0.4) };
        world.line(format!(
            "Material \"dielectric\" \"float eta\" {:.3} \"float roughness\" {roughness:.4}{bumps}",
            stream.range(1.2, 1.8)
        ));
    } else if kind < 0.92 {
        world.line("Material \"thindielectric\" \"float eta\" 1.5");
    } else if kind < 0.96 {
        let (front, through) = (albedo(stream) * 0.6, albedo(stream) * 0.4);
        world.line(format!(
            "Material \"diffusetransmission\" \"rgb reflectance\" {} \"rgb transmittance\" {}",
            numbers(&front.to_array()),
            numbers(&through.to_array())
        ));
    } else {
        world.line(format!(
            "Material \"coatedconductor\" \"rgb reflectance\" {} \"float interface.roughness\" {roughness:.4} \"float \
             conductor.roughness\" {:.4}",
            numbers(&albedo(stream).to_array()),
            stream.log_range(0.01, 0.5)
        ));
    }
}

fn metal(world: &mut World, roughness: f64, bumps: &str, stream: &mut Stream) {
    let metal = stream.pick(&METALS);
    world.line(format!(
        "Material \"conductor\" \"spectrum eta\" \"metal-{metal}-eta\" \"spectrum k\" \"metal-{metal}-k\" \"float roughness\" \
         {roughness:.4}{bumps}"
    ));
}

/// The parameter of a reflectance, textured if `repeats` are given.
fn reflectance(world: &mut World, repeats: Option<f64>, stream: &mut Stream) -> String {
    match repeats {
        Some(repeats) => format!("\"texture reflectance\" \"{}\"", colours(world, repeats, stream)),
        None => format!("\"rgb reflectance\" {}", numbers(&albedo(stream).to_array())),
    }
}

/// The parameter of bumps, with this chance.
fn bumps(world: &mut World, chance: f64, repeats: f64, stream: &mut Stream) -> String {
    if stream.chance(chance) {
        format!(" \"texture displacement\" \"{}\"", heights(world, repeats, stream))
    } else {
        String::new()
    }
}
