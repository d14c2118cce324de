//! Draws the feature weights of the first pass: interpolated beside directly computed (the paper's Fig. 6), and
//! from neighbourhoods of pixels beside those of samples (its Fig. 5).

use std::path::{Path, PathBuf};

use prpf::filter::{RpfSettings, rpf};
use prpf::image::Planes;
use prpf::stats::Store;

use crate::picture;

/// The groups of weights that are drawn side by side: a name, and the weights that are added up.
pub const GROUPS: [(&str, &[&str]); 4] = [
    ("α", &["alpha R", "alpha G", "alpha B"]),
    ("β of positions", &["beta P1.x", "beta P1.y", "beta P1.z"]),
    ("β of normals", &["beta N1.x", "beta N1.y", "beta N1.z"]),
    ("β of albedos", &["beta albedo.r", "beta albedo.g", "beta albedo.b"]),
];

/// Fraction of pixels that may exceed the colour scale.
const CLIPPED_FRACTION: f64 = 0.01;

/// The computations of weights that are compared.
pub const COMPUTATIONS: [&str; 3] = ["interpolated", "by pixels", "by samples"];

/// The files of a scene, by index of [`COMPUTATIONS`].
pub fn files(folder: &Path, scene: &str) -> [PathBuf; 3] {
    COMPUTATIONS.map(|name| folder.join(format!("{scene}-weights-{}.png", name.replace(' ', "-"))))
}

/// Writes the pictures. `by_pixels` are P-RPF's weights of the first pass with their names, interpolated and
/// directly computed. The weights by samples are those of RPF on the same samples. All have the colour scale of the
/// directly computed ones.
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
    let sums = [
        sum_groups(names, by_pixels[0]),
        sum_groups(names, by_pixels[1]),
        sum_groups(&rpf_names, &by_samples[0]),
    ];
    let scales: Vec<f32> = sums[1].iter().map(|planes| scale(planes.data())).collect();
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

/// The sum of each group's weights.
fn sum_groups(names: &[String], weights: &Planes) -> Vec<Planes> {
    let sum = |(_, added): &(&str, &[&str])| {
        let mut sum = Planes::new(weights.width(), weights.height(), 1);
        for k in (0..names.len()).filter(|&k| added.contains(&names[k].as_str())) {
            sum.data_mut().iter_mut().zip(weights.plane(k)).for_each(|(sum, value)| *sum += value);
        }
        sum
    };
    GROUPS.iter().map(sum).collect()
}

/// The end of the colour scale; 1 if all values are 0.
fn scale(values: &[f32]) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    let index =
        ((sorted.len() as f64 * (1.0 - CLIPPED_FRACTION)) as usize).min(sorted.len().saturating_sub(1));
    sorted.get(index).copied().filter(|&value| value > 0.0).unwrap_or(1.0)
}
