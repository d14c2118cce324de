//! Signed distances (negative inside) and ways to blend them. Formulas: Quílez, "Distance
//! functions"; those of ellipsoids are bounds rather than distances, which meshing can live with.

use glam::{DVec2, DVec3};

pub fn sphere(p: DVec3, centre: DVec3, radius: f64) -> f64 {
    p.distance(centre) - radius
}

pub fn ellipsoid(p: DVec3, centre: DVec3, radii: DVec3) -> f64 {
    let q = p - centre;
    let (k0, k1) = ((q / radii).length(), (q / (radii * radii)).length());
    if k1 == 0.0 { -radii.min_element() } else { k0 * (k0 - 1.0) / k1 }
}

/// A capsule whose radius goes linearly from `radius_a` at `a` to `radius_b` at `b`.
pub fn cone(p: DVec3, a: DVec3, b: DVec3, radius_a: f64, radius_b: f64) -> f64 {
    let axis = b - a;
    let t = ((p - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
    p.distance(a + axis * t) - (radius_a + (radius_b - radius_a) * t)
}

/// A ring about the y axis through `centre`.
pub fn torus(p: DVec3, centre: DVec3, major: f64, minor: f64) -> f64 {
    let q = p - centre;
    DVec2::new(DVec2::new(q.x, q.z).length() - major, q.y).length() - minor
}

/// Union with a fillet of size `k` (polynomial smooth minimum).
pub fn smooth_union(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - 0.25 * h * h * k
}

/// `a` without `b`, with a fillet of size `k`.
pub fn smooth_difference(a: f64, b: f64, k: f64) -> f64 {
    -smooth_union(-a, b, k)
}

/// 0 below `low`, 1 above `high`, smooth between.
pub fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_union_is_a_union_far_from_the_seam() {
        assert_eq!(smooth_union(1.0, 3.0, 0.5), 1.0);
        assert!(smooth_union(1.0, 1.0, 0.5) < 1.0);
    }

    #[test]
    fn a_cone_has_its_radii_at_its_ends() {
        let (a, b) = (DVec3::ZERO, DVec3::Y * 2.0);
        assert!(cone(DVec3::X * 0.5, a, b, 0.5, 0.1).abs() < 1e-12);
        assert!(cone(DVec3::new(0.1, 2.0, 0.0), a, b, 0.5, 0.1).abs() < 1e-12);
    }
}
