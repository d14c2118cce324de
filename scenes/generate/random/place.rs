//! Places where objects stand: a room with or without a window, open ground, a studio.

use glam::{DVec2, DVec3};

use super::materials::{Surface, wall};
use super::numbers;
use super::world::World;
use crate::noise::Stream;

/// A place.
pub struct Place {
    pub kind: Kind,
    /// Half of the ground's sides along x and z. Objects stand within.
    pub half: DVec2,
    /// Height of the ceiling, or of what light comes from.
    pub height: f64,
}

/// What a place is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Walls on all sides; the hole in the wall at +x, if any, is (y, z) from low to high.
    Room {
        window: Option<[DVec2; 2]>,
    },
    Outdoors,
    /// Ground and perhaps a backdrop.
    Studio,
}

impl Place {
    pub fn draw(stream: &mut Stream) -> Self {
        let kind = stream.range(0.0, 1.0);
        let half = DVec2::new(stream.range(1.0, 3.2), stream.range(1.0, 3.2));
        let height = stream.range(2.2, 3.6);
        if kind < 0.5 {
            let window = stream.chance(0.55).then(|| {
                let (low, width) = (stream.range(0.3, 1.2), stream.log_range(0.08, 1.6));
                let z = stream.range(-0.8, 0.8) * (half.y - width / 2.0).max(0.0);
                let top = stream.range(low + 0.4, height - 0.1);
                [DVec2::new(low, z - width / 2.0), DVec2::new(top, z + width / 2.0)]
            });
            return Self { kind: Kind::Room { window }, half, height };
        }
        let kind = if kind < 0.75 { Kind::Outdoors } else { Kind::Studio };
        Self { kind, half, height }
    }

    /// Adds ground and walls.
    pub fn build(&self, world: &mut World, stream: &mut Stream) {
        let DVec2 { x, y: z } = self.half;
        let h = self.height;
        match self.kind {
            // Enclose a room
            Kind::Room { window } => {
                rectangle(
                    world,
                    stream,
                    Surface::Floor,
                    [[-x, 0.0, -z], [-x, 0.0, z], [x, 0.0, z], [x, 0.0, -z]],
                );
                rectangle(world, stream, Surface::Wall, [[-x, h, -z], [x, h, -z], [x, h, z], [-x, h, z]]);
                rectangle(
                    world,
                    stream,
                    Surface::Wall,
                    [[-x, 0.0, -z], [x, 0.0, -z], [x, h, -z], [-x, h, -z]],
                );
                rectangle(world, stream, Surface::Wall, [[x, 0.0, z], [-x, 0.0, z], [-x, h, z], [x, h, z]]);
                rectangle(
                    world,
                    stream,
                    Surface::Wall,
                    [[-x, 0.0, z], [-x, 0.0, -z], [-x, h, -z], [-x, h, z]],
                );
                // Build the wall at +x, around its window
                let [low, high] = window.unwrap_or([DVec2::new(h, z); 2]);
                for [y0, z0, y1, z1] in [
                    [0.0, -z, low.x, z],
                    [high.x, -z, h, z],
                    [low.x, -z, high.x, low.y],
                    [low.x, high.y, high.x, z],
                ] {
                    if y1 > y0 && z1 > z0 {
                        let corners = [[x, y0, z0], [x, y0, z1], [x, y1, z1], [x, y1, z0]];
                        rectangle(world, stream, Surface::Wall, corners);
                    }
                }
            }
            // Lay open ground, with a wall now and then
            Kind::Outdoors => {
                let r = 60.0;
                rectangle(
                    world,
                    stream,
                    Surface::Floor,
                    [[-r, 0.0, -r], [-r, 0.0, r], [r, 0.0, r], [r, 0.0, -r]],
                );
                if stream.chance(0.4) {
                    let back = z + stream.range(0.5, 4.0);
                    let corners = [[-8.0, 0.0, back], [8.0, 0.0, back], [8.0, h, back], [-8.0, h, back]];
                    rectangle(world, stream, Surface::Wall, corners);
                }
            }
            // Lay a studio's ground, and raise a backdrop now and then
            Kind::Studio => {
                let r = 8.0;
                let back = z + 1.0;
                let ground = [[-r, 0.0, -r], [-r, 0.0, back], [r, 0.0, back], [r, 0.0, -r]];
                rectangle(world, stream, Surface::Floor, ground);
                if stream.chance(0.6) {
                    let backdrop = [[-r, 0.0, back], [r, 0.0, back], [r, 5.0, back], [-r, 5.0, back]];
                    rectangle(world, stream, Surface::Wall, backdrop);
                }
            }
        }
    }
}

/// Adds a rectangle with texture coordinates in metres.
fn rectangle(world: &mut World, stream: &mut Stream, surface: Surface, corners: [[f64; 3]; 4]) {
    let [a, b, _, d] = corners.map(DVec3::from);
    let (width, height) = (a.distance(b), a.distance(d));
    let uv = [0.0, 0.0, width, 0.0, width, height, 0.0, height];
    world.attribute(|world| {
        wall(world, surface, stream);
        world.line(format!(
            "Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" {} \"point2 uv\" {}",
            numbers(corners.as_flattened()),
            numbers(&uv)
        ));
    });
}
