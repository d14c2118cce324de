//! Renders a batch into a pixel-statistics store: samplers, camera rays, BSDFs, light sampling,
//! integrators.
//!
//! A sample is one path. Its numbers are addressed by seed, pixel, sample index and dimension, and
//! what is remembered of it is written in the order of the store's [`Layout`]. Knows nothing of
//! filters and budgets: it is told how many samples each pixel gets.

pub mod bsdf;
mod camera;
#[cfg(test)]
mod chi_squared;
mod disk;
mod integrator;
mod lights;
mod pixel_filter;
mod record;
mod sampler;
mod shard;
mod sphere_map;

use std::sync::Arc;

use rayon::prelude::*;

use self::camera::CameraRays;
use self::integrator::{PathTracer, Wavefront};
use self::lights::Lights;
use self::pixel_filter::FilterSampler;
use self::record::Records;
use self::sampler::{Addresses, Independent, Sobol, Source};
use crate::geometry::{Accel, LANES, Lanes, RayLanes, mask_of};
use crate::scene::{Camera, Effects, SamplerKind, Scene};
use crate::stats::{BLOCK, Layout, Row, Store};

pub use shard::Shard;

/// Samples that are traced together: enough for most packets to be full, few enough for what is known of
/// them to stay in the first-level cache.
const WAVEFRONT: usize = 128;

/// Packets that are traced together at most, where few of a block's pixels get samples.
const MOST_PACKETS: usize = 2 * WAVEFRONT / LANES;

// What is a lane to the tracer is a pixel to the store.
const _: () = assert!(LANES == BLOCK);

/// Renders samples of one scene.
pub struct Renderer<'s> {
    seed: u64,
    shard: Shard,
    layout: Layout,
    sampler: SamplerKind,
    /// First column and row of the film that are rendered.
    corner: [usize; 2],
    resolution: (usize, usize),
    /// Factor from radiance to pixel value.
    exposure: f32,
    filter: FilterSampler,
    camera: CameraRays,
    tracer: PathTracer<'s>,
    /// For each of the layout's dimensions, its place in [`Records::values`].
    alive: Vec<usize>,
}

impl<'s> Renderer<'s> {
    /// Prepares what all batches share: light tables, and the layout that the scene's effects call
    /// for. Everything random follows from `seed`.
    pub fn new(scene: &'s Scene, accel: &'s Accel<'s>, seed: u64) -> Self {
        Self::of(scene, accel, Arc::new(Lights::new(scene)), &scene.camera, seed)
    }

    /// The same, seen through another camera; its lens may bring the effect of depth of field or take
    /// it away.
    pub fn with_camera(&self, camera: &Camera) -> Self {
        let PathTracer { scene, accel, lights, .. } = &self.tracer;
        Self::of(scene, accel, lights.clone(), camera, self.seed).with_shard(self.shard)
    }

    fn of(
        scene: &'s Scene,
        accel: &'s Accel<'s>,
        lights: Arc<Lights<'s>>,
        camera: &Camera,
        seed: u64,
    ) -> Self {
        let effects = Effects { lens: camera.lens_radius > 0.0, ..scene.effects() };
        let layout = Layout::for_effects(&effects);
        let [x0, x1, y0, y1] = scene.film.pixel_bounds;
        Self {
            seed,
            shard: Shard::WHOLE,
            sampler: scene.sampler,
            corner: [x0, y0],
            resolution: (x1 - x0, y1 - y0),
            exposure: scene.film.scale,
            filter: FilterSampler::new(&scene.film.filter),
            camera: CameraRays::new(camera, &scene.film),
            tracer: PathTracer::new(scene, accel, lights, &effects, &layout),
            alive: Records::alive(&layout),
            layout,
        }
    }

    /// Renders only a shard of every pixel's samples.
    pub fn with_shard(self, shard: Shard) -> Self {
        Self { shard, ..self }
    }

    /// The sample vector's layout: that of the stores to render into.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Width and height of what is rendered, in pixels: those of the stores to render into.
    pub fn resolution(&self) -> (usize, usize) {
        self.resolution
    }

    /// What positions in sample vectors are divided by, in scene units.
    pub fn diameter(&self) -> f32 {
        self.tracer.diameter()
    }

    /// The nearest surface seen through the middle of a pixel of [`Self::resolution`], from the middle
    /// of the lens when the shutter opens: where it is in render space.
    pub fn seen_at(&self, x: usize, y: usize) -> Option<glam::Vec3> {
        let film = glam::Vec2::new((x + self.corner[0]) as f32 + 0.5, (y + self.corner[1]) as f32 + 0.5);
        let ray = self.camera.ray(film, glam::Vec2::splat(0.5), 0.0);
        self.tracer.accel.intersect(&ray).map(|hit| ray.origin + hit.t * ray.direction)
    }

    /// Renders `counts[pixel]` more samples into every pixel, row by row over the film's pixel
    /// bounds, in parallel on rayon's current pool.
    ///
    /// # Panics
    /// If there is not one count for each of the store's pixels, or its layout is not
    /// [`Self::layout`].
    pub fn render_batch(&self, counts: &[u32], store: &mut Store) {
        assert_eq!(counts.len(), store.pixels(), "one count for each pixel");
        assert_eq!(*store.layout(), self.layout, "the store's samples are made by this renderer");
        let width = store.width().max(1);
        // Rows differ much in cost where sampling is adaptive, so they are dealt out one by one.
        let rows = store.rows_mut().par_iter_mut().zip(counts.par_chunks(width)).enumerate().with_max_len(1);
        match self.sampler {
            SamplerKind::Sobol => {
                rows.for_each(|(y, (row, counts))| self.render_row::<Sobol>(y, counts, row))
            }
            SamplerKind::Independent => {
                rows.for_each(|(y, (row, counts))| self.render_row::<Independent>(y, counts, row));
            }
        }
    }

    /// Pixels go in the blocks in which the store takes them in: first a sample of each, then a second of
    /// those that get one, and so on.
    fn render_row<S: Source>(&self, y: usize, counts: &[u32], row: &mut Row) {
        let mut batch = Batch::default();
        let row_number = (y + self.corner[1]) as u32;
        for (block, counts) in counts.chunks(LANES).enumerate() {
            let column = |lane: usize| block * LANES + lane;
            let sources: [S; LANES] = std::array::from_fn(|lane| {
                S::for_pixel(self.seed, (column(lane) + self.corner[0]) as u32, row_number)
            });
            let mut indices = [0; LANES];
            indices
                .iter_mut()
                .zip(0..counts.len())
                .for_each(|(index, lane)| *index = row.next_index(column(lane)));
            let mut starts = Starts {
                samples: Addresses::NONE,
                centres: [[0.0; LANES], [row_number as f32 + 0.5; LANES]],
            };
            for lane in 0..LANES {
                starts.centres[0][lane] = (column(lane) + self.corner[0]) as f32 + 0.5;
            }
            // A pixel's indices end somewhere.
            let left = |lane: usize| counts.get(lane).map_or(0, |&count| count.min(u32::MAX - indices[lane]));
            for round in 0..(0..LANES).map(left).max().unwrap_or(0) {
                let present = mask_of(|lane| round < left(lane));
                for lane in 0..LANES {
                    let index = self.shard.sequence_index(indices[lane].saturating_add(round));
                    starts.samples.set(lane, sources[lane].address(index));
                }
                self.start::<S>(&starts, present, &mut batch.wave);
                batch.origins.push((block, present));
                batch.paths += present.count_ones() as usize;
                if batch.paths > WAVEFRONT - LANES || batch.origins.len() == MOST_PACKETS {
                    self.finish::<S>(&mut batch, row);
                }
            }
        }
        self.finish::<S>(&mut batch, row);
    }

    /// Starts some samples: those whose bit is set.
    fn start<S: Source>(&self, starts: &Starts, present: u32, wave: &mut Wavefront<'s>) {
        let camera = self.tracer.dimensions().camera::<S>(&starts.samples);
        let mut film = starts.centres;
        let [film_x, film_y] = &mut film;
        for (lane, (x, y)) in film_x.iter_mut().zip(film_y).enumerate() {
            let offset = self.filter.sample(glam::Vec2::new(camera.film[0][lane], camera.film[1][lane]));
            (*x, *y) = (*x + offset.x, *y + offset.y);
        }
        let mut rays = RayLanes::NONE;
        self.camera.rays(&film, &camera.lens, &camera.time, &mut rays);
        let records = wave.start(&rays, &starts.samples, present);
        (records.film, records.lens, records.time) = (film, camera.lens, camera.time);
        // The first hit's numbers are there even if there is none: that they were not used must not show in
        // their distribution.
        (records.light1, records.bsdf1) = (camera.light_uv, camera.bsdf_uv);
    }

    /// Traces what was started and takes it into the store.
    fn finish<S: Source>(&self, batch: &mut Batch<'s>, row: &mut Row) {
        let Batch { wave, origins, values, .. } = batch;
        values.resize(self.layout.len(), [0.0; LANES]);
        self.tracer.trace::<S>(wave);
        for (records, &(block, present)) in wave.records().iter().zip(&*origins) {
            records.values(self.exposure, &self.alive, values);
            row.push_block(block, present, values);
        }
        wave.clear();
        origins.clear();
        batch.paths = 0;
    }
}

/// Samples that are to be started: where their numbers come from, and the centres of their pixels.
struct Starts {
    samples: Addresses,
    centres: [Lanes; 2],
}

/// Samples that are traced together.
#[derive(Default)]
struct Batch<'s> {
    wave: Wavefront<'s>,
    /// Of each packet of the wavefront, the block of pixels, and which of them have a sample in it.
    origins: Vec<(usize, u32)>,
    /// How many samples that are.
    paths: usize,
    /// Sample vectors of a packet.
    values: Vec<Lanes>,
}
