//! Reads the layers of one file that a denoiser needs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use half::f16;

use super::ImportError;
use super::exr_layer::{ExrLayer, layers};
use super::role::{LayerMap, Role, by_name, has_pbrts_variance};
use crate::image::exr_file::{self, Attribute, ExrPart, Metadata, Windows, attribute_names};
use crate::image::{ImageError, Planes, luminance};

/// A render by any program.
#[derive(Clone, Debug)]
pub struct Frame {
    pub path: PathBuf,
    pub windows: Windows,
    /// What the header of the colour's part says beside the image.
    pub metadata: Metadata,
    /// 3 planes, linear RGB. Negative values are set to 0; not finite ones are as in the file.
    pub colour: Planes,
    pub negative_values: usize,
    /// Features that were found, 3 planes each; a depth is the third of them.
    pub features: Vec<(Role, Planes)>,
    /// Variance of the pixel's mean: 3 planes, finite.
    pub variance: Option<Planes>,
    /// Whether the variance follows from that of the luminance of samples that met a surface.
    pub is_variance_of_luminance: bool,
    /// Of the colour's layer: 1 plane.
    pub alpha: Option<Planes>,
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
            by_name(&all, name, Some(colour_layer), |layer| layer.triple().is_some())
                .map_err(|problem| fail(format!("--aovs: {problem}")))
        };
        let aovs = aovs.iter().map(find_aov).collect::<Result<Vec<_>, _>>()?;

        // Read their channels
        let wanted = found
            .iter()
            .map(|&(role, layer)| (layer, role.channels(layer)))
            .chain(aovs.iter().map(|&layer| (layer, Role::Colour.channels(layer))))
            .chain(colour_layer.alpha().map(|channel| (colour_layer, Some(vec![channel.to_owned()]))));
        let wanted: Vec<_> = wanted.map(|(layer, channels)| (layer, channels.unwrap_or_default())).collect();
        let colour_info = &parts[colour_layer.part].info;
        let size = (colour_info.width, colour_info.height);
        for (layer, _) in &wanted {
            let info = &parts[layer.part].info;
            if info.windows != colour_info.windows {
                return Err(fail(format!(
                    "found the layer `{}` with {}x{} pixels in another place than those of the colour, {}x{}; accepted are \
                     equal data windows",
                    layer.name, info.width, info.height, size.0, size.1
                )));
            }
        }
        let mut planes = read_all(path, &wanted)?.into_iter();
        let has_pbrts_variance = has_pbrts_variance(&all);

        // Sort them by role
        let spp = samples_per_pixel(&parts);
        let mut frame = Self {
            path: path.to_owned(),
            windows: colour_info.windows,
            metadata: exr_file::read_metadata(path, colour_layer.part)?,
            colour: planes.next().unwrap_or_default(),
            negative_values: 0,
            features: Vec::new(),
            variance: None,
            is_variance_of_luminance: false,
            alpha: None,
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
                    frame.is_variance_of_luminance = has_pbrts_variance && layer.key() == "variance";
                    frame.variance = Some(scaled(planes, 1.0 / spp as f32));
                }
                Role::Depth => frame.features.push((role, along_z(&planes))),
                _ => frame.features.push((role, planes)),
            }
        }
        frame.aovs = aovs.iter().map(|layer| layer.name.clone()).zip(planes.by_ref()).collect();
        frame.alpha = planes.next();
        frame.remove_invalid_values();
        Ok(frame)
    }

    /// Sets negative values of the colour to 0: reconstruction filters with negative lobes and colours outside the gamut
    /// give them, and no filter expects them of light. Layers get 0 where they are not finite, since no sample count tells
    /// of it. A variance that is not finite becomes the largest that half precision holds, beyond which it was written.
    fn remove_invalid_values(&mut self) {
        let largest = f16::MAX.to_f32() / self.spp.unwrap_or(1) as f32;
        let variance = self.variance.iter_mut().flat_map(Planes::data_mut);
        variance.filter(|value| !value.is_finite()).for_each(|value| *value = largest);
        let layers = self.aovs.iter_mut().flat_map(|(_, planes)| planes.data_mut());
        layers.filter(|value| !value.is_finite()).for_each(|value| *value = 0.0);
        let is_negative = |value: &&mut f32| value.is_finite() && **value < 0.0;
        for value in self.colour.data_mut().iter_mut().filter(is_negative) {
            *value = 0.0;
            self.negative_values += 1;
        }
        if self.is_variance_of_luminance {
            self.spread_variance_of_luminance();
        }
    }

    /// Gives each channel the variance of pbrt-v4's sensor's second response, which is the luminance, in proportion to its square: the
    /// sensor's responses are X, Y and Z, and the image is R, G and B.
    fn spread_variance_of_luminance(&mut self) {
        let Some(variance) = &mut self.variance else { return };
        for i in 0..variance.pixels() {
            let rgb = [0, 1, 2].map(|c| self.colour.plane(c)[i]);
            let luminance = luminance(rgb);
            let of_luminance = variance.plane(1)[i];
            for (c, value) in rgb.into_iter().enumerate() {
                let ratio = if luminance > 0.0 { value / luminance } else { 1.0 };
                variance.plane_mut(c)[i] = of_luminance * ratio * ratio;
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::exr_file::{Channel, Precision};

    /// Reads a file of one row of these channels, of 4 samples per pixel.
    fn read(channels: &[(&str, [f32; 2])]) -> Frame {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let channels: Vec<Channel> =
            channels.iter().map(|(name, values)| Channel::new(*name, values, Precision::Float)).collect();
        let spp = (attribute_names::SAMPLES_PER_PIXEL.to_owned(), Attribute::Int(4));
        exr_file::write(&path, Windows::whole(2, 1), &channels, &[spp]).unwrap();
        Frame::read(&path, &LayerMap::default(), &[]).unwrap()
    }

    #[test]
    fn an_infinite_variance_is_a_large_one_and_the_alpha_is_read() {
        let colour = [("R", [1.0, 1.0]), ("G", [1.0, 1.0]), ("B", [1.0, 1.0]), ("A", [0.25, 1.0])];
        let variance = ["mse.r", "mse.g", "mse.b"].map(|name| (name, [0.5, f32::INFINITY]));
        let frame = read(&[&colour[..], &variance].concat());
        assert_eq!(frame.alpha.unwrap().plane(0), [0.25, 1.0]);
        assert_eq!(frame.variance.unwrap().plane(2), [0.5, 65504.0 / 4.0]);
    }

    #[test]
    fn the_variance_of_pbrts_sensor_is_spread_by_luminance() {
        let colour = [("R", [2.0, 0.0]), ("G", [0.0, 0.0]), ("B", [0.0, 0.0])];
        let variance = [("Variance.R", [7.0; 2]), ("Variance.G", [0.8, 4.0]), ("Variance.B", [9.0; 2])];
        let relative = ["R", "G", "B"].map(|c| format!("RelativeVariance.{c}"));
        let relative: Vec<_> = relative.iter().map(|name| (name.as_str(), [1.0; 2])).collect();
        let frame = read(&[&colour[..], &variance, &relative].concat());
        assert!(frame.is_variance_of_luminance);
        let found = frame.variance.unwrap();
        // Red light of luminance 0.2126 · 2
        let expected = 0.2 / 0.2126f32.powi(2);
        assert!((found.plane(0)[0] / expected - 1.0).abs() < 1e-5, "{}", found.plane(0)[0]);
        assert_eq!([found.plane(1)[0], found.plane(2)[0]], [0.0; 2]);
        assert_eq!(found.plane(0)[1], 1.0, "of a black pixel as it is");
    }
}
