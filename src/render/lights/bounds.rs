//! Where lights are and whereto they shine, and what of it could arrive at a point: the measure by
//! which lights are chosen.
//!
//! Sources: Conty Estevez and Kulla 2018 ("Importance Sampling of Many Lights with Adaptive Tree
//! Splitting"); pbrt-v4, section 12.6.3. Bounding spheres take the place of boxes, which have the
//! angles wanted here at once.

use std::f64::consts::PI;

use glam::{DQuat, DVec3, Vec3};

/// Cosines are compared with this tolerance, well above their rounding errors, so that light which
/// could just arrive is never ruled out.
const COS_TOLERANCE: f32 = 1e-3;

/// A point that light arrives at.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    pub position: Vec3,
    /// Unit normal on the side that light arrives from.
    pub normal: Vec3,
    /// Light from behind counts as well.
    pub transmits: bool,
}

impl Receiver {
    /// Bound on the cosine at which light arrives from one of the unit directions around `wi` with
    /// this largest angle; 0 only if none counts.
    #[inline(always)]
    pub fn cosine(&self, wi: Vec3, spread: Angle) -> f32 {
        let cos = self.normal.dot(wi);
        let angle = Angle::from_cos(if self.transmits { cos.abs() } else { cos });
        (angle.minus(spread).cos + COS_TOLERANCE).max(0.0)
    }
}

/// An angle in [0, π] by its cosine and sine.
#[derive(Clone, Copy, Debug)]
pub struct Angle {
    cos: f32,
    sin: f32,
}

impl Angle {
    pub const ZERO: Self = Self { cos: 1.0, sin: 0.0 };

    #[inline(always)]
    fn from_cos(cos: f32) -> Self {
        Self { cos, sin: (1.0 - cos * cos).max(0.0).sqrt() }
    }

    /// The difference, or 0 if it is negative.
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        let cos = self.cos * other.cos + self.sin * other.sin;
        let sin = self.sin * other.cos - self.cos * other.sin;
        if self.cos >= other.cos { Self::ZERO } else { Self { cos, sin } }
    }
}

/// Bounds of a light, or of several: a sphere around them, a cone around their axes, and how far
/// from its axis each of them shines.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds {
    pub centre: Vec3,
    pub radius: f32,
    /// Unit.
    pub axis: Vec3,
    /// Cosine of the largest angle between `axis` and that of a light (θo). A light that is the
    /// same in a cone of directions counts as lights along all of them.
    pub cos_axes: f32,
    /// Cosine of the largest angle between a light's axis and where it shines (θe), at most π.
    pub cos_emission: f32,
    /// The same in the directions opposite to all of these.
    pub two_sided: bool,
    /// Brightness sent along the axis per solid angle; summed over the lights.
    pub intensity: f32,
}

impl LightBounds {
    /// What could arrive at a point, about as irradiance; 0 only if nothing can. Without a branch, so
    /// that it can be done for many points at once.
    #[inline(always)]
    pub fn importance(&self, receiver: &Receiver) -> f32 {
        let to_centre = self.centre - receiver.position;
        let squared = to_centre.length_squared();
        let squared_radius = self.radius * self.radius;
        let inside = if squared_radius > 0.0 { self.intensity / squared_radius } else { 0.0 };
        let wi = to_centre / squared.sqrt();
        let squared_sin = squared_radius / squared;
        let spread = Angle { cos: (1.0 - squared_sin).max(0.0).sqrt(), sin: squared_sin.sqrt() };
        let cos_receiver = receiver.cosine(wi, spread);
        let cos = -self.axis.dot(wi);
        let from_axis = Angle::from_cos(if self.two_sided { cos.abs() } else { cos });
        let cos_light = from_axis.minus(Angle::from_cos(self.cos_axes)).minus(spread).cos + COS_TOLERANCE;
        // A wide spot light shines backwards as well.
        let outside = self.intensity * cos_light.max(COS_TOLERANCE) * cos_receiver / squared;
        let outside = if cos_light <= self.cos_emission { 0.0 } else { outside };
        if squared <= squared_radius { inside } else { outside }
    }

    /// Bounds of both; `centre` is that of the sphere.
    pub fn union(&self, other: &Self, centre: Vec3) -> Self {
        let two_sided = self.two_sided || other.two_sided;
        let reach = |of: &Self| of.centre.distance(centre) + of.radius;
        let (axis, cos_axes) = union_of_cones(self, other, two_sided);
        Self {
            centre,
            radius: reach(self).max(reach(other)),
            axis,
            cos_axes,
            cos_emission: self.cos_emission.min(other.cos_emission),
            two_sided,
            intensity: self.intensity + other.intensity,
        }
    }

    /// Integral of the cosine bound over all directions (Conty Estevez and Kulla, section 4.1): how
    /// widely the light is spread, but for the second side.
    pub fn orientation_measure(&self) -> f64 {
        let axes = f64::from(self.cos_axes).clamp(-1.0, 1.0).acos();
        let reach = (axes + f64::from(self.cos_emission).clamp(-1.0, 1.0).acos()).min(PI);
        let (sin, cos) = axes.sin_cos();
        2.0 * PI * (1.0 - cos)
            + PI / 2.0 * (2.0 * reach * sin - (axes - 2.0 * reach).cos() - 2.0 * axes * sin + cos)
    }
}

/// Axis and cosine of the smallest cone around the cones of axes.
fn union_of_cones(a: &LightBounds, b: &LightBounds, two_sided: bool) -> (Vec3, f32) {
    let (axis_a, mut axis_b) = (a.axis.as_dvec3(), b.axis.as_dvec3());
    if two_sided && axis_a.dot(axis_b) < 0.0 {
        axis_b = -axis_b;
    }
    let half_angle = |cos: f32| f64::from(cos).clamp(-1.0, 1.0).acos();
    let (angle_a, angle_b) = (half_angle(a.cos_axes), half_angle(b.cos_axes));
    let perpendicular = axis_a.cross(axis_b);
    let between = perpendicular.length().atan2(axis_a.dot(axis_b));
    if (between + angle_b).min(PI) <= angle_a {
        return (a.axis, a.cos_axes);
    }
    if (between + angle_a).min(PI) <= angle_b {
        return (b.axis, b.cos_axes);
    }
    let angle = 0.5 * (angle_a + between + angle_b);
    match perpendicular.try_normalize() {
        Some(pole) if angle < PI => {
            let axis: DVec3 = DQuat::from_axis_angle(pole, angle - angle_a) * axis_a;
            (axis.as_vec3().normalize(), angle.cos() as f32)
        }
        _ => (a.axis, -1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(axis: Vec3) -> LightBounds {
        LightBounds {
            centre: Vec3::ZERO,
            radius: 0.1,
            axis,
            cos_axes: 1.0,
            cos_emission: 0.0,
            two_sided: false,
            intensity: 2.0,
        }
    }

    fn facing(position: Vec3) -> Receiver {
        Receiver { position, normal: -position.normalize(), transmits: false }
    }

    #[test]
    fn far_from_a_light_the_importance_is_its_irradiance() {
        let light = flat(Vec3::Z);
        let off_axis = Vec3::new(0.0, 60.0, 80.0);
        let tilted = Receiver { normal: Vec3::NEG_Z, ..facing(off_axis) };
        for (receiver, cosines) in [(facing(Vec3::Z * 100.0), 1.0), (facing(off_axis), 0.8), (tilted, 0.64)] {
            let expected = 2.0 * cosines / 1e4;
            assert!((light.importance(&receiver) / expected - 1.0).abs() < 5e-3, "{receiver:?}");
        }
    }

    #[test]
    fn the_dark_side_of_a_light_counts_only_if_there_is_none() {
        let behind = facing(Vec3::Z * -5.0);
        assert_eq!(flat(Vec3::Z).importance(&behind), 0.0);
        assert!(LightBounds { two_sided: true, ..flat(Vec3::Z) }.importance(&behind) > 0.0);
    }

    #[test]
    fn within_the_bounds_light_may_come_from_anywhere() {
        let inside = Receiver { position: Vec3::Z * -0.05, normal: Vec3::NEG_Z, transmits: false };
        assert!(flat(Vec3::Z).importance(&inside) > 0.0);
    }

    #[test]
    fn a_union_holds_the_cones_and_spheres_of_both() {
        let tilted = LightBounds { centre: Vec3::X, cos_axes: 0.9, ..flat(Vec3::X) };
        let both = flat(Vec3::Z).union(&tilted, Vec3::X * 0.5);
        assert!((both.radius - 0.6).abs() < 1e-6);
        // From the first axis to the far edge of the other cone.
        let width = f64::from(both.cos_axes).acos() * 2.0;
        assert!((width - (PI / 2.0 + 0.9f64.acos())).abs() < 1e-6, "{width}");
        let half = both.cos_axes.acos();
        assert!((both.axis.dot(Vec3::Z) - half.cos()).abs() < 1e-5);
        assert_eq!(both.intensity, 4.0);
        let opposite = flat(Vec3::Z).union(&flat(Vec3::NEG_Z), Vec3::ZERO);
        assert!((opposite.cos_axes + 1.0).abs() < 1e-6);
        let two_sided = LightBounds { two_sided: true, ..flat(Vec3::NEG_Z) };
        assert_eq!(two_sided.union(&flat(Vec3::Z), Vec3::ZERO).cos_axes, 1.0);
    }

    #[test]
    fn the_orientation_measure_is_that_of_known_cones() {
        // One direction with a cosine lobe: the integral of the cosine over a hemisphere.
        assert!((flat(Vec3::Z).orientation_measure() - PI).abs() < 1e-6);
        let anywhere = LightBounds { cos_axes: -1.0, ..flat(Vec3::Z) };
        assert!((anywhere.orientation_measure() - 4.0 * PI).abs() < 1e-6);
    }
}
