//! Procedural textures from Perlin noise (2002), with pbrt's constants (pbrt-v3, section 10.6).
//!
//! pbrt drops octaves that are finer than a pixel. Here all octaves are evaluated and pixel sampling
//! averages them. Only `wrinkled` differs: pbrt replaces the dropped octaves by an approximate mean.

use glam::{Vec2, Vec3};

use super::floor::{floor, floor3};
use super::texture_value::TextureValue;

/// A function of the position in texture space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Procedural {
    /// A sum of octaves of noise; `roughness` is the ratio of the amplitudes of successive octaves.
    Fbm { octaves: u32, roughness: f32 },
    /// A sum of octaves of the absolute value of noise.
    Wrinkled { octaves: u32, roughness: f32 },
    /// Waves whose height varies with the wind.
    Windy,
    /// Veins across y.
    Marble { octaves: u32, roughness: f32, scale: f32, variation: f32 },
}

/// Ratio of the frequencies of successive octaves. It is not 2, so that their zeros do not coincide.
const LACUNARITY: f32 = 1.99;
/// pbrt's estimate of the mean of the absolute value of noise.
const MEAN_ABSOLUTE: f32 = 0.2;
/// Values are clamped to this magnitude, so that sums and products stay finite.
const LARGEST: f32 = 1e6;
/// Scale factor of the colours of marble.
const MARBLE_BRIGHTNESS: f32 = 1.5;
/// Radius of a dot in a cell of side 1.
const DOT_RADIUS: f32 = 0.35;

impl Procedural {
    /// The value at a point in texture space.
    pub fn value<V: TextureValue>(&self, p: Vec3) -> V {
        let gray = match *self {
            Self::Fbm { octaves, roughness } => fbm(p, octaves, roughness),
            Self::Wrinkled { octaves, roughness } => turbulence(p, octaves, roughness),
            Self::Windy => fbm(0.1 * p, 3, 0.5).abs() * fbm(p, 6, 0.5),
            Self::Marble { octaves, roughness, scale, variation } => {
                let p = scale * p;
                return V::from_rgb(marble(p.y + variation * fbm(p, octaves, roughness)));
            }
        };
        V::splat(bounded(gray))
    }
}

/// Whether a point is inside a dot. About every second unit cell has one.
pub fn in_dot(st: Vec2) -> bool {
    let cell = (st + 0.5).map(floor);
    let noise_at = |x: f32, y: f32| noise(Vec3::new(cell.x + x, cell.y + y, 0.5));
    if noise_at(0.5, 0.5) <= 0.0 {
        return false;
    }
    let shift = (0.5 - DOT_RADIUS) * Vec2::new(noise_at(1.5, 2.8), noise_at(4.5, 9.8));
    st.distance_squared(cell + shift) < DOT_RADIUS * DOT_RADIUS
}

/// Clamps to [`LARGEST`] and replaces NaN by 0.
fn bounded(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(-LARGEST, LARGEST) }
}

fn fbm(p: Vec3, octaves: u32, roughness: f32) -> f32 {
    bounded(sum_of_octaves(p, octaves, roughness, |noise| noise).0)
}

fn turbulence(p: Vec3, octaves: u32, roughness: f32) -> f32 {
    let (sum, amplitude) = sum_of_octaves(p, octaves, roughness, f32::abs);
    sum + MEAN_ABSOLUTE * amplitude
}

/// The sum of octaves, and the amplitude of the next octave.
fn sum_of_octaves(p: Vec3, octaves: u32, roughness: f32, shape: impl Fn(f32) -> f32) -> (f32, f32) {
    let (mut sum, mut frequency, mut amplitude) = (0.0, 1.0, 1.0);
    for _ in 0..octaves {
        sum += amplitude * shape(noise(frequency * p));
        frequency *= LACUNARITY;
        amplitude *= roughness;
    }
    (sum, amplitude)
}

/// The colour of marble, periodic in its argument.
fn marble(phase: f32) -> Vec3 {
    const GRAY: Vec3 = Vec3::new(0.58, 0.58, 0.6);
    const COLOURS: [Vec3; 9] = [
        GRAY,
        GRAY,
        GRAY,
        Vec3::new(0.5, 0.5, 0.5),
        Vec3::new(0.6, 0.59, 0.58),
        GRAY,
        GRAY,
        Vec3::new(0.2, 0.2, 0.33),
        GRAY,
    ];
    const SEGMENTS: usize = COLOURS.len() - 3;
    let along = bounded(0.5 + 0.5 * phase.sin()) * SEGMENTS as f32;
    let first = (along as usize).min(SEGMENTS - 1);
    let t = along - first as f32;
    // Evaluate a cubic Bézier curve by de Casteljau's algorithm
    let mut points = [0, 1, 2, 3].map(|i| COLOURS[first + i]);
    for rest in (1..4).rev() {
        for i in 0..rest {
            points[i] = points[i].lerp(points[i + 1], t);
        }
    }
    MARBLE_BRIGHTNESS * points[0]
}

/// Perlin noise: 0 at integer coordinates, in [-1, 1], with continuous second derivatives.
fn noise(p: Vec3) -> f32 {
    let corner = floor3(p);
    let offset = p - corner;
    if !offset.is_finite() {
        return 0.0;
    }
    // `rem_euclid` also handles cells beyond the range of integers
    let cell = [corner.x, corner.y, corner.z].map(|x| x.rem_euclid(256.0) as usize);
    let weight = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let lerp = |a: f32, b: f32, t: f32| a + t * (b - a);
    let at = |x: usize, y: usize, z: usize| {
        let step = Vec3::new(x as f32, y as f32, z as f32);
        gradient([cell[0] + x, cell[1] + y, cell[2] + z], offset - step)
    };
    let along_x = |y, z| lerp(at(0, y, z), at(1, y, z), weight(offset.x));
    let along_y = |z| lerp(along_x(0, z), along_x(1, z), weight(offset.y));
    lerp(along_y(0), along_y(1), weight(offset.z))
}

/// Dot product of the offset from a corner and the corner's gradient, which points to the middle of
/// an edge of the cube.
fn gradient(corner: [usize; 3], offset: Vec3) -> f32 {
    let hash = corner.iter().fold(0, |hash, i| usize::from(PERMUTATION[(hash + i) % 256]));
    let hash = hash % 16;
    let first = if hash < 8 || hash == 12 || hash == 13 { offset.x } else { offset.y };
    let second = if hash < 4 || hash == 12 || hash == 13 { offset.y } else { offset.z };
    (if hash & 1 == 0 { first } else { -first }) + if hash & 2 == 0 { second } else { -second }
}

/// Perlin's permutation of 0 to 255.
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69, 142, 8, 99,
    37, 240, 21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32,
    57, 177, 33, 88, 237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175, 74, 165, 71, 134, 139, 48, 27,
    166, 77, 146, 158, 231, 83, 111, 229, 122, 60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244,
    102, 143, 54, 65, 25, 63, 161, 1, 216, 80, 73, 209, 76, 132, 187, 208, 89, 18, 169, 200, 196, 135, 130,
    116, 188, 159, 86, 164, 100, 109, 198, 173, 186, 3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147,
    118, 126, 255, 82, 85, 212, 207, 206, 59, 227, 47, 16, 58, 17, 182, 189, 28, 42, 223, 183, 170, 213, 119,
    248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9, 129, 22, 39, 253, 19, 98, 108, 110,
    79, 113, 224, 232, 178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238, 210, 144, 12, 191, 179,
    162, 241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184, 84, 204, 176,
    115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141, 128, 195, 78,
    66, 215, 61, 156, 180,
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Points away from integer coordinates.
    fn points() -> impl Iterator<Item = Vec3> {
        (0..4000).map(|i| Vec3::new(0.137, 0.291, 0.413) * i as f32 - Vec3::new(70.3, 200.1, 9.9))
    }

    #[test]
    fn the_permutation_is_a_bijection() {
        let mut sorted = PERMUTATION;
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, &n)| i == usize::from(n)));
    }

    #[test]
    fn noise_is_zero_at_integer_coordinates_with_the_corner_gradients() {
        for p in [Vec3::ZERO, Vec3::new(3.0, -7.0, 260.0), Vec3::splat(1e9)] {
            assert_eq!(noise(p), 0.0);
        }
        let step = 1e-3;
        let slope = |axis: Vec3| noise(step * axis) / step;
        let expected = |axis: Vec3| gradient([0; 3], axis);
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert!((slope(axis) - expected(axis)).abs() < 1e-2, "{axis}");
        }
    }

    #[test]
    fn noise_is_what_pbrt_computes() {
        // Computed independently from pbrt's formula, two of whose sixteen gradients differ from
        // Perlin's, at points that are exact in binary
        let known = [
            ([0.5, 0.25, 0.75], -0.375_078_7),
            ([3.25, -1.5, 7.125], -0.216_717_2),
            ([100.5, 200.25, -300.75], -0.091_460_7),
            ([0.5, 0.5, 0.5], -0.125),
        ];
        for (p, expected) in known {
            assert!((noise(Vec3::from(p)) - expected).abs() < 1e-6, "{p:?}");
        }
    }

    #[test]
    fn noise_has_period_256_and_mean_zero() {
        let sum: f32 = points().map(noise).sum();
        assert!((sum / 4000.0).abs() < 0.01, "{sum}");
        for p in points().take(100) {
            assert!((noise(p) - noise(p + 256.0)).abs() < 1e-2 && noise(p).abs() <= 1.0);
        }
    }

    #[test]
    fn the_first_octave_is_noise_itself_and_the_second_half_as_high() {
        for p in points().take(100) {
            assert_eq!(fbm(p, 1, 0.5), noise(p));
            assert_eq!(fbm(p, 2, 0.25), noise(p) + 0.25 * noise(1.99 * p));
            let wrinkled: f32 = Procedural::Wrinkled { octaves: 1, roughness: 0.5 }.value(p);
            assert_eq!(wrinkled, noise(p).abs() + 0.1);
        }
    }

    #[test]
    fn marble_without_variation_is_gray_between_veins() {
        let marble = Procedural::Marble { octaves: 8, roughness: 0.5, scale: 2.0, variation: 0.0 };
        // sin = -1 is the start of the colours, sin = 1 their end
        let half_turn = std::f32::consts::FRAC_PI_2 / 2.0;
        for y in [-half_turn, half_turn] {
            let value: Vec3 = marble.value(Vec3::new(7.0, y, 3.0));
            assert!((value - 1.5 * Vec3::new(0.58, 0.58, 0.6)).length() < 1e-5, "{value}");
        }
        // The darkest colour is four fifths along
        let darkest =
            (0..100).map(|i| marble.value::<Vec3>(Vec3::Y * (i as f32 / 32.0)).x).fold(1.0, f32::min);
        assert!(darkest > 0.3 && darkest < 0.75, "{darkest}");
    }

    #[test]
    fn dots_cover_their_area() {
        let side = 64;
        let cells = (0..side * side).map(|i| Vec2::new((i % side) as f32, (i / side) as f32));
        let dotted = cells.filter(|cell| noise(Vec3::new(cell.x + 0.5, cell.y + 0.5, 0.5)) > 0.0).count();
        let (mut inside, n) = (0, 16 * side);
        for i in 0..n * n {
            let st = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / 16.0 - 0.5;
            inside += usize::from(in_dot(st));
        }
        let covered = inside as f32 / (n * n) as f32;
        let expected = dotted as f32 / (side * side) as f32 * std::f32::consts::PI * DOT_RADIUS * DOT_RADIUS;
        assert!(expected > 0.1 && (covered / expected - 1.0).abs() < 0.02, "{covered} {expected}");
    }

    #[test]
    fn extreme_points_and_parameters_give_finite_values() {
        for p in [Vec3::splat(f32::MAX), Vec3::splat(f32::NAN), Vec3::splat(1e30)] {
            for kind in [
                Procedural::Fbm { octaves: 64, roughness: 1e30 },
                Procedural::Wrinkled { octaves: 64, roughness: -1e30 },
                Procedural::Windy,
                Procedural::Marble { octaves: 8, roughness: 0.5, scale: 1e30, variation: 1e30 },
            ] {
                let value: Vec3 = kind.value(p);
                assert!(value.is_finite() && value.abs().max_element() <= LARGEST, "{kind:?} {p}: {value}");
            }
            in_dot(p.truncate());
        }
    }
}
