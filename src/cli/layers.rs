//! The layers of the EXR, in pbrt's spellings where pbrt has one.

use crate::filter::{self, Filtered};
use crate::image::Planes;
use crate::image::exr_file::{Channel, Precision};
use crate::progressive::ErrorEstimate;
use crate::state::ImageMetadata;
use crate::stats::{Block, Part, Store};

/// A named layer: its channels' suffixes, one plane each.
struct Layer {
    /// Empty for the image itself.
    name: &'static str,
    suffixes: &'static [&'static str],
    planes: Planes,
    precision: Precision,
}

const RGB: &[&str] = &["R", "G", "B"];
const XYZ: &[&str] = &["X", "Y", "Z"];
const X: &[&str] = &["X"];

/// Of layers beside the image.
const NAMES: [&str; 10] = [
    "Noisy",
    "Albedo",
    "Ns",
    "P",
    "Variance",
    "Error",
    "SampleCount",
    "InterpolationFailure",
    "FilterResidual",
    "TileError",
];

/// All layers of a finished render.
pub(super) struct Layers(Vec<Layer>);

impl Layers {
    pub fn of(
        filtered: &Filtered,
        store: &Store,
        estimate: Option<&ErrorEstimate>,
        metadata: &ImageMetadata,
    ) -> Self {
        use Precision::{Float, Half};
        let layout = store.layout();
        let mut layers = Vec::new();
        let mut add =
            |name, suffixes, planes, precision| layers.push(Layer { name, suffixes, planes, precision });
        add("", RGB, filtered.image.clone(), Float);
        add("Noisy", RGB, store.means(Part::Whole, layout.radiance()), Float);
        if let Some(dims) = layout.block(Block::Albedo) {
            add("Albedo", RGB, store.means(Part::Whole, dims), Half);
        }
        if let Some(dims) = layout.block(Block::Normal1) {
            add("Ns", XYZ, store.means(Part::Whole, dims), Half);
        }
        if let Some(dims) = layout.block(Block::Position1) {
            let mut position = store.means(Part::Whole, dims);
            for (plane, origin) in position.planes_mut().zip(metadata.origin) {
                plane.iter_mut().for_each(|v| *v = (f64::from(*v * metadata.diameter) + origin) as f32);
            }
            add("P", XYZ, position, Float);
        }
        add("Variance", RGB, filter::variance_of_mean(store), Float);
        add("Error", X, filtered.error.clone(), Float);
        add("SampleCount", X, store.count_plane(), Float);
        if let Some(failure) = &filtered.interpolation_failure {
            add("InterpolationFailure", X, failure.clone(), Half);
        }
        add("FilterResidual", X, filtered.residual.clone(), Float);
        if let Some(estimate) = estimate {
            add("TileError", X, estimate.of_pixels(store.width(), store.height()), Float);
        }
        Self(layers)
    }

    /// Whether there can be layers of these names: known before any filtering.
    ///
    /// # Errors
    /// A name that no layer ever has.
    pub fn check(names: &[String]) -> anyhow::Result<()> {
        match names.iter().find(|name| !NAMES.contains(&name.as_str())) {
            Some(unknown) => anyhow::bail!("--layers: found `{unknown}`; accepted are {}", NAMES.join(", ")),
            None => Ok(()),
        }
    }

    /// Leaves out all but the image and the layers of these names.
    ///
    /// # Errors
    /// A name of no layer that there is.
    pub fn keep_only(&mut self, names: &[String]) -> anyhow::Result<()> {
        let known: Vec<&str> =
            self.0.iter().map(|layer| layer.name).filter(|name| !name.is_empty()).collect();
        if let Some(unknown) = names.iter().find(|name| !known.contains(&name.as_str())) {
            anyhow::bail!("--layers: found `{unknown}`; accepted are {}", known.join(", "));
        }
        self.0.retain(|layer| layer.name.is_empty() || names.iter().any(|name| name == layer.name));
        Ok(())
    }

    /// The channels to write.
    pub fn channels(&self) -> Vec<Channel<'_>> {
        let of_layer = |layer: &'_ Layer| -> Vec<(String, usize)> {
            let name = |suffix: &&str| {
                if layer.name.is_empty() { suffix.to_string() } else { format!("{}.{suffix}", layer.name) }
            };
            layer.suffixes.iter().map(name).zip(0..).collect()
        };
        self.0
            .iter()
            .flat_map(|layer| {
                of_layer(layer)
                    .into_iter()
                    .map(move |(name, plane)| Channel::new(name, layer.planes.plane(plane), layer.precision))
            })
            .collect()
    }
}
