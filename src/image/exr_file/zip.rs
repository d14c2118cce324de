//! Compresses a block of scan lines as OpenEXR's ZIP does.
//!
//! Bytes at even places come first and those at odd places after them, each byte is replaced by its difference from the one
//! before, and the result is a zlib stream (OpenEXR, "Technical Introduction", section on compression). The `exr` crate does
//! the same with a slower encoder.

use libdeflater::{CompressionLvl, Compressor};

/// Level of the encoder. Noisy numbers hardly get smaller on higher ones, which take several times as long.
const LEVEL: i32 = 1;

/// Compresses one block after another, in the same memory.
pub struct Encoder {
    compressor: Compressor,
    separated: Vec<u8>,
    differences: Vec<u8>,
    compressed: Vec<u8>,
}

impl Default for Encoder {
    fn default() -> Self {
        let level = CompressionLvl::new(LEVEL).expect("a level of the encoder");
        let [separated, differences, compressed] = [const { Vec::new() }; 3];
        Self { compressor: Compressor::new(level), separated, differences, compressed }
    }
}

impl Encoder {
    /// Returns the compressed bytes, or `data` itself if they would not be fewer, as the format asks for.
    pub fn compress(&mut self, data: Vec<u8>) -> Vec<u8> {
        self.take_differences(&data);
        // No more room than the data takes: an encoder that does not get by with it is of no use
        self.compressed.resize(data.len(), 0);
        match self.compressor.zlib_compress(&self.differences, &mut self.compressed) {
            Ok(length) if length < data.len() => self.compressed[..length].to_vec(),
            _ => data,
        }
    }

    /// Separates the bytes at even and odd places, and takes differences of neighbours, with an offset of half the range.
    fn take_differences(&mut self, data: &[u8]) {
        let Self { separated, differences, .. } = self;
        separated.clear();
        separated.extend(data.iter().step_by(2));
        separated.extend(data.iter().skip(1).step_by(2));
        differences.clear();
        differences.extend(separated.first());
        differences.extend(separated.windows(2).map(|pair| pair[1].wrapping_sub(pair[0]).wrapping_add(128)));
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;

    #[test]
    fn bytes_are_separated_and_differ_from_the_one_before() {
        let mut encoder = Encoder::default();
        encoder.take_differences(&[10, 200, 12, 201, 7]);
        assert_eq!(encoder.differences, [10, 130, 123, 65, 129]);
        encoder.take_differences(&[]);
        assert!(encoder.differences.is_empty());
    }

    #[test]
    fn what_would_grow_stays_as_it_is() {
        let mut rng = Pcg32::seed_from_u64(1);
        let noise: Vec<u8> = (0..4096).map(|_| rng.random()).collect();
        let mut encoder = Encoder::default();
        assert_eq!(encoder.compress(noise.clone()), noise);
        assert!(encoder.compress(vec![7; 4096]).len() < 200);
        assert!(encoder.compress(Vec::new()).is_empty());
    }
}
