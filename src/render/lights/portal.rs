//! A rectangle through which alone an environment is seen, and directions through it in proportion
//! to the brightness there (Bitterli, Novák and Jarosz 2015; pbrt-v4, section 12.5.3).
//!
//! The directions of the half space beyond it are laid out as a square: by the angles from its
//! normal along its two edges. In this square the rectangle is an upright window, from wherever it
//! is seen, so that one table of brightness serves all points.

use std::f64::consts::PI;

use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::bounds::LightBounds;
use super::windowed::{Window, WindowedDistribution};
use crate::scene::light::Portal;

/// Most rows of the table of brightness: 8 MB.
const MAX_ROWS: usize = 1024;
/// Most points looked at for a cell, along each side.
const MAX_POINTS: usize = 8;
/// Added to the brightness of every cell, as a share of the mean, so that none that is lit between
/// the points looked at is ruled out.
const FLOOR: f32 = 0.01;

/// A portal, ready to be looked and sampled through.
#[derive(Clone, Debug)]
pub struct PortalView {
    /// Render space to the portal's: along its edges, and out.
    to_local: DMat3,
    /// Opposite corners, in render space.
    corners: [DVec3; 2],
    distribution: WindowedDistribution,
    bounds: LightBounds,
}

impl PortalView {
    /// `rows`: of the environment's image. `brightness`: from a unit direction.
    pub fn new(portal: &Portal, rows: usize, brightness: impl Fn(Vec3) -> f32 + Sync) -> Self {
        let corner = portal.corner.as_dvec3();
        let [along, up] = portal.edges.map(Vec3::as_dvec3);
        // Exactly at right angles, which the edges are only nearly.
        let x = along.normalize();
        let z = x.cross(up).normalize();
        let y = z.cross(x);
        let up = y * up.dot(y);
        let to_local = DMat3::from_cols(x, y, z).transpose();

        let size = rows.clamp(1, MAX_ROWS);
        // Two points a texel, so that none is missed, within what a tall image may cost.
        let points = (2 * rows.div_ceil(size)).min(MAX_POINTS);
        let to_render = to_local.transpose();
        let means: Vec<f32> = (0..size * size)
            .into_par_iter()
            .map(|cell| {
                let corner = DVec2::new((cell % size) as f64, (cell / size) as f64);
                let point = |i: usize| {
                    let within = DVec2::new((i % points) as f64 + 0.5, (i / points) as f64 + 0.5);
                    let at = (corner + within / points as f64) / size as f64;
                    brightness((to_render * direction(at)).as_vec3())
                };
                (0..points * points).map(point).sum::<f32>() / (points * points) as f32
            })
            .collect();
        let solid_angles: Vec<f32> = (0..size * size)
            .map(|cell| {
                let centre = DVec2::new((cell % size) as f64 + 0.5, (cell / size) as f64 + 0.5);
                solid_angle(direction(centre / size as f64)) as f32
            })
            .collect();
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        let mean =
            (dot(&means, &solid_angles) / solid_angles.iter().map(|&s| f64::from(s)).sum::<f64>()) as f32;
        let weights: Vec<f32> = means
            .iter()
            .zip(&solid_angles)
            .map(|(m, solid_angle)| (m + FLOOR * mean) * solid_angle)
            .collect();
        Self {
            to_local,
            corners: [corner, corner + along + up],
            distribution: WindowedDistribution::new(size, &weights),
            bounds: LightBounds {
                centre: (corner + (along + up) / 2.0).as_vec3(),
                radius: (((along + up).length() / 2.0) as f32).next_up(),
                axis: (-z).as_vec3(),
                cos_axes: 1.0,
                cos_emission: 0.0,
                two_sided: false,
                intensity: (along.cross(up).length()) as f32 * mean,
            },
        }
    }

    /// As of a lamp in its place.
    pub fn bounds(&self) -> LightBounds {
        self.bounds
    }

    /// Whether a ray from a point in a unit direction goes out through it.
    #[inline]
    pub fn shows(&self, from: Vec3, direction: Vec3) -> bool {
        let seen = self.window(from).zip(square(self.to_local * direction.as_dvec3()));
        seen.is_some_and(|(window, at)| window.contains(at))
    }

    /// A unit direction from a point and its density per solid angle; `None` if nothing is seen
    /// from there.
    #[inline]
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<(Vec3, f32)> {
        let (at, density) = self.distribution.sample(&self.window(from)?, u.as_dvec2())?;
        let local = direction(at);
        let pdf = (density / solid_angle(local)) as f32;
        let direction = (self.to_local.transpose() * local).as_vec3();
        (pdf > 0.0 && pdf.is_finite()).then_some((direction, pdf))
    }

    /// Density with which [`Self::sample`] gives a unit direction.
    #[inline]
    pub fn pdf(&self, from: Vec3, direction: Vec3) -> f32 {
        let local = self.to_local * direction.as_dvec3();
        let Some((window, at)) = self.window(from).zip(square(local)) else { return 0.0 };
        let pdf = (self.distribution.density(&window, at) / solid_angle(local)) as f32;
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// Its place in the square, seen from a point; `None` from outside.
    #[inline]
    fn window(&self, from: Vec3) -> Option<Window> {
        let [min, max] = self.corners.map(|corner| square(self.to_local * (corner - from.as_dvec3())));
        let (min, max) = (min?, max?);
        // By rounding it may be turned inside out, seen from its own plane.
        min.cmple(max).all().then_some(Window { min, max })
    }
}

/// The point of the square of a direction of any length; `None` if it does not lead out.
#[inline]
fn square(direction: DVec3) -> Option<DVec2> {
    let angle = |along: f64| (along.atan2(direction.z) / PI + 0.5).clamp(0.0, 1.0);
    (direction.z > 0.0).then(|| DVec2::new(angle(direction.x), angle(direction.y)))
}

/// The unit direction of a point of the square.
#[inline]
fn direction(at: DVec2) -> DVec3 {
    let angle = (at - 0.5) * PI;
    DVec3::new(angle.x.tan(), angle.y.tan(), 1.0).normalize()
}

/// Solid angle per area of the square, at a unit direction.
#[inline]
fn solid_angle(direction: DVec3) -> f64 {
    PI * PI * (1.0 - direction.x * direction.x) * (1.0 - direction.y * direction.y) / direction.z
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;
    use crate::render::chi_squared::{p_value, significance};

    const PORTAL: Portal = Portal {
        corner: Vec3::new(-1.0, 2.0, 3.0),
        edges: [Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 0.6, 0.8)],
    };

    /// Bright around one direction, and dark in a quarter.
    fn sky(direction: Vec3) -> f32 {
        let sun = direction.dot(Vec3::new(0.2, -0.5, 0.8).normalize());
        let dark = direction.x < -0.2 && direction.y < -0.3;
        if dark { 0.0 } else { 1.0 + 50.0 * (sun.max(0.0)).powi(200) }
    }

    fn view() -> PortalView {
        PortalView::new(&PORTAL, 64, sky)
    }

    #[test]
    fn a_slender_portal_that_leans_a_little_is_upright() {
        let edges = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(-1.9, 2000.0, 0.0)];
        let view = PortalView::new(&Portal { corner: Vec3::ZERO, edges }, 16, |_| 1.0);
        let from = Vec3::new(0.5, 1000.0, -5.0);
        for i in 0..100 {
            let u = Vec2::new(i as f32 / 100.0, (i * 37 % 100) as f32 / 100.0);
            let (direction, pdf) = view.sample(from, u).expect("it is seen");
            let there = from + direction * (5.0 / direction.z);
            assert!((-0.01..=1.01).contains(&there.x) && (-1.0..=2001.0).contains(&there.y), "{there}");
            assert!(pdf > 0.0);
        }
    }

    /// Some near, some far, one nearly in its plane.
    const POINTS: [Vec3; 4] = [
        Vec3::new(0.0, 2.0, 0.0),
        Vec3::new(-4.0, 5.0, -1.0),
        Vec3::new(0.2, 30.0, -100.0),
        Vec3::new(6.0, 2.1, 3.05),
    ];

    /// A direction through a uniform point of the rectangle, and its density per solid angle.
    fn through(from: Vec3, u: Vec2) -> (Vec3, f64) {
        let target = PORTAL.corner + u.x * PORTAL.edges[0] + u.y * PORTAL.edges[1];
        let out = PORTAL.edges[0].cross(PORTAL.edges[1]);
        let to = target - from;
        let direction = to.normalize();
        (direction, f64::from(to.length_squared() / out.dot(direction)))
    }

    #[test]
    fn all_rays_through_the_rectangle_and_no_others_are_let_through() {
        let (view, mut rng) = (view(), Pcg32::seed_from_u64(1));
        for from in POINTS {
            for _ in 0..1000 {
                let u = Vec2::new(rng.random::<f32>() * 3.0 - 1.0, rng.random::<f32>() * 3.0 - 1.0);
                let inside = u.cmpge(Vec2::ZERO).all() && u.cmple(Vec2::ONE).all();
                assert_eq!(view.shows(from, through(from, u).0), inside, "{from} {u}");
                assert!(!view.shows(from, -through(from, u).0));
            }
        }
        let outside = Vec3::new(0.0, 0.0, 10.0);
        assert!(!view.shows(outside, Vec3::NEG_Z) && view.sample(outside, Vec2::splat(0.5)).is_none());
    }

    #[test]
    fn the_density_over_the_rectangle_integrates_to_one() {
        let view = view();
        for from in POINTS {
            let n = 400;
            let sum: f64 = (0..n * n)
                .map(|i| {
                    let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
                    let (direction, density) = through(from, u);
                    f64::from(view.pdf(from, direction)) / density
                })
                .sum();
            let integral = sum / f64::from(n * n);
            assert!((integral - 1.0).abs() < 0.01, "{from}: {integral}");
        }
    }

    #[test]
    fn sampled_directions_follow_the_density() {
        let (view, mut rng) = (view(), Pcg32::seed_from_u64(2));
        let bins = 6;
        for from in POINTS {
            // Bins of equal area of the rectangle.
            let mut expected = vec![0.0; bins * bins];
            let n = 100_000;
            let fine = 60 * bins;
            for i in 0..fine * fine {
                let u = Vec2::new((i % fine) as f32 + 0.5, (i / fine) as f32 + 0.5) / fine as f32;
                let (direction, density) = through(from, u);
                expected[i / fine / 60 * bins + i % fine / 60] +=
                    f64::from(view.pdf(from, direction)) / density / (fine * fine) as f64 * n as f64;
            }
            let mut counts = vec![0.0; bins * bins];
            let mut outside = 0;
            for _ in 0..n {
                let (direction, pdf) = view.sample(from, Vec2::new(rng.random(), rng.random())).unwrap();
                let (is_inside, expected) = (view.shows(from, direction), view.pdf(from, direction));
                assert!((pdf / expected - 1.0).abs() < 0.01 || !is_inside, "{from}: {pdf} {expected}");
                // Rounding carries a few past the edge.
                outside += usize::from(!is_inside);
                let out = PORTAL.edges[0].cross(PORTAL.edges[1]);
                let t = out.dot(PORTAL.corner - from) / out.dot(direction);
                let hit = from + t * direction - PORTAL.corner;
                let cell = |edge: Vec3| {
                    ((hit.dot(edge) / edge.length_squared() * bins as f32) as usize).min(bins - 1)
                };
                counts[cell(PORTAL.edges[1]) * bins + cell(PORTAL.edges[0])] += 1.0;
            }
            assert!(outside <= n / 10_000, "{from}: {outside} directions lead past the portal");
            let p = p_value(&counts, &expected);
            assert!(p > significance(POINTS.len()), "{from}: p = {p}");
        }
    }

    #[test]
    fn what_is_bright_through_the_portal_is_sampled_with_little_noise() {
        // The standard deviation of light over density, over its mean, here and uniformly by area.
        let (view, mut rng) = (view(), Pcg32::seed_from_u64(3));
        let from = POINTS[0];
        let mut relative = |draw: &dyn Fn(Vec2) -> (Vec3, f64)| {
            let n = 20_000;
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..n {
                let (direction, pdf) = draw(Vec2::new(rng.random(), rng.random()));
                let value = f64::from(sky(direction)) / pdf;
                sum += value;
                squares += value * value;
            }
            let mean = sum / f64::from(n);
            (mean, (squares / f64::from(n) - mean * mean).sqrt() / mean)
        };
        let (mean, noise) = relative(&|u| {
            let (direction, pdf) = view.sample(from, u).unwrap();
            (direction, f64::from(pdf))
        });
        let (plain_mean, plain_noise) = relative(&|u| through(from, u));
        assert!((mean / plain_mean - 1.0).abs() < 0.03, "{mean} {plain_mean}");
        assert!(noise < 0.2 && plain_noise > 3.0 * noise, "{noise} {plain_noise}");
    }
}
