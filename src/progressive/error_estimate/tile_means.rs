//! Means of a map over tiles, and over the image with their standard error.

/// Side of the tiles, in pixels.
pub const TILE: usize = 16;

/// Sums of a map over tiles.
pub struct TileMeans {
    pub columns: usize,
    sums: Vec<f64>,
    counts: Vec<u32>,
}

/// A mean over an image, and its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Mean {
    pub value: f64,
    pub standard_error: f64,
}

impl TileMeans {
    /// `value`: the map at a pixel; pixels that are not known do not count.
    pub fn new(
        [width, height]: [usize; 2],
        value: impl Fn(usize) -> f64,
        is_known: impl Fn(usize) -> bool,
    ) -> Self {
        let columns = width.div_ceil(TILE);
        let tiles = columns * height.div_ceil(TILE);
        let (mut sums, mut counts) = (vec![0.0; tiles], vec![0; tiles]);
        for i in (0..width * height).filter(|&i| is_known(i)) {
            let tile = i / width / TILE * columns + i % width / TILE;
            sums[tile] += value(i);
            counts[tile] += 1;
        }
        Self { columns, sums, counts }
    }

    /// Returns the number of tiles.
    pub fn len(&self) -> usize {
        self.sums.len()
    }

    /// Returns the number of pixels of a tile.
    pub fn pixels_of(&self, tile: usize) -> f64 {
        f64::from(self.counts[tile])
    }

    /// Returns the mean of a tile; 0 without pixels.
    pub fn tile_mean(&self, tile: usize) -> f64 {
        self.sums[tile] / self.pixels_of(tile).max(1.0)
    }

    /// Returns the number of pixels of all tiles.
    pub fn pixels(&self) -> usize {
        self.counts.iter().map(|&n| n as usize).sum()
    }

    /// Returns the mean over the pixels. Its standard error is that of independent tiles; a single tile has a standard error
    /// of its whole value.
    pub fn mean(&self) -> Mean {
        let value = self.sums.iter().sum::<f64>() / self.pixels().max(1) as f64;
        let tiles = self.counts.iter().filter(|&&n| n > 0).count();
        if tiles < 2 {
            return Mean { value, standard_error: value.abs() };
        }
        let deviation = |(sum, &n): (&f64, &u32)| (sum - value * f64::from(n)).powi(2);
        let squares: f64 = self.sums.iter().zip(&self.counts).map(deviation).sum();
        let corrected = squares * tiles as f64 / (tiles - 1) as f64;
        Mean { value, standard_error: corrected.sqrt() / self.pixels() as f64 }
    }
}

impl Mean {
    /// Returns a value without error.
    pub fn exactly(value: f64) -> Self {
        Self { value, standard_error: 0.0 }
    }

    /// Returns the product with another value, as if their errors were independent.
    pub fn product(self, other: Self) -> Self {
        let errors = [self.standard_error * other.value, other.standard_error * self.value];
        Self { value: self.value * other.value, standard_error: errors[0].hypot(errors[1]) }
    }

    /// Returns the ratio to another value, which is not 0, as if their errors were independent.
    pub fn over(self, other: Self) -> Self {
        let inverse = other.value.recip();
        self.product(Self { value: inverse, standard_error: other.standard_error * inverse * inverse })
    }

    /// Returns the mean and its standard error times a factor.
    pub fn times(self, factor: f64) -> Self {
        Self { value: factor * self.value, standard_error: factor * self.standard_error }
    }

    /// Returns the logarithm of the value, and its standard deviation, which is at least `deviation`. A value that its noise
    /// hides counts as half of its standard error.
    pub fn logarithm(self, deviation: f64) -> (f64, f64) {
        let value = self.value.max(0.5 * self.standard_error).max(f64::MIN_POSITIVE);
        (value.ln(), deviation.hypot(self.standard_error / value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_errors_of_products_and_ratios_add_in_squares() {
        let mean = |value, standard_error| Mean { value, standard_error };
        for found in [mean(2.0, 0.6).product(mean(3.0, 1.2)), mean(2.0, 0.6).over(mean(1.0 / 3.0, 0.4 / 3.0))]
        {
            assert!(
                (found.value - 6.0).abs() < 1e-12 && (found.standard_error - 3.0).abs() < 1e-12,
                "{found:?}"
            );
        }
    }

    #[test]
    fn logarithms_deviate_by_noise_and_calibration() {
        let mean = |value, standard_error| Mean { value, standard_error };
        let (logarithm, deviation) = mean(2.0, 0.8).times(3.0).logarithm(0.3);
        assert!((logarithm - 6f64.ln()).abs() < 1e-12 && (deviation - 0.5).abs() < 1e-12);
        // Noise hides a negative value.
        let (logarithm, deviation) = mean(-1.0, 4.0).logarithm(0.0);
        assert!((logarithm - 2f64.ln()).abs() < 1e-12 && (deviation - 2.0).abs() < 1e-12);
    }
}
