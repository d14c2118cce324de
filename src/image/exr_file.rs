//! Reads and writes OpenEXR files with named channels and attributes (openexr.com, "OpenEXR File
//! Layout").
//!
//! Layers are prefixes of channel names, as in pbrt and tev: `R` `G` `B` is the image itself,
//! `Albedo.R` belongs to the layer `Albedo`.

mod attribute;
mod read;
#[cfg(test)]
mod tests;
mod write;
mod zip;

use exr::meta::attribute::IntegerBounds;
use exr::meta::header::{ImageAttributes, LayerAttributes};

pub use attribute::Attribute;
pub use read::{
    ExrInfo, ExrPart, read_channels, read_info, read_layer, read_metadata, read_part, read_parts,
};
pub use write::{encode, write, write_with_metadata};

/// The first bytes of every EXR file.
pub const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Attribute names of pbrt, which other programs read.
pub mod attribute_names {
    /// Mean number of samples per pixel; [`Int`](super::Attribute::Int).
    pub const SAMPLES_PER_PIXEL: &str = "samplesPerPixel";
    /// Wall time of the render in seconds; [`Float`](super::Attribute::Float).
    pub const RENDER_TIME_SECONDS: &str = "renderTimeSeconds";
    /// Mean squared error with respect to a reference; [`Float`](super::Attribute::Float).
    pub const MSE: &str = "MSE";
}

/// Precision of stored values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit float: 11 significant bits. Finite values beyond ±65504 are stored as ±65504, because an
    /// infinity would spread in later processing.
    Half,
    /// 32-bit float: values are stored exactly.
    Float,
}

impl Precision {
    /// Bytes of a value.
    fn bytes(self) -> usize {
        match self {
            Self::Half => 2,
            Self::Float => 4,
        }
    }
}

/// A channel to be written.
#[derive(Clone, Debug)]
pub struct Channel<'a> {
    /// Full name with its layer: `R`, `Albedo.R`, `SampleCount.X`.
    pub name: String,
    /// Row by row from the top left, width × height values.
    pub values: &'a [f32],
    pub precision: Precision,
}

impl<'a> Channel<'a> {
    pub fn new(name: impl Into<String>, values: &'a [f32], precision: Precision) -> Self {
        Self { name: name.into(), values, precision }
    }
}

/// The position of the stored pixels and of the image that is shown: EXR's data and display windows, half-open bounds x0, x1,
/// y0, y1 (pbrt's order).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Windows {
    /// The stored pixels. They may lie outside the display window, as those of overscan do.
    pub data: [i32; 4],
    pub display: [i32; 4],
}

impl Windows {
    /// The windows of an image that is stored whole.
    pub fn whole(width: usize, height: usize) -> Self {
        Self::in_film([0, width, 0, height], [width, height])
    }

    /// The windows of a part of a film of this width and height.
    pub fn in_film(part: [usize; 4], [width, height]: [usize; 2]) -> Self {
        let bounds = |bounds: [usize; 4]| bounds.map(|bound| i32::try_from(bound).unwrap_or(i32::MAX));
        Self { data: bounds(part), display: bounds([0, width, 0, height]) }
    }

    /// Width of the stored pixels; 0 if the bounds are reversed.
    pub fn width(&self) -> usize {
        side(self.data[0], self.data[1])
    }

    /// Height of the stored pixels; 0 if the bounds are reversed.
    pub fn height(&self) -> usize {
        side(self.data[2], self.data[3])
    }
}

fn side(begin: i32, end: i32) -> usize {
    (i64::from(end) - i64::from(begin)).max(0) as usize
}

/// What the header of a file says beside the image: attributes of every type.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    shared: ImageAttributes,
    own: LayerAttributes,
}

impl Default for Metadata {
    fn default() -> Self {
        Self { shared: ImageAttributes::new(IntegerBounds::zero()), own: LayerAttributes::default() }
    }
}
