//! Samples candidates for a neighbourhood: pixel offsets from a Gaussian of a quarter window, then a random
//! sample of each pixel (technical report, section on preprocessing).

use rand::Rng;
use rand_pcg::Pcg32;

use super::samples::Samples;
use super::settings::{RpfPass, RpfSettings};

/// Entries of the table of offsets. The rarest offset of a window has some tens of them.
const TABLE_SIZE: usize = 1 << 13;

/// Bits of a random number that select the offset along one axis.
const OFFSET_BITS: u32 = 24;

/// Bits that select one of a pixel's samples.
const SLOT_BITS: u32 = 16;

/// A sample of a pixel.
#[derive(Clone, Copy)]
pub struct Candidate {
    /// Index of the pixel.
    pub pixel: u32,
    /// Index among the pixel's samples.
    pub slot: u32,
    /// Index among all samples.
    pub id: u32,
}

/// The candidate distribution of a pass.
pub struct CandidateSampler {
    window: usize,
    /// Size of a neighbourhood before clustering, the pixel's own samples included.
    pub size: usize,
    /// A pixel is selected at most as often as it has samples.
    is_capped: bool,
    /// Quantiles of the offset along one axis.
    offsets: Vec<i16>,
    /// Index of the first entry of each offset, in ascending order, and the size of the table.
    firsts: Vec<usize>,
}

impl CandidateSampler {
    pub fn new(pass: &RpfPass, settings: &RpfSettings, samples: &Samples) -> Self {
        let radius = (pass.window / 2) as i32;
        let deviation = ((pass.window as f32 - settings.window_trim) / 4.0).max(settings.min_deviation);
        let density = |d: i32| (-0.5 * (d as f32 / deviation).powi(2)).exp();
        let total: f32 = (-radius..=radius).map(density).sum();
        let mut cumulative = 0.0;
        let mut firsts = vec![0];
        let mut offsets = Vec::with_capacity(TABLE_SIZE);
        for d in -radius..=radius {
            cumulative += density(d) / total;
            // Every offset has an entry, so that there is one in the narrowest image.
            let end = ((cumulative * TABLE_SIZE as f32).round() as usize).max(offsets.len() + 1);
            offsets.resize(end, d as i16);
            firsts.push(end);
        }
        let size = (pass.fraction * (pass.window * pass.window) as f32 * samples.mean_count()).round();
        let is_capped = settings.cap_candidates;
        Self { window: pass.window, size: size as usize, is_capped, offsets, firsts }
    }

    /// Collects the candidates of a pixel: inside window and image, and not samples of the pixel itself.
    /// `pass` and `seed` determine the random numbers; `tally` is scratch memory.
    pub fn sample(
        &self,
        samples: &Samples,
        (x, y): (usize, usize),
        (seed, pass): (u64, usize),
        tally: &mut Vec<u32>,
        candidates: &mut Vec<Candidate>,
    ) {
        candidates.clear();
        let (width, height) = (samples.width(), samples.height());
        let wanted = self.size.saturating_sub(samples.count(x, y));
        if width * height == 1 {
            return;
        }
        if self.is_capped {
            tally.clear();
            tally.resize((self.window + 1).pow(2), 0);
        }
        let (columns, rows) = (self.range_inside(x, width), self.range_inside(y, height));
        let mut rng = Pcg32::new(seed.rotate_left(32) ^ (y * width + x) as u64, pass as u64);
        for _ in 0..wanted {
            // Sample an offset other than 0
            let (dx, dy, bits) = loop {
                let bits = rng.next_u64();
                let mask = (1 << OFFSET_BITS) - 1;
                let dx = self.offset(columns, bits & mask);
                let dy = self.offset(rows, bits >> OFFSET_BITS & mask);
                if (dx, dy) != (0, 0) {
                    break (dx, dy, bits >> (2 * OFFSET_BITS));
                }
            };
            let (xj, yj) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            let ids = samples.ids(xj, yj);
            let count = ids.len();

            // Skip a pixel that has been selected as often as it has samples
            if self.is_capped {
                let radius = (self.window / 2) as isize;
                let entry = (dy + radius) as usize * (self.window + 1) + (dx + radius) as usize;
                tally[entry] += 1;
                if tally[entry] as usize > count {
                    continue;
                }
            }

            // Select one of its samples
            if count > 0 {
                let slot = (bits * count as u64) >> SLOT_BITS;
                let id = (ids.start as u64 + slot) as u32;
                candidates.push(Candidate { pixel: (yj * width + xj) as u32, slot: slot as u32, id });
            }
        }
    }

    /// Returns start and length of the part of the table with offsets that stay inside an axis of `size`
    /// pixels from `at`.
    fn range_inside(&self, at: usize, size: usize) -> (usize, usize) {
        let radius = self.window / 2;
        let first = self.firsts[radius - radius.min(at)];
        (first, self.firsts[radius + radius.min(size - 1 - at) + 1] - first)
    }

    /// Returns the offset for [`OFFSET_BITS`] random bits.
    #[inline]
    fn offset(&self, (first, len): (usize, usize), bits: u64) -> isize {
        isize::from(self.offsets[first + ((bits * len as u64) >> OFFSET_BITS) as usize])
    }
}
