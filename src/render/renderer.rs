//! Renders the samples of one scene, in parallel over the rows of the film.

mod coarse_image;

use std::sync::Arc;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::camera_rays::CameraRays;
use super::filter_sampler::FilterSampler;
use super::integrator::{PathEvent, PathRadiance, PathTracer};
use super::lights::Lights;
use super::rejected_sample::RejectedSample;
use super::row_renderer::RowRenderer;
use super::sample_layout::sample_layout;
use super::sample_records::SampleRecords;
use super::sample_sink::{SampleSink, record_bytes};
use super::sampler::{Independent, Sobol};
use super::shard::Shard;
use crate::geometry::Accel;
use crate::scene::{Camera, Effects, SamplerKind, Scene};
use crate::stats::{BlockSet, Layout, Rectangle, Row, Store};

/// Renders samples of one scene.
pub struct Renderer<'s> {
    sampler: SamplerKind,
    resolution: (usize, usize),
    camera: Camera,
    /// Blocks of dimensions to record, where the scene has them.
    recorded: BlockSet,
    /// The layout of all of the scene's effects.
    whole_layout: Layout,
    layout: Layout,
    rows: RowRenderer<'s>,
}

impl<'s> Renderer<'s> {
    /// Prepares what all batches share: light sampling, and the layout of the scene's effects. All sample
    /// values depend on `seed`.
    pub fn new(scene: &'s Scene, accel: &'s Accel<'s>, seed: u64) -> Self {
        Self::with_lights(scene, accel, Arc::new(Lights::new(scene)), &scene.camera, seed, BlockSet::ALL)
    }

    /// Returns this renderer with another camera. The layout may change, because the camera's lens decides
    /// whether there is depth of field.
    pub fn with_camera(&self, camera: &Camera) -> Self {
        self.rebuilt(camera, self.recorded)
    }

    /// Returns this renderer with sample vectors of these blocks of dimensions only. Their values stay the same.
    pub fn recording(&self, blocks: BlockSet) -> Self {
        self.rebuilt(&self.camera, blocks)
    }

    fn rebuilt(&self, camera: &Camera, recorded: BlockSet) -> Self {
        let PathTracer { scene, accel, lights, .. } = &self.rows.tracer;
        Self::with_lights(scene, accel, lights.clone(), camera, self.rows.seed, recorded)
            .with_shard(self.rows.shard)
    }

    fn with_lights(
        scene: &'s Scene,
        accel: &'s Accel<'s>,
        lights: Arc<Lights<'s>>,
        camera: &Camera,
        seed: u64,
        recorded: BlockSet,
    ) -> Self {
        let effects = Effects { lens: camera.lens_radius > 0.0, ..scene.effects() };
        let whole_layout = sample_layout(&effects);
        let layout = whole_layout.restricted_to(recorded);
        let [x0, x1, y0, y1] = scene.film.pixel_bounds;
        Self {
            sampler: scene.sampler,
            resolution: (x1 - x0, y1 - y0),
            camera: camera.clone(),
            recorded,
            rows: RowRenderer {
                seed,
                shard: Shard::WHOLE,
                corner: [x0, y0],
                exposure: scene.film.scale,
                white_balance: scene.film.white_balance,
                filter: FilterSampler::new(&scene.film.filter),
                camera: CameraRays::new(camera, &scene.film),
                tracer: PathTracer::new(scene, accel, lights, &effects, &layout),
                enabled: SampleRecords::enabled_dimensions(&layout),
            },
            whole_layout,
            layout,
        }
    }

    /// Restricts the renderer to a shard of every pixel's samples.
    pub fn with_shard(mut self, shard: Shard) -> Self {
        self.rows.shard = shard;
        self
    }

    /// Restricts the renderer to a rectangle of its pixels, whose samples stay the same.
    pub fn with_part(mut self, part: &Rectangle) -> Self {
        let [x, y] = self.rows.corner;
        self.rows.corner = [x + part.x[0], y + part.y[0]];
        self.resolution = (part.width(), part.height());
        self
    }

    /// Returns the sample vector's layout, which stores to render into must have.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the layout of [`Self::recording`].
    pub fn layout_of(&self, blocks: BlockSet) -> Layout {
        self.whole_layout.restricted_to(blocks)
    }

    /// Returns width and height of the film's pixel bounds, which stores to render into must have.
    pub fn resolution(&self) -> (usize, usize) {
        self.resolution
    }

    /// Returns the length that positions in sample vectors are divided by, in scene units.
    pub fn diameter(&self) -> f32 {
        self.rows.tracer.diameter()
    }

    /// Returns the nearest surface point on the ray through the centre of a pixel of [`Self::resolution`], the
    /// centre of the lens and the time when the shutter opens; in render space, `None` if there is none.
    pub fn seen_at(&self, x: usize, y: usize) -> Option<Vec3> {
        let [x0, y0] = self.rows.corner;
        let film = Vec2::new((x + x0) as f32 + 0.5, (y + y0) as f32 + 0.5);
        let ray = self.rows.camera.ray(film, Vec2::splat(0.5), 0.0);
        self.rows.tracer.accel.intersect(&ray).map(|hit| ray.origin + hit.t * ray.direction)
    }

    /// Returns the radiance of the `index`-th sample of a pixel of [`Self::resolution`], before the film's exposure
    /// and white balance. The scalar reference path tracer computes it, which tests compare with
    /// [`Self::render_batch`]. `events` is called with every event of the path.
    pub fn reference_radiance(
        &self,
        x: usize,
        y: usize,
        index: u32,
        events: &mut dyn FnMut(PathEvent),
    ) -> PathRadiance {
        match self.sampler {
            SamplerKind::Sobol => self.rows.reference_radiance::<Sobol>(x, y, index, events),
            SamplerKind::Independent => self.rows.reference_radiance::<Independent>(x, y, index, events),
        }
    }

    /// Renders `counts[pixel]` more samples into every pixel, row by row over the film's pixel bounds, in
    /// parallel on rayon's current pool. Returns the first sample, in the order of rows, columns and indices,
    /// that the store rejected; `None` if there is none.
    ///
    /// # Panics
    /// If there is not one count for each of the store's pixels, or the store's layout is not
    /// [`Self::layout`].
    pub fn render_batch(&self, counts: &[u32], store: &mut Store) -> Option<RejectedSample> {
        assert_eq!(counts.len(), store.pixels(), "one count for each pixel");
        assert_eq!(*store.layout(), self.layout, "the store must have the renderer's layout");
        let width = store.width().max(1);
        // One row a task, because rows differ much in cost where sampling is adaptive.
        let rows = store.rows_mut().par_iter_mut().zip(counts.par_chunks(width)).enumerate().with_max_len(1);
        rows.filter_map(|(y, (row, counts))| self.render_row(y, counts, None, row)).min()
    }

    /// Does the same as [`Self::render_batch`], and hands the records of all samples to a sink, some rows at a time.
    ///
    /// # Panics
    /// As [`Self::render_batch`].
    pub fn render_recorded(
        &self,
        counts: &[u32],
        store: &mut Store,
        sink: &mut dyn SampleSink,
    ) -> Option<RejectedSample> {
        /// Bytes of the rows that are rendered before their records are handed over, if there are several rows.
        const PIECE_BYTES: usize = 32 << 20;
        assert_eq!(counts.len(), store.pixels(), "one count for each pixel");
        assert_eq!(*store.layout(), self.layout, "the store must have the renderer's layout");
        let width = store.width().max(1);
        let bytes = |y: usize| -> usize {
            let samples: u64 = counts[y * width..][..width].iter().map(|&n| u64::from(n)).sum();
            samples as usize * record_bytes(&self.layout)
        };
        let mut first_rejected = None;
        let mut start = 0;
        while start < store.height() {
            // Collect rows for a piece
            let (mut end, mut size) = (start, 0);
            while end < store.height() && (end == start || size + bytes(end) <= PIECE_BYTES) {
                size += bytes(end);
                end += 1;
            }

            // Render them
            let rows =
                store.rows_mut()[start..end].par_iter_mut().zip(counts[start * width..].par_chunks(width));
            let rendered: Vec<_> = rows
                .enumerate()
                .with_max_len(1)
                .map(|(k, (row, counts))| {
                    let mut records = Vec::with_capacity(bytes(start + k));
                    (self.render_row(start + k, counts, Some(&mut records), row), records)
                })
                .collect();
            let mut piece = Vec::with_capacity(size);
            for (rejected, records) in rendered {
                first_rejected = first_rejected.or(rejected);
                piece.extend(records);
            }
            if !piece.is_empty() {
                sink.take(piece);
            }
            start = end;
        }
        first_rejected
    }

    fn render_row(
        &self,
        y: usize,
        counts: &[u32],
        records: Option<&mut Vec<u8>>,
        row: &mut Row,
    ) -> Option<RejectedSample> {
        match self.sampler {
            SamplerKind::Sobol => self.rows.render::<Sobol>(y, counts, records, row),
            SamplerKind::Independent => self.rows.render::<Independent>(y, counts, records, row),
        }
    }
}

#[cfg(test)]
mod tests;
