//! The camera in a person's hand: orbit, pan and dolly around a point, lens and focus.

use glam::{DAffine3, DQuat, DVec3};

use super::protocol::Move;
use crate::scene::Camera;
use crate::scene::camera::Projection;

/// The nearest that the camera looks up or down, in radians from the vertical: beyond it would flip.
const POLE_MARGIN: f64 = 0.05;
/// The camera does not come nearer to the point than this share of its first distance.
const NEAREST: f64 = 1e-3;
/// Focal distances are at least this share of the distance to the point looked at.
const NEAREST_FOCUS: f64 = 1e-3;

/// The scene's camera, where a person has taken it.
#[derive(Clone, Debug)]
pub struct Rig {
    original: Camera,
    camera: Camera,
    /// The point looked at, in render space.
    pivot: DVec3,
    /// Distance from camera to pivot at first.
    first_distance: f64,
    /// The axis that stands for up: the one nearest to the camera's.
    up: DVec3,
}

/// Where the camera stands and how it looks.
struct Pose {
    position: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
}

impl Rig {
    /// `seen`: what the scene's camera sees in the middle of the image, if anything; `reach`: how far
    /// away the point looked at is else.
    pub fn new(camera: &Camera, seen: Option<DVec3>, reach: f64) -> Self {
        let pose = Pose::of(camera);
        let ahead = seen.map(|seen| match camera.projection {
            // The middle of its image is not ahead.
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
            up: nearest_axis(pose.up),
        }
    }

    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Distance to the point looked at, in scene units.
    pub fn distance(&self) -> f64 {
        (self.pivot - Pose::of(&self.camera).position).length()
    }

    /// Distance of a point along the view axis, in scene units.
    pub fn depth_of(&self, point: DVec3) -> f64 {
        let camera_space = self.camera.to_render.at_f64(self.camera.shutter_open).inverse();
        camera_space.transform_point3(point).z
    }

    /// Moves as asked, unless that leads beyond what the renderer's numbers can hold. `seen` is the point at
    /// the pixel to focus on.
    pub fn apply(&mut self, step: &Move, seen: Option<DVec3>) {
        let before = self.clone();
        self.go(step, seen);
        if !self.is_sound() {
            *self = before;
        }
    }

    fn is_sound(&self) -> bool {
        let Camera { to_render, screen_window: [x0, x1, y0, y1], lens_radius, focal_distance, .. } =
            &self.camera;
        let window = [x0, x1, y0, y1, &(x1 - x0), &(y1 - y0)].into_iter().all(|v| v.is_finite());
        let matrix = to_render.at_f64(self.camera.shutter_open).as_affine3a();
        let pivot = self.pivot.as_vec3();
        window
            && x0 < x1
            && y0 < y1
            && matrix.is_finite()
            && pivot.is_finite()
            && lens_radius.is_finite()
            && (f32::MIN_POSITIVE..=f32::MAX).contains(focal_distance)
    }

    fn go(&mut self, step: &Move, seen: Option<DVec3>) {
        if step.reset {
            *self = Self::reset(self);
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
            // A pinhole's focal distance means nothing; a lens that is put on looks at the point.
            if self.camera.lens_radius == 0.0 && self.original.lens_radius == 0.0 && step.focus.is_none() {
                self.focus(self.depth_of(self.pivot));
            }
            self.camera.lens_radius = radius;
        }
        if let Some(distance) = step.focus {
            self.focus(f64::from(distance));
        }
        if let Some(point) = seen {
            self.focus(self.depth_of(point));
        }
    }

    fn reset(&self) -> Self {
        let pose = Pose::of(&self.original);
        Self {
            camera: self.original.clone(),
            pivot: pose.position + self.first_distance * pose.forward,
            ..self.clone()
        }
    }

    /// Whether it sees what that camera sees: a focus that no lens has changes nothing.
    pub fn sees_as(&self, other: &Camera) -> bool {
        let is_pinhole = self.camera.lens_radius == 0.0 && other.lens_radius == 0.0;
        let focal_distance = if is_pinhole { other.focal_distance } else { self.camera.focal_distance };
        Camera { focal_distance, ..self.camera.clone() } == *other
    }

    fn focus(&mut self, depth: f64) {
        self.camera.focal_distance = depth.max(NEAREST_FOCUS * self.first_distance) as f32;
    }

    /// Turns around the pivot so that the picture follows the hand.
    fn orbit(&mut self, right: f64, up: f64) {
        let pose = Pose::of(&self.camera);
        let away = pose.position - self.pivot;
        // With a mirrored camera the picture's right lies the other way round.
        let hand = -self.up.cross(away).dot(pose.right).signum();
        let turn = DQuat::from_axis_angle(self.up, hand * right);
        let pitch = {
            let elevation = (away.normalize_or_zero().dot(self.up)).clamp(-1.0, 1.0).asin();
            let limit = std::f64::consts::FRAC_PI_2 - POLE_MARGIN;
            // A scene's own camera may stand beyond the limit; it can come back but not go on.
            let wanted = elevation + up;
            let kept =
                if up > 0.0 { wanted.min(limit.max(elevation)) } else { wanted.max((-limit).min(elevation)) };
            kept - elevation
        };
        let axis = pose.right.normalize_or_zero();
        let lifts = axis.cross(away).dot(self.up) > 0.0;
        let tilt = DQuat::from_axis_angle(axis, if lifts { pitch } else { -pitch });
        let rotation = DAffine3::from_quat(turn * tilt);
        let about =
            DAffine3::from_translation(self.pivot) * rotation * DAffine3::from_translation(-self.pivot);
        self.moved(about);
    }

    fn pan(&mut self, right: f64, down: f64) {
        let pose = Pose::of(&self.camera);
        let [_, _, y_min, y_max] = self.camera.screen_window.map(f64::from);
        let spread = match self.camera.projection {
            Projection::Perspective { tan_half_fov } => f64::from(tan_half_fov) * self.distance(),
            Projection::Orthographic => 1.0,
            // As a field of view of a right angle.
            Projection::Spherical(_) => self.distance(),
        };
        let shift = (y_max - y_min) * spread * (down * pose.up - right * pose.right);
        self.moved(DAffine3::from_translation(shift));
        self.pivot += shift;
    }

    fn dolly(&mut self, amount: f64) {
        match self.camera.projection {
            Projection::Perspective { .. } | Projection::Spherical(_) => {
                let pose = Pose::of(&self.camera);
                let away = pose.position - self.pivot;
                let factor = (-amount).exp().max(NEAREST * self.first_distance / away.length().max(1e-30));
                self.moved(DAffine3::from_translation((factor - 1.0) * away));
            }
            // Parallel rays see no distance: the window shrinks instead.
            Projection::Orthographic => {
                let factor = (-amount).exp();
                self.camera.screen_window = self.camera.screen_window.map(|v| v * factor as f32);
            }
        }
    }

    fn moved(&mut self, by: DAffine3) {
        if by.is_finite() {
            self.camera.to_render = self.camera.to_render.clone().moved(by);
        }
    }
}

impl Pose {
    fn of(camera: &Camera) -> Self {
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

fn nearest_axis(v: DVec3) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    axes.max_by(|a, b| a.dot(v).total_cmp(&b.dot(v))).unwrap_or(DVec3::Y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::AnimatedTransform;

    /// Looks along z at a point 10 units away.
    fn rig(mirror: f64) -> Rig {
        let camera = Camera {
            to_render: AnimatedTransform::fixed(DAffine3::from_scale(DVec3::new(mirror, 1.0, 1.0))),
            projection: Projection::Perspective { tan_half_fov: 0.5 },
            screen_window: [-2.0, 2.0, -1.0, 1.0],
            lens_radius: 0.0,
            focal_distance: 1e6,
            shutter_open: 0.0,
            shutter_close: 1.0,
        };
        Rig::new(&camera, Some(DVec3::new(0.0, 0.0, 10.0)), 1.0)
    }

    /// Where a point is on the film: right and up, in tangents.
    fn on_film(rig: &Rig, point: DVec3) -> (f64, f64) {
        let p = rig.camera.to_render.at_f64(0.0).inverse().transform_point3(point);
        (p.x / p.z, p.y / p.z)
    }

    const NEAR_SIDE: DVec3 = DVec3::new(0.0, 0.0, 9.0);
    const PIVOT: DVec3 = DVec3::new(0.0, 0.0, 10.0);

    #[test]
    fn what_is_in_front_follows_the_hand_in_an_orbit() {
        for mirror in [1.0, -1.0] {
            let mut rig = rig(mirror);
            rig.apply(&Move { orbit: Some([0.1, 0.0]), ..Move::default() }, None);
            let (x, y) = on_film(&rig, NEAR_SIDE);
            assert!(x > 0.005 && y.abs() < 1e-9, "{mirror} {x} {y}");
            assert!((rig.distance() - 10.0).abs() < 1e-9);
            assert!(on_film(&rig, PIVOT).0.abs() < 1e-9);
            rig.apply(&Move { orbit: Some([0.0, 0.1]), ..Move::default() }, None);
            assert!(on_film(&rig, NEAR_SIDE).1 < -0.005, "seen from above it sinks");
        }
    }

    #[test]
    fn an_orbit_stops_short_of_the_pole() {
        let mut rig = rig(1.0);
        for _ in 0..10 {
            rig.apply(&Move { orbit: Some([0.0, 1.0]), ..Move::default() }, None);
        }
        let position = rig.camera.to_render.at_f64(0.0).translation;
        let elevation = (position - PIVOT).normalize().y.asin();
        assert!((elevation - (std::f64::consts::FRAC_PI_2 - POLE_MARGIN)).abs() < 1e-6, "{elevation}");
    }

    #[test]
    fn a_pan_by_the_images_height_shifts_the_picture_by_it() {
        let mut rig = rig(1.0);
        rig.apply(&Move { pan: Some([1.0, 0.5]), ..Move::default() }, None);
        let (x, y) = on_film(&rig, PIVOT);
        // The image is 2 · 0.5 high at distance 1.
        assert!((x - 1.0).abs() < 1e-9 && (y + 0.5).abs() < 1e-9, "{x} {y}");
    }

    #[test]
    fn a_pan_follows_the_hand_in_a_window_that_was_shrunk() {
        let mut rig = rig(1.0);
        rig.camera.projection = Projection::Orthographic;
        rig.apply(&Move { dolly: Some(2f32.ln()), ..Move::default() }, None);
        rig.apply(&Move { pan: Some([1.0, 0.0]), ..Move::default() }, None);
        // The window is 2 high, and half of that after the dolly.
        assert!((rig.camera.to_render.at_f64(0.0).translation + DVec3::X).length() < 1e-6);
    }

    #[test]
    fn a_dolly_halves_the_distance_and_never_passes_the_point() {
        let mut rig = rig(1.0);
        rig.apply(&Move { dolly: Some(2f32.ln()), ..Move::default() }, None);
        assert!((rig.distance() - 5.0).abs() < 1e-6);
        for _ in 0..20 {
            rig.apply(&Move { dolly: Some(4.0), ..Move::default() }, None);
        }
        assert!(rig.distance() > 0.009);
    }

    #[test]
    fn a_focus_that_no_lens_has_changes_nothing_that_is_seen() {
        let mut rig = rig(1.0);
        let scenes_own = rig.camera.clone();
        rig.apply(&Move { focus: Some(3.0), ..Move::default() }, None);
        assert!(rig.sees_as(&scenes_own) && rig.camera.focal_distance == 3.0);
        rig.apply(&Move { aperture: Some(0.1), ..Move::default() }, None);
        let with_lens = rig.camera.clone();
        assert!(!rig.sees_as(&scenes_own) && rig.sees_as(&with_lens));
        rig.apply(&Move { focus: Some(4.0), ..Move::default() }, None);
        assert!(!rig.sees_as(&with_lens));
    }

    #[test]
    fn focus_is_along_the_axis_and_reset_undoes_everything() {
        let mut rig = rig(1.0);
        rig.apply(&Move { aperture: Some(0.2), ..Move::default() }, None);
        assert_eq!((rig.camera.lens_radius, rig.camera.focal_distance), (0.2, 10.0));
        rig.apply(&Move::default(), Some(DVec3::new(5.0, 0.0, 7.0)));
        assert_eq!(rig.camera.focal_distance, 7.0);
        rig.apply(&Move { orbit: Some([1.0, 0.3]), pan: Some([0.1, 0.2]), ..Move::default() }, None);
        rig.apply(&Move { reset: true, ..Move::default() }, None);
        assert_eq!(rig.camera, rig.original);
    }

    #[test]
    fn moves_that_never_end_leave_a_camera_that_can_be_rendered() {
        let scene = |camera: &str| {
            crate::scene::pbrt::read_str(&format!("{camera} WorldBegin"), std::path::Path::new("")).unwrap()
        };
        for camera in ["Camera \"perspective\"", "Camera \"orthographic\""] {
            let scene = scene(camera);
            let mut rig = Rig::new(&scene.camera, None, 5.0);
            for dolly in [-4.0, 4.0] {
                let step = Move { dolly: Some(dolly), pan: Some([4.0, -4.0]), ..Move::default() };
                (0..300).for_each(|_| rig.apply(&step, None));
                assert!(rig.is_sound(), "{rig:?}");
            }
        }
    }
}
