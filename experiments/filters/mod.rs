//! The experiment `filters`: which denoiser makes the best image of the same samples?
//!
//! Renders each scene uniformly and adaptively, driven by `nlm`, and lets all denoisers filter the same samples.

mod report;
mod settings;

use std::time::Instant;

use anyhow::ensure;
use prpf::adaptive::Sampling;
use prpf::filter::{DENOISERS, Denoiser, SampleVectors, nlm};
use prpf::geometry::Accel;
use prpf::image::metrics::Pair;

use crate::ledger::{Key, Values};
use crate::session::Session;
use crate::test_scene::TestScene;
use crate::trial::Trial;
use settings::Settings;

/// The errors of all denoisers on the same samples.
struct Sample {
    scene: String,
    pixels: usize,
    sampling: Sampling,
    spp: u32,
    seed: u64,
    /// Expected relMSE of the reference itself.
    reference_relmse: f64,
    /// `DENOISER QUANTITY`, with the errors of [`TestScene::errors`], `brightness` relative to the reference's and `seconds`.
    values: Values,
}

/// Runs the experiment.
pub fn run(session: &mut Session) -> anyhow::Result<()> {
    let settings: Settings = session.settings()?;
    ensure!(settings.seeds > 0, "filters.toml: seeds is at least 1");
    // Those that this machine has, but for the one that keeps all samples
    let is_compared = |denoiser: &&dyn Denoiser| {
        denoiser.missing().is_none() && !matches!(denoiser.reads().sample_vectors, SampleVectors::All { .. })
    };
    let denoisers: Vec<&dyn Denoiser> = DENOISERS.into_iter().filter(is_compared).collect();
    let mut samples = Vec::new();
    for file in session.scenes(&settings.views.concat())? {
        let test_scene = TestScene::new(session, &file, &settings.size)?;
        let accel = Accel::build(&test_scene.scene);
        for &spp in &settings.spp {
            for sampling in [Sampling::Uniform, Sampling::Adaptive] {
                for seed in 0..settings.seeds {
                    let trial = Trial::new(sampling, &nlm::STANDARD, spp, seed);
                    let values = measure(session, &test_scene, &accel, &trial, &denoisers)?;
                    let (scene, pixels) = (test_scene.name.clone(), test_scene.reference.image.pixels());
                    let reference_relmse = test_scene.reference.relmse;
                    samples.push(Sample { scene, pixels, sampling, spp, seed, reference_relmse, values });
                }
            }
        }
    }
    report::write(session, &settings, &denoisers, &samples)
}

/// Renders a trial and filters its samples by each denoiser.
fn measure(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    trial: &Trial,
    denoisers: &[&dyn Denoiser],
) -> anyhow::Result<Values> {
    let Trial { sampling, spp, seed, .. } = *trial;
    session.show_status(format!("{}: {sampling:?}, {spp} spp, seed {seed}", test_scene.name));
    let reference = &test_scene.reference;
    let names: Vec<String> = denoisers.iter().map(|denoiser| denoiser.name().to_string()).collect();
    let (width, height) = (reference.image.width(), reference.image.height());
    let settings = format!(
        "sampling={sampling:?} spp={spp} size={width}x{height} reference-spp={} denoisers={}",
        reference.spp,
        names.join(",")
    );
    session.ledger.measure(Key::new(&test_scene.name, seed, settings), &[], || {
        let store = trial.run(test_scene, accel).store;
        let mut values = Values::new();
        for (denoiser, name) in denoisers.iter().zip(&names) {
            let started = Instant::now();
            let image = denoiser.filter(&store, seed).image;
            let seconds = started.elapsed().as_secs_f64();
            let brightness = Pair::new(&image, &reference.image)?.mean_ratio();
            let others = [("brightness", brightness), ("seconds", seconds)];
            let all = test_scene.errors(&image).into_iter().chain(others);
            values.extend(all.map(|(quantity, value)| (format!("{name} {quantity}"), value)));
        }
        Ok(values)
    })
}
