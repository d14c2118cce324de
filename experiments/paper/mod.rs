//! The experiment `paper`: do the paper's claims hold here?
//!
//! Compares the paper's figures with ours. RPF and P-RPF filter the same samples, on the paper's scenes as far as
//! they are public and on our own.

mod claims;
mod crop;
mod crop_measurement;
mod interpretations;
mod measure;
mod method;
mod report;
mod scene_results;
mod settings;
mod stage_timer;
mod weight_maps;

use crate::session::Session;
use settings::Settings;

/// Runs the experiment.
pub fn run(session: &mut Session) -> anyhow::Result<()> {
    let settings: Settings = session.settings()?;
    let names: Vec<String> = settings.scenes.iter().map(|scene| scene.name.clone()).collect();
    let files = session.scenes(&names)?;
    let mut measured = Vec::new();
    for scene_settings in &settings.scenes {
        if let Some(file) = files.iter().find(|file| file.name == scene_settings.name) {
            measured.push(measure::measure(session, &settings, scene_settings, file)?);
        }
    }
    let missing: Vec<String> =
        names.into_iter().filter(|name| files.iter().all(|file| file.name != *name)).collect();
    report::write(session, &settings, &measured, &missing)
}
