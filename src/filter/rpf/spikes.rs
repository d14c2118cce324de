//! Spike removal: what stands out among a pixel's filtered samples (technical report, section on
//! spikes).

use super::samples::{Value, mean};
use super::settings::SpikeSettings;

/// Brings the samples of a pixel that stand out to its mean. Channels are treated together.
pub(super) fn remove(samples: &mut [Value], settings: &SpikeSettings) {
    if samples.len() < 2 {
        return;
    }
    let before = mean(samples);
    let mut limits = [0.0; 3];
    for (c, limit) in limits.iter_mut().enumerate() {
        let squares: f32 = samples.iter().map(|s| (s[c] - before[c]).powi(2)).sum();
        *limit = settings.deviations * (squares / (samples.len() - 1) as f32).sqrt();
    }
    for sample in samples.iter_mut() {
        if settings.clamp_bright {
            for c in 0..3 {
                let (old, new) = (sample[c], sample[c].min(before[c] + limits[c]));
                if new < old {
                    sample[c] = new;
                    sample[3 + c] *= new / old;
                }
            }
        } else if (0..3).any(|c| (sample[c] - before[c]).abs() > limits[c]) {
            *sample = before;
        }
    }
    if settings.keep_energy {
        let after = mean(samples);
        for sample in samples {
            (0..sample.len()).for_each(|c| sample[c] += before[c] - after[c]);
        }
    }
}
