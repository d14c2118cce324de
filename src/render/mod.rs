//! Renders a batch into a pixel-statistics store: samplers, camera rays, BSDFs, light sampling,
//! integrators.
//!
//! A sample is one path. Its numbers are addressed by seed, pixel, sample index and dimension, and
//! what is remembered of it is written in the order of the store's [`Layout`]. Knows nothing of
//! filters and budgets: it is told how many samples each pixel gets.

pub mod bsdf;
mod camera;
mod disk;
mod integrator;
mod lights;
mod pixel_filter;
mod record;
mod sampler;
mod share;

use rayon::prelude::*;

use self::camera::CameraRays;
use self::integrator::{PathTracer, Wavefront};
use self::pixel_filter::FilterSampler;
use self::record::Records;
use self::sampler::{Addresses, Independent, Sobol, Source};
use crate::geometry::{Accel, LANES, Lanes, RayLanes};
use crate::scene::{Camera, Effects, SamplerKind, Scene};
use crate::stats::{Layout, Row, Store};

pub use share::Share;

/// Samples that are traced together: enough for most packets to be full, few enough for what is known of
/// them to stay in the first-level cache.
const WAVEFRONT: usize = 128;

/// Renders samples of one scene.
pub struct Renderer<'s> {
    seed: u64,
    share: Share,
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
        Self::with_camera(scene, &scene.camera, accel, seed)
    }

    /// The same, seen through another camera; its lens may bring the effect of depth of field or take
    /// it away.
    pub fn with_camera(scene: &'s Scene, camera: &Camera, accel: &'s Accel<'s>, seed: u64) -> Self {
        let effects = Effects { lens: camera.lens_radius > 0.0, ..scene.effects() };
        let layout = Layout::for_effects(&effects);
        let [x0, x1, y0, y1] = scene.film.pixel_bounds;
        Self {
            seed,
            share: Share::WHOLE,
            sampler: scene.sampler,
            corner: [x0, y0],
            resolution: (x1 - x0, y1 - y0),
            exposure: scene.film.scale,
            filter: FilterSampler::new(&scene.film.filter),
            camera: CameraRays::new(camera, &scene.film),
            tracer: PathTracer::new(scene, accel, &effects, &layout),
            alive: Records::alive(&layout),
            layout,
        }
    }

    /// Renders only a share of every pixel's samples.
    pub fn of_share(self, share: Share) -> Self {
        Self { share, ..self }
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
    pub fn seen_at(&self, accel: &Accel, x: usize, y: usize) -> Option<glam::Vec3> {
        let film = glam::Vec2::new((x + self.corner[0]) as f32 + 0.5, (y + self.corner[1]) as f32 + 0.5);
        let ray = self.camera.ray(film, glam::Vec2::splat(0.5), 0.0);
        accel.intersect(&ray).map(|hit| ray.origin + hit.t * ray.direction)
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

    fn render_row<S: Source>(&self, y: usize, counts: &[u32], row: &mut Row) {
        let mut batch = Batch::default();
        let mut starts = Starts { samples: Addresses::NONE, centres: [[0.0; LANES]; 2] };
        for (column, &count) in counts.iter().enumerate() {
            let (x, y) = (column + self.corner[0], y + self.corner[1]);
            let source = S::for_pixel(self.seed, x as u32, y as u32);
            let first = row.next_index(column);
            for index in first..first.saturating_add(count) {
                let lane = batch.columns.len() % LANES;
                starts.samples.set(lane, source.address(self.share.in_sequence(index)));
                (starts.centres[0][lane], starts.centres[1][lane]) = (x as f32 + 0.5, y as f32 + 0.5);
                batch.columns.push(column);
                if lane == LANES - 1 {
                    self.start::<S>(&starts, LANES, &mut batch.wave);
                }
                if batch.columns.len() == WAVEFRONT {
                    self.finish::<S>(&mut batch, row);
                }
            }
        }
        let rest = batch.columns.len() % LANES;
        if rest > 0 {
            self.start::<S>(&starts, rest, &mut batch.wave);
        }
        self.finish::<S>(&mut batch, row);
    }

    /// Starts the first `count` of some samples.
    fn start<S: Source>(&self, starts: &Starts, count: usize, wave: &mut Wavefront<'s>) {
        let camera = self.tracer.dimensions().camera::<S>(&starts.samples);
        let mut film = starts.centres;
        let [film_x, film_y] = &mut film;
        for (lane, (x, y)) in film_x.iter_mut().zip(film_y).enumerate() {
            let offset = self.filter.sample(glam::Vec2::new(camera.film[0][lane], camera.film[1][lane]));
            (*x, *y) = (*x + offset.x, *y + offset.y);
        }
        let mut rays = RayLanes::NONE;
        self.camera.rays(&film, &camera.lens, &camera.time, &mut rays);
        // The first hit's numbers are there even if there is none: that they were not used must not show in
        // their distribution.
        let records = Records {
            film,
            lens: camera.lens,
            time: camera.time,
            light1: camera.light_uv,
            bsdf1: camera.bsdf_uv,
            ..Records::NONE
        };
        wave.start(&rays, &starts.samples, &records, count);
    }

    /// Traces what was started, one path for each of the columns, and takes it into the store.
    fn finish<S: Source>(&self, batch: &mut Batch<'s>, row: &mut Row) {
        let Batch { wave, columns, samples } = batch;
        self.tracer.trace::<S>(wave);
        let dims = self.layout.len();
        samples.resize(columns.len().next_multiple_of(LANES) * dims, 0.0);
        for (records, samples) in wave.records().iter().zip(samples.chunks_exact_mut(LANES * dims)) {
            let values = records.values(self.exposure);
            for (dim, &place) in self.alive.iter().enumerate() {
                let lanes = samples[dim..].iter_mut().step_by(dims);
                lanes.zip(&values[place]).for_each(|(to, from)| *to = *from);
            }
        }
        let mut rest = &samples[..];
        for pixel in columns.chunk_by(|a, b| a == b) {
            let (samples, others) = rest.split_at(pixel.len() * dims);
            row.push(pixel[0], samples);
            rest = others;
        }
        wave.clear();
        columns.clear();
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
    /// Of each sample's pixel.
    columns: Vec<usize>,
    /// Their values, one after the other.
    samples: Vec<f32>,
}
