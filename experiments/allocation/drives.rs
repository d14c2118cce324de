//! What drives the samples: all maps, each alone, each left out, and the true error.

use prpf::adaptive::{PrioritySettings, Sampling};
use prpf::geometry::Accel;
use prpf::progressive::Denoiser;

use super::MapSettings;
use crate::bench::Bench;
use crate::curves::{self, Point};
use crate::trial::{Bed, Steering, Trial};

/// A choice of maps.
#[derive(Clone, Debug)]
pub struct Drive {
    pub name: String,
    priority: PrioritySettings,
    steering: Steering,
}

/// What the program does without being told otherwise.
pub const DEFAULT: &str = "default";
/// The true error in the place of all maps.
pub const ORACLE: &str = "true error";

/// The weight of a map.
type Weight = fn(&mut PrioritySettings) -> &mut f32;

/// The maps by their names.
pub const MAPS: [(&str, Weight); 4] = [
    ("filtered variance", |settings| &mut settings.filtered_variance),
    ("unfiltered variance", |settings| &mut settings.raw_variance),
    ("interpolation failure", |settings| &mut settings.interpolation_failure),
    ("filter residual", |settings| &mut settings.residual),
];

/// Name of a map's drive when it is alone, and when only it is missing.
pub fn names(map: &str) -> [String; 2] {
    [format!("only {map}"), format!("without {map}")]
}

/// All choices, the default first, the true error last.
pub fn all() -> Vec<Drive> {
    let default = PrioritySettings::default();
    let mut nothing = default;
    MAPS.iter().for_each(|(_, weight)| *weight(&mut nothing) = 0.0);
    let drive = |name: &str, priority: PrioritySettings, steering: Steering| Drive {
        name: name.to_owned(),
        priority,
        steering,
    };
    let mut drives = vec![drive(DEFAULT, default, Steering::None)];
    for (map, weight) in MAPS {
        let [alone, left_out] = names(map);
        let (mut only, mut without) = (nothing, default);
        *weight(&mut only) = 1.0;
        *weight(&mut without) = 0.0;
        drives.push(drive(&alone, only, Steering::None));
        drives.push(drive(&left_out, without, Steering::None));
    }
    let mut variance = nothing;
    variance.filtered_variance = 1.0;
    drives.push(drive(ORACLE, variance, Steering::Oracle));
    drives
}

/// Measures filtered images by each choice.
pub fn measure(
    bench: &mut Bench,
    bed: &Bed,
    accel: &Accel,
    settings: MapSettings,
) -> anyhow::Result<Vec<(Drive, Vec<Point>)>> {
    let spp = settings.spp;
    let mut measured = Vec::new();
    for drive in all() {
        let mut points = Vec::new();
        for seed in 0..settings.seeds {
            let trial = Trial {
                priority: drive.priority,
                steering: drive.steering,
                ..Trial::new(Sampling::Adaptive, Denoiser::Prpf, spp, seed)
            };
            let values = curves::take(bench, bed, accel, &trial, &format!("driven by: {}", drive.name))?;
            points.push(Point { spp, seed, seconds: values["seconds"], error: values["relmse"] });
        }
        curves::level_seconds(&mut points);
        measured.push((drive, points));
    }
    Ok(measured)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_map_is_alone_once_and_left_out_once() {
        let drives = all();
        let weights = |drive: &Drive| {
            let mut priority = drive.priority;
            MAPS.map(|(_, weight)| *weight(&mut priority) > 0.0)
        };
        assert_eq!(weights(&drives[0]), [true; 4]);
        for (i, (map, _)) in MAPS.iter().enumerate() {
            let [alone, left_out] = names(map);
            let of = |name: &str| weights(drives.iter().find(|drive| drive.name == name).unwrap());
            assert_eq!(of(&alone), std::array::from_fn(|k| k == i));
            assert_eq!(of(&left_out), std::array::from_fn(|k| k != i));
        }
    }
}
