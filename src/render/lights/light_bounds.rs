//! Spatial and directional bounds of lights, and the importance that they have at a point: an estimate of
//! the irradiance.
//!
//! Sources: Conty Estevez and Kulla, *Importance Sampling of Many Lights with Adaptive Tree Splitting* (2018);
//! pbrt-v4, section 12.6.3. Bounding spheres replace their boxes: the angle that a sphere subtends needs no
//! further bound.

use std::f64::consts::PI;

use glam::{DQuat, DVec3, Vec3};

use super::angle::Angle;
use super::light_sample_context::{COS_TOLERANCE, LightSampleContext};

/// Bounds of one light or several: a sphere around their positions, a cone around their axes, and the angle
/// from its axis within which each of them emits.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds {
    pub centre: Vec3,
    pub radius: f32,
    /// Unit axis of the cone.
    pub axis: Vec3,
    /// Cosine of the largest angle between `axis` and a light's axis (θo), at most π. A light with constant
    /// intensity over a cone of directions counts as lights along all of them.
    pub cos_axes: f32,
    /// Cosine of the largest angle between a light's axis and a direction that it emits in (θe), at most π.
    pub cos_emission: f32,
    /// The lights emit in the opposite directions as well.
    pub two_sided: bool,
    /// Sum of the lights' radiant intensities along their axes, averaged over the channels.
    pub intensity: f32,
}

impl LightBounds {
    /// Estimate of the irradiance at a point; 0 only if no light can illuminate it. Branchless, so that the
    /// compiler vectorises loops over points.
    #[inline(always)]
    pub fn importance(&self, context: &LightSampleContext) -> f32 {
        let to_centre = self.centre - context.position;
        let squared = to_centre.length_squared();
        let squared_radius = self.radius * self.radius;
        let inside = if squared_radius > 0.0 { self.intensity / squared_radius } else { 0.0 };
        let wi = to_centre / squared.sqrt();
        let squared_sin = squared_radius / squared;
        let spread = Angle { cos: (1.0 - squared_sin).max(0.0).sqrt(), sin: squared_sin.sqrt() };
        let cos_incident = context.bound_cosine(wi, spread);
        let cos = -self.axis.dot(wi);
        let from_axis = Angle::from_cos(if self.two_sided { cos.abs() } else { cos });
        let cos_light = from_axis.minus(Angle::from_cos(self.cos_axes)).minus(spread).cos + COS_TOLERANCE;
        // A wide spot light emits backwards as well, where the cosine is negative.
        let outside = self.intensity * cos_light.max(COS_TOLERANCE) * cos_incident / squared;
        let outside = if cos_light <= self.cos_emission { 0.0 } else { outside };
        if squared <= squared_radius { inside } else { outside }
    }

    /// Bounds of both, with the given centre of the sphere.
    pub fn union(&self, other: &Self, centre: Vec3) -> Self {
        let two_sided = self.two_sided || other.two_sided;
        let farthest = |bounds: &Self| bounds.centre.distance(centre) + bounds.radius;
        let (axis, cos_axes) = union_of_cones(self, other, two_sided);
        Self {
            centre,
            radius: farthest(self).max(farthest(other)),
            axis,
            cos_axes,
            cos_emission: self.cos_emission.min(other.cos_emission),
            two_sided,
            intensity: self.intensity + other.intensity,
        }
    }

    /// Integral over all directions of the bound on the cosine to the axis (Conty Estevez and Kulla,
    /// section 4.1), of one side only.
    pub fn orientation_measure(&self) -> f64 {
        let axes = f64::from(self.cos_axes).clamp(-1.0, 1.0).acos();
        let emission = (axes + f64::from(self.cos_emission).clamp(-1.0, 1.0).acos()).min(PI);
        let (sin, cos) = axes.sin_cos();
        2.0 * PI * (1.0 - cos)
            + PI / 2.0 * (2.0 * emission * sin - (axes - 2.0 * emission).cos() - 2.0 * axes * sin + cos)
    }
}

/// Axis and cosine of the half angle of the smallest cone around both cones of axes.
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

    fn facing(position: Vec3) -> LightSampleContext {
        LightSampleContext { position, normal: -position.normalize(), transmits: false }
    }

    #[test]
    fn far_from_a_light_the_importance_is_its_irradiance() {
        let light = flat(Vec3::Z);
        let off_axis = Vec3::new(0.0, 60.0, 80.0);
        let tilted = LightSampleContext { normal: Vec3::NEG_Z, ..facing(off_axis) };
        for (context, cosines) in [(facing(Vec3::Z * 100.0), 1.0), (facing(off_axis), 0.8), (tilted, 0.64)] {
            let expected = 2.0 * cosines / 1e4;
            assert!((light.importance(&context) / expected - 1.0).abs() < 5e-3, "{context:?}");
        }
    }

    #[test]
    fn a_one_sided_light_has_no_importance_behind_it() {
        let behind = facing(Vec3::Z * -5.0);
        assert_eq!(flat(Vec3::Z).importance(&behind), 0.0);
        assert!(LightBounds { two_sided: true, ..flat(Vec3::Z) }.importance(&behind) > 0.0);
    }

    #[test]
    fn a_point_within_the_bounds_has_a_positive_importance() {
        let inside = LightSampleContext { position: Vec3::Z * -0.05, normal: Vec3::NEG_Z, transmits: false };
        assert!(flat(Vec3::Z).importance(&inside) > 0.0);
    }

    #[test]
    fn a_union_contains_the_cones_and_spheres_of_both() {
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
    fn the_orientation_measure_of_known_cones() {
        // One direction with a cosine lobe: the integral of the cosine over a hemisphere.
        assert!((flat(Vec3::Z).orientation_measure() - PI).abs() < 1e-6);
        let anywhere = LightBounds { cos_axes: -1.0, ..flat(Vec3::Z) };
        assert!((anywhere.orientation_measure() - 4.0 * PI).abs() < 1e-6);
    }
}
