//! The neighbourhood N of a pixel: its own samples, and those candidates whose features are similar
//! (technical report, sections on preprocessing and clustering).

use super::candidate_sampler::{Candidate, CandidateSampler};
use super::samples::Samples;
use super::settings::RpfSettings;
use crate::filter::prpf::bit_slices::BLOCK_SAMPLES;
use crate::filter::prpf::sample_vector::{MAX_VARIABLES, SampleVector, copy};
use crate::simd::{apply, multiversioned};
use crate::stats::{Block, Feature, Layout};

/// Similarity thresholds of each dimension: the absolute minimum and the number of standard deviations.
/// Dimensions that are no features have infinite minima.
pub struct Clustering {
    min_threshold: SampleVector,
    z: SampleVector,
}

impl Clustering {
    pub fn new(settings: &RpfSettings, layout: &Layout) -> Self {
        let (mut min_threshold, mut z) = ([f32::INFINITY; MAX_VARIABLES], [0.0; MAX_VARIABLES]);
        let second = [Block::Position2, Block::Normal2].map(|block| layout.block(block));
        for (dim, kind) in layout.features() {
            let is_second = second.iter().flatten().any(|block| block.contains(&dim));
            if settings.cluster_second_hit || !is_second {
                (min_threshold[dim], z[dim]) = match kind {
                    Feature::WorldPosition => (settings.min_threshold_world, settings.z_world),
                    Feature::Normal | Feature::Albedo => (settings.min_threshold, settings.z),
                };
            }
        }
        Self { min_threshold, z }
    }

    /// Returns the means of a pixel's samples, and how much a neighbour may differ from them in each dimension.
    fn thresholds(&self, own: &[SampleVector]) -> (SampleVector, SampleVector) {
        let (means, variances) = moments(own, &own[0]);
        // The unbiased variance; that of one sample is unknown.
        let unbiased = own.len() as f32 / (own.len().max(2) - 1) as f32;
        let threshold = |dim: usize| {
            let minimum = self.min_threshold[dim];
            if minimum.is_infinite() {
                return f32::INFINITY;
            }
            let deviation = (variances[dim] * unbiased).sqrt();
            let spread = self.z[dim] * deviation;
            if deviation > minimum { spread } else { spread.max(minimum) }
        };
        (means, std::array::from_fn(threshold))
    }
}

/// A neighbourhood, the pixel's own samples first.
pub struct Neighbourhood {
    /// Sample vectors, and places for as many as a neighbourhood may have.
    rows: Vec<SampleVector>,
    /// Indices of the samples among all.
    ids: Vec<u32>,
    len: usize,
    /// Means of the pixel's own samples.
    centre: SampleVector,
    candidates: Vec<Candidate>,
    tally: Vec<u32>,
}

impl Neighbourhood {
    /// Allocates memory for the neighbourhoods of a pass.
    pub fn new(sampler: &CandidateSampler, samples: &Samples) -> Self {
        // A rejected sample is written to the place of the next one: one more place.
        let places = sampler.size.max(samples.max_count()) + 1;
        Self {
            rows: vec![[0.0; MAX_VARIABLES]; places],
            ids: vec![0; places],
            len: 0,
            centre: [0.0; MAX_VARIABLES],
            candidates: Vec::with_capacity(sampler.size),
            tally: Vec::new(),
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.len
    }

    /// The sample vectors.
    pub fn rows(&self) -> &[SampleVector] {
        &self.rows[..self.len]
    }

    /// Indices of the samples among all.
    pub fn ids(&self) -> &[u32] {
        &self.ids[..self.len]
    }

    /// Means of the pixel's own samples.
    pub fn centre(&self) -> &SampleVector {
        &self.centre
    }

    /// Collects the neighbourhood of a pixel that has samples. `seed` and `pass` determine the candidates.
    pub fn gather(
        &mut self,
        samples: &Samples,
        sampler: &CandidateSampler,
        clustering: &Clustering,
        (x, y): (usize, usize),
        (seed, pass): (u64, usize),
    ) {
        sampler.sample(samples, (x, y), (seed, pass), &mut self.tally, &mut self.candidates);
        let own = samples.ids(x, y);
        let rows = &mut self.rows;
        for (slot, id) in own.clone().enumerate() {
            copy(samples.sample(y * samples.width() + x, slot), &mut rows[slot]);
            self.ids[slot] = id as u32;
        }
        let (centre, thresholds) = clustering.thresholds(&rows[..own.len()]);
        self.centre = centre;
        self.len =
            append_similar(&self.candidates, samples, own.len(), &centre, &thresholds, rows, &mut self.ids);
    }

    /// Returns mean and variance of each dimension.
    pub fn moments(&self) -> (SampleVector, SampleVector) {
        moments(self.rows(), &self.centre)
    }
}

/// Appends the candidates within the thresholds to the first `len` rows. Returns the number of rows after that.
#[apply(multiversioned!)]
fn append_similar(
    candidates: &[Candidate],
    samples: &Samples,
    mut len: usize,
    centre: &SampleVector,
    thresholds: &SampleVector,
    rows: &mut [SampleVector],
    ids: &mut [u32],
) -> usize {
    for candidate in candidates {
        let row = &mut rows[len];
        copy(samples.sample(candidate.pixel as usize, candidate.slot as usize), row);
        ids[len] = candidate.id;
        let mut dissimilar = 0;
        for l in 0..MAX_VARIABLES {
            dissimilar += u32::from((row[l] - centre[l]).abs() > thresholds[l]);
        }
        len += usize::from(dissimilar == 0);
    }
    len
}

/// Returns mean and variance of each dimension. Sums are relative to `shift`, which avoids cancellation far
/// from 0, and taken block by block, which limits rounding errors.
#[apply(multiversioned!)]
fn moments(rows: &[SampleVector], shift: &SampleVector) -> (SampleVector, SampleVector) {
    let (mut sums, mut squares) = ([0.0; MAX_VARIABLES], [0.0; MAX_VARIABLES]);
    for block in rows.chunks(BLOCK_SAMPLES) {
        let (mut sum, mut square) = ([0.0; MAX_VARIABLES], [0.0; MAX_VARIABLES]);
        for row in block {
            for l in 0..MAX_VARIABLES {
                let d = row[l] - shift[l];
                sum[l] += d;
                square[l] += d * d;
            }
        }
        for l in 0..MAX_VARIABLES {
            sums[l] += sum[l];
            squares[l] += square[l];
        }
    }
    let n = rows.len() as f32;
    let mean = std::array::from_fn(|l| shift[l] + sums[l] / n);
    let variance = std::array::from_fn(|l| (squares[l] / n - (sums[l] / n).powi(2)).max(0.0));
    (mean, variance)
}

#[cfg(test)]
mod tests;
