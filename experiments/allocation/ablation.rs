//! Measures what each priority map contributes to adaptive sampling.
//!
//! The loop runs with all maps, with each map alone, with each one left out, and with the true error in place of
//! all maps.

use prpf::adaptive::{PrioritySettings, Sampling};
use prpf::filter::DENOISERS;
use prpf::geometry::Accel;

use super::settings::MapSettings;
use crate::curves::{self, Point};
use crate::session::Session;
use crate::test_scene::TestScene;
use crate::trial::{InterimPasses, Trial};

/// A selection of the priority maps.
#[derive(Clone, Debug)]
pub struct Ablation {
    pub name: String,
    priority: PrioritySettings,
    interim_passes: InterimPasses,
}

/// Name of the selection of all maps.
pub const ALL_MAPS: &str = "all maps";
/// Name of the selection that replaces all maps by the true error.
pub const ORACLE: &str = "true error";

/// Accesses the weight of a map.
type Weight = fn(&mut PrioritySettings) -> &mut f32;

/// The maps of a denoiser that does not interpolate, by name.
pub const MAPS: [(&str, Weight); 3] = [
    ("filtered variance", |settings| &mut settings.filtered_variance),
    ("unfiltered variance", |settings| &mut settings.raw_variance),
    ("filter residual", |settings| &mut settings.residual),
];

/// Names of the selections with only this map, and without it.
pub fn names(map: &str) -> [String; 2] {
    [format!("only {map}"), format!("without {map}")]
}

/// All selections: that of all maps first, the true error last.
pub fn all() -> Vec<Ablation> {
    // Each selection is tried, whatever is expected of it
    let default = PrioritySettings { max_ratio: 1.0, ..PrioritySettings::default() };
    let mut nothing = default;
    MAPS.iter().for_each(|(_, weight)| *weight(&mut nothing) = 0.0);
    let ablation = |name: &str, priority: PrioritySettings, interim_passes: InterimPasses| Ablation {
        name: name.to_owned(),
        priority,
        interim_passes,
    };
    let mut ablations = vec![ablation(ALL_MAPS, default, InterimPasses::EveryBatch)];
    for (map, weight) in MAPS {
        let [alone, left_out] = names(map);
        let (mut only, mut without) = (nothing, default);
        *weight(&mut only) = 1.0;
        *weight(&mut without) = 0.0;
        ablations.push(ablation(&alone, only, InterimPasses::EveryBatch));
        ablations.push(ablation(&left_out, without, InterimPasses::EveryBatch));
    }
    let mut variance = nothing;
    variance.filtered_variance = 1.0;
    ablations.push(ablation(ORACLE, variance, InterimPasses::Oracle));
    ablations
}

/// Measures the filtered images of each selection, if the settings name the scene.
pub fn measure(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    settings: &MapSettings,
) -> anyhow::Result<Vec<(Ablation, Vec<Point>)>> {
    let mut measured = Vec::new();
    if !settings.scenes.contains(&test_scene.name) {
        return Ok(measured);
    }
    let spp = settings.spp;
    for ablation in all() {
        let mut points = Vec::new();
        for seed in 0..settings.seeds {
            let trial = Trial {
                priority: ablation.priority,
                interim_passes: ablation.interim_passes,
                ..Trial::new(Sampling::Adaptive, DENOISERS[0], spp, seed)
            };
            let values = curves::measure_trial(
                session,
                test_scene,
                accel,
                &trial,
                &format!("maps: {}", ablation.name),
            )?;
            points.push(Point::new(&trial, &values));
        }
        curves::use_median_seconds(&mut points);
        measured.push((ablation, points));
    }
    Ok(measured)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_map_is_alone_once_and_left_out_once() {
        let ablations = all();
        let weights = |ablation: &Ablation| {
            let mut priority = ablation.priority;
            MAPS.map(|(_, weight)| *weight(&mut priority) > 0.0)
        };
        assert_eq!(weights(&ablations[0]), [true; 3]);
        for (i, (map, _)) in MAPS.iter().enumerate() {
            let [alone, left_out] = names(map);
            let weights_of =
                |name: &str| weights(ablations.iter().find(|ablation| ablation.name == name).unwrap());
            assert_eq!(weights_of(&alone), std::array::from_fn(|k| k == i));
            assert_eq!(weights_of(&left_out), std::array::from_fn(|k| k != i));
        }
    }
}
