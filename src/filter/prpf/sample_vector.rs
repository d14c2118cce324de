//! Sample vectors in arrays of a fixed size, for vector code.

/// Maximum number of dimensions that weights are computed from. Longer sample vectors end in auxiliary dimensions.
pub const MAX_VARIABLES: usize = 32;

/// A sample vector, padded to a fixed size.
pub type SampleVector = [f32; MAX_VARIABLES];

/// Copies the first [`MAX_VARIABLES`] values of a sample to the start of `to`. Copies chunks of a fixed size,
/// the last of which may overlap its predecessor: this takes a third of the time of a copy of variable
/// length.
#[inline(always)]
pub fn copy(sample: &[f32], to: &mut SampleVector) {
    const CHUNK: usize = 8;
    let n = sample.len().min(MAX_VARIABLES);
    if n < CHUNK {
        to[..n].copy_from_slice(sample);
        return;
    }
    for start in (0..n).step_by(CHUNK) {
        let start = start.min(n - CHUNK);
        let chunk: &[f32; CHUNK] = sample[start..start + CHUNK].try_into().expect("it has this length");
        to[start..start + CHUNK].copy_from_slice(chunk);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_any_length_are_copied_whole() {
        for n in 0..=MAX_VARIABLES {
            let sample: Vec<f32> = (0..n).map(|i| i as f32).collect();
            let mut to = [-1.0; MAX_VARIABLES];
            copy(&sample, &mut to);
            assert_eq!(to[..n], sample);
            assert!(to[n..].iter().all(|&v| v == -1.0));
        }
    }
}
