//! Camera rays: from a place on the film, a point on the lens and a moment of the shutter to a ray
//! in render space.

use glam::{Affine3A, Vec2, Vec3};

use super::disk::concentric_disk;
use crate::geometry::Ray;
use crate::scene::{AnimatedTransform, Camera, Film, camera::Projection};

/// What is left of camera and film when all that is the same for every ray has been computed.
#[derive(Clone, Debug)]
pub struct CameraRays {
    to_render: Motion,
    projection: Projection,
    /// Film position times this plus `offset` is the position in the screen window.
    scale: Vec2,
    offset: Vec2,
    lens_radius: f32,
    focal_distance: f32,
    shutter_open: f32,
    shutter: f32,
}

#[derive(Clone, Debug)]
enum Motion {
    Still(Affine3A),
    Moving(AnimatedTransform),
}

impl CameraRays {
    pub fn new(camera: &Camera, film: &Film) -> Self {
        let [x_min, x_max, y_min, y_max] = camera.screen_window;
        let to_render = if camera.to_render.is_animated() {
            Motion::Moving(camera.to_render.clone())
        } else {
            Motion::Still(camera.to_render.at(camera.shutter_open))
        };
        Self {
            to_render,
            projection: camera.projection,
            // Rows run downwards on the film, y upwards in the window.
            scale: Vec2::new((x_max - x_min) / film.width as f32, (y_min - y_max) / film.height as f32),
            offset: Vec2::new(x_min, y_max),
            lens_radius: camera.lens_radius,
            focal_distance: camera.focal_distance,
            shutter_open: camera.shutter_open,
            shutter: camera.shutter_close - camera.shutter_open,
        }
    }

    /// The ray through `film` (pixels of the whole image), with a unit direction. `lens` and
    /// `time` are numbers in [0, 1); a pinhole does not look at `lens`.
    #[inline]
    pub fn ray(&self, film: Vec2, lens: Vec2, time: f32) -> Ray {
        let screen = film * self.scale + self.offset;
        // Both projections give a direction with z = 1, so that distances along z are multiples.
        let (mut origin, mut direction) = match self.projection {
            Projection::Perspective { tan_half_fov } => (Vec3::ZERO, (screen * tan_half_fov).extend(1.0)),
            Projection::Orthographic => (screen.extend(0.0), Vec3::Z),
        };
        if self.lens_radius > 0.0 {
            // From the point on the lens towards the point in focus, over the focal distance.
            let on_lens = (self.lens_radius * concentric_disk(lens)).extend(0.0);
            origin += on_lens;
            direction -= on_lens / self.focal_distance;
        }
        let time = self.shutter_open + self.shutter * time;
        let to_render = match &self.to_render {
            Motion::Still(transform) => *transform,
            Motion::Moving(transform) => transform.at(time),
        };
        Ray {
            origin: to_render.transform_point3(origin),
            direction: to_render.transform_vector3(direction).normalize(),
            t_max: f32::INFINITY,
            time,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::PixelFilter;
    use glam::DAffine3;

    fn film() -> Film {
        Film {
            width: 400,
            height: 200,
            pixel_bounds: [0, 400, 0, 200],
            filter: PixelFilter::Box { radius: [0.5, 0.5] },
            filename: None,
            scale: 1.0,
        }
    }

    fn camera(projection: Projection, lens_radius: f32) -> Camera {
        Camera {
            to_render: AnimatedTransform::fixed(DAffine3::IDENTITY),
            projection,
            screen_window: [-2.0, 2.0, -1.0, 1.0],
            lens_radius,
            focal_distance: 5.0,
            shutter_open: 1.0,
            shutter_close: 3.0,
        }
    }

    fn close(a: Vec3, b: Vec3) -> bool {
        (a - b).abs().max_element() < 1e-5
    }

    #[test]
    fn the_centre_of_the_film_looks_along_z() {
        let rays = CameraRays::new(&camera(Projection::Perspective { tan_half_fov: 0.5 }, 0.0), &film());
        let ray = rays.ray(Vec2::new(200.0, 100.0), Vec2::ZERO, 0.0);
        assert!(close(ray.direction, Vec3::Z));
        assert_eq!((ray.origin, ray.time), (Vec3::ZERO, 1.0));
    }

    #[test]
    fn the_field_of_view_spans_the_shorter_side_with_rows_downwards() {
        let half = 20f32.to_radians();
        let rays =
            CameraRays::new(&camera(Projection::Perspective { tan_half_fov: half.tan() }, 0.0), &film());
        let top = rays.ray(Vec2::new(200.0, 0.0), Vec2::ZERO, 0.0).direction;
        assert!(close(top, Vec3::new(0.0, half.sin(), half.cos())));
        let left = rays.ray(Vec2::new(0.0, 100.0), Vec2::ZERO, 0.0).direction;
        assert!(close(left / left.z, Vec3::new(-2.0 * half.tan(), 0.0, 1.0)));
    }

    #[test]
    fn rays_through_any_point_of_the_lens_meet_in_focus() {
        for projection in [Projection::Perspective { tan_half_fov: 0.5 }, Projection::Orthographic] {
            let rays = CameraRays::new(&camera(projection, 0.3), &film());
            let film = Vec2::new(130.0, 170.0);
            let focus = |lens: Vec2| {
                let ray = rays.ray(film, lens, 0.0);
                ray.origin + ray.direction * (5.0 / ray.direction.z)
            };
            let pinhole = focus(Vec2::splat(0.5));
            for lens in [Vec2::new(0.0, 0.0), Vec2::new(0.9, 0.2), Vec2::new(0.4, 0.99)] {
                assert!(close(focus(lens), pinhole), "{projection:?}");
                assert!(rays.ray(film, lens, 0.0).origin != rays.ray(film, Vec2::splat(0.5), 0.0).origin);
            }
        }
    }

    #[test]
    fn time_runs_over_the_shutter() {
        let rays = CameraRays::new(&camera(Projection::Orthographic, 0.0), &film());
        assert_eq!(rays.ray(Vec2::ZERO, Vec2::ZERO, 0.5).time, 2.0);
    }
}
