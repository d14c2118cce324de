//! Exports a render state as named numpy arrays, for work in Python.
//!
//! Takes a state and what the filter makes of it; writes an `.npz` archive. h and w are height and width in pixels, d is
//! the number of dimensions of a sample vector, k the size of the reservoir.
//!
//! | name | type, shape | content |
//! | --- | --- | --- |
//! | `drawn`, `rejected` | u4, \[h, w\] | samples taken per pixel, and those of them that were rejected (NaN, infinite) |
//! | `count`, `count_a`, `count_b` | u4, \[h, w\] | valid samples: all, and those of even and odd index |
//! | `mean`, `mean_a`, `mean_b` | f8, \[d, h, w\] | means of each dimension |
//! | `m2`, `m2_a`, `m2_b` | f8, \[d, h, w\] | sums of squared deviations from them |
//! | `reservoir` | f4, \[h, w, k, d\] | sample vectors; the first `reservoir_count` of each pixel |
//! | `reservoir_count` | u4, \[h, w\] | |
//! | `dimension_names`, `dimension_groups`, `dimension_units` | text, \[d\] | of the sample vector |
//! | `image`, `variance` | f4, \[3, h, w\] | the image that the state's settings filter, and its variance (the EXR's layer `Variance` is of the unfiltered mean) |
//! | `residual`, `error` | f4, \[h, w\] | as in [`crate::filter::FilterResult`] |
//! | `interpolation_failure` | f4, \[h, w\] | the denoiser's own, or that of the last interim pass |
//! | `tile_error` | f4, \[⌈h/16⌉, ⌈w/16⌉\] | estimated relMSE per tile, if there is an estimate |
//! | `feature_weights` | f4, \[pass, weight, h, w\] | those of `--denoiser prpf`, if the state has sample vectors |
//! | `feature_weight_names` | text, \[weight\] | β of a feature, α of a colour, randomness of the colour, sum of interpolation weights (infinite at nodes) |
//! | `first_pass` | f4, \[3, h, w\] | the image after the first pass of `--denoiser prpf`, without the redistributed excess of fireflies |
//! | `header` | text, \[\] | JSON: scene, settings, streams, filter passes |

use std::io::{self, Seek, Write};

use super::header::Header;
use super::npz::Npz;
use super::render_state::RenderState;
use crate::filter::{FireflySettings, PrpfSettings, prpf};
use crate::image::Planes;
use crate::progressive::Filtered;
use crate::stats::{Dimension, Feature, Group, Moments, Part, Store};

/// Writes an `.npz` archive. `filtered` is the result of filtering the state.
///
/// # Errors
/// Those of `out`.
pub fn export(state: &RenderState, filtered: &Filtered, out: impl Write + Seek) -> io::Result<()> {
    let mut npz = Npz::new(out);
    statistics(&state.checkpoint.store, &mut npz)?;
    reservoir(&state.checkpoint.store, &mut npz)?;
    maps(filtered, &mut npz)?;
    if state.checkpoint.store.capacity() > 0 {
        weights(state, &mut npz)?;
    }
    let header = serde_json::to_string(&Header::new(state)).map_err(io::Error::from)?;
    npz.texts("header", &[], &[&header])?;
    npz.finish()
}

/// Selects one of a dimension's moments.
type Value = fn(Moments) -> f64;

fn mean(moments: Moments) -> f64 {
    moments.mean
}

fn m2(moments: Moments) -> f64 {
    moments.m2
}

const PARTS: [(&str, Part); 3] = [("", Part::Whole), ("_a", Part::Half(0)), ("_b", Part::Half(1))];

fn statistics<W: Write + Seek>(store: &Store, npz: &mut Npz<W>) -> io::Result<()> {
    let (width, height, dims) = (store.width(), store.height(), store.layout().len());
    let rows = store.rows();
    let pixels = || rows.iter().flat_map(|row| (0..width).map(move |x| (row, x)));
    npz.array("drawn", &[height, width], pixels().map(|(row, x)| row.next_index(x)))?;
    npz.array("rejected", &[height, width], pixels().map(|(row, x)| row.rejected(x)))?;
    for (suffix, part) in PARTS {
        npz.array(&format!("count{suffix}"), &[height, width], store.counts(part))?;
        let values = [("mean", mean as Value), ("m2", m2)];
        for (name, value) in values {
            let all =
                (0..dims).flat_map(|dim| pixels().map(move |(row, x)| value(row.moments(x, dim, part))));
            npz.array(&format!("{name}{suffix}"), &[dims, height, width], all)?;
        }
    }
    let dimensions = store.layout().dimensions();
    let texts = |text: fn(&Dimension) -> &'static str| dimensions.iter().map(text).collect::<Vec<_>>();
    npz.texts("dimension_names", &[dims], &texts(|d| d.name))?;
    npz.texts("dimension_groups", &[dims], &texts(group))?;
    npz.texts("dimension_units", &[dims], &texts(unit))
}

fn group(dimension: &Dimension) -> &'static str {
    match dimension.group {
        Group::Position => "position",
        Group::Colour => "colour",
        Group::Feature(_) => "feature",
        Group::Random => "random",
        Group::Auxiliary => "auxiliary",
    }
}

fn unit(dimension: &Dimension) -> &'static str {
    match dimension.group {
        Group::Position => "pixels of the film",
        Group::Colour => "linear radiance",
        Group::Feature(Feature::WorldPosition) => "scene diameters, from render space's origin",
        Group::Feature(Feature::Normal) => "unit vector",
        Group::Feature(Feature::Albedo) => "reflectance",
        Group::Random => "[0, 1)",
        Group::Auxiliary if dimension.name == "hit" => "1 or 0",
        Group::Auxiliary => "linear radiance",
    }
}

fn reservoir<W: Write + Seek>(store: &Store, npz: &mut Npz<W>) -> io::Result<()> {
    let (width, height, dims) = (store.width(), store.height(), store.layout().len());
    let pixels = || store.rows().iter().flat_map(|row| (0..width).map(move |x| row.reservoir(x)));
    let count = |vectors: &[f32]| (vectors.len() / dims) as u32;
    npz.array("reservoir_count", &[height, width], pixels().map(count))?;
    let size = store.capacity() * dims;
    let padded =
        pixels().flat_map(|vectors| vectors.iter().copied().chain(std::iter::repeat(0.0)).take(size));
    npz.array("reservoir", &[height, width, store.capacity(), dims], padded)
}

fn maps<W: Write + Seek>(Filtered { result, estimate, .. }: &Filtered, npz: &mut Npz<W>) -> io::Result<()> {
    let mut planes = |name: &str, planes: &Planes| {
        let shape = [planes.count(), planes.height(), planes.width()];
        let shape = if planes.count() == 1 { &shape[1..] } else { &shape };
        npz.array(name, shape, planes.data().iter().copied())
    };
    planes("image", &result.image)?;
    planes("variance", &result.variance)?;
    planes("residual", &result.residual)?;
    planes("error", &result.error)?;
    if let Some(interpolation) = &result.interpolation {
        planes("interpolation_failure", &interpolation.failure)?;
    }
    match estimate {
        Some(estimate) => planes("tile_error", &estimate.tiles),
        None => Ok(()),
    }
}

fn weights<W: Write + Seek>(state: &RenderState, npz: &mut Npz<W>) -> io::Result<()> {
    let store = &state.checkpoint.store;
    let (names, passes) = prpf::feature_weights(store, &PrpfSettings::paper(), state.settings.seed);
    let shape = [passes.len(), names.len(), store.height(), store.width()];
    npz.array("feature_weights", &shape, passes.iter().flat_map(|pass| pass.data().iter().copied()))?;
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    npz.texts("feature_weight_names", &[names.len()], &names)?;
    let first = first_pass(store, state.settings.seed);
    npz.array("first_pass", &[first.count(), first.height(), first.width()], first.data().iter().copied())
}

/// Filters with the first pass alone, so that another implementation can be compared without running all four.
fn first_pass(store: &Store, seed: u64) -> Planes {
    let paper = PrpfSettings::paper();
    let fireflies = FireflySettings { redistribution_window: 0, ..paper.fireflies };
    let windows = paper.windows[..1].to_vec();
    prpf::filter(store, &PrpfSettings { windows, fireflies, ..paper }, seed).image
}
