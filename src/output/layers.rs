//! The layers of an EXR, in pbrt's spellings where pbrt has one.

use crate::filter::{self, FilterResult};
use crate::image::Planes;
use crate::image::exr_file::{Channel, Precision};
use crate::progressive::ErrorEstimate;
use crate::state::ImageMetadata;
use crate::stats::{Block, BlockSet, Part, Store};

const RGB: &[&str] = &["R", "G", "B"];
const XYZ: &[&str] = &["X", "Y", "Z"];
const X: &[&str] = &["X"];

/// What layers are computed from.
struct Source<'a> {
    result: &'a FilterResult,
    store: &'a Store,
    estimate: Option<&'a ErrorEstimate>,
    metadata: &'a ImageMetadata,
}

impl Source<'_> {
    /// Returns the means of a block of dimensions; `None` if the layout does not have it.
    fn means(&self, block: Block) -> Option<Planes> {
        Some(self.store.means(Part::Whole, self.store.layout().block(block)?))
    }

    /// Returns the mean position in world space.
    fn position(&self) -> Option<Planes> {
        let mut position = self.means(Block::Position1)?;
        for (plane, origin) in position.planes_mut().zip(self.metadata.origin) {
            plane.iter_mut().for_each(|v| *v = (f64::from(*v * self.metadata.diameter) + origin) as f32);
        }
        Some(position)
    }
}

/// How a layer is computed; `None` if this render does not have it.
type Compute = fn(&Source) -> Option<Planes>;

/// A layer: name, suffixes of the channels (one plane each), precision, the block of dimensions whose statistics it reads
/// beside the radiance, and how it is computed.
type Row = (&'static str, &'static [&'static str], Precision, Option<Block>, Compute);
/// All layers. The image itself has no name. To add a layer, add a row.
const TABLE: &[Row] = &[
    ("", RGB, Precision::Float, None, |source| Some(source.result.image.clone())),
    ("Noisy", RGB, Precision::Float, None, |source| {
        Some(source.store.means(Part::Whole, source.store.layout().radiance()))
    }),
    ("Albedo", RGB, Precision::Half, Some(Block::Albedo), |source| source.means(Block::Albedo)),
    ("Ns", XYZ, Precision::Half, Some(Block::Normal1), |source| source.means(Block::Normal1)),
    ("P", XYZ, Precision::Float, Some(Block::Position1), |source| source.position()),
    ("Variance", RGB, Precision::Float, None, |source| Some(filter::variance_of_mean(source.store))),
    ("Error", X, Precision::Float, None, |source| Some(source.result.error.clone())),
    ("SampleCount", X, Precision::Float, None, |source| Some(source.store.count_plane())),
    ("InterpolationFailure", X, Precision::Half, None, |source| {
        Some(source.result.interpolation.as_ref()?.failure.clone())
    }),
    ("FilterResidual", X, Precision::Float, None, |source| Some(source.result.residual.clone())),
    ("TileError", X, Precision::Float, None, |source| {
        Some(source.estimate?.to_pixels(source.store.width(), source.store.height()))
    }),
];

/// A computed layer.
struct Layer {
    name: &'static str,
    suffixes: &'static [&'static str],
    precision: Precision,
    planes: Planes,
}

/// The layers of one image.
pub struct Layers(Vec<Layer>);

/// A name that no layer has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("--layers: found `{found}`; accepted are {accepted}")]
pub struct UnknownLayer {
    found: String,
    accepted: String,
}

impl Layers {
    /// Computes the image and the layers of these names, or all that this render has.
    pub fn new(
        result: &FilterResult,
        store: &Store,
        estimate: Option<&ErrorEstimate>,
        metadata: &ImageMetadata,
        names: Option<&[String]>,
    ) -> Self {
        let source = Source { result, store, estimate, metadata };
        let compute = |&(name, suffixes, precision, _, compute): &Row| {
            Some(Layer { name, suffixes, precision, planes: compute(&source)? })
        };
        Self(selected(names).filter_map(compute).collect())
    }

    /// Returns the blocks of dimensions whose statistics the layers of these names, or all layers, read.
    pub fn blocks_read(names: Option<&[String]>) -> BlockSet {
        selected(names).filter_map(|&(_, _, _, block, _)| block).collect()
    }

    /// Checks that some renders have layers of these names, before anything is rendered.
    ///
    /// # Errors
    /// A name that no layer ever has.
    pub fn check_names(names: &[String]) -> Result<(), UnknownLayer> {
        check(names, TABLE.iter().map(|&(name, ..)| name))
    }

    /// Checks that this render has layers of these names.
    ///
    /// # Errors
    /// A name that none of its layers has.
    pub fn check_present(&self, names: &[String]) -> Result<(), UnknownLayer> {
        check(names, self.0.iter().map(|layer| layer.name))
    }

    /// Returns the channels to write.
    pub fn channels(&self) -> Vec<Channel<'_>> {
        let channels = |layer: &'_ Layer| -> Vec<(String, usize)> {
            let name = |suffix: &&str| {
                if layer.name.is_empty() { suffix.to_string() } else { format!("{}.{suffix}", layer.name) }
            };
            layer.suffixes.iter().map(name).zip(0..).collect()
        };
        self.0
            .iter()
            .flat_map(|layer| {
                channels(layer)
                    .into_iter()
                    .map(move |(name, plane)| Channel::new(name, layer.planes.plane(plane), layer.precision))
            })
            .collect()
    }
}

/// Returns the rows of the image and of the layers of these names, or all.
fn selected(names: Option<&[String]>) -> impl Iterator<Item = &'static Row> {
    TABLE.iter().filter(move |(name, ..)| {
        name.is_empty() || names.is_none_or(|names| names.iter().any(|wanted| wanted == name))
    })
}

fn check(names: &[String], known: impl Iterator<Item = &'static str>) -> Result<(), UnknownLayer> {
    let known: Vec<&str> = known.filter(|name| !name.is_empty()).collect();
    match names.iter().find(|name| !known.contains(&name.as_str())) {
        Some(unknown) => Err(UnknownLayer { found: unknown.clone(), accepted: known.join(", ") }),
        None => Ok(()),
    }
}
