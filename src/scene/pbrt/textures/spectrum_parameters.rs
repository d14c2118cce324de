//! Parameters that are colours or spectra.

use glam::{DVec3, Vec3};

use crate::scene::color_space::ColorSpace;
use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::files;
use crate::scene::pbrt::parser::{Parameter, ParameterDictionary, ParameterType, Result};
use crate::scene::pbrt::spectrum::{Spectrum, rgb_from_xyz};

impl SceneBuilder {
    /// The colour or spectrum called `name`, if given.
    pub fn spectrum(&mut self, params: &ParameterDictionary, name: &str) -> Result<Option<Spectrum>> {
        self.spectrum_of(params, name, ColorSpace::to_srgb)
    }

    /// The emission called `name`, if given.
    pub fn light_spectrum(&mut self, params: &ParameterDictionary, name: &str) -> Result<Option<Spectrum>> {
        self.spectrum_of(params, name, ColorSpace::light_to_srgb)
    }

    fn spectrum_of(
        &mut self,
        params: &ParameterDictionary,
        name: &str,
        to_srgb: fn(ColorSpace, DVec3) -> DVec3,
    ) -> Result<Option<Spectrum>> {
        let Some(param) = params.get(name) else { return Ok(None) };
        Ok(Some(match (param.kind, param.numbers()) {
            (ParameterType::Rgb, &[r, g, b]) => {
                Spectrum::Rgb(to_srgb(self.state.color_space, DVec3::new(r, g, b)).as_vec3())
            }
            (ParameterType::Xyz, &[x, y, z]) => Spectrum::Rgb(rgb_from_xyz(DVec3::new(x, y, z)).as_vec3()),
            (ParameterType::Rgb | ParameterType::Xyz, numbers) => {
                return Err(param.error(format_args!("a list of {} numbers", numbers.len()), "three numbers"));
            }
            (ParameterType::Float, &[value]) => Spectrum::Rgb(Vec3::splat(value as f32)),
            (ParameterType::Blackbody, &[kelvin, ref scale @ ..]) if kelvin > 0.0 && scale.len() < 2 => {
                let scale = scale.first().unwrap_or(&1.0) * self.dialect.blackbody_peak(kelvin);
                Spectrum::Blackbody { kelvin, scale }
            }
            (ParameterType::Blackbody, _) => return Err(param.error("not a temperature", "kelvins above 0")),
            (ParameterType::Spectrum, numbers) => match param.strings() {
                [] => self.sampled_spectrum(param, numbers)?,
                [name] => self.named_spectrum(param, name)?,
                names => return Err(param.error(format_args!("a list of {} names", names.len()), "one name")),
            },
            _ => return Err(param.error("of an unsuitable type", "rgb, spectrum, blackbody or texture")),
        }))
    }

    /// One of pbrt's named spectra, or a file of wavelengths and values.
    fn named_spectrum(&mut self, param: &Parameter, name: &str) -> Result<Spectrum> {
        if let Some(spectrum) = Spectrum::named(name) {
            return Ok(spectrum);
        }
        let path = self.resolve_content(name);
        let shown = path.display();
        let numbers = files::numbers(&path).map_err(|error| {
            param.error(format_args!("the file \"{shown}\" ({error})"), "a spectrum's name or file")
        })?;
        self.sampled_spectrum(param, &numbers)
    }

    fn sampled_spectrum(&mut self, param: &Parameter, numbers: &[f64]) -> Result<Spectrum> {
        let spectrum = match self.dialect.sorts_spectra() {
            true if numbers.len() > 1 && !numbers.len().is_multiple_of(2) => {
                let message =
                    format!("the last of {} numbers of \"{}\" is ignored", numbers.len(), param.name);
                self.warnings
                    .add(param.loc, format!("{message}; expected pairs of wavelength (nm) and value"));
                Spectrum::from_unsorted_numbers(&numbers[..numbers.len() - 1])
            }
            true => Spectrum::from_unsorted_numbers(numbers),
            false => Spectrum::from_numbers(numbers),
        };
        match spectrum {
            Some(spectrum) if self.dialect.spectra_are_zero_outside() => Ok(spectrum.zero_outside()),
            Some(spectrum) => Ok(spectrum),
            None => {
                let expected = "pairs of wavelength (nm) and value, in rising order";
                Err(param.error(format_args!("a list of {} numbers", numbers.len()), expected))
            }
        }
    }
}
