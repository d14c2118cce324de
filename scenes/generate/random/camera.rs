//! Cameras: where from, where to, with which lens and shutter.

use glam::DVec3;

use super::place::{Kind, Place};
use crate::noise::Stream;

/// A view of a place.
pub struct View {
    eye: DVec3,
    target: DVec3,
    /// Degrees.
    fov: f64,
    /// Radius and distance of focus.
    lens: Option<[f64; 2]>,
    is_shutter_open: bool,
    resolution: [u32; 2],
}

impl View {
    /// Draws a view; `moves` tells whether anything moves.
    pub fn draw(place: &Place, moves: bool, stream: &mut Stream) -> Self {
        // Some look over the objects, at the sky or the black background
        let looks_over = !matches!(place.kind, Kind::Room { .. }) && stream.chance(0.4);
        let target = DVec3::new(
            stream.range(-0.4, 0.4) * place.half.x,
            if looks_over { stream.range(0.6, 2.0) } else { stream.range(0.1, 0.9) },
            stream.range(-0.4, 0.4) * place.half.y,
        );
        let eye = match place.kind {
            // By the wall at −z, which no window is in
            Kind::Room { .. } => DVec3::new(
                stream.range(-0.9, 0.6) * place.half.x,
                stream.range(0.5, (place.height - 0.3).min(2.0)),
                -place.half.y + 0.06,
            ),
            Kind::Outdoors | Kind::Studio => DVec3::new(
                stream.range(-1.0, 1.0) * place.half.x,
                stream.log_range(0.3, 3.0),
                -place.half.y - stream.range(0.3, 2.5),
            ),
        };
        let distance = eye.distance(target);
        let lens = stream
            .chance(0.5)
            .then(|| [distance * stream.log_range(0.003, 0.08), distance * stream.range(0.5, 1.6)]);
        let sides = [(192, 192), (256, 144), (160, 224), (240, 160)];
        let (width, height) = stream.pick(&sides);
        Self {
            eye,
            target,
            fov: stream.log_range(14.0, 60.0),
            lens,
            is_shutter_open: moves,
            resolution: [width, height],
        }
    }

    /// The options of a file, before `WorldBegin`.
    pub fn text(&self) -> String {
        let Self { eye, target, fov, .. } = self;
        let [width, height] = self.resolution;
        let lens = self.lens.map_or_else(String::new, |[radius, distance]| {
            format!(" \"float lensradius\" {radius:.5} \"float focaldistance\" {distance:.4}")
        });
        let shutter =
            if self.is_shutter_open { " \"float shutteropen\" 0 \"float shutterclose\" 1" } else { "" };
        format!(
            "Film \"rgb\" \"integer xresolution\" {width} \"integer yresolution\" {height} \"string filename\" \
             \"view.exr\"\nPixelFilter \"gaussian\"\nIntegrator \"path\" \"integer maxdepth\" 7\n\
             LookAt {:.4} {:.4} {:.4}  {:.4} {:.4} {:.4}  0 1 0\n\
             Camera \"perspective\" \"float fov\" {fov:.2}{lens}{shutter}\n",
            eye.x, eye.y, eye.z, target.x, target.y, target.z
        )
    }
}
