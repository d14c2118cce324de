//! Whether a render fits in memory, said before any is taken.

use anyhow::bail;
use sysinfo::System;

use crate::progressive::{Denoiser, NO_CEILING, PixelMemory, Settings};
use crate::state;
use crate::stats::{BLOCK, Layout};

/// Refuses a render whose store, filter and, if it `keeps` states, copy of the store would not fit in
/// the memory that is left.
///
/// # Errors
/// One line: what is needed, what there is, what would fit.
pub(super) fn fits(
    layout: &Layout,
    settings: &Settings,
    size: (usize, usize),
    keeps: bool,
) -> anyhow::Result<()> {
    let memory = PixelMemory::of(layout, settings);
    let rpf = settings.denoiser == Denoiser::Rpf;
    if rpf && memory.samples >= NO_CEILING as usize {
        bail!(
            "--denoiser rpf keeps all samples of a pixel whole, and has to know how many these can be: \
             add --spp N or --max-spp N"
        );
    }
    let copy = if keeps { state::size(layout, memory.samples, 1).unwrap_or(usize::MAX) } else { 0 };
    within(available_bytes(), &memory, copy, size, rpf)
}

fn within(
    available: f64,
    memory: &PixelMemory,
    copy: usize,
    (width, height): (usize, usize),
    rpf: bool,
) -> anyhow::Result<()> {
    /// The filters hold planes of their own beside the store.
    const BESIDE_STORE: f64 = 1.5;
    let pixels = width as f64 * height as f64;
    // Statistics come in whole blocks of a row.
    let blocks = width.next_multiple_of(BLOCK) as f64 / width.max(1) as f64;
    let statistics = memory.statistics as f64 * BESIDE_STORE * blocks + copy as f64;
    let samples = memory.samples as f64 * memory.per_sample as f64;
    let needed = (statistics + samples) * pixels;
    if needed <= available {
        return Ok(());
    }
    let whole = match memory.samples {
        0 => String::new(),
        kept => format!(" with {kept} samples each kept whole"),
    };
    let fewer = ((available / pixels - statistics) / memory.per_sample as f64).floor();
    let fewer =
        if rpf && fewer >= 1.0 { format!(", or these with --max-spp {fewer}") } else { String::new() };
    bail!(
        "{width}x{height} pixels{whole} need about {:.1} GB of memory, {:.1} GB are available; up to {:.0} pixels would \
         fit{fewer}",
        needed / 1e9,
        available / 1e9,
        (available / (statistics + samples)).floor()
    )
}

/// Memory left to this process: of the machine, or of the control group (a container) that it runs in.
fn available_bytes() -> f64 {
    let mut system = System::new();
    system.refresh_memory();
    let group = system.cgroup_limits().map_or(u64::MAX, |group| group.total_memory.saturating_sub(group.rss));
    system.available_memory().min(group) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEMORY: PixelMemory = PixelMemory { statistics: 1000, samples: 10, per_sample: 100 };

    fn refused(available: f64, copy: usize, size: (usize, usize), rpf: bool) -> String {
        within(available, &MEMORY, copy, size, rpf).map_or_else(|error| error.to_string(), |()| String::new())
    }

    #[test]
    fn what_would_fit_is_said_and_does_fit() {
        // 1.5 times the statistics and ten samples of each pixel.
        assert_eq!(refused(2500.0 * 1024.0, 0, (32, 32), false), "");
        let said = refused(2500.0 * 1023.0, 0, (32, 32), false);
        assert!(said.contains("10 samples each kept whole") && said.contains("up to 1023 pixels"), "{said}");
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
    fn some_memory_is_left_to_this_test() {
        assert!(available_bytes() > 1e6);
    }
}
