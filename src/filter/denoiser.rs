//! The interface of a denoiser: a reconstruction method with one of its presets.
//!
//! A denoiser filters a store. It also states its name, the data that it reads, its cost and the cheaper denoiser that replaces it in interim passes. `denoisers` lists all of them.

use super::denoiser_name::DenoiserName;
use super::result::FilterResult;
use super::whole_image::WholeImage;
use crate::image::Planes;
use crate::stats::{Block, Store};

/// A method of reconstruction with one of its presets.
pub trait Denoiser: Send + Sync {
    /// Returns the name that image files, reports, states and the page show.
    fn name(&self) -> DenoiserName;

    /// Returns one line for lists of denoisers.
    fn summary(&self) -> &'static str;

    /// Returns what the denoiser reads of a store.
    fn reads(&self) -> Reads;

    /// Returns what a filter pass costs.
    fn cost(&self) -> Cost;

    /// Returns the cheaper denoiser for interim passes; itself if there is none.
    fn stand_in(&self) -> &'static dyn Denoiser;

    /// Returns the samples per pixel below which squares of pixels are better filtered (`sparse_filtering`); 0, the default, for a
    /// denoiser that cannot filter them: its values do not depend on other pixels, or it reads sample vectors.
    fn least_spp(&self) -> f64 {
        0.0
    }

    /// Returns what the denoiser needs and this machine lacks; `None` if it can be used.
    fn missing(&self) -> Option<&'static str> {
        None
    }

    /// Returns the name of the trained weights that it filters by, for outputs; `None` if it has none.
    fn weights(&self) -> Option<&'static str> {
        None
    }

    /// Returns whether the error of its image is estimated by the images that it makes of each half of the samples alone: its
    /// weights follow the values that they filter, and it reads no sample vectors.
    fn is_judged_by_halves(&self) -> bool {
        false
    }

    /// Filters a store. The result depends on `seed` and not on the number of threads.
    fn filter(&self, store: &Store, seed: u64) -> FilterResult;

    /// Returns how the denoiser filters parts of an image; `None`, the default, if it needs whole images.
    fn parts(&self) -> Option<&dyn PartFilter> {
        None
    }

    /// Returns how the denoiser filters layers of the colour; `None`, the default, if it cannot.
    fn layers(&self) -> Option<&dyn LayerFilter> {
        None
    }
}

/// A denoiser that can filter layers that sum to the colour, such as light groups, by the weights of the colour.
pub trait LayerFilter {
    /// Filters a store, and layers: of each the means of both halves of the samples, 3 planes. Returns the filtered layers as
    /// well, which sum to the image without directly visible emission up to rounding.
    fn filter_with_layers(
        &self,
        store: &Store,
        seed: u64,
        layers: &[[Planes; 2]],
    ) -> (FilterResult, Vec<Planes>);
}

/// A denoiser that can filter the parts of an image one by one, to the same result as the whole. Every pixel needs two
/// samples.
pub trait PartFilter {
    /// Returns the width in pixels of the margin that a part needs on each side, as far as the image extends.
    fn margin(&self) -> usize;

    /// Filters a part with its margin, whose results are not of use.
    fn filter_part(&self, store: &Store, whole: &dyn WholeImage) -> FilterResult;
}

/// The data of a store that a denoiser reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reads {
    /// Blocks of dimensions whose statistics it reads, where the scene calls for them: by default a render keeps no
    /// others. One that reads sample vectors finds all.
    pub blocks: &'static [Block],
    pub sample_vectors: SampleVectors,
}

/// Number of sample vectors of a pixel that a denoiser reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleVectors {
    None,
    /// A reservoir of this size per pixel.
    Reservoir(usize),
    /// All of them; each takes this many additional bytes during a filter pass.
    All {
        bytes_beside: usize,
    },
}

/// The cost of a filter pass, measured once on two cores. It is the estimate until a pass has been timed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Seconds of one core per pixel, from the start of the pass until the image is written, with memory at hand.
    pub core_seconds: f64,
    /// Bytes per pixel that it takes, beside the store.
    pub bytes: usize,
    /// Time of a pass with reused memory, in units of a pass of `nlm draft`.
    pub pass_time: f64,
    /// Whether the times are per sample of a pixel instead of per pixel.
    pub is_per_sample: bool,
}

impl Cost {
    /// Assumed seconds of one core for a byte of new memory, unless less is measured: on virtual machines 0.1 to 3 seconds per
    /// gigabyte were.
    pub const MEMORY_SECONDS: f64 = 2e-9;

    /// Returns [`Self::core_seconds`] with new memory, of which a byte takes a core `memory_seconds`.
    pub fn core_seconds_with(&self, memory_seconds: f64) -> f64 {
        self.core_seconds + self.bytes as f64 * memory_seconds
    }
}

impl PartialEq for dyn Denoiser {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl std::fmt::Debug for dyn Denoiser {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}", self.name())
    }
}
