//! What a command leaves behind: images and the report.

use std::path::{Path, PathBuf};
use std::time::Instant;

use rayon::prelude::*;

use super::layers::Layers;
use super::report::{Report, Spread};
use crate::files;
use crate::filter::{Filtered, Quality};
use crate::image::exr_file::{self, Attribute, Windows, names};
use crate::image::formats::OutputFormat;
use crate::image::metrics::Pair;
use crate::image::tone::to_srgb8;
use crate::image::{self, Planes, png_file};
use crate::progressive::{Batch, Denoiser, Settings};
use crate::state::{self, ImageMetadata};
use crate::stats::Store;

/// What can be known of an output before minutes of rendering.
pub(super) fn can_be_written(path: &Path) -> anyhow::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        anyhow::bail!("{}: found no folder {}; it has to exist", path.display(), folder.display());
    }
    if path.is_dir()
        || path.as_os_str().as_encoded_bytes().ends_with(std::path::MAIN_SEPARATOR_STR.as_bytes())
    {
        anyhow::bail!("{}: found a folder; accepted is the name of a file", path.display());
    }
    Ok(files::can_replace(path).map_err(|error| image::Problem::from(error).at(path))?)
}

/// Refuses to put something else in a state's place.
pub(super) fn replaces_no_state(path: &Path) -> anyhow::Result<()> {
    if path.is_file() && state::check_signature(path).is_ok() {
        anyhow::bail!("{}: found a render state; accepted is the name of another file", path.display());
    }
    Ok(())
}

/// The one spelling of a file's name, whether there is such a file yet or not.
fn place_of(path: &Path) -> std::io::Result<PathBuf> {
    let absolute = std::path::absolute(files::resolve_links(path)?)?;
    let of_new = || Some(absolute.parent()?.canonicalize().ok()?.join(absolute.file_name()?));
    Ok(absolute.canonicalize().ok().or_else(of_new).unwrap_or(absolute))
}

/// Refuses outputs that would replace each other or what is read.
pub(super) fn are_distinct<'a>(
    read: impl IntoIterator<Item = &'a Path>,
    outputs: &[&Path],
) -> anyhow::Result<()> {
    let mut seen = read.into_iter().map(place_of).collect::<Result<Vec<_>, _>>()?;
    for path in outputs {
        let place = place_of(path)?;
        if seen.contains(&place) {
            anyhow::bail!(
                "{}: found the same file twice; accepted are files other than what is read, one for each output",
                path.display()
            );
        }
        seen.push(place);
    }
    Ok(())
}

/// Writes to nowhere, to see how long it takes. What fails here will fail, and be said, at the end.
pub(super) fn encode(path: &Path, layers: &Layers, filtered: &Filtered) {
    let (width, height) = (filtered.image.width(), filtered.image.height());
    match OutputFormat::of(path) {
        Ok(OutputFormat::Exr) => {
            let _ = exr_file::encode(Windows::whole(width, height), &layers.channels(), &[]);
        }
        Ok(OutputFormat::Png) => {
            let _ = png_file::encode(width, height, &to_srgb8(&filtered.image, 0.0));
        }
        Err(_) => {}
    }
}

/// What is written of a render: an image, and what its attributes tell of it.
pub(super) struct Written<'a> {
    pub layers: &'a Layers,
    pub store: &'a Store,
    pub image: &'a Planes,
    pub batches: &'a [Batch],
    pub metadata: &'a ImageMetadata,
    pub settings: &'a Settings,
    /// What has made the image: where the samples or the time did not suffice not what was asked for.
    pub filter: (Denoiser, Quality),
    pub reference: Option<&'a Planes>,
    /// When the program started.
    pub start: Instant,
}

impl Written<'_> {
    /// Writes an image file.
    ///
    /// # Errors
    /// Those of the file system, and a name that is of no format.
    pub fn write(&self, path: &Path) -> Result<(), image::ImageError> {
        match OutputFormat::of(path)? {
            OutputFormat::Png => png_file::write(path, self.image, 0.0),
            OutputFormat::Exr => {
                let windows = Windows { data: self.metadata.pixel_bounds, display: self.metadata.film };
                exr_file::write(path, windows, &self.layers.channels(), &self.attributes())
            }
        }
    }

    /// Writes all image files: a full disk under one of them is none under the others.
    ///
    /// # Errors
    /// All of theirs, in one line.
    pub fn write_all(&self, paths: &[PathBuf]) -> anyhow::Result<()> {
        let failed: Vec<String> = paths
            .par_iter()
            .filter_map(|path| self.write(path).err().map(|error| error.to_string()))
            .collect();
        if failed.is_empty() { Ok(()) } else { Err(anyhow::anyhow!(failed.join("; "))) }
    }

    fn attributes(&self) -> Vec<(String, Attribute)> {
        let spread = Spread::of(self.store);
        let own = |name: &str| format!("prpf.{name}");
        let schedule = self.batches.iter().map(|b| b.samples_total.try_into().unwrap_or(i64::MAX)).collect();
        let mut attributes = vec![
            (names::SAMPLES_PER_PIXEL.to_owned(), Attribute::Int(spread.mean.round() as i32)),
            (names::RENDER_TIME_SECONDS.to_owned(), Attribute::Float(self.start.elapsed().as_secs_f32())),
            (own("seed"), Attribute::Text(self.settings.seed.to_string())),
            (own("version"), Attribute::Text(env!("CARGO_PKG_VERSION").to_owned())),
            (own("commandLine"), Attribute::Text(command_line())),
            (own("scene"), Attribute::Text(self.metadata.source.clone())),
            (own("sceneHash"), Attribute::Text(format!("sha256:{}", self.metadata.hash))),
            (own("denoiser"), Attribute::Text(self.filter_name())),
            (own("samplesMin"), Attribute::Int(spread.min.try_into().unwrap_or(i32::MAX))),
            (own("samplesMean"), Attribute::Float(spread.mean as f32)),
            (own("samplesMax"), Attribute::Int(spread.max.try_into().unwrap_or(i32::MAX))),
            (own("batches"), Attribute::Ints(schedule)),
        ];
        if let Some(mse) = self.reference.and_then(|r| Some(Pair::new(self.image, r).ok()?.mse())) {
            attributes.push((names::MSE.to_owned(), Attribute::Float(mse as f32)));
        }
        attributes
    }

    fn filter_name(&self) -> String {
        let (denoiser, quality) = self.filter;
        match denoiser {
            Denoiser::None => "none".to_owned(),
            Denoiser::Rpf => "rpf".to_owned(),
            Denoiser::Prpf => format!("prpf {}", quality.name()),
        }
    }
}

fn command_line() -> String {
    let words: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    words.join(" ")
}

pub(super) fn write_report(path: &Path, report: &Report) -> anyhow::Result<()> {
    let text = serde_json::to_vec_pretty(report)?;
    files::replace_file::<anyhow::Error>(path, |file| {
        use std::io::Write;
        file.write_all(&text)?;
        Ok(file.write_all(b"\n")?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_that_cannot_be_written_are_refused_before_the_render() {
        let folder = tempfile::tempdir().unwrap();
        assert!(can_be_written(&folder.path().join("new.exr")).is_ok());
        assert!(can_be_written(&folder.path().join("none/new.exr")).is_err());
        assert!(can_be_written(folder.path()).is_err());
        // A folder in which not even root may write.
        #[cfg(target_os = "linux")]
        assert!(can_be_written(Path::new("/proc/new.exr")).is_err());
    }

    #[test]
    fn outputs_replace_neither_each_other_nor_what_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("mesh.ply"), "").unwrap();
        let distinct = |read: &str, outputs: &[&str]| {
            let outputs: Vec<_> = outputs.iter().map(|name| at(name)).collect();
            are_distinct([&*at(read)], &outputs.iter().map(PathBuf::as_path).collect::<Vec<_>>()).is_ok()
        };
        assert!(distinct("mesh.ply", &["a.exr", "a.png"]));
        assert!(!distinct("mesh.ply", &["a.exr", "mesh.ply"]));
        assert!(!distinct("mesh.ply", &["a.exr", "./a.exr"]));
    }
}
