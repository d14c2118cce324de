//! Lights of every kind and size: lamps, brighter the smaller they are, bulbs, sky and sun.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::environment;
use super::numbers;
use super::place::{Kind, Place};
use super::world::World;
use crate::noise::Stream;

/// Lights a place.
pub fn light(world: &mut World, place: &Place, stream: &mut Stream) {
    if stream.chance(0.2) {
        bulbs(world, place, stream);
    }
    match place.kind {
        // Light a room through its window and by lamps
        Kind::Room { window } => {
            if let Some([low, high]) = window {
                let portal = stream.chance(0.3).then(|| {
                    let x = place.half.x;
                    [[x, low.x, low.y], [x, low.x, high.y], [x, high.x, high.y], [x, high.x, low.y]]
                });
                // As much light whatever the window's size
                let area = (high.x - low.x) * (high.y - low.y);
                let scale = stream.log_range(1.5, 6.0) / area.max(0.05);
                environment::sky(world, scale, portal, stream);
                if stream.chance(0.5) {
                    sun(
                        world,
                        DVec3::new(stream.range(0.5, 2.0), stream.range(0.3, 1.0), stream.range(-0.7, 0.7)),
                        3.0 * scale,
                        stream,
                    );
                }
            }
            let lamps = stream.count(u32::from(window.is_none()), 4);
            for _ in 0..lamps {
                lamp(world, place, stream);
            }
        }
        // Light open ground by sky and sun
        Kind::Outdoors => {
            environment::sky(world, stream.log_range(0.3, 1.5), None, stream);
            if stream.chance(0.6) {
                let direction =
                    DVec3::new(stream.range(-1.0, 1.0), stream.range(0.2, 1.0), stream.range(-1.0, 0.5));
                sun(world, direction, stream.log_range(1.0, 6.0), stream);
            }
        }
        // Light a studio by lamps
        Kind::Studio => {
            for _ in 0..stream.count(1, 4) {
                lamp(world, place, stream);
            }
            if stream.chance(0.4) {
                environment::sky(world, stream.log_range(0.02, 0.4), None, stream);
            }
        }
    }
}

/// A colour of light, of luminance about 1.
fn white(stream: &mut Stream) -> DVec3 {
    let warmth = stream.range(-0.35, 0.35);
    let tint = if stream.chance(0.1) { 0.8 } else { 0.1 };
    DVec3::new(1.0 + warmth, 1.0, 1.0 - warmth) * (1.0 - stream.range(0.0, tint))
}

/// A distant light that comes from `direction`.
fn sun(world: &mut World, direction: DVec3, irradiance: f64, stream: &mut Stream) {
    let d = direction.normalize();
    let colour = white(stream) * irradiance;
    world.line(format!(
        "LightSource \"distant\" \"point3 from\" {} \"point3 to\" [ 0 0 0 ] \"rgb L\" {}",
        numbers(&d.to_array()),
        numbers(&colour.to_array())
    ));
}

/// A lamp above the objects.
fn lamp(world: &mut World, place: &Place, stream: &mut Stream) {
    let ceiling = if matches!(place.kind, Kind::Room { .. }) { place.height - 0.05 } else { place.height };
    let at = DVec3::new(
        stream.range(-0.8, 0.8) * place.half.x,
        ceiling * if stream.chance(0.6) { 1.0 } else { stream.range(0.3, 1.0) },
        stream.range(-0.8, 0.8) * place.half.y,
    );
    // Light flux in units of what fills the place
    let flux = stream.log_range(0.3, 3.0) * place.half.x * place.half.y * 4.0;
    let colour = white(stream);
    match stream.count(0, 5) {
        0 => {
            let intensity = colour * (flux / (4.0 * PI));
            world.line(format!(
                "LightSource \"point\" \"rgb I\" {} \"point3 from\" {}",
                numbers(&intensity.to_array()),
                numbers(&at.to_array())
            ));
        }
        1 => {
            let cone = stream.range(12.0, 50.0);
            let intensity = colour * (flux / (TAU * (1.0 - cone.to_radians().cos())).max(0.1));
            let to = [stream.range(-0.5, 0.5), 0.0, stream.range(-0.5, 0.5)];
            world.line(format!(
                "LightSource \"spot\" \"rgb I\" {} \"point3 from\" {} \"point3 to\" {} \"float coneangle\" {cone:.2} \
                 \"float conedeltaangle\" {:.2}",
                numbers(&intensity.to_array()),
                numbers(&at.to_array()),
                numbers(&to),
                cone * stream.range(0.05, 0.9)
            ));
        }
        2 => {
            let radius = stream.log_range(0.01, 0.25);
            let radiance = colour * (flux / (4.0 * PI * PI * radius * radius));
            world.attribute(|world| {
                emit(world, radiance);
                let at = at - DVec3::Y * (radius + 0.01);
                world.line(format!("Translate {:.4} {:.4} {:.4}", at.x, at.y.max(radius), at.z));
                world.line(format!("Shape \"sphere\" \"float radius\" {radius:.5}"));
            });
        }
        _ => {
            // A panel or a tube, facing down, somewhat tilted
            let (width, length) = (stream.log_range(0.04, 1.2), stream.log_range(0.1, 1.5));
            let radiance = colour * (flux / (PI * width * length));
            world.attribute(|world| {
                emit(world, radiance);
                world.line(format!("Translate {:.4} {:.4} {:.4}", at.x, at.y, at.z));
                world.line(format!("Rotate {:.2} 0 1 0", stream.range(0.0, 180.0)));
                if at.y < place.height - 0.5 {
                    world.line(format!("Rotate {:.2} 1 0 0", stream.range(-70.0, 70.0)));
                }
                let (x, z) = (width / 2.0, length / 2.0);
                let corners = [-x, 0.0, -z, x, 0.0, -z, x, 0.0, z, -x, 0.0, z];
                world.line(format!(
                    "Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" {}",
                    numbers(&corners)
                ));
            });
        }
    }
}

/// Small lamps that are seen: discs of light where they are out of focus.
fn bulbs(world: &mut World, place: &Place, stream: &mut Stream) {
    let radius = stream.log_range(0.004, 0.06);
    let luminance = stream.log_range(3.0, 300.0);
    for _ in 0..stream.count(3, 16) {
        let at = DVec3::new(
            stream.range(-0.9, 0.9) * place.half.x,
            stream.range(0.2, 2.0),
            stream.range(0.0, 0.9) * place.half.y,
        );
        let radiance = white(stream) * luminance;
        world.attribute(|world| {
            emit(world, radiance);
            world.line(format!("Translate {:.4} {:.4} {:.4}", at.x, at.y, at.z));
            world.line(format!("Shape \"sphere\" \"float radius\" {radius:.5}"));
        });
    }
}

/// Makes the shapes that follow emit light.
fn emit(world: &mut World, radiance: DVec3) {
    world.line(format!("AreaLightSource \"diffuse\" \"rgb L\" {}", numbers(&radiance.to_array())));
    world.line("Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]");
}
