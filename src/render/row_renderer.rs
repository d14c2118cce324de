//! Renders the samples of one row of pixels.
//!
//! Pixels are sampled in the blocks in which the store takes them: one sample of each pixel of a block, then a
//! second of those that get one, and so on. Wavefronts of samples are traced together.

use glam::{Mat3, Vec2};

use super::camera_rays::CameraRays;
use super::filter_sampler::FilterSampler;
use super::integrator::{PathEvent, PathRadiance, PathTracer, Wavefront};
use super::rejected_sample::RejectedSample;
use super::sample_sink::append_records;
use super::sampler::{SampleAddresses, Sampler};
use super::shard::Shard;
use crate::geometry::RayLanes;
use crate::simd::{LANES, Lanes, lane_mask, lanes_in};
use crate::stats::Row;

/// Samples of a wavefront: enough for most packets to be full, few enough for their state to stay in the
/// first-level cache.
const WAVEFRONT_SAMPLES: usize = 128;

/// Packets that a wavefront is started with at most, where few of a block's pixels get samples.
const MAX_PACKETS: usize = 2 * WAVEFRONT_SAMPLES / LANES;

/// Renders rows; all of them share it.
pub struct RowRenderer<'s> {
    pub seed: u64,
    pub shard: Shard,
    /// First column and row of the film's pixel bounds.
    pub corner: [usize; 2],
    /// Factor from radiance to pixel value.
    pub exposure: f32,
    /// Matrix that the radiance of a sample is multiplied by, if any.
    pub white_balance: Option<Mat3>,
    pub filter: FilterSampler,
    pub camera: CameraRays,
    pub tracer: PathTracer<'s>,
    /// `SampleRecords::enabled_dimensions` of the store's layout.
    pub enabled: Vec<usize>,
}

impl<'s> RowRenderer<'s> {
    /// Renders `counts[x]` more samples into every pixel of row `y` of the film's pixel bounds. Returns the first
    /// sample, in the order of columns and indices, that the store rejected. Appends the samples to `records`, if there are
    /// any.
    pub fn render<S: Sampler>(
        &self,
        y: usize,
        counts: &[u32],
        records: Option<&mut Vec<u8>>,
        row: &mut Row,
    ) -> Option<RejectedSample> {
        let mut batch = WavefrontBatch { y, recorded: records, ..WavefrontBatch::default() };
        let row_number = (y + self.corner[1]) as u32;
        for (block, counts) in counts.chunks(LANES).enumerate() {
            // Most of them, in a short step
            if counts.iter().all(|&count| count == 0) {
                continue;
            }

            // Find the pixels' samplers, centres and next sample indices
            let column = |lane: usize| block * LANES + lane;
            let samplers: [S; LANES] = std::array::from_fn(|lane| {
                S::for_pixel(self.seed, (column(lane) + self.corner[0]) as u32, row_number)
            });
            let mut indices = [0; LANES];
            indices
                .iter_mut()
                .zip(0..counts.len())
                .for_each(|(index, lane)| *index = row.next_index(column(lane)));
            let mut samples = CameraSamplePacket {
                addresses: SampleAddresses::NONE,
                centres: [[0.0; LANES], [row_number as f32 + 0.5; LANES]],
            };
            for lane in 0..LANES {
                samples.centres[0][lane] = (column(lane) + self.corner[0]) as f32 + 0.5;
            }

            // Start a sample of each pixel that gets another one
            // Indices must not wrap around.
            let left = |lane: usize| counts.get(lane).map_or(0, |&count| count.min(u32::MAX - indices[lane]));
            for round in 0..(0..LANES).map(left).max().unwrap_or(0) {
                let mask = lane_mask(|lane| round < left(lane));
                for lane in 0..LANES {
                    let index = self.shard.sequence_index(indices[lane].saturating_add(round));
                    samples.addresses.set(lane, samplers[lane].address(index));
                }
                self.start::<S>(&samples, mask, &mut batch.wave);
                batch.origins.push((block, mask));
                batch.samples += mask.count_ones() as usize;
                if batch.samples > WAVEFRONT_SAMPLES - LANES || batch.origins.len() == MAX_PACKETS {
                    self.finish::<S>(&mut batch, row);
                }
            }
        }
        self.finish::<S>(&mut batch, row);
        batch.first_rejected.map(|(x, index)| RejectedSample { y, x, index })
    }

    /// Generates the camera rays of the samples in a mask's lanes and starts their paths.
    fn start<S: Sampler>(&self, samples: &CameraSamplePacket, mask: u32, wave: &mut Wavefront<'s>) {
        // Sample the film position
        let camera = self.tracer.dimensions().camera::<S>(&samples.addresses);
        let mut film = samples.centres;
        let [film_x, film_y] = &mut film;
        for (lane, (x, y)) in film_x.iter_mut().zip(film_y).enumerate() {
            let offset = self.filter.sample(Vec2::new(camera.film[0][lane], camera.film[1][lane]));
            (*x, *y) = (*x + offset.x, *y + offset.y);
        }

        // Generate the camera rays
        let mut rays = RayLanes::NONE;
        self.camera.rays(&film, &camera.lens, &camera.time, &mut rays);

        // Start the paths and record their sample values
        let records = wave.start(&rays, &samples.addresses, mask);
        (records.film, records.lens, records.time) = (film, camera.lens, camera.time);
        // Sample values of the first hit are recorded even if there is none, so that their distribution does
        // not depend on whether they were used.
        (records.light1, records.bsdf1) = (camera.light_uv, camera.bsdf_uv);
    }

    /// Computes the radiance of a pixel's `index`-th sample with the scalar reference path tracer.
    pub fn reference_radiance<S: Sampler>(
        &self,
        x: usize,
        y: usize,
        index: u32,
        events: &mut dyn FnMut(PathEvent),
    ) -> PathRadiance {
        let (column, row_number) = ((x + self.corner[0]) as u32, (y + self.corner[1]) as u32);
        let sampler = S::for_pixel(self.seed, column, row_number);
        let address = sampler.address(self.shard.sequence_index(index));
        let camera = self.tracer.dimensions().camera::<S>(&SampleAddresses::splat(address));
        let pair = |values: &[Lanes; 2]| Vec2::new(values[0][0], values[1][0]);
        let centre = Vec2::new(column as f32 + 0.5, row_number as f32 + 0.5);
        let film = centre + self.filter.sample(pair(&camera.film));
        let ray = self.camera.ray(film, pair(&camera.lens), camera.time[0]);
        self.tracer.reference_radiance::<S>(ray, address, events)
    }

    /// Traces the paths that were started and adds their samples to the store's row.
    fn finish<S: Sampler>(&self, batch: &mut WavefrontBatch<'s, '_>, row: &mut Row) {
        let WavefrontBatch { wave, origins, values, samples, first_rejected, y, recorded } = batch;
        values.resize(self.enabled.len(), [0.0; LANES]);
        self.tracer.trace::<S>(wave);
        for (records, &(block, mask)) in wave.records().iter().zip(&*origins) {
            match &self.white_balance {
                None => records.sample_vectors(self.exposure, &self.enabled, values),
                Some(matrix) => {
                    records.white_balanced(matrix).sample_vectors(self.exposure, &self.enabled, values);
                }
            }
            if let Some(recorded) = recorded {
                append_records(recorded, *y, row, block, mask, values);
            }
            for lane in lanes_in(row.push_block(block, mask, values)) {
                let x = block * LANES + lane;
                let sample = (x, row.next_index(x) - 1);
                *first_rejected = Some(first_rejected.map_or(sample, |first| first.min(sample)));
            }
        }
        wave.clear();
        origins.clear();
        *samples = 0;
    }
}

/// Samples to be started: the addresses of their sample values, and the centres of their pixels.
struct CameraSamplePacket {
    addresses: SampleAddresses,
    centres: [Lanes; 2],
}

/// Samples that are traced together.
#[derive(Default)]
struct WavefrontBatch<'s, 'r> {
    wave: Wavefront<'s>,
    /// The block of pixels of each packet of the wavefront, and the pixels that have a sample in it.
    origins: Vec<(usize, u32)>,
    /// Samples in all packets.
    samples: usize,
    /// Sample vectors of a packet.
    values: Vec<Lanes>,
    /// Column and sample index of the first sample that the store rejected.
    first_rejected: Option<(usize, u32)>,
    /// The row, and where its samples are recorded.
    y: usize,
    recorded: Option<&'r mut Vec<u8>>,
}
