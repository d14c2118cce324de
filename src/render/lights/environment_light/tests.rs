use super::*;
use crate::render::chi_squared::{p_value, significance};
use crate::render::sphere_map::SphereMap;

fn light(image: Option<EnvironmentImage>) -> EnvironmentLight {
    transformed_light(Mat3A::from_rotation_x(0.7) * Mat3A::from_rotation_z(2.0), image)
}

fn transformed_light(to_render: Mat3A, image: Option<EnvironmentImage>) -> EnvironmentLight {
    EnvironmentLight {
        to_render,
        from_render: to_render.inverse(),
        scale: Vec3::new(1.0, 2.0, 3.0),
        image: image.map(Arc::new),
        portal: None,
    }
}

/// For each map an image with a bright spot, a dark half and a black corner.
fn images() -> [EnvironmentImage; 2] {
    let texel = |x: usize, y: usize| match (x, y) {
        (5, 3) => Vec3::splat(200.0),
        (0..6, 0..4) => Vec3::ZERO,
        (_, 8..) => Vec3::new(0.1, 0.2, 0.1),
        _ => Vec3::splat(1.0 + (x * y % 7) as f32),
    };
    [SphereMap::LatLong, SphereMap::EqualArea].map(|map| EnvironmentImage::new(map, 16, 16, true, texel))
}

/// A constant light, and one for each image.
fn lights() -> Vec<EnvironmentLight> {
    std::iter::once(light(None)).chain(images().map(|image| light(Some(image)))).collect()
}

/// [`lights`], and lights with the images under a shear and a mirroring scale.
fn lights_and_stretched_lights() -> Vec<EnvironmentLight> {
    let sheared = Mat3A::from_cols(Vec3A::X, Vec3A::new(0.8, 1.0, 0.0), Vec3A::new(0.3, -0.2, 1.0));
    let scaled = Mat3A::from_rotation_y(0.4) * Mat3A::from_diagonal(Vec3::new(2.0, -0.7, 1.2));
    let stretched =
        [sheared, scaled].map(|to_render| images().map(|image| transformed_light(to_render, Some(image))));
    lights().into_iter().chain(stretched.into_iter().flatten()).collect()
}

/// Bin of a direction: 8 in azimuth by 8 in height, of equal solid angle.
fn bin(d: Vec3) -> usize {
    let phi = (d.y.atan2(d.x) / (2.0 * PI)).rem_euclid(1.0);
    ((d.z + 1.0) * 4.0).clamp(0.0, 7.0) as usize * 8 + (phi * 8.0).min(7.0) as usize
}

fn halton(i: u32, base: u32) -> f32 {
    let (mut i, mut f, mut r) = (i, 1.0, 0.0);
    while i > 0 {
        f /= base as f32;
        r += f * (i % base) as f32;
        i /= base;
    }
    r.min(0.999_999_9)
}

fn uniform_directions(n: u32) -> impl Iterator<Item = Vec3> {
    (0..n).map(|i| sample_uniform_sphere(Vec2::new(halton(i, 2), halton(i, 3))))
}

#[test]
fn the_density_integrates_to_one() {
    let n = 800_000;
    for (k, light) in lights_and_stretched_lights().iter().enumerate() {
        let sum: f64 = uniform_directions(n).map(|d| f64::from(light.pdf(Vec3::ZERO, d))).sum();
        let integral = sum / f64::from(n) * f64::from(4.0 * PI);
        assert!((integral - 1.0).abs() < 0.01, "light {k}: {integral}");
    }
}

#[test]
fn sampled_directions_follow_the_density() {
    use rand::{RngExt, SeedableRng};
    let n = 100_000;
    let lights = lights_and_stretched_lights();
    for (k, light) in lights.iter().enumerate() {
        let mut expected = [0.0; 64];
        let m = 2_000_000;
        for d in uniform_directions(m) {
            expected[bin(d)] +=
                f64::from(light.pdf(Vec3::ZERO, d)) * f64::from(4.0 * PI) * f64::from(n) / f64::from(m);
        }
        let mut counts = [0.0; 64];
        let mut rng = rand_pcg::Pcg32::seed_from_u64(k as u64);
        let mut misplaced = 0;
        for _ in 0..n {
            let (d, radiance, pdf) = light.sample(Vec3::ZERO, Vec2::new(rng.random(), rng.random())).unwrap();
            counts[bin(d)] += 1.0;
            // Rounding moves a few samples into the adjacent texel.
            misplaced += u32::from((pdf / light.pdf(Vec3::ZERO, d) - 1.0).abs() > 0.05);
            assert!(radiance.distance(light.radiance(Vec3::ZERO, d)) < 0.02 * radiance.length() + 1e-3);
        }
        assert!(misplaced < n / 1000, "light {k}: {misplaced} samples of another density");
        let p = p_value(&counts, &expected);
        assert!(p > significance(lights.len()), "light {k}: p = {p}");
    }
}

#[test]
fn the_mean_irradiance_is_a_quarter_of_the_integral_of_the_radiance() {
    let n = 200_000;
    for (k, light) in lights().iter().enumerate() {
        let sum: f64 = uniform_directions(n).map(|d| f64::from(average(light.radiance(Vec3::ZERO, d)))).sum();
        let expected = sum / f64::from(n) * f64::from(PI);
        let actual = f64::from(light.mean_irradiance());
        assert!((expected / actual - 1.0).abs() < 0.02, "light {k}: {expected} {actual}");
    }
}

#[test]
fn a_black_image_is_never_sampled() {
    let black = light(Some(EnvironmentImage::new(SphereMap::LatLong, 4, 2, true, |_, _| Vec3::ZERO)));
    assert!(black.sample(Vec3::ZERO, Vec2::splat(0.5)).is_none());
    assert_eq!((black.pdf(Vec3::ZERO, Vec3::Z), black.mean_irradiance()), (0.0, 0.0));
}
