//! The options that place samples by a map, and reading the map.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};

use crate::adaptive::{MapValues, SampleMap};
use crate::image::{Planes, exr_file};

#[derive(Clone, Args)]
pub(super) struct SampleMapOptions {
    /// Place samples by this map of the render's size instead of by the denoiser's maps. It must not depend on the samples
    /// it places: make it by another seed
    #[arg(long, value_name = "FILE.exr")]
    pub sample_map: Option<PathBuf>,
    /// What the map's values are: ratios, scaled to the mean that --spp asks for, or in proportion for --time; or numbers
    /// of samples, after which the render ends
    #[arg(long, value_name = "KIND", value_enum, default_value_t = ValuesOption::Relative, requires = "sample_map")]
    pub sample_map_values: ValuesOption,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ValuesOption {
    Relative,
    Absolute,
}

impl SampleMapOptions {
    /// Returns whether the map is the budget of samples.
    pub fn is_budget(&self) -> bool {
        self.sample_map.is_some() && self.sample_map_values == ValuesOption::Absolute
    }

    /// Reads the map, which has to have the size of the render.
    ///
    /// # Errors
    /// One line that names the file.
    pub fn read(&self, size: (usize, usize)) -> anyhow::Result<Option<SampleMap>> {
        let Some(path) = &self.sample_map else { return Ok(None) };
        let planes = read_values(path)?;
        let found = (planes.width(), planes.height());
        if found != size {
            bail!(
                "{}: found a sample map of {}x{} pixels; accepted is the size of the render, {}x{}",
                path.display(),
                found.0,
                found.1,
                size.0,
                size.1
            );
        }
        let kind = match self.sample_map_values {
            ValuesOption::Relative => MapValues::Relative,
            ValuesOption::Absolute => MapValues::Absolute,
        };
        SampleMap::new(planes.into_data(), kind)
            .with_context(|| format!("{}: the sample map", path.display()))
            .map(Some)
    }
}

/// Reads the values of a map: the only channel of a file, else `SampleCount.X`, else `Y`, else the mean of R, G and B.
fn read_values(path: &Path) -> anyhow::Result<Planes> {
    let channels = exr_file::read_info(path)?.channels;
    let has = |name: &str| channels.iter().any(|channel| channel == name);
    let single = if let [only] = channels.as_slice() {
        Some(only.as_str())
    } else {
        ["SampleCount.X", "Y"].into_iter().find(|name| has(name))
    };
    if let Some(name) = single {
        return Ok(exr_file::read_channels(path, &[name])?);
    }
    if !["R", "G", "B"].into_iter().all(has) {
        bail!(
            "{}: found a sample map with the channels {}; accepted are one channel, SampleCount.X, Y, or R G B",
            path.display(),
            channels.join(", ")
        );
    }
    let colours = exr_file::read_channels(path, &["R", "G", "B"])?;
    let mut mean = Planes::new(colours.width(), colours.height(), 1);
    for (i, mean) in mean.data_mut().iter_mut().enumerate() {
        *mean = colours.channel_mean(i);
    }
    Ok(mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::exr_file::{Channel, Precision, Windows};

    #[test]
    fn the_channel_is_found_by_name_or_because_it_is_alone() {
        let folder = tempfile::tempdir().unwrap();
        let read = |names: &[&str]| {
            let path = folder.path().join("map.exr");
            let values: Vec<[f32; 2]> = (0..names.len()).map(|k| [k as f32 + 1.0, 3.0]).collect();
            let channels = names.iter().zip(&values);
            let channels: Vec<_> =
                channels.map(|(&name, values)| Channel::new(name, values, Precision::Float)).collect();
            exr_file::write(&path, Windows::whole(2, 1), &channels, &[]).unwrap();
            let options =
                SampleMapOptions { sample_map: Some(path), sample_map_values: ValuesOption::Relative };
            options.read((2, 1)).map(|map| map.unwrap().values()[0])
        };
        assert_eq!(read(&["density"]).unwrap(), 1.0);
        assert_eq!(read(&["R", "G", "B", "SampleCount.X"]).unwrap(), 4.0);
        assert_eq!(read(&["A", "Y"]).unwrap(), 2.0);
        assert_eq!(read(&["A", "B", "G", "R"]).unwrap(), 3.0);
        assert!(read(&["A", "Z"]).unwrap_err().to_string().contains("channels A, Z; accepted are"));
    }
}
