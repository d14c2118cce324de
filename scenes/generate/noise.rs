//! Hashed lattice noise: the same on every machine.

use glam::DVec2;

/// A number in [0, 1) from three integers (the mixing constants are those of splitmix64,
/// Steele, Lea and Flood 2014).
pub fn hash(x: i64, y: i64, seed: u64) -> f64 {
    let mut bits = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (x as u64).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (y as u64)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Smooth noise in [0, 1) with one lattice point a unit, repeating after `period` units.
pub fn value(at: DVec2, period: [i64; 2], seed: u64) -> f64 {
    let cell = at.floor();
    let f = at - cell;
    let smooth = f * f * (3.0 - 2.0 * f);
    let corner = |dx: i64, dy: i64| {
        hash((cell.x as i64 + dx).rem_euclid(period[0]), (cell.y as i64 + dy).rem_euclid(period[1]), seed)
    };
    let low = corner(0, 0) + (corner(1, 0) - corner(0, 0)) * smooth.x;
    let high = corner(0, 1) + (corner(1, 1) - corner(0, 1)) * smooth.x;
    low + (high - low) * smooth.y
}

/// Octaves of [`value`], each of twice the frequency and half the weight; in [0, 1).
pub fn fractal(at: DVec2, period: [i64; 2], octaves: u32, seed: u64) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for octave in 0..octaves {
        let frequency = 1i64 << octave;
        let weight = 1.0 / frequency as f64;
        sum += weight * value(at * frequency as f64, period.map(|p| p * frequency), seed + u64::from(octave));
        weights += weight;
    }
    sum / weights
}

/// A stream of numbers for scattering things about.
pub struct Stream {
    seed: u64,
    taken: i64,
}

impl Stream {
    pub fn new(seed: u64) -> Self {
        Self { seed, taken: 0 }
    }

    /// The next number, in [low, high).
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        self.taken += 1;
        low + (high - low) * hash(self.taken, 0, self.seed)
    }

    /// The next number, in [low, high), whose logarithm is uniform.
    pub fn log_range(&mut self, low: f64, high: f64) -> f64 {
        self.range(low.ln(), high.ln()).exp()
    }

    /// The next whole number, in low to high − 1; low if there is none.
    pub fn count(&mut self, low: u32, high: u32) -> u32 {
        (self.range(f64::from(low), f64::from(high.max(low + 1))) as u32).max(low)
    }

    /// Whether something of this probability happens.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.range(0.0, 1.0) < probability
    }

    /// One of some things.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.count(0, of.len() as u32) as usize]
    }

    /// The seed of another stream.
    pub fn seed(&mut self) -> u64 {
        self.range(0.0, 2f64.powi(52)) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_repeats_after_its_period() {
        for i in 0..50 {
            let at = DVec2::new(0.37 * f64::from(i), 0.61 * f64::from(i));
            let shifted = fractal(at + DVec2::new(4.0, -8.0), [4, 8], 3, 7);
            assert!((fractal(at, [4, 8], 3, 7) - shifted).abs() < 1e-9);
        }
    }

    #[test]
    fn a_stream_covers_its_range_evenly() {
        let mut stream = Stream::new(3);
        let mean = (0..10_000).map(|_| stream.range(2.0, 4.0)).sum::<f64>() / 1e4;
        // The mean's standard deviation is 2 / √12 / 100 ≈ 0.006.
        assert!((mean - 3.0).abs() < 0.025, "mean {mean}");
    }
}
