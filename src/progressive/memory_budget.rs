//! The memory of a render: whether it fits, before any is taken, and how much it has taken.

use sysinfo::System;

use super::settings::{NO_CEILING, PixelMemory, Settings};
use crate::filter::SampleVectors;
use crate::stats::{Layout, PIXEL_BLOCK, Row};

/// In one line: what is needed, what there is, what would fit.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct MemoryError(String);

/// Checks that the store, the filter and, if checkpoints are kept, a copy of the store fit in the memory that is
/// available, as far as that is known. `size` in pixels.
///
/// # Errors
/// They do not fit, or their size has no bound.
pub fn fits_in_memory(
    layout: &Layout,
    settings: &Settings,
    size: (usize, usize),
    keeps_checkpoints: bool,
) -> Result<(), MemoryError> {
    let mut memory = PixelMemory::new(layout, settings);
    let keeps_all = matches!(settings.denoiser.reads().sample_vectors, SampleVectors::All { .. });
    if keeps_all && memory.sample_vectors >= NO_CEILING as usize {
        return Err(MemoryError(format!(
            "--denoiser {} keeps all sample vectors, whose number has no limit here: add --spp N or --max-spp N",
            settings.denoiser.name()
        )));
    }
    let mut copy = 0;
    if keeps_checkpoints {
        let bytes = |samples| Row::byte_len(1, layout.len(), samples).unwrap_or(usize::MAX);
        copy = bytes(0);
        memory.per_sample_vector += bytes(1) - bytes(0);
    }
    let pass = settings.denoiser.cost().bytes;
    available_bytes().map_or(Ok(()), |available| within(available, &memory, copy, pass, size, keeps_all))
}

/// `copy`: bytes of a pixel's statistics in a checkpoint; `pass`: bytes of a pixel during a filter pass.
fn within(
    available: f64,
    memory: &PixelMemory,
    copy: usize,
    pass: usize,
    (width, height): (usize, usize),
    keeps_all: bool,
) -> Result<(), MemoryError> {
    /// The filters hold planes of their own beside the store, more of them the more it holds.
    const BESIDE_STORE: f64 = 0.5;
    let pixels = width as f64 * height as f64;
    // Statistics come in whole blocks of a row.
    let blocks = width.next_multiple_of(PIXEL_BLOCK) as f64 / width.max(1) as f64;
    let store = memory.statistics as f64 * blocks;
    let statistics = store + (BESIDE_STORE * store).max(pass as f64) + copy as f64;
    let samples = memory.sample_vectors as f64 * memory.per_sample_vector as f64;
    let needed = (statistics + samples) * pixels;
    if needed <= available {
        return Ok(());
    }
    let whole = match memory.sample_vectors {
        0 => String::new(),
        size => format!(" with {size} sample vectors each"),
    };
    let fewer = ((available / pixels - statistics) / memory.per_sample_vector as f64).floor();
    let fewer =
        if keeps_all && fewer >= 1.0 { format!(", or these with --max-spp {fewer}") } else { String::new() };
    Err(MemoryError(format!(
        "{width}x{height} pixels{whole} need about {:.1} GB of memory, {:.1} GB are available; up to {:.0} \
         pixels would fit{fewer}",
        needed / 1e9,
        available / 1e9,
        (available / (statistics + samples)).floor()
    )))
}

/// Returns the memory that the program holds now (`VmRSS`) or has held at most (`VmHWM`), if the system tells.
pub fn memory_bytes(kind: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(kind)?.strip_prefix(':'))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// Returns the memory that is available to this process, of the machine or, if that is less, of its container; `None` if
/// the system does not tell.
fn available_bytes() -> Option<f64> {
    let mut system = System::new();
    system.refresh_memory();
    if system.total_memory() == 0 || system.available_memory() == 0 {
        return None;
    }
    let container = system.cgroup_limits().map_or(u64::MAX, |c| c.total_memory.saturating_sub(c.rss));
    Some(system.available_memory().min(container) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEMORY: PixelMemory = PixelMemory { statistics: 1000, sample_vectors: 10, per_sample_vector: 100 };

    fn refused(available: f64, copy: usize, size: (usize, usize), keeps_all: bool) -> String {
        within(available, &MEMORY, copy, 400, size, keeps_all)
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
    }

    #[test]
    fn a_states_copy_and_the_blocks_of_narrow_images_count() {
        assert!(!refused(2500.0 * 1024.0, 1, (32, 32), false).is_empty());
        // A column takes as many statistics as sixteen.
        assert!(!refused((1500.0 * 16.0 + 1000.0) * 50.0 - 1.0, 0, (1, 50), false).is_empty());
        assert_eq!(refused((1500.0 * 16.0 + 1000.0) * 50.0, 0, (1, 50), false), "");
    }

    #[test]
    fn what_a_pass_holds_counts_where_it_is_more_than_half_of_the_store() {
        let needs = |pass| (1000 + pass + 1000) as f64;
        for (pass, counted) in [(500, 500), (700, 700), (100, 500)] {
            assert!(within(16.0 * needs(counted), &MEMORY, 0, pass, (16, 1), false).is_ok(), "{pass}");
            assert!(within(16.0 * needs(counted) - 1.0, &MEMORY, 0, pass, (16, 1), false).is_err(), "{pass}");
        }
    }

    #[test]
    fn some_memory_is_left_to_this_test() {
        assert!(available_bytes().is_none_or(|bytes| bytes > 1e6));
    }
}
