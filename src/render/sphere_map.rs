//! Maps between the unit square of an image and the unit sphere of directions, for environment lights and
//! spherical cameras.

use std::f32::consts::{FRAC_PI_4, PI};

use glam::{Vec2, Vec3};

/// Parametrisation of the sphere by an image. Rows run from v = 0 downwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SphereMap {
    /// Latitude and longitude: azimuth around z over u, polar angle from z over v.
    LatLong,
    /// The equal-area octahedral map (Clarberg 2008).
    EqualArea,
}

impl SphereMap {
    /// Returns the unit direction of a point of the square.
    #[inline]
    pub fn direction(self, uv: Vec2) -> Vec3 {
        match self {
            Self::LatLong => {
                let ((sin_phi, cos_phi), (sin_theta, cos_theta)) =
                    ((2.0 * PI * uv.x).sin_cos(), (PI * uv.y).sin_cos());
                Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
            }
            Self::EqualArea => {
                let p = 2.0 * uv - 1.0;
                let a = p.abs();
                // Signed distance from the diagonals that map to the equator.
                let d = 1.0 - a.x - a.y;
                let r = 1.0 - d.abs();
                let phi = if r == 0.0 { FRAC_PI_4 } else { FRAC_PI_4 * ((a.y - a.x) / r + 1.0) };
                let (sin_phi, cos_phi) = phi.sin_cos();
                let radius = r * (2.0 - r * r).max(0.0).sqrt();
                Vec3::new(
                    (radius * cos_phi).copysign(p.x),
                    (radius * sin_phi).copysign(p.y),
                    (1.0 - r * r).copysign(d),
                )
            }
        }
    }

    /// Returns the point of the square for a point at most one square beyond its borders, by continuation on
    /// the sphere.
    #[inline]
    pub fn wrapped(self, mut uv: Vec2) -> Vec2 {
        if self == Self::EqualArea {
            // Each border is folded onto itself around its middle.
            for axis in 0..2 {
                if !(0.0..=1.0).contains(&uv[axis]) {
                    uv[axis] = if uv[axis] < 0.0 { -uv[axis] } else { 2.0 - uv[axis] };
                    uv[1 - axis] = 1.0 - uv[1 - axis];
                }
            }
        }
        // Angles beyond a border need no wrapping, because sine and cosine are periodic.
        uv
    }

    /// Returns the point of the square of a unit direction.
    #[inline]
    pub fn uv(self, direction: Vec3) -> Vec2 {
        match self {
            Self::LatLong => {
                let phi = direction.y.atan2(direction.x) / (2.0 * PI);
                let phi = if phi < 0.0 { phi + 1.0 } else { phi };
                Vec2::new(phi, direction.z.clamp(-1.0, 1.0).acos() / PI)
            }
            Self::EqualArea => {
                let a = direction.abs();
                let r = (1.0 - a.z).max(0.0).sqrt();
                let phi = if r == 0.0 { 0.0 } else { a.y.atan2(a.x) / (2.0 * FRAC_PI_4) };
                let mut p = Vec2::new(r - phi * r, phi * r);
                if direction.z < 0.0 {
                    p = 1.0 - Vec2::new(p.y, p.x);
                }
                (Vec2::new(p.x.copysign(direction.x), p.y.copysign(direction.y)) + 1.0) * 0.5
            }
        }
    }

    /// Returns the solid angle per area of the square.
    #[inline]
    pub fn solid_angle(self, uv: Vec2) -> f32 {
        match self {
            Self::LatLong => 2.0 * PI * PI * (PI * uv.y).sin(),
            Self::EqualArea => 4.0 * PI,
        }
    }

    /// Returns the texel for (`x`, `y`) at most one step beyond the borders of an image, by continuation on the
    /// sphere.
    #[inline]
    pub fn wrap(self, x: isize, y: isize, width: usize, height: usize) -> (usize, usize) {
        // Nearly all texels are inside; as unsigned numbers, negative coordinates are beyond every border
        if (x as usize) < width && (y as usize) < height {
            return (x as usize, y as usize);
        }
        let (w, h) = (width as isize, height as isize);
        let (x, y) = match self {
            // Columns wrap around; the rows at the poles repeat.
            Self::LatLong => (x.rem_euclid(w), y.clamp(0, h - 1)),
            // Every border is folded onto itself around its middle.
            Self::EqualArea => {
                let (x, y) = if x < 0 || x >= w { (x.clamp(0, w - 1), h - 1 - y) } else { (x, y) };
                let (x, y) = if y < 0 || y >= h { (w - 1 - x, y.clamp(0, h - 1)) } else { (x, y) };
                (x.clamp(0, w - 1), y.clamp(0, h - 1))
            }
        };
        (x as usize, y as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAPS: [SphereMap; 2] = [SphereMap::LatLong, SphereMap::EqualArea];

    fn grid(n: usize) -> impl Iterator<Item = Vec2> {
        let at = move |i: usize| (i as f32 + 0.5) / n as f32;
        (0..n * n).map(move |i| Vec2::new(at(i % n), at(i / n)))
    }

    #[test]
    fn directions_map_back_to_their_points() {
        for map in MAPS {
            for uv in grid(64) {
                let direction = map.direction(uv);
                assert!((direction.length() - 1.0).abs() < 1e-5);
                assert!((map.uv(direction) - uv).abs().max_element() < 1e-4, "{map:?} {uv}");
            }
        }
    }

    #[test]
    fn the_solid_angle_is_the_jacobian_of_the_map() {
        let step = 1e-2;
        for map in MAPS {
            for uv in grid(9).map(|uv| uv + Vec2::new(3e-3, 7e-3)) {
                let (dx, dy) = (Vec2::X * step / 2.0, Vec2::Y * step / 2.0);
                let du = map.direction(uv + dx) - map.direction(uv - dx);
                let dv = map.direction(uv + dy) - map.direction(uv - dy);
                let measured = du.cross(dv).length() / (step * step);
                assert!((measured / map.solid_angle(uv) - 1.0).abs() < 0.02, "{map:?} {uv} {measured}");
            }
        }
    }

    #[test]
    fn known_directions_map_as_in_pbrt() {
        let at = |map: SphereMap, d: Vec3| map.uv(d);
        assert!((at(SphereMap::LatLong, Vec3::Y) - Vec2::new(0.25, 0.5)).length() < 1e-6);
        assert!((at(SphereMap::LatLong, Vec3::NEG_Y) - Vec2::new(0.75, 0.5)).length() < 1e-6);
        assert!((at(SphereMap::EqualArea, Vec3::Z) - Vec2::new(0.5, 0.5)).length() < 1e-6);
        assert!((at(SphereMap::EqualArea, Vec3::X) - Vec2::new(1.0, 0.5)).length() < 1e-6);
        assert!((at(SphereMap::EqualArea, Vec3::Y) - Vec2::new(0.5, 1.0)).length() < 1e-6);
    }

    #[test]
    fn texels_beyond_a_border_are_neighbours_on_the_sphere() {
        let n = 32;
        for map in MAPS {
            let texel =
                |x: usize, y: usize| map.direction(Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / n as f32);
            for i in 0..n as isize {
                let inside = [(0, i), (n as isize - 1, i), (i, 0), (i, n as isize - 1)];
                let outside = [(-1, i), (n as isize, i), (i, -1), (i, n as isize)];
                for ((x, y), (ox, oy)) in inside.into_iter().zip(outside) {
                    let (wx, wy) = map.wrap(ox, oy, n, n);
                    let distance = texel(x as usize, y as usize).distance(texel(wx, wy));
                    assert!(distance < 0.25, "{map:?} ({ox}, {oy}) -> ({wx}, {wy}): {distance}");
                }
            }
        }
    }
}
