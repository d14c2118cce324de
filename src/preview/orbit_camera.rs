//! The preview's camera: orbit, pan and dolly around a pivot, aperture and focus.
//!
//! Takes the scene's camera and the moves of the page; gives the camera to render with.

use glam::{DAffine3, DQuat, DVec3};

use super::camera_move::CameraMove;
use crate::scene::Camera;
use crate::scene::camera::{Projection, is_window};

/// Smallest angle between the view direction and the vertical, in radians; beyond it the camera would flip.
const POLE_MARGIN: f64 = 0.05;
/// Smallest distance to the pivot, as a fraction of the first distance.
const NEAREST: f64 = 1e-3;
/// Smallest focal distance, as a fraction of the first distance to the pivot.
const NEAREST_FOCUS: f64 = 1e-3;

/// A camera that orbits a pivot.
#[derive(Clone, Debug)]
pub struct OrbitCamera {
    /// The scene's own camera.
    original: Camera,
    camera: Camera,
    /// The point that the camera looks at and orbits, in render space.
    pivot: DVec3,
    /// Distance from the scene's own camera to the pivot.
    first_distance: f64,
    /// Whether a user has set the focal distance.
    is_focused: bool,
    /// The vertical axis of orbits: the coordinate axis nearest to the camera's up.
    up: DVec3,
}

/// Position and axes of a camera, in render space.
struct Pose {
    position: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
}

impl OrbitCamera {
    /// Starts with the scene's camera. `seen` is the point that is visible in the middle of the image, if any;
    /// `reach` is the distance to the pivot otherwise.
    pub fn new(camera: &Camera, seen: Option<DVec3>, reach: f64) -> Self {
        let pose = Pose::new(camera);
        let ahead = seen.map(|seen| match camera.projection {
            // The middle of a spherical image is not in the forward direction.
            Projection::Spherical(_) => (seen - pose.position).length(),
            Projection::Perspective { .. } | Projection::Orthographic => {
                (seen - pose.position).dot(pose.forward)
            }
        });
        let distance = ahead.filter(|d| *d > 0.0).unwrap_or(reach);
        Self {
            original: camera.clone(),
            camera: camera.clone(),
            pivot: pose.position + distance * pose.forward,
            first_distance: distance,
            is_focused: false,
            up: nearest_axis(pose.up),
        }
    }

    /// Returns the camera to render with.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns whether the camera can have a lens.
    pub fn has_lens(&self) -> bool {
        !matches!(self.camera.projection, Projection::Spherical(_))
    }

    /// Returns the distance to the pivot, in scene units.
    pub fn distance(&self) -> f64 {
        (self.pivot - Pose::new(&self.camera).position).length()
    }

    /// Returns the distance of a point along the view axis, in scene units.
    pub fn depth_of(&self, point: DVec3) -> f64 {
        let camera_space = self.camera.to_render.at_f64(self.camera.shutter_open).inverse();
        camera_space.transform_point3(point).z
    }

    /// Applies a move, unless the resulting camera cannot be represented in the renderer's precision. `seen` is the
    /// point at the pixel to focus on.
    pub fn apply(&mut self, step: &CameraMove, seen: Option<DVec3>) {
        let before = self.clone();
        self.apply_unchecked(step, seen);
        if !self.is_valid() {
            *self = before;
        }
    }

    /// Tests whether all numbers are finite, the screen window is not empty and the focal distance is positive.
    fn is_valid(&self) -> bool {
        let Camera { to_render, screen_window, lens_radius, focal_distance, .. } = &self.camera;
        let matrix = to_render.at_f64(self.camera.shutter_open).as_affine3a();
        let pivot = self.pivot.as_vec3();
        is_window(*screen_window)
            && matrix.is_finite()
            && pivot.is_finite()
            && lens_radius.is_finite()
            && (f32::MIN_POSITIVE..=f32::MAX).contains(focal_distance)
    }

    fn apply_unchecked(&mut self, step: &CameraMove, seen: Option<DVec3>) {
        if step.reset {
            *self = self.with_original_camera();
        }
        if let Some([right, up]) = step.orbit {
            self.orbit(f64::from(right), f64::from(up));
        }
        if let Some([right, down]) = step.pan {
            self.pan(f64::from(right), f64::from(down));
        }
        if let Some(amount) = step.dolly {
            self.dolly(f64::from(amount));
        }
        if let Some(radius) = step.aperture {
            // The focal distance of a pinhole camera is arbitrary: its first lens focuses on the pivot.
            let is_pinhole = self.camera.lens_radius == 0.0 && self.original.lens_radius == 0.0;
            if is_pinhole && !self.is_focused {
                self.camera.focal_distance = self.nearest_focus(self.depth_of(self.pivot));
            }
            self.camera.lens_radius = if self.has_lens() { radius } else { 0.0 };
        }
        if let Some(distance) = step.focus {
            self.focus(f64::from(distance));
        }
        if let Some(point) = seen {
            self.focus(self.depth_of(point));
        }
    }

    fn with_original_camera(&self) -> Self {
        let pose = Pose::new(&self.original);
        Self {
            camera: self.original.clone(),
            pivot: pose.position + self.first_distance * pose.forward,
            is_focused: false,
            ..self.clone()
        }
    }

    /// Tests whether another camera renders the same image: without a lens the focal distance is irrelevant.
    pub fn is_equivalent(&self, other: &Camera) -> bool {
        let is_pinhole = self.camera.lens_radius == 0.0 && other.lens_radius == 0.0;
        let focal_distance = if is_pinhole { other.focal_distance } else { self.camera.focal_distance };
        Camera { focal_distance, ..self.camera.clone() } == *other
    }

    fn focus(&mut self, depth: f64) {
        self.camera.focal_distance = self.nearest_focus(depth);
        self.is_focused = true;
    }

    /// Returns a focal distance that is not too small.
    fn nearest_focus(&self, depth: f64) -> f32 {
        depth.max(NEAREST_FOCUS * self.first_distance) as f32
    }

    /// Rotates around the pivot so that the image follows the pointer.
    fn orbit(&mut self, right: f64, up: f64) {
        let pose = Pose::new(&self.camera);
        let away = pose.position - self.pivot;
        // A mirrored camera turns the other way round.
        let handedness = -self.up.cross(away).dot(pose.right).signum();
        let turn = DQuat::from_axis_angle(self.up, handedness * right);
        let pitch = {
            let elevation = (away.normalize_or_zero().dot(self.up)).clamp(-1.0, 1.0).asin();
            let limit = std::f64::consts::FRAC_PI_2 - POLE_MARGIN;
            // A scene's own camera may be beyond the limit; it can move back but no farther.
            let wanted = elevation + up;
            let limited =
                if up > 0.0 { wanted.min(limit.max(elevation)) } else { wanted.max((-limit).min(elevation)) };
            limited - elevation
        };
        let axis = pose.right.normalize_or_zero();
        let lifts = axis.cross(away).dot(self.up) > 0.0;
        let tilt = DQuat::from_axis_angle(axis, if lifts { pitch } else { -pitch });
        let rotation = DAffine3::from_quat(turn * tilt);
        let about =
            DAffine3::from_translation(self.pivot) * rotation * DAffine3::from_translation(-self.pivot);
        self.transform(about);
    }

    fn pan(&mut self, right: f64, down: f64) {
        let pose = Pose::new(&self.camera);
        let [x_min, x_max, y_min, y_max] = self.camera.screen_window.map(f64::from);
        let spread = match self.camera.projection {
            Projection::Perspective { tan_half_fov } => f64::from(tan_half_fov) * self.distance(),
            Projection::Orthographic => 1.0,
            // As for a perspective camera whose field of view is a right angle.
            Projection::Spherical(_) => self.distance(),
        };
        let [right, down] = [right * (x_max - x_min).signum(), down * (y_max - y_min).signum()];
        let shift = (y_max - y_min).abs() * spread * (down * pose.up - right * pose.right);
        self.transform(DAffine3::from_translation(shift));
        self.pivot += shift;
    }

    fn dolly(&mut self, amount: f64) {
        match self.camera.projection {
            Projection::Perspective { .. } | Projection::Spherical(_) => {
                let pose = Pose::new(&self.camera);
                let away = pose.position - self.pivot;
                let factor = (-amount).exp().max(NEAREST * self.first_distance / away.length().max(1e-30));
                self.transform(DAffine3::from_translation((factor - 1.0) * away));
            }
            // An orthographic image does not depend on the distance: the screen window shrinks instead.
            Projection::Orthographic => {
                let factor = (-amount).exp();
                self.camera.screen_window = self.camera.screen_window.map(|v| v * factor as f32);
            }
        }
    }

    fn transform(&mut self, by: DAffine3) {
        if by.is_finite() {
            self.camera.to_render = self.camera.to_render.clone().moved(by);
        }
    }
}

impl Pose {
    fn new(camera: &Camera) -> Self {
        let to_render = camera.to_render.at_f64(camera.shutter_open);
        let axis = |v| to_render.transform_vector3(v).normalize_or_zero();
        Self {
            position: to_render.translation,
            right: axis(DVec3::X),
            up: axis(DVec3::Y),
            forward: axis(DVec3::Z),
        }
    }
}

/// Returns the coordinate axis nearest to a direction.
fn nearest_axis(v: DVec3) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    axes.max_by(|a, b| a.dot(v).total_cmp(&b.dot(v))).unwrap_or(DVec3::Y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::AnimatedTransform;

    /// Looks along z at a point 10 units away.
    fn orbit_camera(mirror: f64) -> OrbitCamera {
        let camera = Camera {
            to_render: AnimatedTransform::fixed(DAffine3::from_scale(DVec3::new(mirror, 1.0, 1.0))),
            projection: Projection::Perspective { tan_half_fov: 0.5 },
            screen_window: [-2.0, 2.0, -1.0, 1.0],
            lens_radius: 0.0,
            focal_distance: 1e6,
            shutter_open: 0.0,
            shutter_close: 1.0,
        };
        OrbitCamera::new(&camera, Some(DVec3::new(0.0, 0.0, 10.0)), 1.0)
    }

    /// Projects a point to the film: right and up, in tangents.
    fn on_film(orbit: &OrbitCamera, point: DVec3) -> (f64, f64) {
        let p = orbit.camera.to_render.at_f64(0.0).inverse().transform_point3(point);
        (p.x / p.z, p.y / p.z)
    }

    const NEAR_SIDE: DVec3 = DVec3::new(0.0, 0.0, 9.0);
    const PIVOT: DVec3 = DVec3::new(0.0, 0.0, 10.0);

    #[test]
    fn in_an_orbit_the_near_side_follows_the_pointer() {
        for mirror in [1.0, -1.0] {
            let mut orbit = orbit_camera(mirror);
            orbit.apply(&CameraMove { orbit: Some([0.1, 0.0]), ..CameraMove::default() }, None);
            let (x, y) = on_film(&orbit, NEAR_SIDE);
            assert!(x > 0.005 && y.abs() < 1e-9, "{mirror} {x} {y}");
            assert!((orbit.distance() - 10.0).abs() < 1e-9);
            assert!(on_film(&orbit, PIVOT).0.abs() < 1e-9);
            orbit.apply(&CameraMove { orbit: Some([0.0, 0.1]), ..CameraMove::default() }, None);
            assert!(on_film(&orbit, NEAR_SIDE).1 < -0.005, "seen from above it sinks");
        }
    }

    #[test]
    fn an_orbit_stops_short_of_the_pole() {
        let mut orbit = orbit_camera(1.0);
        for _ in 0..10 {
            orbit.apply(&CameraMove { orbit: Some([0.0, 1.0]), ..CameraMove::default() }, None);
        }
        let position = orbit.camera.to_render.at_f64(0.0).translation;
        let elevation = (position - PIVOT).normalize().y.asin();
        assert!((elevation - (std::f64::consts::FRAC_PI_2 - POLE_MARGIN)).abs() < 1e-6, "{elevation}");
    }

    #[test]
    fn a_pan_by_the_images_height_shifts_the_image_by_it() {
        let mut orbit = orbit_camera(1.0);
        orbit.apply(&CameraMove { pan: Some([1.0, 0.5]), ..CameraMove::default() }, None);
        let (x, y) = on_film(&orbit, PIVOT);
        // The image is 2 · 0.5 high at distance 1.
        assert!((x - 1.0).abs() < 1e-9 && (y + 0.5).abs() < 1e-9, "{x} {y}");
    }

    #[test]
    fn a_pan_follows_the_pointer_in_a_window_that_was_shrunk() {
        let mut orbit = orbit_camera(1.0);
        orbit.camera.projection = Projection::Orthographic;
        orbit.apply(&CameraMove { dolly: Some(2f32.ln()), ..CameraMove::default() }, None);
        orbit.apply(&CameraMove { pan: Some([1.0, 0.0]), ..CameraMove::default() }, None);
        // The window is 2 high, and half of that after the dolly.
        assert!((orbit.camera.to_render.at_f64(0.0).translation + DVec3::X).length() < 1e-6);
    }

    #[test]
    fn a_dolly_halves_the_distance_and_never_passes_the_point() {
        let mut orbit = orbit_camera(1.0);
        orbit.apply(&CameraMove { dolly: Some(2f32.ln()), ..CameraMove::default() }, None);
        assert!((orbit.distance() - 5.0).abs() < 1e-6);
        for _ in 0..20 {
            orbit.apply(&CameraMove { dolly: Some(4.0), ..CameraMove::default() }, None);
        }
        assert!(orbit.distance() > 0.009);
    }

    #[test]
    fn without_a_lens_the_focus_changes_nothing() {
        let mut orbit = orbit_camera(1.0);
        let scenes_own = orbit.camera.clone();
        orbit.apply(&CameraMove { focus: Some(3.0), ..CameraMove::default() }, None);
        assert!(orbit.is_equivalent(&scenes_own) && orbit.camera.focal_distance == 3.0);
        orbit.apply(&CameraMove { aperture: Some(0.1), ..CameraMove::default() }, None);
        let with_lens = orbit.camera.clone();
        assert!(!orbit.is_equivalent(&scenes_own) && orbit.is_equivalent(&with_lens));
        orbit.apply(&CameraMove { focus: Some(4.0), ..CameraMove::default() }, None);
        assert!(!orbit.is_equivalent(&with_lens));
    }

    #[test]
    fn focus_is_along_the_axis_and_reset_undoes_everything() {
        let mut orbit = orbit_camera(1.0);
        orbit.apply(&CameraMove { aperture: Some(0.2), ..CameraMove::default() }, None);
        assert_eq!((orbit.camera.lens_radius, orbit.camera.focal_distance), (0.2, 10.0));
        orbit.apply(&CameraMove::default(), Some(DVec3::new(5.0, 0.0, 7.0)));
        assert_eq!(orbit.camera.focal_distance, 7.0);
        orbit.apply(
            &CameraMove { orbit: Some([1.0, 0.3]), pan: Some([0.1, 0.2]), ..CameraMove::default() },
            None,
        );
        orbit.apply(&CameraMove { reset: true, ..CameraMove::default() }, None);
        assert_eq!(orbit.camera, orbit.original);
    }

    #[test]
    fn a_focus_that_was_set_survives_a_change_of_the_aperture() {
        let mut orbit = orbit_camera(1.0);
        let aperture = |radius| CameraMove { aperture: Some(radius), ..CameraMove::default() };
        orbit.apply(&CameraMove::default(), Some(DVec3::new(0.0, 0.0, 7.0)));
        for radius in [0.1, 0.0, 0.3] {
            orbit.apply(&aperture(radius), None);
            assert_eq!(orbit.camera.focal_distance, 7.0, "{radius}");
        }
        orbit.apply(&CameraMove { reset: true, ..aperture(0.1) }, None);
        assert_eq!(orbit.camera.focal_distance, 10.0, "the pivot's");
    }

    #[test]
    fn moves_that_never_end_leave_a_camera_that_can_be_rendered() {
        let scene = |camera: &str| {
            crate::scene::pbrt::read_str(&format!("{camera} WorldBegin"), std::path::Path::new("")).unwrap()
        };
        for camera in ["Camera \"perspective\"", "Camera \"orthographic\""] {
            let scene = scene(camera);
            let mut orbit = OrbitCamera::new(&scene.camera, None, 5.0);
            for dolly in [-4.0, 4.0] {
                let step = CameraMove { dolly: Some(dolly), pan: Some([4.0, -4.0]), ..CameraMove::default() };
                (0..300).for_each(|_| orbit.apply(&step, None));
                assert!(orbit.is_valid(), "{orbit:?}");
            }
        }
    }
}
