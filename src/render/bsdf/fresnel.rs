//! Fresnel reflectance of smooth boundaries, and refraction by Snell's law.
//!
//! Sources: Born and Wolf, *Principles of Optics*, sections 1.5.2 and 14.2. The hemispherical mean is Duntley's
//! closed form, quoted as (A1.15) by Judd, *Fresnel reflection of diffusely incident light* (1942).

use glam::Vec3;

/// Unpolarised reflectance of a dielectric boundary. `cos` in [0, 1] is the cosine of incidence, `eta` the index of
/// refraction of the far side over that of the near side.
pub(super) fn dielectric(cos: f32, eta: f32) -> f32 {
    let cos = cos.clamp(0.0, 1.0);
    let Some(cos_far) = refracted_cos(cos, eta) else { return 1.0 };
    if cos == 0.0 {
        return 1.0;
    }
    let parallel = (eta * cos - cos_far) / (eta * cos + cos_far);
    let perpendicular = (cos - eta * cos_far) / (cos + eta * cos_far);
    (parallel * parallel + perpendicular * perpendicular) / 2.0
}

/// Cosine of refraction; `None` at total internal reflection.
fn refracted_cos(cos: f32, eta: f32) -> Option<f32> {
    let sin2_far = (1.0 - cos * cos).max(0.0) / (eta * eta);
    (sin2_far < 1.0).then(|| (1.0 - sin2_far).sqrt())
}

/// Refracts `w` at a boundary with unit normal `m` on the side of `w`; `None` at total internal reflection. `eta` as
/// in [`dielectric`].
pub(super) fn refract(w: Vec3, m: Vec3, eta: f32) -> Option<Vec3> {
    let cos = w.dot(m).clamp(0.0, 1.0);
    let cos_far = refracted_cos(cos, eta)?;
    Some((m * (cos / eta - cos_far) - w / eta).normalize_or(-m))
}

/// Mean of [`dielectric`] over diffuse (cosine-weighted) incidence, with `eta` >= 1.
pub(super) fn dielectric_mean(eta: f32) -> f32 {
    // The closed form is 0/0 at 1; the mean is below 1e-3 up to here.
    const MIN_ETA: f64 = 1.0 + 1e-4;
    let n = f64::from(eta);
    if n < MIN_ETA {
        return 0.0;
    }
    let (n2, n4) = (n * n, n.powi(4));
    let mean = 0.5
        + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
        + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n - 1.0) / (n + 1.0)).ln()
        - 2.0 * n * n2 * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
        + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n.ln();
    mean.clamp(0.0, 1.0) as f32
}

/// Unpolarised reflectance of a conductor for each channel. The complex index of refraction `eta` + i `k` is relative
/// to the near side.
#[inline(always)]
pub(super) fn conductor(cos: f32, eta: Vec3, k: Vec3) -> Vec3 {
    let channel = |i: usize| conductor_channel(cos.clamp(0.0, 1.0), eta[i], k[i]);
    Vec3::new(channel(0), channel(1), channel(2))
}

#[inline(always)]
fn conductor_channel(cos: f32, eta: f32, k: f32) -> f32 {
    if cos == 0.0 {
        return 1.0;
    }
    let (cos2, sin2) = (cos * cos, 1.0 - cos * cos);
    // a + ib = √((eta + ik)² - sin²). The larger part has no cancellation, and gives the smaller.
    let real = eta * eta - k * k - sin2;
    let imaginary = 2.0 * eta * k;
    let modulus = (real * real + imaginary * imaginary).sqrt();
    let large = ((modulus + real.abs()) / 2.0).sqrt();
    let small = if large > 0.0 { eta * k / large } else { 0.0 };
    let (a, b) = if real >= 0.0 { (large, small) } else { (small, large) };
    let b2 = b * b;
    let perpendicular = ((a - cos).powi(2) + b2) / ((a + cos).powi(2) + b2);
    let parallel = perpendicular * ((a * cos - sin2).powi(2) + b2 * cos2)
        / ((a * cos + sin2).powi(2) + b2 * cos2).max(f32::MIN_POSITIVE);
    ((perpendicular + parallel) / 2.0).clamp(0.0, 1.0)
}

/// Absorption index k of a conductor of `eta` = 1 with the given reflectance at normal incidence, which is clamped to
/// 0.9999 for a finite result (pbrt-v4's `ConductorMaterial`).
pub(super) fn absorption_from_reflectance(reflectance: Vec3) -> Vec3 {
    const MAX_REFLECTANCE: f32 = 0.9999;
    let r = reflectance.clamp(Vec3::ZERO, Vec3::splat(MAX_REFLECTANCE));
    2.0 * (r / (1.0 - r)).map(f32::sqrt)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glass_reflects_four_percent_at_normal_incidence_from_both_sides() {
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((dielectric(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-6);
    }

    #[test]
    fn glass_reflects_no_parallel_polarised_light_at_brewsters_angle() {
        // tan = eta: only the perpendicular polarisation is reflected, ((eta² - 1) / (eta² + 1))².
        let cos = 1.0 / (1.0 + 1.5f32 * 1.5).sqrt();
        let expected = 0.5 * (1.25f32 / 3.25).powi(2);
        assert!((dielectric(cos, 1.5) - expected).abs() < 1e-6);
    }

    #[test]
    fn beyond_the_critical_angle_all_light_is_reflected() {
        let critical = (1.0 - 1.0 / 2.25f32).sqrt();
        assert_eq!(dielectric(critical - 1e-3, 1.0 / 1.5), 1.0);
        assert!(dielectric(critical + 1e-2, 1.0 / 1.5) < 0.8);
        let w = Vec3::new((1.0 - 0.3f32 * 0.3).sqrt(), 0.0, 0.3);
        assert_eq!(refract(w, Vec3::Z, 1.0 / 1.5), None);
    }

    #[test]
    fn equal_indices_reflect_nothing_and_grazing_light_is_fully_reflected() {
        assert!(dielectric(0.4, 1.0) < 1e-12);
        assert_eq!(dielectric(0.0, 1.5), 1.0);
        assert_eq!(conductor(0.0, Vec3::ONE, Vec3::ONE), Vec3::ONE);
    }

    #[test]
    fn refraction_obeys_snells_law_and_is_invertible() {
        let w = Vec3::new(0.6, 0.0, 0.8);
        let inside = refract(w, Vec3::Z, 1.5).expect("no total internal reflection from outside");
        assert!((inside.x + 0.6 / 1.5).abs() < 1e-6);
        let back = refract(inside, -Vec3::Z, 1.0 / 1.5).expect("refraction is invertible");
        assert!((back - w).length() < 1e-5);
    }

    #[test]
    fn a_conductor_without_absorption_is_a_dielectric() {
        for cos in [0.05, 0.3, 0.7, 1.0] {
            let metal = conductor(cos, Vec3::splat(1.5), Vec3::ZERO).x;
            assert!((metal - dielectric(cos, 1.5)).abs() < 1e-5, "{cos}: {metal}");
        }
    }

    #[test]
    fn copper_has_its_known_reflectance_at_normal_incidence() {
        // ((eta - 1)² + k²) / ((eta + 1)² + k²)
        let (eta, k) = (Vec3::new(0.2, 0.92, 1.1), Vec3::new(3.9, 2.45, 2.14));
        let f = conductor(1.0, eta, k);
        for i in 0..3 {
            let expected = ((eta[i] - 1.0).powi(2) + k[i] * k[i]) / ((eta[i] + 1.0).powi(2) + k[i] * k[i]);
            assert!((f[i] - expected).abs() < 1e-5);
        }
    }

    #[test]
    fn the_absorption_index_gives_the_reflectance_at_normal_incidence() {
        let r = Vec3::new(0.0, 0.5, 0.95);
        let f = conductor(1.0, Vec3::ONE, absorption_from_reflectance(r));
        assert!((f - r).abs().max_element() < 1e-4, "{f}");
        let white = conductor(1.0, Vec3::ONE, absorption_from_reflectance(Vec3::ONE));
        assert!((white - 0.9999).abs().max_element() < 1e-5);
    }

    #[test]
    fn the_closed_form_mean_is_the_integral() {
        for eta in [1.0, 1.01, 1.33, 1.5, 2.0, 3.0] {
            let n = 20_000;
            let mean = (0..n)
                .map(|i| {
                    let cos = ((i as f32 + 0.5) / n as f32).sqrt(); // cos² is uniform
                    f64::from(dielectric(cos, eta))
                })
                .sum::<f64>()
                / f64::from(n);
            let closed = f64::from(dielectric_mean(eta));
            assert!((mean - closed).abs() < 1e-3, "{eta}: {mean} {closed}");
        }
    }
}
