//! Makes a store of frames: each of two frames is one half of the samples of every pixel.
//!
//! Without a variance a frame counts as one sample: the difference of the halves is then what is known of their noise.
//! With one, it has as many samples as its file states, with that variance.
//!
//! One frame with a variance is divided into two halves c + e and c − e with a random e of the frame's own variance (Pang
//! et al. 2021, "Recorrupted-to-Recorrupted"). Their errors are uncorrelated, and each has the variance of half the
//! samples.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::ImportError;
use super::frame::Frame;
use super::role::Role;
use crate::image::Planes;
use crate::stats::{Columns, HalfMoments, LARGEST_VALUE, Store};

/// Samples of a frame with a variance whose file does not state their number: enough to trust the variance more than that
/// of the neighbours, as with real samples.
const ASSUMED_SPP: u32 = 16;
/// Largest fraction of the colour by which the sum of its layers may differ from it, on average.
const AOV_TOLERANCE: f64 = 0.01;
/// Names of the store's columns for each feature.
const FEATURES: [(Role, [&str; 3]); 4] = [
    (Role::Albedo, ["albedo.r", "albedo.g", "albedo.b"]),
    (Role::Normal, ["N1.x", "N1.y", "N1.z"]),
    (Role::Position, POSITION),
    (Role::Depth, POSITION),
];
const POSITION: [&str; 3] = ["P1.x", "P1.y", "P1.z"];

/// A store of frames.
#[derive(Debug)]
pub struct FrameStore {
    pub store: Store,
    /// The layers that sum to the colour, in both halves.
    pub aovs: Vec<(String, [Planes; 2])>,
    /// Pixels without a finite value in any frame.
    pub empty_pixels: usize,
}

/// One half of every pixel.
struct Half {
    /// 3 planes.
    colour: Planes,
    /// Variance of the colour: 3 planes.
    variance: Option<Planes>,
    samples: u32,
}

/// The names of a feature's columns, and its planes in both halves.
type Feature = ([&'static str; 3], [Planes; 2]);

impl FrameStore {
    /// Makes a store of two frames, or of one with a variance. `seed` is that of the noise that divides one frame.
    ///
    /// # Errors
    /// Another number of frames, frames of different sizes or equal frames, one frame without variance, AOVs that do not sum
    /// to the colour, no valid pixel.
    pub fn new(frames: &[Frame], seed: u64) -> Result<Self, ImportError> {
        // Make the halves
        frames.iter().try_for_each(check_aovs)?;
        let (halves, aovs) = match frames {
            [a, b] => {
                check_pair(a, b)?;
                let aovs = a.aovs.iter().zip(&b.aovs);
                let aovs = aovs.map(|((name, a), (_, b))| (name.clone(), [a.clone(), b.clone()])).collect();
                (halves_from_pair(a, b), aovs)
            }
            [frame] => {
                let halves = halves_from_one(frame, seed)?;
                let divide = |planes: &Planes| {
                    halves.each_ref().map(|half| in_proportion(planes, &half.colour, &frame.colour))
                };
                let aovs = frame.aovs.iter().map(|(name, planes)| (name.clone(), divide(planes))).collect();
                (halves, aovs)
            }
            _ => {
                let problem = format!("found {} images; accepted are one and two", frames.len());
                return Err(ImportError::Frames(problem));
            }
        };

        // Make the store
        let features = features(frames);
        let names: Vec<&str> =
            ["R", "G", "B"].into_iter().chain(features.iter().flat_map(|(names, _)| *names)).collect();
        let columns = Columns::new(&names).map_err(|error| ImportError::Frames(error.to_string()))?;
        let buffers = [0, 1].map(|h| Buffers::new(&halves, &features, h));
        let moments = buffers.each_ref().map(Buffers::moments);
        let (width, height) = (halves[0].colour.width(), halves[0].colour.height());
        let store = Store::from_half_moments(width, height, &columns, &moments, seed)?;
        if store.samples() == 0 {
            return Err(ImportError::Layers {
                path: frames[0].path.clone(),
                problem: format!(
                    "found no pixel whose colour and variance are valid; accepted are finite values of at most {LARGEST_VALUE:e}"
                ),
            });
        }
        let is_empty = |i: &usize| buffers.iter().all(|half| half.counts[*i] == 0);
        Ok(Self { store, aovs, empty_pixels: (0..width * height).filter(is_empty).count() })
    }
}

fn halves_from_pair(a: &Frame, b: &Frame) -> [Half; 2] {
    // The difference of the frames tells more than the variance of another quantity
    let has_variance = [a, b].iter().all(|frame| frame.variance.is_some() && !frame.is_variance_of_luminance);
    [a, b].map(|frame| Half {
        colour: frame.colour.clone(),
        variance: frame.variance.clone().filter(|_| has_variance),
        samples: if has_variance { frame.spp.unwrap_or(ASSUMED_SPP) } else { 1 },
    })
}

fn halves_from_one(frame: &Frame, seed: u64) -> Result<[Half; 2], ImportError> {
    let Some(variance) = &frame.variance else {
        return Err(ImportError::Layers {
            path: frame.path.clone(),
            problem: "found one image without a variance; accepted are two renders with different seeds, or a layer of the \
                      variance of the mean, by --map variance=LAYER"
                .to_owned(),
        });
    };
    Ok(divide(&frame.colour, variance, seed).map(|colour| {
        let mut variance = variance.clone();
        variance.data_mut().iter_mut().for_each(|value| *value *= 2.0);
        // At least two samples, which have a variance
        let samples = (frame.spp.unwrap_or(ASSUMED_SPP) / 2).max(2);
        Half { colour, variance: Some(variance), samples }
    }))
}

/// Returns the features that all frames have; a depth only without positions.
fn features(frames: &[Frame]) -> Vec<Feature> {
    let find = |frame: &Frame, role: Role| {
        let found = frame.features.iter().find(|(found, _)| *found == role);
        found.map(|(_, planes)| planes.clone())
    };
    let mut features: Vec<Feature> = Vec::new();
    for (role, names) in FEATURES {
        let planes: Option<Vec<Planes>> = frames.iter().map(|frame| find(frame, role)).collect();
        let is_new = features.iter().all(|(known, _)| *known != names);
        if let (Some(planes), true) = (planes, is_new) {
            let mut halves = [planes[0].clone(), planes[planes.len() - 1].clone()];
            if names == POSITION {
                scale_positions(&mut halves);
            }
            halves.iter_mut().for_each(remove_invalid_values);
            features.push((names, halves));
        }
    }
    features
}

/// Sets values that no store takes to 0: a pixel keeps its colour if a feature of it is wrong.
fn remove_invalid_values(feature: &mut Planes) {
    let is_valid = |value: f32| value.abs() <= LARGEST_VALUE;
    feature.data_mut().iter_mut().filter(|value| !is_valid(**value)).for_each(|value| *value = 0.0);
}

/// Scales positions to order 1. Those of the background may be at any distance.
fn scale_positions(halves: &mut [Planes; 2]) {
    const MOST: f32 = 4.0;
    let values = halves.iter().flat_map(|half| half.data()).map(|value| value.abs());
    let mut values: Vec<f32> = values.filter(|&value| value > 0.0 && value.is_finite()).collect();
    if values.is_empty() {
        return;
    }
    let middle = values.len() / 2;
    let scale = 1.0 / *values.select_nth_unstable_by(middle, f32::total_cmp).1;
    halves
        .iter_mut()
        .flat_map(Planes::data_mut)
        .for_each(|value| *value = (scale * *value).clamp(-MOST, MOST));
}

fn check_pair(a: &Frame, b: &Frame) -> Result<(), ImportError> {
    let fail = |problem: String| Err(ImportError::Layers { path: b.path.clone(), problem });
    if a.windows.data != b.windows.data {
        let [accepted, found] = [a, b].map(|frame| {
            let [left, _, top, _] = frame.windows.data;
            format!("{}x{} pixels from {left},{top} on", frame.windows.width(), frame.windows.height())
        });
        return fail(format!("found {found}; accepted is the data window of the first image, {accepted}"));
    }
    // Black frames are equal, too
    let is_lit = a.colour.data().iter().any(|value| value.is_finite() && *value > 0.0);
    if is_lit && a.colour == b.colour {
        return fail(
            "found the colours of the first image; accepted is a render of the same frame with another seed"
                .to_owned(),
        );
    }
    Ok(())
}

/// Checks that AOVs sum to the colour.
fn check_aovs(frame: &Frame) -> Result<(), ImportError> {
    if frame.aovs.is_empty() {
        return Ok(());
    }
    let (mut difference, mut brightness) = (0.0, 0.0);
    for (i, &colour) in frame.colour.data().iter().enumerate() {
        let sum: f32 = frame.aovs.iter().map(|(_, planes)| planes.data()[i]).sum();
        if colour.is_finite() && sum.is_finite() {
            difference += f64::from((sum - colour).abs());
            brightness += f64::from(colour);
        }
    }
    if difference <= AOV_TOLERANCE * brightness {
        return Ok(());
    }
    Err(ImportError::Layers {
        path: frame.path.clone(),
        problem: format!(
            "--aovs: found layers whose sum differs from the colour by {:.1} % of it; accepted are layers that sum to it",
            100.0 * difference / brightness.max(f64::MIN_POSITIVE)
        ),
    })
}

/// Divides a frame into two halves whose mean it is. All channels of a pixel get the same deviation in units of their
/// standard deviation, since the noise of a renderer is that of whole samples. Neither half gets negative.
fn divide(colour: &Planes, variance: &Planes, seed: u64) -> [Planes; 2] {
    let mut halves = [colour.clone(), colour.clone()];
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    for i in 0..colour.pixels() {
        // Box-Muller
        let [u, v]: [f32; 2] = [random.random(), random.random()];
        let deviation = (-2.0 * (1.0 - u).ln()).sqrt() * (std::f32::consts::TAU * v).cos();
        for c in 0..3 {
            let value = colour.plane(c)[i];
            // Not `clamp`, which panics where the value is not a number
            let noise = (deviation * variance.plane(c)[i].max(0.0).sqrt()).max(-value.abs()).min(value.abs());
            if noise.is_finite() {
                halves[0].plane_mut(c)[i] += noise;
                halves[1].plane_mut(c)[i] -= noise;
            }
        }
    }
    halves
}

/// Divides a layer in the proportions in which the colour was divided.
fn in_proportion(layer: &Planes, half: &Planes, colour: &Planes) -> Planes {
    let mut planes = layer.clone();
    let values = planes.data_mut().iter_mut().zip(half.data()).zip(colour.data());
    values.filter(|(_, colour)| **colour > 0.0).for_each(|((value, half), colour)| *value *= half / colour);
    planes
}

/// The moments of one half.
struct Buffers {
    counts: Vec<u32>,
    means: Vec<f32>,
    variances: Vec<f32>,
}

impl Buffers {
    fn new(halves: &[Half; 2], features: &[Feature], h: usize) -> Self {
        let half = &halves[h];
        let pixels = half.colour.pixels();
        let mut buffers =
            Self { counts: vec![half.samples; pixels], means: Vec::new(), variances: Vec::new() };
        for i in 0..pixels {
            let start = buffers.means.len();
            for c in 0..3 {
                buffers.means.push(half.colour.plane(c)[i]);
                let variance = half.variance.as_ref().map_or(0.0, |variance| variance.plane(c)[i]);
                buffers.variances.push(if variance < 0.0 { 0.0 } else { variance });
            }
            for (_, planes) in features {
                for c in 0..3 {
                    let [own, other] = [&planes[h], &planes[1 - h]].map(|planes| planes.plane(c)[i]);
                    buffers.means.push(own);
                    // What the difference of two means tells of the variance of one. That of single samples follows from
                    // both halves.
                    buffers.variances.push(if half.samples > 1 { 0.5 * (own - other).powi(2) } else { 0.0 });
                }
            }
            // From the variance of the mean to that of the samples
            buffers.variances[start..].iter_mut().for_each(|variance| *variance *= half.samples as f32);
            let is_valid = |value: &f32| value.abs() <= LARGEST_VALUE;
            let is_valid_variance = |value: &f32| value.sqrt() <= LARGEST_VALUE;
            let (means, variances) = (&mut buffers.means[start..], &mut buffers.variances[start..]);
            if !means.iter().all(is_valid) || !variances.iter().all(is_valid_variance) {
                buffers.counts[i] = 0;
                means.fill(0.0);
                variances.fill(0.0);
            }
        }
        buffers
    }

    fn moments(&self) -> HalfMoments<'_> {
        HalfMoments { counts: &self.counts, means: &self.means, variances: &self.variances }
    }
}

#[cfg(test)]
mod tests;
