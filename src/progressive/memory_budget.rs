//! The memory that a render needs: whether it fits, before any is taken.

use super::excerpt::excerpt_pixels;
use super::settings::{PixelMemory, Settings};
use crate::adaptive::NO_CEILING;
use crate::filter::SampleVectors;
use crate::memory::{available_bytes, format_bytes};
use crate::stats::{Layout, PIXEL_BLOCK, Row, Store};

/// In one line: what is needed, what there is, what would fit.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct MemoryError(String);

/// Checks that the store, the filter and, if checkpoints are kept, a copy of the store fit in the memory that is
/// available, as far as that is known. `size` in pixels. Of several `processes` it is the first one that is checked: it holds
/// the whole image and its own part.
///
/// # Errors
/// They do not fit, or their size has no bound.
pub fn fits_in_memory(
    layout: &Layout,
    settings: &Settings,
    size: (usize, usize),
    keeps_checkpoints: bool,
    processes: usize,
) -> Result<(), MemoryError> {
    let Some(demand) = Demand::new(layout, settings, keeps_checkpoints, processes) else {
        return Err(MemoryError(format!(
            "--denoiser {} keeps all sample vectors, whose number has no limit here: add --spp N or --max-spp N",
            settings.denoiser.name()
        )));
    };
    available_bytes().map_or(Ok(()), |available| demand.fits(available, size))
}

/// Returns the bytes that such a render takes in one process, as [`fits_in_memory`] counts them; `None` if they have no bound.
pub fn memory_needed(
    layout: &Layout,
    settings: &Settings,
    size: (usize, usize),
    keeps_checkpoints: bool,
) -> Option<f64> {
    Demand::new(layout, settings, keeps_checkpoints, 1).map(|demand| demand.bytes(size))
}

/// Bytes beside those of pixels: what threads hold, blocks of an image that is being written. Measured, 60 MB with two threads, of
/// which some 30 are taken before.
const FIXED: f64 = 6e7;

/// The memory that a render demands.
#[derive(Clone, Copy)]
struct Demand {
    memory: PixelMemory,
    /// Bytes of a pixel's statistics beside the store: in a checkpoint, and in the parts of several processes.
    copies: usize,
    /// Bytes of a pixel during a filter pass.
    pass: usize,
    /// Whether images of the halves are made for the error estimate.
    has_half_images: bool,
    /// Whether all sample vectors are kept.
    keeps_all: bool,
}

impl Demand {
    /// The demand of a render with these settings, in the first of its processes; `None` if it has no bound.
    fn new(layout: &Layout, settings: &Settings, keeps_checkpoints: bool, processes: usize) -> Option<Self> {
        let mut memory = PixelMemory::new(layout, settings);
        let denoiser = settings.denoiser;
        let keeps_all = matches!(denoiser.reads().sample_vectors, SampleVectors::All { .. });
        if keeps_all && memory.sample_vectors >= NO_CEILING as usize {
            return None;
        }
        let mut copies = 0;
        if keeps_checkpoints {
            let bytes = |samples| Row::byte_len(1, layout, samples).unwrap_or(usize::MAX);
            copies = bytes(0);
            memory.per_sample_vector += bytes(1) - bytes(0);
        }
        if processes > 1 {
            // Its own part, and the bytes of another one while it gathers
            let bytes = |samples| (2 * Store::bytes_per_pixel(layout, samples)).div_ceil(processes);
            copies += bytes(0);
            memory.per_sample_vector += bytes(1) - bytes(0);
        }
        // Under a time budget that of squares may filter the pixels
        let substitute = settings.budget.seconds.map_or(denoiser, |_| settings.square_denoiser());
        let pass = denoiser.cost().bytes.max(substitute.cost().bytes);
        let has_half_images = denoiser.is_judged_by_halves();
        Some(Self { memory, copies, pass, has_half_images, keeps_all })
    }

    /// Returns the bytes of an image of this size, in pixels, without its sample vectors.
    fn without_sample_vectors(&self, (width, height): (usize, usize)) -> f64 {
        // Statistics come in whole blocks of a row.
        let blocks = width.next_multiple_of(PIXEL_BLOCK) as f64 / width.max(1) as f64;
        self.bytes_for_pixels(width as f64 * height as f64, blocks)
    }

    /// Returns the same of a number of pixels, each of which takes the statistics of `blocks` pixels.
    fn bytes_for_pixels(&self, pixels: f64, blocks: f64) -> f64 {
        /// The filters hold planes of their own beside the store, more of them the more it holds.
        const BESIDE_STORE: f64 = 0.5;
        let (store, pass) = (self.memory.statistics as f64 * blocks, self.pass as f64);
        let whole_pass = pixels * pass.max(BESIDE_STORE * store);
        // The excerpt, a store of each of its halves, and a pass over one of these
        let half_images =
            if self.has_half_images { excerpt_pixels(pixels) * (3.0 * store + pass) } else { 0.0 };
        FIXED + pixels * (store + self.copies as f64) + whole_pass.max(half_images)
    }

    /// Returns the bytes of a pixel's sample vectors.
    fn sample_vector_bytes(&self) -> f64 {
        self.memory.sample_vectors as f64 * self.memory.per_sample_vector as f64
    }

    fn bytes(&self, size: (usize, usize)) -> f64 {
        self.without_sample_vectors(size) + self.sample_vector_bytes() * (size.0 as f64 * size.1 as f64)
    }

    fn fits(&self, available: f64, size: (usize, usize)) -> Result<(), MemoryError> {
        let needed = self.bytes(size);
        if needed <= available {
            return Ok(());
        }
        let (width, height) = size;
        let whole = match self.memory.sample_vectors {
            0 => String::new(),
            size => format!(" with {size} sample vectors each"),
        };
        let per_sample_vector = self.memory.per_sample_vector as f64 * (width as f64 * height as f64);
        let fewer = ((available - self.without_sample_vectors(size)) / per_sample_vector).floor();
        let fewer = if self.keeps_all && fewer >= 1.0 {
            format!(", or these with --max-spp {fewer}")
        } else {
            String::new()
        };
        let pixels = self.most_pixels(available, size);
        let fit = if pixels > 0 {
            format!("up to {pixels} pixels would fit")
        } else {
            "no image would fit".to_owned()
        };
        Err(MemoryError(format!(
            "{width}x{height} pixels{whole} need about {} of memory, and {} are available; {fit}{fewer}",
            format_bytes(needed),
            format_bytes(available),
        )))
    }

    /// Returns how many pixels would fit, in whole blocks, below a size that does not.
    fn most_pixels(&self, available: f64, (width, height): (usize, usize)) -> u64 {
        let fits = |&pixels: &u64| {
            self.bytes_for_pixels(pixels as f64, 1.0) + self.sample_vector_bytes() * pixels as f64
                <= available
        };
        let (mut least, mut most) = (0, width as u64 * height as u64);
        while most - least > 1 {
            let middle = least + (most - least) / 2;
            if fits(&middle) { least = middle } else { most = middle }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{Denoiser, learned, nlm};
    use crate::progressive::budget::Budget;

    const MEMORY: PixelMemory = PixelMemory { statistics: 1000, sample_vectors: 10, per_sample_vector: 100 };

    fn demand(copies: usize, pass: usize, keeps_all: bool) -> Demand {
        Demand { memory: MEMORY, copies, pass, has_half_images: false, keeps_all }
    }

    /// Returns what is said with these bytes beside the fixed ones.
    fn refused(available: f64, copies: usize, size: (usize, usize), keeps_all: bool) -> String {
        demand(copies, 400, keeps_all)
            .fits(FIXED + available, size)
            .map_or_else(|error| error.to_string(), |()| String::new())
    }

    #[test]
    fn what_would_fit_is_said_and_does_fit() {
        // 1.5 times the statistics and ten samples of each pixel.
        assert_eq!(refused(2500.0 * 1024.0, 0, (32, 32), false), "");
        let said = refused(2500.0 * 1023.0, 0, (32, 32), false);
        assert!(said.contains("10 sample vectors each") && said.contains("up to 1023 pixels"), "{said}");
        assert!(!said.contains("--max-spp"), "{said}");
        let said = refused(2300.0 * 1024.0, 0, (32, 32), true);
        assert!(said.contains("--max-spp 8"), "{said}");
        assert!(refused(-1.0, 0, (32, 32), true).contains("no image would fit"));
    }

    #[test]
    fn a_states_copy_and_the_blocks_of_narrow_images_count() {
        assert!(!refused(2500.0 * 1024.0, 1, (32, 32), false).is_empty());
        // A column takes as many statistics as sixteen.
        assert!(!refused((1500.0 * 16.0 + 1000.0) * 50.0 - 1.0, 0, (1, 50), false).is_empty());
        assert_eq!(refused((1500.0 * 16.0 + 1000.0) * 50.0, 0, (1, 50), false), "");
    }

    #[test]
    fn the_parts_of_several_processes_count() {
        let layout = Layout::with_blocks(|_| true);
        let settings = Settings { reservoir: 4, ..Settings::default() };
        let bytes =
            |processes| Demand::new(&layout, &settings, true, processes).expect("a bound").bytes((64, 64));
        let store = Store::bytes_per_pixel(&layout, settings.reservoir_capacity()) as f64 * 64.0 * 64.0;
        for (processes, stores) in [(1, 0.0), (2, 1.0), (8, 0.25)] {
            let found = (bytes(processes) - bytes(1)) / store;
            assert!((found - stores).abs() < 0.05, "{processes}: {found}");
        }
    }

    #[test]
    fn the_pass_that_may_take_the_place_of_the_chosen_one_counts() {
        let layout = Layout::with_blocks(|_| false);
        let pass = |seconds| {
            let budget = Budget { seconds, ..Budget::default() };
            let settings = Settings { budget, denoiser: &nlm::DRAFT, ..Settings::default() };
            Demand::new(&layout, &settings, false, 1).expect("a bound").pass
        };
        assert_eq!(pass(None), nlm::DRAFT.cost().bytes);
        assert_eq!(pass(Some(1.0)), learned::DRAFT.cost().bytes);
    }

    #[test]
    fn what_a_pass_holds_counts_where_it_is_more_than_half_of_the_store() {
        let needs = |pass| (1000 + pass + 1000) as f64;
        for (pass, counted) in [(500, 500), (700, 700), (100, 500)] {
            let demand = demand(0, pass, false);
            assert!(demand.fits(FIXED + 16.0 * needs(counted), (16, 1)).is_ok(), "{pass}");
            assert!(demand.fits(FIXED + 16.0 * needs(counted) - 1.0, (16, 1)).is_err(), "{pass}");
        }
    }

    #[test]
    fn images_of_the_halves_decide_where_the_excerpt_is_the_whole_image() {
        let demand = Demand { has_half_images: true, ..demand(0, 700, false) };
        let bytes = |side| (demand.bytes((side, side)) - FIXED) / (side * side) as f64;
        assert_eq!(bytes(128), 1000.0 + 1000.0 + 3.0 * 1000.0 + 700.0);
        assert_eq!(bytes(1024), 1000.0 + 1000.0 + 700.0);
    }
}
