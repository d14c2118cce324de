//! Generates camera rays: takes a film position, a lens sample and a time sample, gives a ray in render space.

use glam::{Mat3, Vec2, Vec3};

use super::disk::concentric_disk;
use super::sphere_map::SphereMap;
use crate::geometry::{Ray, RayLanes};
use crate::scene::camera::{Projection, SphericalMapping};
use crate::scene::{AnimatedTransform, Camera, Film};
use crate::simd::{LANES, Lanes, apply, multiversioned};

/// Generates the rays of one camera and film.
#[derive(Clone, Debug)]
pub struct CameraRays {
    to_render: CameraMotion,
    optics: Optics,
    shutter_open: f32,
    /// Time from the shutter's opening to its closing.
    exposure_time: f32,
}

/// Maps film and lens samples to rays in camera space.
#[derive(Clone, Debug)]
enum Optics {
    Lens(Lens),
    /// A spherical camera: the map, and the factors from film positions to its unit square.
    Sphere(SphereMap, Vec2),
}

/// A thin lens or a pinhole, in perspective or orthographic projection.
#[derive(Clone, Debug)]
struct Lens {
    /// Factors from the position in the screen window to the ray's origin and direction.
    screen_in_origin: f32,
    screen_in_direction: f32,
    /// The position in the screen window is `scale` times the film position plus `offset`.
    scale: Vec2,
    offset: Vec2,
    radius: f32,
    /// Inverse of the focal distance; 0 for a pinhole.
    inverse_focus: f32,
}

#[derive(Clone, Debug)]
enum CameraMotion {
    Still(Placement),
    Moving(AnimatedTransform),
}

#[derive(Clone, Copy, Debug)]
struct Placement {
    linear: Mat3,
    origin: Vec3,
}

impl CameraRays {
    pub fn new(camera: &Camera, film: &Film) -> Self {
        let to_render = if camera.to_render.is_animated() {
            CameraMotion::Moving(camera.to_render.clone())
        } else {
            CameraMotion::Still(Placement::from(camera.to_render.at(camera.shutter_open)))
        };
        let sphere = |map| Optics::Sphere(map, Vec2::new(film.width as f32, film.height as f32).recip());
        let optics = match camera.projection {
            Projection::Perspective { tan_half_fov } => {
                Optics::Lens(Lens::new(camera, film, 0.0, tan_half_fov))
            }
            Projection::Orthographic => Optics::Lens(Lens::new(camera, film, 1.0, 0.0)),
            Projection::Spherical(SphericalMapping::LatLong) => sphere(SphereMap::LatLong),
            Projection::Spherical(SphericalMapping::EqualArea) => sphere(SphereMap::EqualArea),
        };
        Self {
            to_render,
            optics,
            shutter_open: camera.shutter_open,
            exposure_time: camera.shutter_close - camera.shutter_open,
        }
    }

    /// Returns the ray through the film position `film`, in pixels of the whole image, with a unit direction
    /// and infinite length. `lens` and `time` are sample values in [0, 1).
    #[inline]
    pub fn ray(&self, film: Vec2, lens: Vec2, time: f32) -> Ray {
        let time = self.shutter_open + self.exposure_time * time;
        let placement = match &self.to_render {
            CameraMotion::Still(placement) => *placement,
            CameraMotion::Moving(transform) => Placement::from(transform.at(time)),
        };
        match &self.optics {
            Optics::Lens(optics) => optics.ray(&placement, film, lens, time),
            Optics::Sphere(map, scale) => {
                let Vec3 { x, y, z } = map.direction(map.wrapped(film * scale));
                Ray {
                    origin: placement.origin,
                    // The camera's pole is y, the map's is z.
                    direction: (placement.linear * Vec3::new(x, z, y)).normalize(),
                    t_max: f32::INFINITY,
                    time,
                }
            }
        }
    }

    /// Computes [`Self::ray`] for every lane.
    pub fn rays(&self, film: &[Lanes; 2], lens: &[Lanes; 2], time: &Lanes, rays: &mut RayLanes) {
        match (&self.to_render, &self.optics) {
            (CameraMotion::Still(placement), Optics::Lens(optics)) => {
                still_camera_rays(optics, placement, film, lens, rays);
                let times = rays.time.iter_mut().zip(time);
                times.for_each(|(to, time)| *to = self.shutter_open + self.exposure_time * time);
            }
            _ => {
                let at = |pair: &[Lanes; 2], lane: usize| Vec2::new(pair[0][lane], pair[1][lane]);
                (0..LANES).for_each(|lane| {
                    rays.set(lane, self.ray(at(film, lane), at(lens, lane), time[lane]));
                });
            }
        }
    }
}

impl From<glam::Affine3A> for Placement {
    #[inline]
    fn from(transform: glam::Affine3A) -> Self {
        Self { linear: transform.matrix3.into(), origin: transform.translation.into() }
    }
}

impl Lens {
    fn new(camera: &Camera, film: &Film, screen_in_origin: f32, screen_in_direction: f32) -> Self {
        let [x_min, x_max, y_min, y_max] = camera.screen_window;
        Self {
            screen_in_origin,
            screen_in_direction,
            // Rows run downwards on the film, y runs upwards in the screen window.
            scale: Vec2::new((x_max - x_min) / film.width as f32, (y_min - y_max) / film.height as f32),
            offset: Vec2::new(x_min, y_max),
            radius: camera.lens_radius.max(0.0),
            inverse_focus: if camera.lens_radius > 0.0 { 1.0 / camera.focal_distance } else { 0.0 },
        }
    }

    #[inline(always)]
    fn ray(&self, placement: &Placement, film: Vec2, lens: Vec2, time: f32) -> Ray {
        let screen = film * self.scale + self.offset;
        // The ray leaves the point on the lens towards the point in focus. Both projections give a direction
        // with z = 1, so that its multiples are distances along z.
        let on_lens = self.radius * concentric_disk(lens);
        let origin = screen * self.screen_in_origin + on_lens;
        let direction = screen * self.screen_in_direction - on_lens * self.inverse_focus;
        Ray {
            origin: placement.linear * origin.extend(0.0) + placement.origin,
            direction: (placement.linear * direction.extend(1.0)).normalize(),
            t_max: f32::INFINITY,
            time,
        }
    }
}

#[apply(multiversioned!)]
fn still_camera_rays(
    camera: &Lens,
    placement: &Placement,
    film: &[Lanes; 2],
    lens: &[Lanes; 2],
    rays: &mut RayLanes,
) {
    let ([film_x, film_y], [lens_x, lens_y]) = (film, lens);
    for lane in 0..LANES {
        let (film, lens) = (Vec2::new(film_x[lane], film_y[lane]), Vec2::new(lens_x[lane], lens_y[lane]));
        let ray = camera.ray(placement, film, lens, 0.0);
        rays.origin.set(lane, ray.origin);
        rays.direction.set(lane, ray.direction);
        rays.t_max[lane] = ray.t_max;
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
            white_balance: None,
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
    fn the_ray_through_the_centre_of_the_film_is_along_z() {
        let rays = CameraRays::new(&camera(Projection::Perspective { tan_half_fov: 0.5 }, 0.0), &film());
        let ray = rays.ray(Vec2::new(200.0, 100.0), Vec2::ZERO, 0.0);
        assert!(close(ray.direction, Vec3::Z));
        assert_eq!((ray.origin, ray.time), (Vec3::ZERO, 1.0));
    }

    #[test]
    fn the_field_of_view_spans_the_shorter_side() {
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
    fn a_spherical_camera_covers_all_directions() {
        let spherical = |mapping| CameraRays::new(&camera(Projection::Spherical(mapping), 0.0), &film());
        let lat_long = spherical(SphericalMapping::LatLong);
        let at = |x: f32, y: f32| lat_long.ray(Vec2::new(x, y), Vec2::ZERO, 0.0).direction;
        assert!(close(at(50.0, 0.0), Vec3::Y) && close(at(50.0, 200.0), Vec3::NEG_Y));
        assert!(close(at(0.0, 100.0), Vec3::X) && close(at(100.0, 100.0), Vec3::Z));
        // Positions beyond a border, which pixel filters reach, continue on the sphere.
        assert!(close(at(-5.0, 70.0), at(395.0, 70.0)) && close(at(0.0, -5.0), at(200.0, 5.0)));
        let equal_area = spherical(SphericalMapping::EqualArea);
        let at = |x: f32, y: f32| equal_area.ray(Vec2::new(x, y), Vec2::ZERO, 0.0).direction;
        assert!(close(at(200.0, 100.0), Vec3::Y) && close(at(400.0, 100.0), Vec3::X));
        assert!(close(at(200.0, 200.0), Vec3::Z) && close(at(0.0, 0.0), Vec3::NEG_Y));
        assert!(close(at(-4.0, 30.0), at(4.0, 170.0)) && close(at(90.0, 203.0), at(310.0, 197.0)));
        let mut rays = RayLanes::NONE;
        let lanes = |v: f32| [v; LANES];
        lat_long.rays(&[lanes(100.0), lanes(100.0)], &[lanes(0.0); 2], &lanes(0.5), &mut rays);
        assert!(close(rays.at(3).direction, Vec3::Z) && rays.at(3).time == 2.0);
    }

    #[test]
    fn time_samples_span_the_exposure() {
        let rays = CameraRays::new(&camera(Projection::Orthographic, 0.0), &film());
        assert_eq!(rays.ray(Vec2::ZERO, Vec2::ZERO, 0.5).time, 2.0);
    }
}
