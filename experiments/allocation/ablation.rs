//! Measures what each priority map contributes to adaptive sampling.
//!
//! The loop runs with all maps, with each map alone, with each one left out, and with the true error in place of
//! all maps.

use prpf::adaptive::{PrioritySettings, Sampling};
use prpf::filter::{DEFAULT, Denoiser, find};
use prpf::geometry::Accel;

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
/// Name of the selection of the other maps alone.
pub const NONE_OF_THEM: &str = "none of them";
/// Name of the selection that replaces all maps by the true error.
pub const ORACLE: &str = "true error";

/// Accesses the weight of a map.
type Weight = fn(&mut PrioritySettings) -> &mut f32;

/// The priority maps to ablate in the loop of a denoiser.
pub struct PriorityMaps {
    denoiser: &'static dyn Denoiser,
    /// The maps, by name.
    pub maps: &'static [(&'static str, Weight)],
    /// Whether there are others, which stay when all of these are left out.
    has_others: bool,
    /// Begins the names of the trials.
    label: &'static str,
}

const RESIDUAL: (&str, Weight) = ("filter residual", |settings| &mut settings.residual);

/// Returns the maps of the default denoiser, which does not interpolate.
pub fn default_maps() -> PriorityMaps {
    let maps = &[
        ("filtered variance", (|settings| &mut settings.filtered_variance) as Weight),
        ("unfiltered variance", |settings| &mut settings.raw_variance),
        RESIDUAL,
    ];
    PriorityMaps { denoiser: DEFAULT, maps, has_others: false, label: "maps" }
}

/// Returns the maps that P-RPF adds to the variances.
pub fn prpf_maps() -> PriorityMaps {
    let maps =
        &[("interpolation failure", (|settings| &mut settings.interpolation_failure) as Weight), RESIDUAL];
    PriorityMaps { denoiser: prpf(), maps, has_others: true, label: "maps of prpf" }
}

/// P-RPF at its full quality.
pub fn prpf() -> &'static dyn Denoiser {
    find("prpf", None).expect("the method's own denoiser")
}

/// Names of the selections with only this map, and without it.
pub fn names(map: &str) -> [String; 2] {
    [format!("only {map}"), format!("without {map}")]
}

/// All selections: that of all maps first, the true error last.
fn selections(&PriorityMaps { maps, has_others, .. }: &PriorityMaps) -> Vec<Ablation> {
    // Each selection is tried, whatever is expected of it
    let default = PrioritySettings { max_ratio: 1.0, ..PrioritySettings::default() };
    let nothing = PrioritySettings {
        filtered_variance: 0.0,
        raw_variance: 0.0,
        interpolation_failure: 0.0,
        residual: 0.0,
        ..default
    };
    let ablation = |name: &str, priority: PrioritySettings, interim_passes: InterimPasses| Ablation {
        name: name.to_owned(),
        priority,
        interim_passes,
    };
    let mut ablations = vec![ablation(ALL_MAPS, default, InterimPasses::EveryBatch)];
    for &(map, weight) in maps {
        let [alone, left_out] = names(map);
        let (mut only, mut without) = (nothing, default);
        *weight(&mut only) = 1.0;
        *weight(&mut without) = 0.0;
        ablations.push(ablation(&alone, only, InterimPasses::EveryBatch));
        ablations.push(ablation(&left_out, without, InterimPasses::EveryBatch));
    }
    if has_others {
        let mut others = default;
        maps.iter().for_each(|(_, weight)| *weight(&mut others) = 0.0);
        ablations.push(ablation(NONE_OF_THEM, others, InterimPasses::EveryBatch));
    }
    let variance = PrioritySettings { filtered_variance: 1.0, ..nothing };
    ablations.push(ablation(ORACLE, variance, InterimPasses::Oracle));
    ablations
}

/// Measures the filtered images of each selection.
pub fn measure(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    maps: &PriorityMaps,
    (spp, seeds): (u32, u64),
) -> anyhow::Result<Vec<(Ablation, Vec<Point>)>> {
    let mut measured = Vec::new();
    for ablation in selections(maps) {
        let mut points = Vec::new();
        for seed in 0..seeds {
            let trial = Trial {
                priority: ablation.priority,
                interim_passes: ablation.interim_passes,
                ..Trial::new(Sampling::Adaptive, maps.denoiser, spp, seed)
            };
            let name = format!("{}: {}", maps.label, ablation.name);
            let values = curves::measure_trial(session, test_scene, accel, &trial, &name)?;
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
        for priority_maps in [default_maps(), prpf_maps()] {
            let (ablations, maps) = (selections(&priority_maps), priority_maps.maps);
            let weights = |ablation: &Ablation| {
                let mut priority = ablation.priority;
                maps.iter().map(|(_, weight)| *weight(&mut priority) > 0.0).collect::<Vec<_>>()
            };
            let count = maps.len();
            assert_eq!(weights(&ablations[0]), vec![true; count]);
            for (i, (map, _)) in maps.iter().enumerate() {
                let [alone, left_out] = names(map);
                let weights_of =
                    |name: &str| weights(ablations.iter().find(|ablation| ablation.name == name).unwrap());
                assert_eq!(weights_of(&alone), (0..count).map(|k| k == i).collect::<Vec<_>>());
                assert_eq!(weights_of(&left_out), (0..count).map(|k| k != i).collect::<Vec<_>>());
            }
        }
    }
}
