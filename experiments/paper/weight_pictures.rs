//! Feature weights of the first pass as pictures: interpolated and computed at every pixel (the paper's
//! Fig. 6), and from neighbourhoods of pixels and of samples (its Fig. 5).

use std::path::{Path, PathBuf};

use prpf::filter::{RpfSettings, rpf};
use prpf::image::Planes;
use prpf::stats::Store;

use crate::picture;

/// What is shown beside each other: a name, and the weights that are added up.
pub const SHOWN: [(&str, &[&str]); 4] = [
    ("α", &["alpha R", "alpha G", "alpha B"]),
    ("β of positions", &["beta P1.x", "beta P1.y", "beta P1.z"]),
    ("β of normals", &["beta N1.x", "beta N1.y", "beta N1.z"]),
    ("β of albedos", &["beta albedo.r", "beta albedo.g", "beta albedo.b"]),
];

/// Share of pixels that may be brighter than the scale's end.
const BEYOND: f64 = 0.01;

/// The ways of computing weights that are shown.
pub const WAYS: [&str; 3] = ["interpolated", "by pixels", "by samples"];

/// A file for each of the [`WAYS`].
pub fn files(folder: &Path, scene: &str) -> [PathBuf; 3] {
    WAYS.map(|way| folder.join(format!("{scene}-weights-{}.png", way.replace(' ', "-"))))
}

/// Writes the pictures. `by_pixels` are the weights of the first pass, interpolated and not, with their
/// names; those by samples are RPF's over the same samples. All have the scale of the second.
pub fn write(
    files: &[PathBuf; 3],
    names: &[String],
    by_pixels: [&Planes; 2],
    store: &Store,
    settings: &RpfSettings,
    seed: u64,
) -> anyhow::Result<()> {
    let first = RpfSettings { passes: settings.passes[..1].to_vec(), ..settings.clone() };
    let (rpf_names, by_samples) = rpf::feature_weights(store, &first, seed);
    let sums =
        [added_up(names, by_pixels[0]), added_up(names, by_pixels[1]), added_up(&rpf_names, &by_samples[0])];
    let scales: Vec<f32> = sums[1].iter().map(|planes| bright(planes.data())).collect();
    for (file, sums) in files.iter().zip(&sums) {
        let scaled: Vec<Planes> = sums
            .iter()
            .zip(&scales)
            .map(|(planes, scale)| {
                let mut planes = planes.clone();
                planes.data_mut().iter_mut().for_each(|value| *value /= scale);
                planes
            })
            .collect();
        picture::write_map(file, &picture::in_a_row(&scaled), 1.0)?;
    }
    Ok(())
}

/// The sums of what is shown, a plane each.
fn added_up(names: &[String], weights: &Planes) -> Vec<Planes> {
    let sum = |(_, added): &(&str, &[&str])| {
        let mut sum = Planes::new(weights.width(), weights.height(), 1);
        for k in (0..names.len()).filter(|&k| added.contains(&names[k].as_str())) {
            sum.data_mut().iter_mut().zip(weights.plane(k)).for_each(|(sum, value)| *sum += value);
        }
        sum
    };
    SHOWN.iter().map(sum).collect()
}

/// A value that hardly any exceeds; 1 where all are 0.
fn bright(values: &[f32]) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    let place = ((sorted.len() as f64 * (1.0 - BEYOND)) as usize).min(sorted.len().saturating_sub(1));
    sorted.get(place).copied().filter(|&value| value > 0.0).unwrap_or(1.0)
}
