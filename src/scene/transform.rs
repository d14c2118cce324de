//! Affine transforms and their motion over the shutter interval.
//!
//! A moving transform is decomposed once into translation, rotation and stretch (Shoemake and Duff
//! 1992, "Matrix animation and polar decomposition"), and recomposed at each time that is evaluated.

use glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3};

/// Limit of Newton's iteration for the polar decomposition. Each step halves the error of the scale, and
/// convergence is quadratic near the solution.
const POLAR_STEPS: usize = 100;
/// Convergence threshold: a few rounding errors of a rotation's entries.
const POLAR_TOLERANCE: f64 = 1e-15;

/// A transform that moves between two key times. It is constant before `start_time` and after
/// `end_time`.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimatedTransform {
    pub start: DAffine3,
    pub start_time: f32,
    pub end_time: f32,
    /// Boxed, because most instances do not move.
    motion: Option<Box<Motion>>,
}

/// The decomposed keys of a moving transform.
#[derive(Clone, Debug, PartialEq)]
struct Motion {
    end: DAffine3,
    translation: [DVec3; 2],
    rotation: Turn,
    stretch: [DMat3; 2],
    /// Applied first, see [`AnimatedTransform::after_translation`].
    before: DVec3,
}

/// A uniform rotation along the shorter arc between two orientations (Shoemake 1985, "Animating rotation with quaternion
/// curves"), with what does not depend on time computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turn {
    start: DQuat,
    /// Unit, and orthogonal to `start` in the plane of the arc; 0 where there is no arc.
    towards: DQuat,
    /// Angle of the arc between the quaternions, which is half of the rotation's; in [0, π/2].
    angle: f64,
}

impl Turn {
    fn new(start: DQuat, end: DQuat) -> Self {
        let end = if start.dot(end) < 0.0 { -end } else { end };
        let cos = start.dot(end);
        let rest = end - start * cos;
        let sin = rest.length();
        let towards = if sin > 0.0 { rest / sin } else { DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0) };
        Self { start, towards, angle: sin.atan2(cos) }
    }

    /// The orientation at a fraction of the way.
    #[inline]
    fn at(&self, t: f64) -> DQuat {
        if self.angle == 0.0 {
            return self.start;
        }
        let (sin, cos) = (t * self.angle).sin_cos();
        (self.start * cos + self.towards * sin).normalize()
    }
}

impl AnimatedTransform {
    /// A transform that is `start` at `start_time` and `end` at `end_time`.
    pub fn new(start: DAffine3, end: DAffine3, start_time: f32, end_time: f32) -> Self {
        let motion = (start != end).then(|| {
            let (start_rotation, start_stretch) = polar_decomposition(start.matrix3);
            let (end_rotation, end_stretch) = polar_decomposition(end.matrix3);
            Box::new(Motion {
                end,
                translation: [start.translation, end.translation],
                rotation: Turn::new(start_rotation, end_rotation),
                stretch: [start_stretch, end_stretch],
                before: DVec3::ZERO,
            })
        });
        Self { start, start_time, end_time, motion }
    }

    /// A transform that does not move.
    pub fn fixed(transform: DAffine3) -> Self {
        Self { start: transform, start_time: 0.0, end_time: 1.0, motion: None }
    }

    /// The motion `self.at(t) · T(offset)`. (Multiplying the keys instead would bend the path of a
    /// rotation.)
    pub fn after_translation(mut self, offset: DVec3) -> Self {
        let shift = DAffine3::from_translation(offset);
        self.start *= shift;
        if let Some(motion) = &mut self.motion {
            motion.end *= shift;
            motion.before += offset;
        }
        self
    }

    /// The motion `rigid · self.at(t)`. `rigid` is a rotation and a translation.
    pub fn moved(mut self, rigid: DAffine3) -> Self {
        let turn = DQuat::from_mat3(&rigid.matrix3);
        self.start = rigid * self.start;
        if let Some(motion) = &mut self.motion {
            motion.end = rigid * motion.end;
            motion.translation = motion.translation.map(|t| rigid.transform_point3(t));
            let Turn { start, towards, angle } = motion.rotation;
            motion.rotation = Turn { start: turn * start, towards: turn * towards, angle };
        }
        self
    }

    /// Whether the two keys differ.
    pub fn is_animated(&self) -> bool {
        self.motion.is_some()
    }

    /// Whether the transform changes during `[open, close]`.
    pub fn moves_during(&self, open: f32, close: f32) -> bool {
        self.is_animated() && open < close && self.start_time < close && open < self.end_time
    }

    /// The transform at `time`. Translation and stretch are interpolated linearly, rotation by slerp
    /// along the shorter arc.
    pub fn at(&self, time: f32) -> Affine3A {
        self.at_f64(time).as_affine3a()
    }

    /// Like [`Self::at`], in double precision.
    pub fn at_f64(&self, time: f32) -> DAffine3 {
        let Some(motion) = &self.motion else { return self.start };
        if time <= self.start_time {
            return self.start;
        }
        if time >= self.end_time {
            return motion.end;
        }
        let t = (f64::from(time) - f64::from(self.start_time))
            / (f64::from(self.end_time) - f64::from(self.start_time));
        let rotation = motion.rotation.at(t);
        let stretch = motion.stretch[0] * (1.0 - t) + motion.stretch[1] * t;
        let matrix3 = DMat3::from_quat(rotation) * stretch;
        let translation = motion.translation[0].lerp(motion.translation[1], t);
        DAffine3 { matrix3, translation: translation + matrix3 * motion.before }
    }

    /// Bound on the second derivative of the path of any point within `radius` of the origin, with
    /// respect to the fraction of the time between the keys.
    ///
    /// The path is T(s) + R(s) S(s) p, where T and S are linear and R rotates uniformly by θ, so the
    /// second derivative is at most (θ² |S| + 2 θ |S₁ - S₀|) |p|.
    pub fn acceleration_bound(&self, radius: f64) -> f64 {
        let Some(motion) = &self.motion else { return 0.0 };
        // The Frobenius norm bounds the spectral norm
        let norm = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let [start, end] = motion.stretch;
        let reach = radius + motion.before.length();
        let angle = 2.0 * motion.rotation.angle;
        // Twice the bound covers rounding
        2.0 * angle * (angle * norm(start).max(norm(end)) + 2.0 * norm(end - start)) * reach
    }
}

/// Decomposes m = rotation · stretch. The stretch includes a reflection, if any. For a singular matrix
/// the rotation is the identity.
fn polar_decomposition(m: DMat3) -> (DQuat, DMat3) {
    let mut orthogonal = m;
    for _ in 0..POLAR_STEPS {
        let Some(inverse) = orthogonal.try_inverse() else { return (DQuat::IDENTITY, m) };
        let next = (orthogonal + inverse.transpose()) * 0.5;
        let change = next - orthogonal;
        orthogonal = next;
        if change.to_cols_array().iter().all(|c| c.abs() <= POLAR_TOLERANCE) {
            break;
        }
    }
    if !orthogonal.is_finite() {
        return (DQuat::IDENTITY, m);
    }
    if orthogonal.determinant() < 0.0 {
        orthogonal = -orthogonal;
    }
    let rotation = DQuat::from_mat3(&orthogonal).normalize();
    (rotation, DMat3::from_quat(rotation).transpose() * m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(a: DAffine3, b: DAffine3) {
        let difference = a.to_cols_array().into_iter().zip(b.to_cols_array()).map(|(a, b)| (a - b).abs());
        assert!(difference.fold(0.0, f64::max) < 1e-9, "{a:?} is not {b:?}");
    }

    fn turned(degrees: f64) -> DAffine3 {
        DAffine3::from_rotation_z(degrees.to_radians())
    }

    #[test]
    fn a_rotation_is_interpolated_by_angle() {
        let motion = AnimatedTransform::new(turned(0.0), turned(90.0), 0.0, 1.0);
        assert_close(motion.at_f64(0.0), turned(0.0));
        assert_close(motion.at_f64(0.5), turned(45.0));
        assert_close(motion.at_f64(0.25), turned(22.5));
        assert_close(motion.at_f64(1.0), turned(90.0));
    }

    #[test]
    fn rotation_takes_the_shorter_way() {
        let motion = AnimatedTransform::new(turned(-170.0), turned(170.0), 0.0, 1.0);
        assert_close(motion.at_f64(0.5), turned(180.0));
    }

    #[test]
    fn translation_and_scale_are_linear_and_constant_outside_the_keys() {
        let place = |s: f64| {
            DAffine3::from_translation(DVec3::new(4.0 * s, 0.0, 1e6))
                * DAffine3::from_scale(DVec3::splat(1.0 + s))
        };
        let motion = AnimatedTransform::new(place(0.0), place(1.0), 1.0, 3.0);
        assert_close(motion.at_f64(0.0), place(0.0));
        assert_close(motion.at_f64(1.5), place(0.25));
        assert_close(motion.at_f64(4.0), place(1.0));
    }

    #[test]
    fn a_mirroring_transform_stays_mirroring_while_it_turns() {
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let motion = AnimatedTransform::new(mirror, turned(60.0) * mirror, 0.0, 1.0);
        assert_close(motion.at_f64(0.5), turned(30.0) * mirror);
    }

    #[test]
    fn a_translation_before_the_motion_follows_its_arc() {
        let offset = DVec3::new(2.0, 0.0, 0.0);
        let motion = AnimatedTransform::new(turned(0.0), turned(90.0), 0.0, 1.0).after_translation(offset);
        for time in [0.0, 0.5, 1.0] {
            let expected = turned(90.0 * f64::from(time)) * DAffine3::from_translation(offset);
            assert_close(motion.at_f64(time), expected);
        }
    }

    #[test]
    fn a_motion_is_moved_as_a_whole() {
        let offset = DVec3::new(2.0, 0.0, 0.0);
        let motion = AnimatedTransform::new(turned(0.0), turned(90.0), 0.0, 1.0).after_translation(offset);
        let rigid = DAffine3::from_axis_angle(DVec3::X, 0.7) * DAffine3::from_translation(DVec3::ONE);
        let moved = motion.clone().moved(rigid);
        for time in [0.0, 0.3, 1.0] {
            assert_close(moved.at_f64(time), rigid * motion.at_f64(time));
        }
    }

    #[test]
    fn motion_outside_the_shutter_is_ignored() {
        let motion = AnimatedTransform::new(turned(0.0), turned(9.0), 0.0, 1.0);
        assert!(motion.moves_during(0.0, 1.0) && motion.moves_during(0.9, 2.0));
        assert!(!motion.moves_during(0.5, 0.5) && !motion.moves_during(1.0, 2.0));
        assert!(!AnimatedTransform::fixed(turned(3.0)).moves_during(0.0, 1.0));
    }

    #[test]
    fn a_singular_transform_is_interpolated_without_nan() {
        let flat = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
        let motion = AnimatedTransform::new(flat, DAffine3::IDENTITY, 0.0, 1.0);
        assert!(motion.at_f64(0.5).is_finite());
    }
}
