//! The sampling speed of the latest steps.

use super::time_constants::SPEED_MEMORY;

/// Samples and seconds of the latest steps; older ones fade.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Speed {
    pub samples: f64,
    pub seconds: f64,
}

impl Speed {
    /// Adds a step.
    pub fn add(&mut self, samples: u64, seconds: f64) {
        let fade = (-seconds / SPEED_MEMORY).exp();
        self.samples = fade * self.samples + samples as f64;
        self.seconds = fade * self.seconds + seconds;
    }

    /// Returns the samples per second; `None` before the first step.
    pub fn rate(&self) -> Option<f64> {
        (self.samples > 0.0).then(|| self.samples / self.seconds.max(1e-6))
    }

    /// Returns the seconds that `samples` samples take; 0 before the first step.
    pub fn seconds_for(&self, samples: f64) -> f64 {
        self.rate().map_or(0.0, |rate| samples / rate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_steps_decide() {
        let mut speed = Speed::default();
        assert_eq!((speed.rate(), speed.seconds_for(5.0)), (None, 0.0));
        speed.add(1000, 1.0);
        assert_eq!(speed.rate(), Some(1000.0));
        for _ in 0..10 {
            speed.add(100, 1.0);
        }
        assert!(speed.rate().is_some_and(|rate| (rate - 100.0).abs() < 1e-3));
    }
}
