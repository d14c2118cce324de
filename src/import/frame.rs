//! Reads the layers of one file that a denoiser needs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::ImportError;
use super::exr_layer::{ExrLayer, layers};
use super::role::{LayerMap, Role, by_name};
use crate::image::exr_file::{self, Attribute, ExrPart, Windows, attribute_names};
use crate::image::{ImageError, Planes};

/// A render by any program.
#[derive(Clone, Debug)]
pub struct Frame {
    pub path: PathBuf,
    /// `None` if the file's windows are not kept in what is written: the data window lies outside the display window.
    pub windows: Option<Windows>,
    /// 3 planes, linear RGB. Negative values are set to 0; not finite ones are as in the file.
    pub colour: Planes,
    pub negative_values: usize,
    /// Features that were found, 3 planes each; a depth is the third of them.
    pub features: Vec<(Role, Planes)>,
    /// Variance of the pixel's mean: 3 planes.
    pub variance: Option<Planes>,
    /// Samples per pixel, if the file states them.
    pub spp: Option<u32>,
    /// Names of the layers and 3 planes of each, whose sum is the colour.
    pub aovs: Vec<(String, Planes)>,
    /// The name of the layer of each role that was found.
    pub found: Vec<(Role, String)>,
}

impl Frame {
    /// Reads a file. `map` names layers that conventions do not find, `aovs` those that sum to the colour.
    ///
    /// # Errors
    /// Those of the file; a layer that is missing or has another size; a variance of samples whose number is unknown.
    pub fn read(path: &Path, map: &LayerMap, aovs: &[String]) -> Result<Self, ImportError> {
        let fail = |problem: String| ImportError::Layers { path: path.to_owned(), problem };
        // Find the layers
        let parts = exr_file::read_parts(path)?;
        let all = layers(&parts);
        let found = map.find(&all).map_err(fail)?;
        let Some(&(Role::Colour, colour_layer)) = found.first() else {
            let names: Vec<String> = all.iter().map(|layer| format!("`{}`", layer.name)).collect();
            let problem = format!(
                "found no colour among the layers {}; accepted is one with R, G and B, by --map colour=LAYER",
                names.join(", ")
            );
            return Err(fail(problem));
        };
        let find_aov = |name: &String| {
            by_name(&all, name, |layer| layer.triple().is_some())
                .map_err(|problem| fail(format!("--aovs: {problem}")))
        };
        let aovs = aovs.iter().map(find_aov).collect::<Result<Vec<_>, _>>()?;

        // Read their channels
        let wanted = found
            .iter()
            .map(|&(role, layer)| (layer, role.channels(layer)))
            .chain(aovs.iter().map(|&layer| (layer, Role::Colour.channels(layer))));
        let wanted: Vec<_> = wanted.map(|(layer, channels)| (layer, channels.unwrap_or_default())).collect();
        let colour_info = &parts[colour_layer.part].info;
        let size = (colour_info.width, colour_info.height);
        for (layer, _) in &wanted {
            let info = &parts[layer.part].info;
            if (info.width, info.height) != size || info.windows != colour_info.windows {
                return Err(fail(format!(
                    "found the layer `{}` with {}x{} pixels in another place than those of the colour, {}x{}; accepted are \
                     equal data windows",
                    layer.name, info.width, info.height, size.0, size.1
                )));
            }
        }
        let mut planes = read_all(path, &wanted)?.into_iter();

        // Sort them by role
        let spp = samples_per_pixel(&parts);
        let mut frame = Self {
            path: path.to_owned(),
            windows: colour_info.windows,
            colour: planes.next().unwrap_or_default(),
            negative_values: 0,
            features: Vec::new(),
            variance: None,
            spp,
            aovs: Vec::new(),
            found: found.iter().map(|&(role, layer)| (role, layer.name.clone())).collect(),
        };
        for (&(role, layer), planes) in found[1..].iter().zip(planes.by_ref()) {
            match role {
                Role::Variance => frame.variance = Some(planes),
                Role::SampleVariance => {
                    let spp = spp.ok_or_else(|| {
                        fail(format!(
                            "found the variance of samples `{}` and no attribute samplesPerPixel; accepted are \
                             --map sample-variance=none,variance=LAYER with that of the mean, or both none",
                            layer.name
                        ))
                    })?;
                    frame.variance = Some(scaled(planes, 1.0 / spp as f32));
                }
                Role::Depth => frame.features.push((role, along_z(&planes))),
                _ => frame.features.push((role, planes)),
            }
        }
        frame.aovs = aovs.iter().map(|layer| layer.name.clone()).zip(planes).collect();
        frame.remove_invalid_values();
        Ok(frame)
    }

    /// Sets negative values of the colour to 0: reconstruction filters with negative lobes and colours outside the gamut
    /// give them, and no filter expects them of light. Layers get 0 where they are not finite, since no sample count tells
    /// of it.
    fn remove_invalid_values(&mut self) {
        let layers = self.aovs.iter_mut().flat_map(|(_, planes)| planes.data_mut());
        layers.filter(|value| !value.is_finite()).for_each(|value| *value = 0.0);
        for value in self.colour.data_mut().iter_mut().filter(|value| **value < 0.0) {
            *value = 0.0;
            self.negative_values += 1;
        }
    }
}

fn scaled(mut planes: Planes, factor: f32) -> Planes {
    planes.data_mut().iter_mut().for_each(|value| *value *= factor);
    planes
}

/// Returns a depth as positions.
fn along_z(depth: &Planes) -> Planes {
    let mut planes = Planes::new(depth.width(), depth.height(), 3);
    planes.plane_mut(2).copy_from_slice(depth.plane(0));
    planes
}

/// Reads the channels of layers, each part of the file once.
fn read_all(path: &Path, wanted: &[(&ExrLayer, Vec<String>)]) -> Result<Vec<Planes>, ImageError> {
    let mut by_part: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    wanted.iter().enumerate().for_each(|(i, (layer, _))| by_part.entry(layer.part).or_default().push(i));
    let mut read = vec![Planes::default(); wanted.len()];
    for (part, indices) in by_part {
        let names: Vec<&str> = indices.iter().flat_map(|&i| wanted[i].1.iter().map(String::as_str)).collect();
        let all = exr_file::read_part(path, part, &names)?;
        let mut first = 0;
        for i in indices {
            let count = wanted[i].1.len();
            let mut planes = Planes::new(all.width(), all.height(), count);
            planes
                .planes_mut()
                .enumerate()
                .for_each(|(k, plane)| plane.copy_from_slice(all.plane(first + k)));
            read[i] = planes;
            first += count;
        }
    }
    Ok(read)
}

/// Returns the samples per pixel by pbrt's attribute, or by Blender's `cycles.LAYER.samples`.
fn samples_per_pixel(parts: &[ExrPart]) -> Option<u32> {
    let attributes = parts.iter().flat_map(|part| &part.info.attributes);
    let number = |(name, value): &(String, Attribute)| match value {
        Attribute::Int(n) if name == attribute_names::SAMPLES_PER_PIXEL => u32::try_from(*n).ok(),
        Attribute::Text(text) if name.starts_with("cycles.") && name.ends_with(".samples") => {
            text.parse().ok()
        }
        _ => None,
    };
    attributes.filter_map(number).find(|&n| n > 0)
}
