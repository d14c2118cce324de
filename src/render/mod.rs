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
use self::record::Record;
use self::sampler::{Independent, Sobol, Source, Stream};
use crate::geometry::Accel;
use crate::scene::{Camera, Effects, SamplerKind, Scene};
use crate::stats::{Layout, Row, Store};

pub use share::Share;

/// Samples that are traced together: enough for the stages to overlap, few enough to stay in the
/// first-level cache.
const WAVEFRONT: usize = 64;

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
    /// For each of the layout's dimensions, its place in [`Record::values`].
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
            alive: Record::alive(&layout),
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
        let mut wave = Wavefront::<S>::with_capacity(WAVEFRONT);
        let mut columns = Vec::with_capacity(WAVEFRONT);
        let mut samples = Vec::with_capacity(WAVEFRONT * self.layout.len());
        for (column, &count) in counts.iter().enumerate() {
            let (x, y) = (column + self.corner[0], y + self.corner[1]);
            let source = S::for_pixel(self.seed, x as u32, y as u32);
            let first = row.next_index(column);
            for index in first..first.saturating_add(count) {
                self.start(x, y, Stream::new(source, self.share.in_sequence(index)), &mut wave);
                columns.push(column);
                if columns.len() == WAVEFRONT {
                    self.finish(&mut wave, &mut columns, &mut samples, row);
                }
            }
        }
        self.finish(&mut wave, &mut columns, &mut samples, row);
    }

    /// Starts one sample of the pixel at (`x`, `y`) of the whole image.
    #[inline]
    fn start<S: Source>(&self, x: usize, y: usize, mut numbers: Stream<S>, wave: &mut Wavefront<'s, S>) {
        let camera = self.tracer.dimensions().camera(&mut numbers);
        let centre = glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let film = centre + self.filter.sample(camera.film);
        let ray = self.camera.ray(film, camera.lens, camera.time);
        let record = Record { film, lens: camera.lens, time: camera.time, ..Record::default() };
        wave.start(ray, numbers, record);
    }

    /// Traces what was started, one path for each of `columns`, and takes it into the store.
    fn finish<S: Source>(
        &self,
        wave: &mut Wavefront<'s, S>,
        columns: &mut Vec<usize>,
        samples: &mut Vec<f32>,
        row: &mut Row,
    ) {
        self.tracer.trace(wave);
        for record in wave.records() {
            let values = record.values(self.exposure);
            samples.extend(self.alive.iter().map(|&i| values[i]));
        }
        let mut rest = &samples[..];
        for pixel in columns.chunk_by(|a, b| a == b) {
            let (samples, others) = rest.split_at(pixel.len() * self.layout.len());
            row.push(pixel[0], samples);
            rest = others;
        }
        wave.clear();
        columns.clear();
        samples.clear();
    }
}
