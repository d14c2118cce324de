//! Uniform points in the unit disk (Shirley and Chiu 1997, "A Low Distortion Map Between Disk and
//! Square").

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::Vec2;

/// Maps the unit square to the unit disk; the square's centre goes to the disk's.
#[inline]
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let p = 2.0 * u - 1.0;
    if p == Vec2::ZERO {
        return p;
    }
    let (radius, angle) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * (p.y / p.x))
    } else {
        (p.y, FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y))
    };
    radius * Vec2::from_angle(angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_areas_of_the_disk_get_equal_shares() {
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
}
