//! Writes a denoiser and renders with it: `cargo run --release --example box_filter -- scenes/pool/pool.pbrt box.exr`
//!
//! A denoiser of the crate itself would also get a line in `src/filter/denoisers.rs`, by which the command line, the page
//! and render states know it.

use std::error::Error;
use std::path::PathBuf;

use prpf::filter::{Cost, Denoiser, DenoiserName, FilterResult, Reads, SampleVectors, unfiltered};
use prpf::image::Planes;
use prpf::stats::{Block, Store};
use prpf::{RenderBuilder, scene::pbrt};

/// The mean of the pixels within [`RADIUS`].
struct BoxFilter;

const RADIUS: usize = 2;

impl Denoiser for BoxFilter {
    fn name(&self) -> DenoiserName {
        DenoiserName { method: "box", preset: None }
    }

    fn summary(&self) -> &'static str {
        "The mean of 5x5 pixels"
    }

    fn reads(&self) -> Reads {
        Reads { blocks: &[Block::Colour, Block::Radiance], sample_vectors: SampleVectors::None }
    }

    fn cost(&self) -> Cost {
        Cost { core_seconds: 3e-6, bytes: 200, pass_time: 1.0, is_per_sample: false }
    }

    fn reach(&self) -> usize {
        RADIUS
    }

    fn stand_in(&self) -> &'static dyn Denoiser {
        &BoxFilter
    }

    fn filter(&self, store: &Store, _seed: u64) -> FilterResult {
        let means = unfiltered(store);
        let (image, halves) = (average(&means.image), means.halves.each_ref().map(average));
        // The halves are independent: a quarter of their squared difference estimates the variance of their mean.
        let mut variance = means.variance.clone();
        let pairs = halves[0].data().iter().zip(halves[1].data());
        variance.data_mut().iter_mut().zip(pairs).for_each(|(v, (a, b))| *v = 0.25 * (a - b).powi(2));
        let mut error = means.error.clone();
        for (i, error) in error.data_mut().iter_mut().enumerate() {
            *error = (0..3).map(|channel| variance.plane(channel)[i]).sum::<f32>() / 3.0;
        }
        FilterResult { made_by: self.name(), image, halves, variance, error, ..means }
    }
}

fn average(planes: &Planes) -> Planes {
    let (width, height) = (planes.width(), planes.height());
    let mut averaged = planes.clone();
    for (channel, plane) in averaged.planes_mut().enumerate() {
        for (i, value) in plane.iter_mut().enumerate() {
            let (x, y) = (i % width, i / width);
            let rows = y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(height);
            let columns = x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width);
            let count = (rows.len() * columns.len()) as f32;
            let pixels = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            *value = pixels.map(|(x, y)| planes.at(channel, x, y)).sum::<f32>() / count;
        }
    }
    averaged
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(scene), Some(image)) = (arguments.next(), arguments.next()) else {
        return Err("usage: box_filter SCENE IMAGE".into());
    };
    let scene = pbrt::read(&scene)?;
    RenderBuilder::new(&scene).spp(16).denoiser(&BoxFilter).run()?.write(image)?;
    Ok(())
}
