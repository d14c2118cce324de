//! What filter passes cost, supposed as long as nothing was measured.

use super::Denoiser;
use crate::filter::Quality;

/// A filter with its effort.
pub(super) type Pass = (Denoiser, Quality);

/// Of one kind of pass. Measured on two cores where new memory is dear, which is then most of the time.
pub(super) struct Cost {
    /// Seconds of a core for each pixel, from the start of the pass until the image is written, all memory being new.
    core_seconds: f64,
    /// Bytes that the same takes for each pixel.
    pub bytes: usize,
    /// Seconds of a draft, for each of the pass.
    pub draft: f64,
    /// Seconds to find where interpolation of feature weights fails, for each of the pass.
    pub maps: f64,
    /// Whether it is that of each sample of a pixel: they are filtered one by one.
    of_samples: bool,
}

/// Seconds for each pixel to write a state.
const STATE_SECONDS: f64 = 2e-6;

impl Cost {
    pub fn of(pass: Pass) -> Self {
        let cost =
            |core_seconds, bytes, draft, maps| Self { core_seconds, bytes, draft, maps, of_samples: false };
        match pass {
            (Denoiser::None, _) => cost(2e-6, 150, 1.0, 0.0),
            (Denoiser::Prpf, Quality::Draft) => cost(3.6e-6, 350, 1.0, 2.5),
            (Denoiser::Prpf, Quality::Standard) => cost(6e-6, 700, 0.36, 0.9),
            (Denoiser::Prpf, Quality::Paper) => cost(3e-5, 700, 0.04, 0.1),
            // For each sample per pixel; a fifth more than measured, since nothing corrects what is supposed of it.
            (Denoiser::Rpf, _) => Self { of_samples: true, ..cost(3.3e-4, 700, 0.01, 0.02) },
        }
    }

    /// The same with so many samples per pixel.
    pub fn at(self, spp: f64) -> Self {
        let growth = if self.of_samples { spp } else { 1.0 };
        Self { core_seconds: growth * self.core_seconds, ..self }
    }

    /// Seconds from the start of the pass until an image of so many pixels is written, and a state if one is kept.
    pub fn seconds(&self, pixels: usize, keeps: bool) -> f64 {
        let state = if keeps { STATE_SECONDS } else { 0.0 };
        pixels as f64 * (self.core_seconds / rayon::current_num_threads() as f64 + state)
    }
}
