//! Clamps fireflies among the filtered samples of a pixel (technical report, section on spikes).

use super::samples::{Value, mean};
use super::settings::RpfFireflySettings;

/// Replaces the samples that deviate from the pixel's mean in any channel by the mean, or clamps them.
pub fn clamp(samples: &mut [Value], settings: &RpfFireflySettings) {
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

#[cfg(test)]
mod tests {
    use super::super::settings::RpfSettings;
    use super::*;

    fn pixel(reds: [f32; 4]) -> [Value; 4] {
        reds.map(|red| [red, 0.5, 0.5, red, 0.5, 0.5, 1.0, 0.0])
    }

    fn reds(samples: [Value; 4]) -> [f32; 4] {
        samples.map(|sample| sample[0])
    }

    #[test]
    fn samples_that_deviate_to_either_side_become_the_mean() {
        // The mean is 3, the standard deviation √(68 ∕ 3) = 4.8.
        let mut samples = pixel([0.0, 0.0, 2.0, 10.0]);
        clamp(&mut samples, &RpfSettings::report().fireflies);
        assert_eq!(reds(samples), [0.0, 0.0, 2.0, 3.0]);
        let mut samples = pixel([10.0, 10.0, 8.0, 0.0]);
        clamp(&mut samples, &RpfSettings::report().fireflies);
        assert_eq!(reds(samples), [10.0, 10.0, 8.0, 7.0]);
    }

    #[test]
    fn energy_is_kept_if_set() {
        let mut samples = pixel([0.0, 0.0, 2.0, 10.0]);
        clamp(&mut samples, &RpfSettings::energy_kept().fireflies);
        assert_eq!(reds(samples), [1.75, 1.75, 3.75, 4.75]);
    }

    #[test]
    fn the_released_rule_clamps_bright_channels() {
        let mut samples = pixel([0.0, 0.0, 2.0, 10.0]);
        clamp(&mut samples, &RpfSettings::release().fireflies);
        let limit = 3.0 + 0.5 * (68f32 / 3.0).sqrt();
        let [a, b, c, d] = reds(samples);
        assert_eq!([a, b, c], [0.0, 0.0, 2.0]);
        assert!((d - limit).abs() < 1e-5 && (samples[3][3] - limit).abs() < 1e-5);
    }

    #[test]
    fn equal_and_single_samples_do_not_change() {
        let mut samples = pixel([0.1; 4]);
        clamp(&mut samples, &RpfSettings::report().fireflies);
        assert_eq!(reds(samples), [0.1; 4]);
        clamp(&mut samples[..1], &RpfSettings::report().fireflies);
        assert_eq!(reds(samples), [0.1; 4]);
    }

    #[test]
    fn one_of_two_samples_may_be_clamped() {
        let mut samples = [0.0, 4.0].map(|red| [red, 0.5, 0.5, red, 0.5, 0.5, 1.0, 0.0]);
        clamp(&mut samples, &RpfSettings::release().fireflies);
        // The mean is 2, the standard deviation √8, half of which is allowed.
        assert!((samples[1][0] - (2.0 + 2f32.sqrt())).abs() < 1e-5, "{}", samples[1][0]);
        assert_eq!(samples[0][0], 0.0);
    }
}
