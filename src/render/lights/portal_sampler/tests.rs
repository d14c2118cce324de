use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::*;
use crate::render::chi_squared::{p_value, significance};

const PORTAL: Portal =
    Portal { corner: Vec3::new(-1.0, 2.0, 3.0), edges: [Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 0.6, 0.8)] };

/// Bright around one direction, and black in a quarter.
fn sky(direction: Vec3) -> f32 {
    let sun = direction.dot(Vec3::new(0.2, -0.5, 0.8).normalize());
    let dark = direction.x < -0.2 && direction.y < -0.3;
    if dark { 0.0 } else { 1.0 + 50.0 * (sun.max(0.0)).powi(200) }
}

fn sampler() -> PortalSampler {
    PortalSampler::new(&PORTAL, 64, sky)
}

#[test]
fn the_edges_of_a_slender_portal_are_orthogonalised() {
    let edges = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(-1.9, 2000.0, 0.0)];
    let sampler = PortalSampler::new(&Portal { corner: Vec3::ZERO, edges }, 16, |_| 1.0);
    let from = Vec3::new(0.5, 1000.0, -5.0);
    for i in 0..100 {
        let u = Vec2::new(i as f32 / 100.0, (i * 37 % 100) as f32 / 100.0);
        let (direction, pdf) = sampler.sample(from, u).expect("the portal is visible");
        let there = from + direction * (5.0 / direction.z);
        assert!((-0.01..=1.01).contains(&there.x) && (-1.0..=2001.0).contains(&there.y), "{there}");
        assert!(pdf > 0.0);
    }
}

/// Near the portal, far from it, and nearly in its plane.
const POINTS: [Vec3; 4] = [
    Vec3::new(0.0, 2.0, 0.0),
    Vec3::new(-4.0, 5.0, -1.0),
    Vec3::new(0.2, 30.0, -100.0),
    Vec3::new(6.0, 2.1, 3.05),
];

/// A direction through a uniform point of the portal, and its density per solid angle.
fn through(from: Vec3, u: Vec2) -> (Vec3, f64) {
    let target = PORTAL.corner + u.x * PORTAL.edges[0] + u.y * PORTAL.edges[1];
    let normal = PORTAL.edges[0].cross(PORTAL.edges[1]);
    let to = target - from;
    let direction = to.normalize();
    (direction, f64::from(to.length_squared() / normal.dot(direction)))
}

#[test]
fn a_direction_is_contained_if_it_leaves_through_the_rectangle() {
    let (sampler, mut rng) = (sampler(), Pcg32::seed_from_u64(1));
    for from in POINTS {
        for _ in 0..1000 {
            let u = Vec2::new(rng.random::<f32>() * 3.0 - 1.0, rng.random::<f32>() * 3.0 - 1.0);
            let inside = u.cmpge(Vec2::ZERO).all() && u.cmple(Vec2::ONE).all();
            assert_eq!(sampler.contains(from, through(from, u).0), inside, "{from} {u}");
            assert!(!sampler.contains(from, -through(from, u).0));
        }
    }
    let outside = Vec3::new(0.0, 0.0, 10.0);
    assert!(!sampler.contains(outside, Vec3::NEG_Z) && sampler.sample(outside, Vec2::splat(0.5)).is_none());
}

#[test]
fn the_density_over_the_portal_integrates_to_one() {
    let sampler = sampler();
    for from in POINTS {
        let n = 400;
        let sum: f64 = (0..n * n)
            .map(|i| {
                let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
                let (direction, density) = through(from, u);
                f64::from(sampler.pdf(from, direction)) / density
            })
            .sum();
        let integral = sum / f64::from(n * n);
        assert!((integral - 1.0).abs() < 0.01, "{from}: {integral}");
    }
}

#[test]
fn sampled_directions_follow_the_density() {
    let (sampler, mut rng) = (sampler(), Pcg32::seed_from_u64(2));
    let bins = 6;
    for from in POINTS {
        // Bins of equal area of the portal.
        let mut expected = vec![0.0; bins * bins];
        let n = 100_000;
        let fine = 60 * bins;
        for i in 0..fine * fine {
            let u = Vec2::new((i % fine) as f32 + 0.5, (i / fine) as f32 + 0.5) / fine as f32;
            let (direction, density) = through(from, u);
            expected[i / fine / 60 * bins + i % fine / 60] +=
                f64::from(sampler.pdf(from, direction)) / density / (fine * fine) as f64 * n as f64;
        }
        let mut counts = vec![0.0; bins * bins];
        let mut outside = 0;
        for _ in 0..n {
            let (direction, pdf) = sampler.sample(from, Vec2::new(rng.random(), rng.random())).unwrap();
            let (is_inside, expected) = (sampler.contains(from, direction), sampler.pdf(from, direction));
            assert!((pdf / expected - 1.0).abs() < 0.01 || !is_inside, "{from}: {pdf} {expected}");
            // Rounding moves a few directions past the edge.
            outside += usize::from(!is_inside);
            let normal = PORTAL.edges[0].cross(PORTAL.edges[1]);
            let t = normal.dot(PORTAL.corner - from) / normal.dot(direction);
            let hit = from + t * direction - PORTAL.corner;
            let cell =
                |edge: Vec3| ((hit.dot(edge) / edge.length_squared() * bins as f32) as usize).min(bins - 1);
            counts[cell(PORTAL.edges[1]) * bins + cell(PORTAL.edges[0])] += 1.0;
        }
        assert!(outside <= n / 10_000, "{from}: {outside} directions miss the portal");
        let p = p_value(&counts, &expected);
        assert!(p > significance(POINTS.len()), "{from}: p = {p}");
    }
}

#[test]
fn sampling_by_radiance_has_less_variance_than_uniform_sampling() {
    // The relative standard deviation of radiance over density.
    let (sampler, mut rng) = (sampler(), Pcg32::seed_from_u64(3));
    let from = POINTS[0];
    let mut relative_deviation = |sample: &dyn Fn(Vec2) -> (Vec3, f64)| {
        let n = 20_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n {
            let (direction, pdf) = sample(Vec2::new(rng.random(), rng.random()));
            let value = f64::from(sky(direction)) / pdf;
            sum += value;
            squares += value * value;
        }
        let mean = sum / f64::from(n);
        (mean, (squares / f64::from(n) - mean * mean).sqrt() / mean)
    };
    let (mean, deviation) = relative_deviation(&|u| {
        let (direction, pdf) = sampler.sample(from, u).unwrap();
        (direction, f64::from(pdf))
    });
    let (uniform_mean, uniform_deviation) = relative_deviation(&|u| through(from, u));
    assert!((mean / uniform_mean - 1.0).abs() < 0.03, "{mean} {uniform_mean}");
    assert!(deviation < 0.2 && uniform_deviation > 3.0 * deviation, "{deviation} {uniform_deviation}");
}
