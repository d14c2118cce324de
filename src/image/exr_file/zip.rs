//! Compresses a block of scan lines as OpenEXR's ZIP does.
//!
//! Bytes at even places come first and those at odd places after them, each byte is replaced by its difference from the one
//! before, and the result is a zlib stream (OpenEXR, "Technical Introduction", section on compression). The `exr` crate does
//! the same with a slower encoder.

use libdeflater::{CompressionLvl, Compressor};

/// Level of the encoder. Noisy numbers hardly get smaller on higher ones, which take several times as long.
const LEVEL: i32 = 1;

/// Returns the compressed bytes, or `data` itself if they would not be fewer, as the format asks for.
pub fn compress(data: Vec<u8>) -> Vec<u8> {
    let mut encoder = Compressor::new(CompressionLvl::new(LEVEL).expect("a level of the encoder"));
    // No more room than the data takes: an encoder that does not get by with it is of no use
    let mut compressed = vec![0; data.len()];
    match encoder.zlib_compress(&differences(&data), &mut compressed) {
        Ok(length) if length < data.len() => {
            compressed.truncate(length);
            compressed
        }
        _ => data,
    }
}

/// Separates the bytes at even and odd places, and takes differences of neighbours, with an offset of half the range.
fn differences(data: &[u8]) -> Vec<u8> {
    let mut separated: Vec<u8> = Vec::with_capacity(data.len());
    separated.extend(data.iter().step_by(2));
    separated.extend(data.iter().skip(1).step_by(2));
    let mut differences = separated.clone();
    for (out, pair) in differences.iter_mut().skip(1).zip(separated.windows(2)) {
        *out = pair[1].wrapping_sub(pair[0]).wrapping_add(128);
    }
    differences
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;

    #[test]
    fn bytes_are_separated_and_differ_from_the_one_before() {
        assert_eq!(differences(&[10, 200, 12, 201, 7]), [10, 130, 123, 65, 129]);
        assert!(differences(&[]).is_empty());
    }

    #[test]
    fn what_would_grow_stays_as_it_is() {
        let mut rng = Pcg32::seed_from_u64(1);
        let noise: Vec<u8> = (0..4096).map(|_| rng.random()).collect();
        assert_eq!(compress(noise.clone()), noise);
        assert!(compress(vec![7; 4096]).len() < 200);
        assert!(compress(Vec::new()).is_empty());
    }
}
