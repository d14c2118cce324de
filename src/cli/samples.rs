//! `--samples`: the file of all samples of a render.

use std::path::Path;

use anyhow::Context;

use super::failure::Failure;
use super::terminal::{escaped, print_error};
use crate::adaptive::SampleMap;
use crate::memory::format_bytes;
use crate::progressive::Settings;
use crate::render::Renderer;
use crate::state::SampleFile;

/// Begins the file, and prints its size. `taken`: samples of an earlier run, which it does not get.
pub(super) fn begin(
    path: &Path,
    renderer: &Renderer,
    settings: &Settings,
    taken: u64,
    is_quiet: bool,
) -> Result<SampleFile, Failure> {
    if !is_quiet {
        let (width, height) = renderer.resolution();
        let pixels = (width * height) as u64;
        let all = settings.sample_map.as_ref().and_then(SampleMap::total);
        let all = all.or(settings.budget.spp.map(|spp| u64::from(spp) * pixels));
        let bytes = SampleFile::bytes_per_sample(renderer.layout()) as u64;
        let predicted = predict(all.map(|all| all.saturating_sub(taken)), bytes, pixels);
        print_error(&escaped(&format!("{}: {predicted}", path.display())));
    }
    let begun = SampleFile::begin(path, renderer.layout());
    begun.with_context(|| format!("{}: cannot begin to write", path.display())).map_err(Failure::Run)
}

/// Waits until the file is complete.
pub(super) fn finish(file: Option<SampleFile>, path: Option<&Path>) -> Result<(), Failure> {
    let result = file.map_or(Ok(()), SampleFile::finish);
    let name = path.map(|path| path.display().to_string()).unwrap_or_default();
    result.with_context(|| format!("{name}: cannot write the samples")).map_err(Failure::Run)
}

/// Describes the size of a file of `samples` samples, whose number may not be known.
fn predict(samples: Option<u64>, bytes: u64, pixels: u64) -> String {
    let size = |samples: u64| format_bytes(samples as f64 * bytes as f64);
    match samples {
        Some(samples) => format!("at most {} ({samples} samples of {bytes} bytes)", size(samples)),
        None => format!("{} for each sample per pixel ({bytes} bytes a sample)", size(pixels)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_predicted() {
        assert_eq!(predict(Some(30_000_000), 100, 1), "at most 3.0 GB (30000000 samples of 100 bytes)");
        assert!(predict(Some(1 << 60), 100, 1).contains("115"), "{}", predict(Some(1 << 60), 100, 1));
        assert_eq!(predict(None, 100, 50_000), "5.0 MB for each sample per pixel (100 bytes a sample)");
    }
}
