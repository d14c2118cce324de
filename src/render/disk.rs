//! Uniform points in the unit disk (Shirley and Chiu 1997, "A Low Distortion Map Between Disk and
//! Square").

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::Vec2;

/// Maps the unit square to the unit disk, centre to centre. Without branches, so that loops over lanes become
/// vector instructions.
#[inline(always)]
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let (x, y) = (2.0 * u.x - 1.0, 2.0 * u.y - 1.0);
    let x_is_larger = x.abs() > y.abs();
    let (radius, other) = if x_is_larger { (x, y) } else { (y, x) };
    let ratio = if radius == 0.0 { 0.0 } else { other / radius };
    let (sin, cos) = sin_cos_within_45_degrees(FRAC_PI_4 * ratio);
    let (along, across) = (radius * cos, radius * sin);
    if x_is_larger { Vec2::new(along, across) } else { Vec2::new(across, along) }
}

/// Returns sine and cosine of an angle given in turns, in [0, 1].
#[inline(always)]
pub fn sin_cos_of_turns(turns: f32) -> (f32, f32) {
    let quarters = 4.0 * turns;
    let quadrant = (quarters + 0.5) as u32;
    let (s, c) = sin_cos_within_45_degrees(FRAC_PI_2 * (quarters - quadrant as f32));
    let (sin, cos) = if quadrant & 1 == 0 { (s, c) } else { (c, s) };
    let (sin_is_negative, cos_is_negative) = (quadrant & 2 != 0, (quadrant + 1) & 2 != 0);
    (if sin_is_negative { -sin } else { sin }, if cos_is_negative { -cos } else { cos })
}

/// Returns sine and cosine of an angle in [-π/4, π/4]: polynomials with the coefficients of the Cephes library
/// (Moshier), whose error there is below 2⁻²⁵ before rounding.
#[inline(always)]
fn sin_cos_within_45_degrees(x: f32) -> (f32, f32) {
    let z = x * x;
    let sin = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * x + x;
    let cos = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    (sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_uniform_in_the_disk() {
        let n = 200;
        let points = (0..n * n)
            .map(|i| concentric_disk(Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32));
        // Eight sectors of four rings of equal area.
        let mut counts = [0; 32];
        for p in points {
            assert!(p.length() <= 1.0);
            let sector = (p.to_angle() / FRAC_PI_4).rem_euclid(8.0).min(7.0) as usize;
            counts[sector * 4 + (p.length_squared() * 4.0).min(3.0) as usize] += 1;
        }
        let expected = f64::from(n * n) / 32.0;
        assert!(counts.iter().all(|&c| (f64::from(c) / expected - 1.0).abs() < 0.05), "{counts:?}");
    }

    #[test]
    fn sine_and_cosine_match_double_precision() {
        for i in 0..=100_000 {
            let turns = i as f32 / 100_000.0;
            let (sin, cos) = sin_cos_of_turns(turns);
            let (exact_sin, exact_cos) = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
            let error = (f64::from(sin) - exact_sin).abs().max((f64::from(cos) - exact_cos).abs());
            assert!(error < 2e-7, "{turns}: {error}");
        }
    }

    #[test]
    fn the_centre_and_the_edges_map_to_those_of_the_disk() {
        assert_eq!(concentric_disk(Vec2::splat(0.5)), Vec2::ZERO);
        assert!((concentric_disk(Vec2::new(1.0, 0.5)) - Vec2::X).length() < 1e-7);
        assert!((concentric_disk(Vec2::new(0.5, 0.0)) - Vec2::NEG_Y).length() < 1e-7);
    }
}
