//! The experiment `allocation`: is adaptive sampling better than uniform?
//!
//! Measures error against samples and seconds, on several scenes with several seeds, and what each priority map
//! contributes.

mod ablation;
mod goals;
mod map_effects;
mod own_loop;
mod report;
mod sample_maps;
mod scene_results;
mod settings;

use anyhow::ensure;
use prpf::geometry::Accel;

use crate::curves::{self, Counts};
use crate::session::Session;
use crate::test_scene::TestScene;
use scene_results::SceneResults;
use settings::{MapSettings, Settings};

/// Runs the experiment.
pub fn run(session: &mut Session) -> anyhow::Result<()> {
    let settings: Settings = session.settings()?;
    ensure!(
        settings.spp.len() >= 2
            && settings.spp.contains(&settings.maps.spp)
            && (1..=settings.seeds).contains(&settings.maps.seeds)
            && settings.own_loop.ablation_seeds <= settings.own_loop.seeds
            && settings.more_uniform_spp.iter().all(|spp| !settings.spp.contains(spp)),
        "allocation.toml: spp needs two values or more, maps.spp among them; maps.seeds is 1 to seeds, \
         own_loop.ablation_seeds at most own_loop.seeds; more_uniform_spp has none of spp"
    );
    let mut all = Vec::new();
    for file in session.scenes(&settings.scenes)? {
        let test_scene = TestScene::new(session, &file, &settings.size)?;
        let accel = Accel::build(&test_scene.scene);
        let Settings { spp, more_uniform_spp, seeds, .. } = &settings;
        let counts = Counts { spp, more_uniform_spp, seeds: *seeds };
        let curves = curves::measure(session, &test_scene, &accel, &counts)?;
        let MapSettings { spp, seeds } = settings.maps;
        let ablations =
            ablation::measure(session, &test_scene, &accel, &ablation::default_maps(), (spp, seeds))?;
        let own_loop = own_loop::measure(session, &test_scene, &accel, &settings.own_loop)?;
        let (picture, optimal_ratio) = sample_maps::write(session, &test_scene, &accel, spp)?;
        let (is_public, reference_relmse) = (test_scene.is_public, test_scene.reference.relmse);
        let scene = test_scene.name;
        all.push(SceneResults {
            scene,
            is_public,
            reference_relmse,
            curves,
            optimal_ratio,
            ablations,
            own_loop,
            picture,
        });
    }
    report::write(session, &settings, &all)
}
