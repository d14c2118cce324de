//! Do the paper's claims hold here? Its figures beside ours, each measured in the same run: RPF and
//! P-RPF on the same samples, over the paper's scenes as far as they are public and over our own.

mod claims;
mod clock;
mod data;
mod measure;
mod methods;
mod part;
mod report;
mod settings;
mod weight_pictures;

use crate::bench::Bench;
use settings::Settings;

pub fn run(bench: &mut Bench) -> anyhow::Result<()> {
    let settings: Settings = bench.settings()?;
    let names: Vec<String> = settings.scenes.iter().map(|scene| scene.name.clone()).collect();
    let files = bench.scenes(&names)?;
    let mut measured = Vec::new();
    for of_scene in &settings.scenes {
        if let Some(file) = files.iter().find(|file| file.name == of_scene.name) {
            measured.push(measure::measure(bench, &settings, of_scene, file)?);
        }
    }
    let missing: Vec<String> =
        names.into_iter().filter(|name| files.iter().all(|file| file.name != *name)).collect();
    report::write(bench, &settings, &measured, &missing)
}
