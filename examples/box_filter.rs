//! Writes a denoiser and renders with it: `cargo run --release --example box_filter -- scenes/pool/pool.pbrt box.exr`
//!
//! A denoiser of the crate itself would also get a line in `src/filter/denoisers.rs`, by which the command line, the page
//! and render states know it.

use std::error::Error;
use std::path::PathBuf;

use prpf::filter::{
    Cost, Denoiser, DenoiserName, FilterResult, Reads, Reliability, SampleVectors, unfiltered,
};
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
        Cost { core_seconds: 2.6e-6, bytes: 200, pass_time: 1.0, is_per_sample: false }
    }

    fn stand_in(&self) -> &'static dyn Denoiser {
        &BoxFilter
    }

    fn filter(&self, store: &Store, _seed: u64) -> FilterResult {
        // Filter the image, and each half of the samples alone
        let noisy = unfiltered(store);
        let (image, halves) = (average(&noisy.image), noisy.halves.each_ref().map(average));

        // Estimate the error from them
        FilterResult::self_filtered(self.name(), store, image, halves, Reliability::SELF_FILTERED)
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

#[cfg(test)]
mod tests {
    use prpf::filter::UNFILTERED;
    use prpf::progressive::ErrorEstimate;
    use prpf::stats::Layout;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    use super::*;

    #[test]
    fn the_estimated_error_of_a_constant_falls_by_the_filter() {
        let layout = Layout::with_blocks(|_| false);
        let mut store = Store::new(64, 64, layout.clone(), 0, 0);
        let mut rng = Pcg32::seed_from_u64(1);
        let mut sample = vec![0.0; layout.len()];
        for pixel in 0..64 * 64 {
            for _ in 0..8 {
                layout.write(&mut sample, Block::Colour, &[2.0 * rng.random::<f32>(); 3]);
                store.push(pixel % 64, pixel / 64, &sample);
            }
        }
        let [filtered, unfiltered] = [&BoxFilter as &dyn Denoiser, UNFILTERED].map(|denoiser| {
            let result = denoiser.filter(&store, 0);
            ErrorEstimate::new(&result, &store, None).expect("every pixel has samples of both halves").value
        });
        assert!(filtered > 0.0 && filtered < 0.2 * unfiltered, "{filtered} of {unfiltered}");
    }
}
